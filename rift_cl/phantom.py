"""Phantoms made of ellipsoids: known objects whose line integrals are known exactly.

An ellipsoid of constant value has a closed-form projection, so a phantom gives both a picture and
the measurement that a perfect scanner would make of it, neither derived from the other. The
Shepp-Logan head is the standard one; ``render`` and ``project`` take any list of ellipsoids.

An image has no z: it shows the equatorial section of every ellipsoid, which is how the classic
two-dimensional head is contained in the three-dimensional one.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from rift_cl.errors import InputError, ShapeError
from rift_cl.geometry import Grid, Parallel

_Reals = NDArray[np.float64]
_STRIP_SAMPLES = 1 << 20


@dataclass(frozen=True)
class Ellipsoid:
    """A solid ellipsoid of constant value; where several overlap, their values add.

    Args:
        center: (z, y, x) of the middle, in the grid's unit of length.
        semi_axes: half lengths of the axes (z, y, x) before the rotation, all positive.
        angle: rotation about z in radians, from the x axis towards the y axis.
        value: density inside.

    Raises:
        ShapeError: ``center`` or ``semi_axes`` is not three numbers.
        InputError: a number is not finite, or a semi-axis not positive.
    """

    center: tuple[float, float, float]
    semi_axes: tuple[float, float, float]
    angle: float
    value: float

    def __post_init__(self) -> None:
        """Check the arguments and bring them into their normal form."""
        for name in ("center", "semi_axes"):
            numbers = tuple(float(v) for v in getattr(self, name))
            if len(numbers) != 3:
                raise ShapeError(f"Ellipsoid: {name} is {numbers}, wanted three lengths (z, y, x)")
            object.__setattr__(self, name, numbers)
        object.__setattr__(self, "angle", float(self.angle))
        object.__setattr__(self, "value", float(self.value))
        if min(self.semi_axes) <= 0:
            raise InputError(f"Ellipsoid: semi_axes is {self.semi_axes}, wanted positive lengths")
        if not np.isfinite([*self.center, *self.semi_axes, self.angle, self.value]).all():
            raise InputError(f"Ellipsoid: every number must be finite, this is {self!r}")

    def placed(self, scale: float, center: tuple[float, float, float]) -> Ellipsoid:
        """This ellipsoid enlarged about the origin by ``scale``, then moved by ``center``."""
        z, y, x = (scale * c + o for c, o in zip(self.center, center, strict=True))
        c, b, a = (scale * s for s in self.semi_axes)
        return Ellipsoid((z, y, x), (c, b, a), self.angle, self.value)


def _upright(
    value: float, semi_axes_xyz: tuple[float, float, float], center_xyz: Sequence[float], deg: float
) -> Ellipsoid:
    # The published tables have y upwards. Here y grows with the index and index 0 is shown on top.
    (a, b, c), (x, y, z) = semi_axes_xyz, center_xyz
    return Ellipsoid((z, -y, x), (c, b, a), math.radians(-deg), value)


SHEPP_LOGAN: tuple[Ellipsoid, ...] = (
    _upright(1.0, (0.69, 0.92, 0.81), (0.0, 0.0, 0.0), 0),
    _upright(-0.8, (0.6624, 0.874, 0.78), (0.0, -0.0184, 0.0), 0),
    _upright(-0.2, (0.11, 0.31, 0.22), (0.22, 0.0, 0.0), -18),
    _upright(-0.2, (0.16, 0.41, 0.28), (-0.22, 0.0, 0.0), 18),
    _upright(0.1, (0.21, 0.25, 0.41), (0.0, 0.35, -0.15), 0),
    _upright(0.1, (0.046, 0.046, 0.05), (0.0, 0.1, 0.25), 0),
    _upright(0.1, (0.046, 0.046, 0.05), (0.0, -0.1, 0.25), 0),
    _upright(0.1, (0.046, 0.023, 0.05), (-0.08, -0.605, 0.0), 0),
    _upright(0.1, (0.023, 0.023, 0.02), (0.0, -0.606, 0.0), 0),
    _upright(0.1, (0.023, 0.046, 0.02), (0.06, -0.605, 0.0), 0),
)
"""The modified Shepp-Logan head inside the unit ball.

