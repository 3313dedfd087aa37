"""A doubt about densities below zero, which projections may hold and splats cannot.

A filtered backprojection is below zero in many places: streaks of few or uneven views, noise and
missing angles see to that. A fit explains streaks, but not what is truly negative. What it has left
of the projections is therefore backprojected, as a correction to its slices. Corrected slices are
deeply negative over several voxels, and far outside the noise of the correction, only where the
projections ask for it. So they are where matter lies in a medium that flats were taken in, or where
hardened beams, scatter or wrong flats make projections that no density has.

Tried on objects with and without such a region, in 5 to 64 parallel and cone views, over half a
turn, a part of one and at uneven angles, with noise, truncated, and beside a dense bead.
"""

from __future__ import annotations

import dataclasses

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import gaussian_filter

from rift_cl.commands.fit_xray.input import Projections, flipped
from rift_cl.commands.fit_xray.scores import backprojected, drawn
from rift_cl.splat.renderer import Renderer
from rift_cl.splat.splats import Splats

# Standard deviation of the smoothing, in voxels.
_SMOOTH = 1.0
# How far below zero it is: as a share of the strong densities, those that this share of the voxels
# stays below, and in robust standard deviations of the correction.
_DEEP, _STRONG, _SURE = 0.1, 0.999, 9.0
# Voxels that are so.
_FEWEST = 8
# A standard deviation in median absolute deviations of normal noise.
_ROBUST = 1.4826

Floats = NDArray[np.float32]


def negative_note(missed: float | None, density: float, unit: str) -> list[str]:
    """A sentence about densities below zero that a fit leaves out; none where there are none.

    Args:
        missed: what ``lowest_missed`` found.
        density: what a density of one stands for, per unit of length.
        unit: of length.
    """
    if missed is None:
        return []
    return [
        f"The projections ask for densities below zero, down to {missed * density:.2g} per {unit}, "
        "which splats cannot have: the fit is about 0 there. 'rift reconstruct' shows them. Causes "
        "are a medium denser than parts of the object, phase contrast, beam hardening, wrong "
        "flats or a wrong rotation axis."
    ]


def lowest_missed(
    renderer: Renderer, splats: Splats, training: Projections, slices: Floats
) -> float | None:
    """The lowest density below zero that projections hold and a fit leaves out, if it is sure.

    Args:
        renderer: that the fit was trained with.
        splats: of the fit.
        training: the projections that it was trained on.
        slices: (nz, ny, nx) the splats at the voxels of ``training.grid``.

    Returns:
        It, smoothed over a voxel, in the unit of the slices; None where there is nothing sure.
    """
    found = backprojected(renderer.device, _left(renderer, splats, training), "hann")
    seen = found != 0
    # Modes may be negative themselves, and are no part of what is missed then.
    corrected, correction = (
        gaussian_filter(volume, _SMOOTH) for volume in (np.maximum(slices, 0) + found, found)
    )
    if not seen.any():
        return None
    away = np.abs(correction[seen] - np.median(correction[seen]))
    strong = float(np.quantile(corrected, _STRONG))
    limit = max(_DEEP * strong, _SURE * _ROBUST * float(np.median(away)))
    if np.count_nonzero(corrected < -limit) < _FEWEST:
        return None
    return float(corrected.min())


def _left(renderer: Renderer, splats: Splats, training: Projections) -> Projections:
    """What the splats leave of the projections."""
    left = training.values.copy()
    for number, (camera, reverse) in enumerate(zip(*training.views, strict=True)):
        left[number] -= flipped(drawn(renderer, splats, camera), reverse)
    return dataclasses.replace(training, values=left)
