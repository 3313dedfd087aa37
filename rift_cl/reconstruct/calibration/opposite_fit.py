"""Centre, roll, slant and fan angle at which opposite rays of a scan agree best.

The pixel at (u, v) from the foot of the source, and the one at (-u, v) in the view
``pi - 2 gamma(u)`` further round, measure the same line in the plane of the source's orbit, and
lines that cross halfway between the sources elsewhere. Where the detector is rolled, or seen from
another distance, other pixels are compared, and differ; so they are where it is slanted, turned
about its columns, so that bins on one side of the foot stand farther from the source than those on
the other. Least squares over these differences, by the method of Gauss and Newton from few wide
pixels to more narrow ones, gives the four numbers.
Only rows so near the orbit enter that the lines hardly part; they count by how well they agree.

The distance of the axis does not enter: an object, and a source at the axis' distance, twice as
large make the same pictures. The orbit's row does not either.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from rift_cl.geometry import Cone
from rift_cl.reconstruct.direct.turn_views import in_one_turn, means, turn_views

Floats = NDArray[np.float64]
Views = NDArray[np.float32]

# Pixels across the detector, from the first fit to the last, and most rows and views in them.
_SIZES, _ROWS, _VIEWS = (40, 128), 13, 60
# Most steps at each size, and what ends them, in standard errors.
_STEPS, _SETTLED = 6, 0.1
# Steps of the derivatives: bins, radians of the roll, share of the distance, radians of the slant.
_SMALL = np.array([0.05, 1e-3, 2e-3, 5e-3])
# The longest steps in one iteration, and the greatest slant.
_LONGEST = np.array([2.0, 0.03, 0.1, 0.06])
_MOST_SLANTED = 0.3
# By how many rows opposite rays may part at the edge of the field of view, and the fewest rows.
_PARTED, _FEWEST = 0.5, 3.0
# Fewest pairs of rays that are fitted.
_FEWEST_RAYS = 200
# Groups share lines, and lines that part differ by more than noise: errors that groups tell are
# too small by about this factor on phantoms of grains with noise of 1 and 5 %.
_INFLATED = 4.0
# Standard deviation of the Gauss function that views are smoothed with, in pixels and in views.
_BLUR = 1.0
# Groups of views whose disagreement tells errors, and how far apart views may be, in steps.
_GROUPS, _GAP = 12, 3.5


@dataclass(frozen=True, eq=False)
class OppositeFit:
    """What opposite rays say of a scan.

    Args:
        center: bin at which the axis is seen in the orbit's row.
        roll: of the detector in its plane, in radians; positive where the axis is seen at greater
            bins in greater rows.
        distance: from source to detector as a share of the scan's.
        slant: of a flat detector about its columns, in radians; positive where greater bins are
            farther from the source.
        errors: (4,) their standard errors, in the same units; infinite where data do not tell.
        disagreement: root mean square difference of opposite rays, as a share of the contrast,
            before the fit and after.
    """

    center: float
    roll: float
    distance: float
    slant: float
    errors: Floats
    disagreement: tuple[float, float]


def fit_opposite_rays(stack: Views, scan: Cone) -> OppositeFit:
    """Fit centre, roll, distance and slant of the detector.

    Args:
        stack: line integrals, (view, row, bin).
        scan: the geometry; the start, which has the right sense and is off by a few bins and
            degrees at most.
    """
    turned, group = in_one_turn(scan.angles)
    merged = means(stack, group)
    found = start = np.array([scan.center[1], 0.0, 0.0, 0.0])
    for size in _SIZES:
        rays = _Rays(merged, turned, scan, max(1, round(scan.bins / size)))
        found, errors = rays.fitted(found)
    before, after = rays.disagreement(start), rays.disagreement(found)
    errors[2] *= np.exp(found[2])
    center, roll, stretch, slant = found.tolist()
    return OppositeFit(center, roll, float(np.exp(stretch)), slant, errors, (before, after))


class _Rays:
    """Rays in pixels of some size, and those that measure the same lines from the other side."""

    def __init__(self, merged: Views, angles: Floats, scan: Cone, bin: int) -> None:
        from scipy.ndimage import gaussian_filter, spline_filter

        self._views = turn_views(angles)
        self._scan, self._bin = scan, bin
        low, high = _near_orbit(scan)
        tall = max(1, min(bin, (high - low) // 4))
        margin = int(np.ceil(_LONGEST[1] * scan.bins)) + 2 * tall
        first = max(0, low - margin)
        pixels = _binned(merged[:, first : high + margin], tall, bin)
        # Noise read between pixels is weaker than noise read at them, and would draw the fit to
        # places between them; smooth noise is alike everywhere.
        pixels = gaussian_filter(pixels, (0.0, _BLUR, _BLUR), mode="nearest")
        ordered = gaussian_filter(pixels[self._views.order], (_BLUR, 0.0, 0.0), mode="nearest")
        self._smooth = spline_filter(ordered, 3, mode="mirror", output=np.float32)
        pixels = gaussian_filter(pixels, (_BLUR, 0.0, 0.0), mode="nearest")
        # Places of pixels on the detector, in its rows and bins.
        rows = first + np.arange(pixels.shape[1]) * tall + (tall - 1) / 2
        self._ends = float(rows[0]), float(rows[-1])
        self._bins = np.arange(pixels.shape[2]) * bin + (bin - 1) / 2
        near = np.flatnonzero((rows >= low - 0.5) & (rows <= high - 0.5))
        chosen = near[_spread(near.size, _ROWS)]
        seen = _spread(len(angles), _VIEWS)
        self._tall, self._rows, self._angles = tall, rows[chosen], angles[seen]
        self._rays = pixels[seen][:, chosen]
        self._contrast = float(self._rays.std())

    def fitted(self, start: Floats) -> tuple[Floats, Floats]:
        """The best parameters next to some, and their standard errors."""
        found, errors = start.copy(), np.full(start.size, np.inf)
        free = np.array([True, self._rows.size > 2, True, not self._scan.curved])
        for _ in range(_STEPS):
            here = self._differences(found)
            if np.count_nonzero(np.isfinite(here)) < _FEWEST_RAYS or not self._contrast > 0:
                return start.copy(), np.full(start.size, np.inf)
            differ, weights = self._weighed(here)
            slopes = []
            for index in np.flatnonzero(free):
                step = np.zeros(start.size)
                step[index] = _SMALL[index]
                slope = (self._differences(found + step) - here) / _SMALL[index]
                slopes.append(np.where(np.isfinite(slope), slope, 0.0))
            jacobian = np.stack(slopes, axis=-1)
            weighted = jacobian * weights[..., None]
            normal = np.einsum("vrbi,vrbj->ij", weighted, jacobian)
            slope = np.einsum("vrbi,vrb->vi", weighted, differ)
            inverse = np.linalg.pinv(normal, rcond=1e-10, hermitian=True)
            change = -inverse @ slope.sum(axis=0)
            groups = np.array_split(slope, _GROUPS)
            scatter = sum(np.outer(part.sum(axis=0), part.sum(axis=0)) for part in groups)
            errors[free] = _INFLATED * np.sqrt(np.diag(inverse @ scatter @ inverse))
            step = np.clip(change, -_LONGEST[free], _LONGEST[free])
            found[free] += step
            found[3] = np.clip(found[3], -_MOST_SLANTED, _MOST_SLANTED)
            if (np.abs(step) < _SETTLED * errors[free]).all():
                break
        return found, errors

    def disagreement(self, parameters: Floats) -> float:
        """Root mean square difference of opposite rays, as a share of the contrast."""
        differ = self._differences(parameters)
        differ = differ[np.isfinite(differ)]
        if not differ.size or not self._contrast > 0:
            return float("nan")
        return float(np.sqrt(np.mean(differ**2))) / self._contrast

    def _weighed(self, differ: Floats) -> tuple[Floats, Floats]:
        """Differences, 0 where there are none, and weights by how well their rows agree."""
        seen = np.isfinite(differ)
        differ = np.where(seen, differ, 0.0)
        count = np.maximum(seen.sum(axis=(0, 2)), 1)
        square = (differ**2).sum(axis=(0, 2)) / count
        least = 1e-6 * self._contrast**2 + 0.1 * np.median(square)
        return differ, seen / (square + least)[:, None]

    def _differences(self, parameters: Floats) -> Floats:
        """Rays less those from the other side, (view, row, bin); NaN where there are none."""
        from scipy.ndimage import map_coordinates

        center, roll, stretch, slant = parameters.tolist()
        scan = self._scan
        distance = scan.source_to_detector * np.exp(stretch)
        across = (self._bins - center)[None, :] * scan.pitch[1]
        along = (self._rows - scan.center[0])[:, None] * scan.pitch[0]
        cosine, sine = np.cos(roll), np.sin(roll)
        u, v = cosine * across - sine * along, sine * across + cosine * along
        if scan.curved:
            gamma, u = u / distance, -u
        else:
            # Ahead of the foot, a place is as far as the slant takes it; so is the opposite one.
            depth = distance + np.sin(slant) * u
            gamma = np.arctan2(np.cos(slant) * u, depth)
            u = -distance * np.tan(gamma) / (np.cos(slant) + np.sin(slant) * np.tan(gamma))
            v = v * (distance + np.sin(slant) * u) / depth
        # The opposite pixel, in the detector's own axes.
        other_bin = center + (cosine * u + sine * v) / scan.pitch[1]
        other_row = scan.center[0] + (cosine * v - sine * u) / scan.pitch[0]
        views = self._views
        angle = self._angles[:, None, None] + np.pi - 2 * gamma
        angle = views.first + np.mod(angle - views.first, 2 * np.pi)
        number = np.interp(angle, views.angles, np.arange(views.angles.size))
        seen = (other_bin >= self._bins[0]) & (other_bin <= self._bins[-1])
        if self._rows.size > 1:
            seen = seen & (other_row >= self._ends[0]) & (other_row <= self._ends[1])
        after = np.clip(np.searchsorted(views.angles, angle), 1, views.angles.size - 1)
        close = views.angles[after] - views.angles[after - 1] <= _GAP * views.step
        whole = seen & close & (angle >= views.angles[0]) & (angle <= views.angles[-1])
        places = np.broadcast_arrays(
            number,
            (other_row - self._ends[0]) / self._tall,
            (other_bin - self._bins[0]) / self._bin,
        )
        read = np.full(whole.shape, np.nan)
        at = np.stack([place[whole] for place in places])
        read[whole] = map_coordinates(self._smooth, at, order=3, mode="mirror", prefilter=False)
        differences: Floats = self._rays - read
        return differences


def _near_orbit(scan: Cone) -> tuple[int, int]:
    """The first row that is compared, and the one after the last."""
    orbit = scan.center[0]
    widest = float(np.abs(np.sin(scan.fan_angles()[[0, -1]])).max())
    reach = max(_PARTED / (2 * widest), _FEWEST / 2)
    return max(0, int(np.ceil(orbit - reach))), min(scan.rows, int(np.floor(orbit + reach)) + 1)


def _binned(stack: Views, tall: int, wide: int) -> Floats:
    """Means over pixels; what is left over at the ends is dropped."""
    views, rows, bins = stack.shape
    whole = stack[:, : rows // tall * tall, : bins // wide * wide]
    blocks = whole.reshape(views, rows // tall, tall, bins // wide, wide)
    pixels: Floats = blocks.mean(axis=(2, 4), dtype=np.float64)
    return pixels


def _spread(count: int, most: int) -> NDArray[np.intp]:
    """At most so many of some numbers, evenly spread."""
    return np.unique(np.linspace(0, count - 1, min(most, count)).round().astype(np.intp))
