"""Whether a fan's angles and its distance to the detector agree with its rays.

The ray at fan angle gamma in the view at ``a`` is met again at ``a + pi - 2 gamma``, at -gamma.
Where the two differ as other rays do, and agree once the angles are spread over another turn, or
the detector is taken to be nearer or further, that is what is wrong. The distance from source to
axis is not among it: an object, and that distance, twice as large make the same pictures.
A round object agrees with everything, and a span without opposite rays contradicts nothing: of
these nothing is said.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from rift_cl.geometry import Fan
from rift_cl.reconstruct.axis.fan_rays import opposite_rays
from rift_cl.reconstruct.axis.turn import OtherTurn
from rift_cl.reconstruct.axis.views import Views, binned

Floats = NDArray[np.float64]

# Bins and views that are compared, about, and the fewest pairs of rays, also as a share of all.
_BINS, _VIEWS, _FEWEST, _FEWEST_SHARE = 64, 120, 200, 0.04
# Trial factors of the angles and of the distance, and how far from 1 they begin to count.
_TURNS = np.exp(np.arange(-26, 27) * np.log(2.6) / 26)
# Those that another unit of length makes are far away.
_DISTANCES = np.append(1.25 ** np.arange(-14.0, 15), [1e-3, 1e3])
_OTHER_TURN, _OTHER_DISTANCE = 0.05, 0.5
# Trial centres beside the one that is given, in the bins that are compared.
_CENTERS = (0.0, -1.0, 1.0, -2.0, 2.0)
# Where the centre may be of rays of which nothing is known: so far from the one that is given, as a
# share of the bins, at so many places, each with those beside it.
_APART, _PLACES = 0.15, 5
# Differences as a share of those of unrelated rays, noise taken off: least of what is doubted, for
# angles and for the distance, and the most of it that an explanation leaves.
_DOUBTED_TURN, _DOUBTED_DISTANCE, _LEFT = 0.25, 0.04, 0.3


def fan_doubt(sinogram: Views, fan: Fan) -> str:
    """What opposite rays have against the angles or the distance to the detector.

    Args:
        sinogram: line integrals of one row, (view, bin).
        fan: its geometry, with the right centre, or nearly.

    Returns:
        The end of a sentence; empty where the rays agree, or do not tell.
    """
    if fan.views < 3:
        return ""
    rays = _Rays(sinogram, fan)
    given = rays.disagreement(1.0, 1.0)
    if not _DOUBTED_DISTANCE < given < np.inf:
        return ""
    turns, distances = np.full(_TURNS.size, np.inf), np.full(_DISTANCES.size, np.inf)
    if given > _DOUBTED_TURN:
        for index in np.flatnonzero(np.abs(np.log(_TURNS)) >= _OTHER_TURN):
            turns[index] = rays.disagreement(float(_TURNS[index]), 1.0)
    for index in np.flatnonzero(np.abs(np.log(_DISTANCES)) >= _OTHER_DISTANCE):
        distances[index] = rays.disagreement(1.0, float(_DISTANCES[index]))
    if min(turns.min(), distances.min()) > _LEFT * given:
        return ""
    if turns.min() < distances.min():
        whole = np.rad2deg(np.ptp(fan.angles)) * fan.views / (fan.views - 1)
        return OtherTurn(float(whole), float(whole * _TURNS[turns.argmin()])).of_rays()
    factor = float(_DISTANCES[distances.argmin()])
    return (
        "rays that measure the same line do not agree, and do if the detector is about "
        f"{factor:.2g} times as far from the source: a length is probably wrong"
    )


def disagreement(sinogram: Views, fan: Fan) -> float:
    """How far opposite rays disagree, about whatever centre is best.

    Args:
        sinogram: line integrals of one row, (view, bin).
        fan: its geometry but for the centre.

    Returns:
        Mean square difference as a share of that of unrelated rays: 0 where they agree, or where
        there is no contrast; infinite where too few lines were measured twice.
    """
    reach = _APART * fan.bins
    centers = fan.center + np.linspace(-reach, reach, _PLACES)
    return min(
        _Rays(sinogram, replace(fan, center=center)).disagreement(1.0, 1.0)
        for center in centers.tolist()
    )


def sense_doubt(sinogram: Views, fan: Fan) -> str:
    """What opposite rays have against the sense in which the angles run, whatever the centre.

    Args:
        sinogram: line integrals of one row, (view, bin).
        fan: its geometry but for the centre.

    Returns:
        A sentence; empty where the rays agree, or do not tell.
    """
    given, reversed_ = (disagreement(sinogram, fan.at(s * fan.angles)) for s in (1, -1))
    if not _DOUBTED_TURN < given < np.inf or reversed_ > _LEFT * given:
        return ""
    return (
        f"Rays that measure the same line differ by {given:.2f} of what unrelated ones do, and by "
        f"{reversed_:.2f} if the source goes round the other way"
    )


class _Rays:
    """The rays of a fan in few bins and views."""

    def __init__(self, sinogram: Views, fan: Fan) -> None:
        count = max(1, round(fan.bins / _BINS))
        views = binned(sinogram, count)
        order = np.argsort(fan.angles, kind="stable")
        chosen = order[:: max(1, round(fan.views / _VIEWS))]
        self._views = views[chosen]
        self._fan = replace(
            fan.subset(chosen),
            bins=views.shape[1],
            pitch=fan.pitch * count,
            center=(fan.center - (count - 1) / 2) / count,
        )
        bends = views[order][2:] - 2 * views[order][1:-1] + views[order][:-2]
        self._noise = float(np.median(np.abs(bends)) / 0.6745) ** 2 / 6
        # Rays at one bin: what all views have in common tells nothing.
        self._contrast = float(self._views.var(axis=0).mean()) - self._noise

    def disagreement(self, turn: float, distance: float) -> float:
        """Mean square difference of opposite rays, as a share of that of unrelated ones.

        Infinite where too few lines were measured twice.
        """
        if not self._contrast > self._noise:
            return 0.0
        fan = self._fan
        angles = fan.angles[0] + turn * (fan.angles - fan.angles[0])
        # A factor of the fan's tangents, which leaves the source where it is.
        fan = replace(fan.at(angles), pitch=fan.pitch / distance)
        return min(self._differences(replace(fan, center=fan.center + aside)) for aside in _CENTERS)

    def _differences(self, fan: Fan) -> float:
        rays, opposite, seen = opposite_rays(self._views, fan)
        if np.count_nonzero(seen) < max(_FEWEST, _FEWEST_SHARE * seen.size):
            return np.inf
        square = float(((rays - opposite)[seen] ** 2).mean())
        return (square - 2 * self._noise) / (2 * self._contrast)
