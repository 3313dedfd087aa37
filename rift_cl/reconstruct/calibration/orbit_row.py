"""The row of the source's orbit, at which views agree on planes through two sources.

A plane that holds two places of the source is seen by both views as a line of pixels. How the
integral over the plane changes as it is displaced is an integral, along that line, of how the data
change across it (Grangeat, Mathematical framework of cone beam 3D reconstruction via the first
derivative of the Radon transform, 1991), and both views must tell the same number: the epipolar
consistency of Aichert et al., IEEE Transactions on Medical Imaging 34, 2205, 2015. These rays need
not be near the orbit's plane nor opposite, so that the row is told, which opposite rays do not.

The lines lie alike in all views that are equally far apart, so that a sparse matrix, made once for
a trial row, reads them in all views. Data are noisy and read between pixels, which makes small dips
of the sum of squares: it is scanned, and the vertex of a parabola through it is the row. What
groups of views would like instead tells the error.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from rift_cl.geometry import Cone
from rift_cl.reconstruct.direct.turn_views import in_one_turn, means, turn_views

Floats = NDArray[np.float64]
Views = NDArray[np.float32]

# Most pixels across the detector, and the Gauss function that smooths them, in pixels.
_PIXELS, _BLUR = 160, 1.5
# Angles between views of a pair, in radians, and the number of planes for each.
_APART, _PLANES = np.deg2rad(np.arange(24.0, 150.0, 12.0)), 24
# The share of the rows that planes reach.
_REACH = 0.85
# How far on either side of the given row, as a share of the rows, it is looked for, and how far on
# either side of the best of these the parabola reaches, in rows too; numbers of trials.
_FAR, _TRIALS, _NEAR, _NEAR_ROWS, _POINTS = 0.12, 17, 0.03, 2.5, 11
# Groups of neighbouring views, and half an interval in standard errors; what groups tell is too
# little, as they share planes, by about this factor on phantoms of grains.
_GROUPS, _HALF_INTERVAL, _INFLATED = 12, 2.3, 3.0
# The widest half interval that is still an answer, as a share of the rows.
_WIDEST = 0.03


def orbit_row(stack: Views, scan: Cone, roll: float = 0.0) -> tuple[float, float] | None:
    """The row of the orbit, and half its 95 % interval; None where the data do not tell.

    Args:
        stack: line integrals, (view, row, bin), of an object that no view cuts at the sides.
        scan: the geometry, flat and circular, of the right sense and axis; its row is where the
            search begins.
        roll: of the detector in its plane, in radians.
    """
    planes = _Planes(stack, scan, roll)
    reach = _FAR * scan.rows
    trials = scan.center[0] + np.linspace(-reach, reach, _TRIALS)
    sums = np.array([planes.squares(row).sum() for row in trials])
    best = int(np.argmin(sums))
    if best in (0, _TRIALS - 1) or not sums[best] > 0:
        return None
    near = np.linspace(-1, 1, _POINTS) * max(_NEAR * scan.rows, _NEAR_ROWS)
    squares = np.array([planes.squares(trials[best] + away) for away in near])
    bend, slope, _ = np.polyfit(near, squares.sum(axis=1), 2)
    vertex = -slope / (2 * bend) if bend > 0 else np.inf
    if not abs(vertex) <= near[-1]:
        return None
    # What each group's parabola, of its own slope at the vertex, adds to the whole one's.
    slopes = np.array([np.polyval(np.polyder(np.polyfit(near, g, 2)), vertex) for g in squares.T])
    error = np.sqrt((slopes**2).sum()) / (2 * bend)
    half = _HALF_INTERVAL * _INFLATED * float(error)
    return (float(trials[best] + vertex), half) if half <= _WIDEST * scan.rows else None


class _Planes:
    """The views of a scan in pixels of some size, and lines in them."""

    def __init__(self, stack: Views, scan: Cone, roll: float) -> None:
        from scipy.ndimage import gaussian_filter

        turned, group = in_one_turn(scan.angles)
        self._views = turn_views(turned)
        n = self._size = max(1, -(-scan.bins // _PIXELS))
        rows, bins = scan.rows // n, scan.bins // n
        merged = means(stack, group)[self._views.order]
        blocks = merged[:, : rows * n, : bins * n].reshape(-1, rows, n, bins, n)
        pixels = gaussian_filter(blocks.mean((2, 4), dtype=np.float64), (0.0, _BLUR, _BLUR))
        self._pixels = np.ascontiguousarray(pixels.reshape(len(pixels), -1).T)
        self._shape, self._scan = (rows, bins), scan
        self._pitch = scan.pitch[0] * n, scan.pitch[1] * n
        to_edge = _REACH * min(scan.center[0], scan.rows - 1 - scan.center[0]) * scan.pitch[0]
        high = np.arctan(max(to_edge, 0.0) / scan.source_to_detector)
        self._lift = np.linspace(-high, high, _PLANES)
        # Rays of every plane, as far apart as pixels at the middle, and a little beyond the fan.
        self._step = self._pitch[1] / scan.source_to_detector
        widest = float(np.abs(scan.fan_angles()).max()) * 1.1
        self._fan = np.arange(-widest, widest + self._step, self._step)
        self._roll = roll

    def squares(self, row: float) -> Floats:
        """Squared differences at a trial row, added up over groups of neighbouring views."""
        one, other = self._read(row)
        each = ((one - other) ** 2).sum(axis=(0, 1))
        return np.array([part.sum() for part in np.array_split(each, _GROUPS)])

    def _read(self, row: float) -> tuple[Floats, Floats]:
        """What views tell of planes, and what those further round tell: (apart, plane, view)."""
        from scipy.ndimage import map_coordinates, spline_filter1d

        views, count = self._views, self._pixels.shape[1]
        shape = len(_APART), _PLANES, count
        one, other = ((self._lines(row, side) @ self._pixels).reshape(shape) for side in (-1, 1))
        smooth = spline_filter1d(other, 3, axis=-1, mode="mirror")
        for index, apart in enumerate(_APART):
            angle = views.angles + apart
            if views.turn:
                angle = views.first + np.mod(angle - views.first, 2 * np.pi)
            number = np.interp(angle, views.angles, np.arange(views.angles.size))
            seen = (angle >= views.angles[0]) & (angle <= views.angles[count - 1])
            for plane in range(_PLANES):
                read = map_coordinates(
                    smooth[index, plane], [number], order=3, mode="mirror", prefilter=False
                )
                other[index, plane] = np.where(seen, read, one[index, plane])
        return one, other

    def _lines(self, orbit: float, side: int) -> Any:
        """The sparse matrix that reads planes' derivatives from the pixels of a view.

        Args:
            orbit: the trial row.
            side: -1 for views whose partner is further round, 1 for the partners.
        """
        from scipy.sparse import csr_array

        scan, (rows, bins), n = self._scan, self._shape, self._size
        cosine, sine, reach = np.cos(self._roll), np.sin(self._roll), scan.source_to_detector
        foot_bin, foot_row = ((x - (n - 1) / 2) / n for x in (scan.center[1], orbit))
        half, lift = (_APART / 2)[:, None], self._lift[None]
        # Along the upright detector's rows, its columns, and away from the source.
        normal = np.stack(
            [
                side * np.sin(lift) * np.sin(half),
                np.broadcast_to(np.cos(lift), np.broadcast_shapes(half.shape, lift.shape)),
                np.sin(lift) * np.cos(half),
            ],
            axis=-1,
        )
        ahead = np.array([0.0, 0.0, 1.0]) - normal[..., 2:] * normal
        ahead /= np.linalg.norm(ahead, axis=-1, keepdims=True)
        beside = np.cross(normal, ahead)
        rays = (
            np.cos(self._fan)[:, None] * ahead[..., None, :]
            + np.sin(self._fan)[:, None] * beside[..., None, :]
        )
        number = np.arange(len(_APART) * _PLANES).reshape(len(_APART), _PLANES, 1)
        entries: list[tuple[Any, Any, Any]] = []
        for sign in (1, -1):
            moved = rays + sign * self._step * normal[..., None, :]
            across, along = (reach * moved[..., k] / moved[..., 2] for k in (0, 1))
            bin = foot_bin + (cosine * across + sine * along) / self._pitch[1]
            row = foot_row + (cosine * along - sine * across) / self._pitch[0]
            row = np.clip(row, 0, rows - 1.001)
            inside = (bin >= 0) & (bin < bins - 1)
            left, top = np.floor(bin[inside]).astype(np.intp), np.floor(row[inside]).astype(np.intp)
            right, down = bin[inside] - left, row[inside] - top
            line = np.broadcast_to(number, bin.shape)[inside]
            for k, i, share in (
                (0, 0, (1 - right) * (1 - down)),
                (1, 0, right * (1 - down)),
                (0, 1, (1 - right) * down),
                (1, 1, right * down),
            ):
                entries.append((sign * share, line, (top + i) * bins + left + k))
        values, lines, places = (np.concatenate(part) for part in zip(*entries, strict=True))
        return csr_array((values, (lines, places)), shape=(number.size, rows * bins))
