"""The centre of rotation: first from opposite views, then from the sharpness of the slice.

Two views from opposite sides are mirror images about the axis, so the reflection under which they
correlate best gives the centre. Over a full turn there are such pairs, and they decide. Over half
a turn the nearest pairs are off by the step between views, and the slice itself decides near
their answer: a wrong centre smears every point into a small arc with negative values beside it,
which adds as much negative as positive, so the mean absolute value of the slice is least at the
right one (Donath, Beckmann and Schreyer, J. Opt. Soc. Am. A 23, 1048, 2006, metric Q_IA). Far
from the right centre that metric misleads, since then the object leaves the field of view; hence
the order, and where it has no minimum nearby, as for a truncated object, the pairs decide again.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from rift_cl.cl.device import Device
from rift_cl.cl.discovery import default_device
from rift_cl.cl.memory import as_host_array
from rift_cl.errors import InputError
from rift_cl.geometry import Grid, Parallel
from rift_cl.operators import Projector
from rift_cl.reconstruct.filtered_backprojection import fbp

Floats = NDArray[np.float64]
# A search needs some detail, and views from nearly all directions.
_FEWEST_BINS = 8
_WIDEST_GAP = np.pi / 6
# Pairs of views that are compared: those nearest to opposite.
_PAIRS = 8
# Pairs count as opposite when no bin moves further than this between them, in bins.
_EXACT = 0.5
# Steps of the two rounds of the sharpness search, and how far each looks, in bins.
_ROUNDS = ((1.0, 6.0), (0.25, 1.5))
# Half-width of the parabola in bins: wide enough to average over the ripple that interpolation
# between bins puts on the scores.
_PARABOLA = 1.5


@dataclass(frozen=True)
class CenterSearch:
    """What a search for the centre of rotation found.

    Args:
        center: the best centre, in bins.
        mirror: centres (first row) and the correlation of mirrored opposite views (second row),
            1 at best.
        sharpness: centres and the mean absolute value of their slices, least at best; empty
            where opposite views decide alone.
        by: what decided, "sharpness" or "mirror".
    """

    center: float
    mirror: Floats
    sharpness: Floats
    by: str


def find_center(
    sinogram: NDArray[np.float32],
    angles: Floats,
    *,
    span: tuple[float, float] | None = None,
    device: Device | None = None,
) -> CenterSearch:
    """Find the detector bin at which the rotation axis is seen.

    Args:
        sinogram: line integrals of one slice, (angle, bin); angles should cover pi.
        angles: directions in radians.
        span: where to search, in bins; the middle half of the detector if not given.
        device: where to work.

    Raises:
        InputError: the sinogram is empty of contrast or too narrow, the views leave a wide gap,
            or the span lies outside the detector.
    """
    device = device or default_device()
    bins = Parallel(angles, np.shape(sinogram)[-1]).bins
    y = as_host_array(sinogram, (len(angles), bins), name="sinogram", wants="find_center")
    _check_searchable(y, angles)
    low, high = span or ((bins - 1) / 4, 3 * (bins - 1) / 4)
    if not 0 <= low < high <= bins - 1:
        raise InputError(
            f"span is {(low, high)}, wanted two bins in ascending order, between 0 and {bins - 1}"
        )
    pairs = _opposite_views(angles)
    mirror = _mirror_scores(y, pairs, low, high)
    guess = float(mirror[0, mirror[1].argmax()])
    by_mirror = _lowest(mirror * [[1], [-1]])
    if pairs.error * bins / 2 < _EXACT:
        return CenterSearch(by_mirror, mirror, np.empty((2, 0)), "mirror")
    scores = _search_sharpness(y, angles, guess, device)
    best = float(scores[0, scores[1].argmin()])
    if abs(best - guess) < _ROUNDS[0][1]:
        return CenterSearch(_lowest(scores), mirror, scores, "sharpness")
    return CenterSearch(by_mirror, mirror, scores, "mirror")


def _mirror_scores(y: NDArray[np.float32], pairs: _Pairs, low: float, high: float) -> Floats:
    """Correlation of opposite views mirrored about every half bin from ``low`` to ``high``."""
    centers = np.arange(np.ceil(2 * low), 2 * high + 1) / 2
    last = y.shape[1] - 1
    scores = []
    for center in centers:
        turn = round(2 * center)
        bins = np.arange(max(0, turn - last), min(last, turn) + 1)
        views, mirrored = y[pairs.first][:, bins], y[pairs.second][:, turn - bins]
        views = views - views.mean(axis=1, keepdims=True)
        mirrored = mirrored - mirrored.mean(axis=1, keepdims=True)
        scale = np.linalg.norm(views) * np.linalg.norm(mirrored)
        scores.append(float((views * mirrored).sum() / scale) if scale > 0 else 0.0)
    return np.stack([centers, np.array(scores)])


def _check_searchable(y: NDArray[np.float32], angles: Floats) -> None:
    if y.shape[1] < _FEWEST_BINS or not np.ptp(y) > 0:
        raise InputError(
            "the sinogram has too few bins or no contrast to find its center of rotation: look at "
            "another row, or give the center yourself (--center)"
        )
    directions = np.sort(np.mod(angles, np.pi))
    gap = np.diff(directions, append=directions[0] + np.pi).max()
    if gap > _WIDEST_GAP:
        raise InputError(
            f"the views leave a gap of {np.rad2deg(gap):.0f} degrees, too wide to find the center "
            "of rotation: give it yourself (--center); are the angles in radians?"
        )


class _Pairs(NamedTuple):
    """Pairs of views from nearly opposite sides, and how far from it the worst is, in radians."""

    first: NDArray[np.intp]
    second: NDArray[np.intp]
    error: float


def _opposite_views(angles: Floats) -> _Pairs:
    """The pairs of views whose directions differ by nearest to pi."""
    order = np.argsort(np.mod(angles, 2 * np.pi))
    circle = np.mod(angles, 2 * np.pi)[order]
    # The view that follows each one's opposite direction, and the one before that.
    after = np.searchsorted(circle, np.mod(circle + np.pi, 2 * np.pi))
    second = np.concatenate([after, after - 1]) % len(angles)
    first = np.tile(np.arange(len(angles)), 2)
    error = np.abs(np.mod(circle[first] - circle[second], 2 * np.pi) - np.pi)
    nearest = np.argsort(error, kind="stable")[:_PAIRS]
    return _Pairs(order[first[nearest]], order[second[nearest]], float(error[nearest].max()))


def _search_sharpness(
    y: NDArray[np.float32], angles: Floats, guess: float, device: Device
) -> Floats:
    """Scores of centres about a guess, in ascending order: coarsely, then finely at the best."""
    scores = np.empty((2, 0))
    for step, reach in _ROUNDS:
        steps = np.arange(-reach, reach + step / 2, step)
        tried = np.setdiff1d(np.clip(guess + steps, 0, y.shape[1] - 1), scores[0])
        scores = np.concatenate([scores, _sharpness(y, angles, tried, device)], axis=1)
        guess = float(scores[0, scores[1].argmin()])
    return scores[:, scores[0].argsort()]


def _sharpness(y: NDArray[np.float32], angles: Floats, centers: Floats, device: Device) -> Floats:
    """The mean absolute value of the slice that each centre gives."""
    bins = y.shape[1]
    grid, views = Grid((bins, bins)), device.array(y)
    disc = np.hypot(grid.coordinates(0)[:, None], grid.coordinates(1)) <= bins / 2
    scores = []
    for center in centers:
        scan = Parallel(angles, bins, center=center)
        image = device.get(fbp(Projector(grid, scan, device=device), views))
        scores.append(float(np.abs(image[disc]).mean(dtype=np.float64)))
    return np.stack([centers, np.array(scores)])


def _lowest(scores: Floats) -> float:
    """The minimum of a parabola fitted about the least score, kept within the fit's range."""
    best = scores[0, scores[1].argmin()]
    near = np.abs(scores[0] - best) <= _PARABOLA
    if np.count_nonzero(near) < 3:
        return float(best)
    curvature, slope, _ = np.polyfit(scores[0, near] - best, scores[1, near], 2)
    if curvature <= 0:
        return float(best)
    return float(best + np.clip(-slope / (2 * curvature), -_PARABOLA, _PARABOLA))
