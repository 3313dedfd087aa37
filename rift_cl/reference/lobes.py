"""Colours of splats from angular bases: the twin of ``lobe_shade.cl`` and its gradient.

The functions and their slopes are those of ``rift_cl.basis.angular``, in float64; here they become
colours, and gradients flow on to means and camera.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from rift_cl.basis.angular import AngularBasis
from rift_cl.geometry import Camera
from rift_cl.reference.sight import sights, sights_grad

Floats = NDArray[np.float64]


class ShadeGradients(NamedTuple):
    """Gradients of a loss by what colours are made of.

    Args:
        linear: (N, L, 3) by the linear coefficients.
        lobes: (N, G) by the geometry.
        means: (N, 3) by the positions.
        view: (3, 4) by the upper rows of the view matrix.
    """

    linear: Floats
    lobes: Floats
    means: Floats
    view: Floats


def shade_lobes(
    basis: AngularBasis, means: Floats, linear: Floats, lobes: Floats | None, camera: Camera
) -> Floats:
    """Colours (N, 3) as a camera sees them; black where they are no numbers.

    Args:
        basis: the functions.
        means: (N, 3) positions.
        linear: (N, L, 3) coefficients.
        lobes: (N, G) geometry; None for harmonics.
        camera: the view.
    """
    with np.errstate(all="ignore"):
        color = basis.evaluate(linear, lobes, sights(means, camera)) + 0.5
    color[~np.isfinite(color).all(1)] = 0
    return np.maximum(color, 0)


def shade_lobes_grad(
    basis: AngularBasis,
    means: Floats,
    linear: Floats,
    lobes: Floats | None,
    camera: Camera,
    incoming: Floats,
) -> ShadeGradients:
    """Gradients of the sum of colours times ``incoming`` (N, 3); see ``shade_lobes``.

    Colours that are held at zero, and black ones, have none.
    """
    shown = shade_lobes(basis, means, linear, lobes, camera) > 0
    with np.errstate(all="ignore"):
        slopes = basis.evaluate(linear, lobes, sights(means, camera), grad=True)

    def flow(by: Floats) -> Floats:
        """Through each channel that is shown; nothing through the others, NaN or not."""
        parts = np.where(shown[:, None], by * incoming[:, None], 0)
        return np.asarray(parts.sum(-1))

    by_linear = np.where(shown[:, None], slopes.by_coeff[..., None] * incoming[:, None], 0)
    by_means, view = sights_grad(flow(slopes.by_directions), camera)
    return ShadeGradients(by_linear, flow(slopes.by_geometry), by_means, view)