The ellipses are those of Shepp and Logan (IEEE Trans. Nucl. Sci. 21, 1974), with the contrasts of
Toft (The Radon Transform, PhD thesis, 1996), which make the details visible. Their extension into
z follows Kak and Slaney in the form of Schabel's ``phantom3d``; the rotations are the ellipses'.
"""


def shepp_logan(grid: Grid, *, oversampling: int = 4) -> NDArray[np.float32]:
    """The modified Shepp-Logan head, upright when row 0 is shown on top: 0 to 1, from ``render``.

    The head's unit ball has the radius ``min(ny * dy, nx * dx) / 2`` and stands about the grid's
    centre, not about the rotation axis: a grid away from the axis carries the head with it. The
    same radius holds along z, so that a volume of few slices is a slab through the middle.
    """
    density = render(_head(grid), grid, oversampling=oversampling)
    # 1 - 0.8 - 0.2 is a hair below zero, which a later square root would not forgive.
    return np.maximum(density, 0, out=density)


def shepp_logan_sinogram(grid: Grid, scan: Parallel) -> NDArray[np.float32]:
    """The exact line integrals of the head that ``shepp_logan(grid)`` shows; see ``project``."""
    return project(_head(grid), grid, scan)


def _head(grid: Grid) -> tuple[Ellipsoid, ...]:
    plane = grid.slice()
    radius = min(n * d for n, d in zip(plane.shape, plane.spacing, strict=True)) / 2
    y, x = plane.center
    z = grid.center[0] if len(grid.shape) == 3 else 0.0
    return tuple(part.placed(radius, (z, y, x)) for part in SHEPP_LOGAN)


def render(
    ellipsoids: Sequence[Ellipsoid], grid: Grid, *, oversampling: int = 4
) -> NDArray[np.float32]:
    """Sum of ellipsoids on a grid, each sample the mean over its pixel or voxel.

    Args:
        ellipsoids: the parts; an image shows their equatorial sections.
        grid: the image or volume to fill.
        oversampling: the mean along x is exact; along y, and along z of a volume, it is taken
            over this many evenly spaced lines through every sample.

    Returns:
        Densities of shape ``grid.shape``.

    Raises:
        InputError: ``oversampling`` is not a positive whole number.
    """
    if int(oversampling) != oversampling or oversampling < 1:
        raise InputError(f"render: oversampling is {oversampling!r}, wanted a whole number >= 1")
    ny, nx = grid.shape[-2:]
    y = _lines(grid, axis=-2, per_sample=int(oversampling))
    volume = len(grid.shape) == 3
    levels = list(_lines(grid, axis=0, per_sample=int(oversampling))) if volume else [None]
    density = np.empty((len(levels), ny, nx), dtype=np.float32)
    rows = max(1, _STRIP_SAMPLES // nx)
    for k, z in enumerate(levels):
        for first in range(0, ny, rows):
            strip = slice(first, first + rows)
            density[k, strip] = _render_strip(ellipsoids, grid, y[strip], z)
    return density.reshape(grid.shape)


def _lines(grid: Grid, *, axis: int, per_sample: int) -> _Reals:
    """Coordinates (sample, line) of evenly spaced lines through every sample along an axis."""
    offsets = ((np.arange(per_sample) + 0.5) / per_sample - 0.5) * grid.spacing[axis]
    return grid.coordinates(axis)[:, None] + offsets


def _render_strip(
    ellipsoids: Sequence[Ellipsoid], grid: Grid, y: _Reals, z: _Reals | None
) -> _Reals:
    nx, dx = grid.shape[-1], grid.spacing[-1]
    left = grid.center[-1] - nx / 2 * dx
    total = np.zeros((len(y), nx))
    for part in ellipsoids:
        middle, half = _chords(part, y, z)
        hit = (half > 0).any(axis=1)
        if hit.any():
            begin, end = (middle - half - left) / dx, (middle + half - left) / dx
            total[hit] += part.value * _coverage(begin[hit], end[hit], nx)
    return total


def _chords(part: Ellipsoid, y: _Reals, z: _Reals | None) -> tuple[_Reals, _Reals]:
    """Middle and half length of the x interval inside, (row, line), on every line y of every z."""
    _, b, a = part.semi_axes
    cos, sin = math.cos(part.angle), math.sin(part.angle)
    xx = (cos / a) ** 2 + (sin / b) ** 2
    xy = cos * sin * (1 / a**2 - 1 / b**2)
    offset = (y - part.center[1])[:, :, None]
    square = xx * _section(part, z) - (offset / (a * b)) ** 2
    middle = part.center[2] - offset * xy / xx + np.zeros_like(square)
    half = np.sqrt(np.maximum(square, 0)) / xx
    return middle.reshape(len(y), -1), half.reshape(len(y), -1)


def _section(part: Ellipsoid, z: _Reals | None) -> _Reals:
    """Squared size of the section at every z relative to the equatorial one; <= 0 if it misses."""
    if z is None:
        return np.ones(1)
    return 1 - ((z - part.center[0]) / part.semi_axes[0]) ** 2


def _coverage(begin: _Reals, end: _Reals, pixels: int) -> _Reals:
    """Share of each pixel, [i, i + 1], that the intervals cover, mean over the lines.

    Left of an edge the share is 0, right of it 1, in its own pixel a part: two impulses and a
    running sum. Intervals are (row, line), the result is (row, pixel).
    """
    edges = np.clip(np.stack([begin, end]), 0, pixels)
    # Whole multiples of 2^-24 add up without rounding: exactly 0 outside and 1 inside.
    edges = np.rint(edges * 2.0**24) / 2.0**24
    whole = np.floor(edges)
    part = edges - whole
    rows, lines = begin.shape
    steps = np.zeros((rows, pixels + 2))
    index = (whole.astype(np.intp) + np.arange(rows)[:, None] * (pixels + 2)).ravel()
    sign = np.array([1.0, -1.0])[:, None, None]
    np.add.at(steps.reshape(-1), index, (sign * (1 - part)).ravel())
    np.add.at(steps.reshape(-1), index + 1, (sign * part).ravel())
    covered: _Reals = np.cumsum(steps, axis=1)[:, :pixels] / lines
    return covered


def project(ellipsoids: Sequence[Ellipsoid], grid: Grid, scan: Parallel) -> NDArray[np.float32]:
    """Exact line integrals of a sum of ellipsoids at the centres of the bins.

    In a direction at ``beta`` from the ellipse's own axes the chord at distance t from its middle
    is ``2 a b sqrt(w - t^2) / w`` with ``w = (a cos beta)^2 + (b sin beta)^2`` (Kak and Slaney,
    Principles of Computerized Tomographic Imaging, 1988, section 3.1).

    Args:
        ellipsoids: the parts, inside the grid or not; an image means their equatorial sections.
        grid: tells an image from a volume; the volume's slices are looked at in their middles.
        scan: the rays.

    Returns:
        Density times length, (angle, bin) for an image and (angle, row, bin) for a volume.
    """
    volume = len(grid.shape) == 3
    levels = list(grid.coordinates(0)[:, None]) if volume else [None]
    stack = np.empty((len(scan.angles), len(levels), scan.bins), dtype=np.float32)
    for k, z in enumerate(levels):
        stack[:, k] = _project_slice(ellipsoids, scan, z)
    return stack if volume else stack[:, 0]


def _project_slice(ellipsoids: Sequence[Ellipsoid], scan: Parallel, z: _Reals | None) -> _Reals:
    angles, t = scan.angles[:, None], scan.coordinates()
    total = np.zeros((len(angles), scan.bins))
    for part in ellipsoids:
        section = float(_section(part, z)[0])
        if section > 0:
            (_, b, a), (_, y, x) = part.semi_axes, part.center
            beta = angles - part.angle
            width = (a * np.cos(beta)) ** 2 + (b * np.sin(beta)) ** 2
            offset = t - (x * np.cos(angles) + y * np.sin(angles))
            chord = np.sqrt(np.maximum(section * width - offset**2, 0)) / width
            total += 2 * a * b * part.value * chord
    return total
