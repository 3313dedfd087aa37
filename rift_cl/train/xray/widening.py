"""Densities widened by a Gaussian: what projections and slices show, as splats of their own.

A projection shows a splat with the variance of ``eps2d`` beside its own, and at the same mass. Who
reads splats from a file and draws the Gaussians as they are finds what was scored only if that
variance is theirs already. Gaussians take it exactly,

    covariance' = R S^2 R^T + D,    peak' = peak det S / det S',

and so do their Hermite modes where D is the same along all axes: they are derivatives in units of
the splat's axes, so that a mode of order n along an axis is multiplied by (s / s')^n.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from rift_cl.basis.indices import graded
from rift_cl.splat.orders import order_of
from rift_cl.train.xray.voxels import covariances

Floats = NDArray[np.float32]


class Densities(NamedTuple):
    """N splats of X-rays, by the names that a scene has for them.

    Args:
        log_scales: (N, 3) logarithms of the standard deviations.
        quats: (N, 4) rotations (w, x, y, z).
        logit_opacities: (N,) logarithms of the densities at the peaks.
        shape_modes: (N, K - 1) Hermite modes of the shapes, or None.
    """

    log_scales: Floats
    quats: Floats
    logit_opacities: Floats
    shape_modes: Floats | None


def widened(splats: Densities, variances: Sequence[float]) -> Densities | None:
    """Splats that have gained a variance, and whose masses are what they were.

    Args:
        splats: N of them.
        variances: along (x, y, z), in the square of the unit of the scales.

    Returns:
        The wider splats; None where they have modes and the variances differ, which would turn the
        axes that modes are in.
    """
    narrow, quats = splats.log_scales.astype(float), splats.quats
    if len(set(variances)) == 1:
        wide = 0.5 * np.logaddexp(2 * narrow, np.log(variances[0])) if variances[0] else narrow
    elif splats.shape_modes is None:
        wide, quats = _principal(quats, narrow, variances)
    else:
        return None
    modes = splats.shape_modes
    if modes is not None:
        powers = graded(order_of(modes.shape[1] + 1), 3)[1:]
        modes = (modes * np.exp((narrow - wide) @ powers.T)).astype(np.float32)
    peaks = splats.logit_opacities + (narrow - wide).sum(axis=1)
    return Densities(wide.astype(np.float32), quats, peaks.astype(np.float32), modes)


def _principal(
    quats: Floats, log_scales: NDArray[np.float64], variances: Sequence[float]
) -> tuple[NDArray[np.float64], Floats]:
    """Logarithms of the standard deviations along new axes, and the rotations to these."""
    wide = covariances(quats.astype(float), np.exp(log_scales)) + np.diag(variances)
    squares, axes = np.linalg.eigh(wide)
    # Of either sign; a rotation wants them right-handed.
    axes[:, :, 0] *= np.linalg.det(axes)[:, None]
    turns = np.roll(Rotation.from_matrix(axes).as_quat(), 1, axis=1)
    return 0.5 * np.log(squares), turns.astype(np.float32)
