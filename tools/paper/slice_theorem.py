"""A projection's spectrum is a slice of the object's: how nearly that holds for ours.

What all of coverage rests on (Bracewell 1956; Figure 2 of the RiFT paper, where it is the complex
amplitudes that agree, not the power). Both sides are made apart. One is a projection, transformed:
of an image, or of a volume about z, by ``Projector``; of a volume along any line, by rays through a
quintic spline. The other is the transform of the samples themselves, along the slice, without any
interpolation, times that of a pixel and of a bin.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from rift_cl.cl import Device
from rift_cl.errors import InputError, NonFiniteError, ShapeError
from rift_cl.geometry import Grid, Parallel
from rift_cl.geometry.numbers import one_number, real_numbers
from rift_cl.operators import Projector

Floats = NDArray[np.float64]
Complex = NDArray[np.complex128]
# Pixels are cut in parts, and bins are finer yet: the projector's own error falls with both.
_PARTS, _FINE = 2, 16
# Frequencies along a slice's radius.
_RADII = 96
# Frequencies along half an edge of a plane slice; samples that a spline rings on for.
_HALF_EDGE, _RINGING = 12, 8


@dataclass(frozen=True, eq=False)
class SliceComparison:
    """The two sides of the slice theorem.

    Args:
        frequencies: (n, 2) of (ky, kx), or (n, 3) of (kz, ky, kx), in cycles per unit of length.
        projection: (n,) the transform of the projection.
        slice: (n,) that of the object there.
    """

    frequencies: Floats
    projection: Complex
    slice: Complex

    @property
    def error(self) -> float:
        """The difference over the slice, root mean squares.

        Squares are weighted by the ramp |k|, by what each frequency of a slice stands for in the
        object, so that the mean value and its neighbours do not hide the rest.
        """
        weight = np.sqrt(np.linalg.norm(self.frequencies, axis=1))
        off = np.linalg.norm(weight * (self.projection - self.slice))
        return float(off / np.linalg.norm(weight * self.slice))


def slice_comparison(
    values: ArrayLike,
    grid: Grid,
    direction: float | ArrayLike,
    *,
    band: float = 0.25,
    device: Device | None = None,
) -> SliceComparison:
    """Compare the spectrum of a projection with the slice of the object's spectrum.

    Args:
        values: the image (y, x) or volume (z, y, x).
        grid: where its samples are.
        direction: the angle of a parallel scan, in radians; or, of a volume, the vector (x, y, z)
            along which it is projected.
        band: the highest frequency, in cycles per sample of the coarsest axis, 0 .. 0.5.
        device: for the projector; the default device if not given.

    Raises:
        ShapeError: the values are not the grid's, or the direction is neither a number nor a
            vector.
        InputError: a number is not finite, the band out of its range, the direction zero, or so
            are all values.
    """
    samples = real_numbers(values)
    if samples is None or samples.shape != grid.shape:
        raise ShapeError(f"values has shape {np.shape(values)}, the grid has {grid.shape}")
    if not np.isfinite(samples).all():
        raise NonFiniteError("values holds NaN or infinity")
    if not samples.any():
        raise InputError("values is zero everywhere: there is no spectrum to compare")
    if not 0 < one_number(band) <= 0.5:
        raise InputError(f"band is {band!r}, wanted cycles per sample, above 0 and up to 0.5")
    highest = band / max(grid.spacing)
    if np.ndim(direction) == 0:
        return _about_z(samples, grid, _angle(direction), highest, device)
    return _along_line(samples, grid, _line(direction, grid), highest)


def _about_z(
    samples: Floats, grid: Grid, angle: float, highest: float, device: Device | None
) -> SliceComparison:
    """By the projector, whose strips are the exact shadows of square pixels on whole bins."""
    (dy, dx), size = grid.spacing[-2:], grid.shape[-2:]
    pitch = min(dy, dx) / _FINE
    width = np.hypot(size[0] * dy, size[1] * dx) + 2 * np.linalg.norm(grid.center[-2:])
    scan = Parallel([angle], int(width / pitch) + 2 * _FINE, pitch)
    parts = samples.repeat(_PARTS, -1).repeat(_PARTS, -2).astype(np.float32)
    spacing = (*grid.spacing[:-2], dy / _PARTS, dx / _PARTS)
    view = Projector(Grid(parts.shape, spacing, grid.center), scan, "strip", device)(parts)[0]
    along, z = _half_plane(highest, len(grid.shape) == 3)
    k = np.stack([z, along * np.sin(angle), along * np.cos(angle)], axis=1)
    turned = np.exp(-2j * np.pi * np.outer(scan.coordinates(), along))
    if len(grid.shape) == 2:
        k = k[:, 1:]
        found = pitch * (view.astype(np.float64) @ turned)
    else:
        rows = np.exp(-2j * np.pi * np.outer(grid.coordinates(0), z))
        found = pitch * grid.spacing[0] * ((view.astype(np.float64) @ turned) * rows).sum(0)
    shadow = np.sinc(k[:, -1] * dx) * np.sinc(k[:, -2] * dy) * np.sinc(along * pitch)
    return SliceComparison(k, found, shadow * transform(samples, grid, k))


def _along_line(samples: Floats, grid: Grid, line: Floats, highest: float) -> SliceComparison:
    """By rays through a quintic spline, as far apart as the finest samples."""
    from scipy.ndimage import spline_filter

    across, down = _frame(line)
    pitch = min(grid.spacing)
    edges = np.array(grid.shape) * grid.spacing
    half = int(float(np.linalg.norm(edges)) / 2 / pitch) + _RINGING
    steps = np.asarray(np.arange(-half, half + 1) * pitch, np.float64)
    coefficients = spline_filter(np.pad(samples, _RINGING), order=5)
    view = np.stack([_ray_sums(coefficients, grid, u * across, down, line, steps) for u in steps])
    u, v = _half_plane(highest, volume=True)
    k = np.outer(u, across) + np.outer(v, down)
    middle = np.array(grid.center)[::-1]
    turned = [np.exp(-2j * np.pi * np.outer(steps, along)) for along in (u, v)]
    found = pitch**2 * ((view.T @ turned[0]) * turned[1]).sum(0) * np.exp(-2j * np.pi * k @ middle)
    backwards = np.ascontiguousarray(k[:, ::-1])
    shadow = np.prod(_spline_response(backwards * grid.spacing), axis=1)
    return SliceComparison(backwards, found, shadow * transform(samples, grid, backwards))


def transform(samples: Floats, grid: Grid, k: Floats) -> Complex:
    """The Fourier sum of samples at any frequencies, without interpolation.

    Args:
        samples: values of shape ``grid.shape``.
        grid: where they are.
        k: (n, axes) in the order of the grid's axes, in cycles per unit of length.

    Returns:
        (n,) sum of f exp(-2 pi i k x) times the volume of a sample.
    """
    turns = [
        np.exp(-2j * np.pi * np.outer(grid.coordinates(a), k[:, a])) for a in range(k.shape[1])
    ]
    total = samples @ turns[-1]
    for turned in turns[-2::-1]:
        total = (total * turned).sum(-2)
    return np.asarray(total * np.prod(grid.spacing), np.complex128)


def _half_plane(highest: float, volume: bool) -> tuple[Floats, Floats]:
    """Frequencies along a radius, or over half a disc: two arrays."""
    if not volume:
        radius = np.linspace(0, highest, _RADII + 1)[1:]
        return radius, np.zeros(_RADII)
    steps = np.arange(-_HALF_EDGE, _HALF_EDGE + 1) * (highest / _HALF_EDGE)
    u, v = (values.ravel() for values in np.meshgrid(steps[_HALF_EDGE:], steps))
    kept = (np.hypot(u, v) <= highest) & (np.hypot(u, v) > 0)
    return u[kept], v[kept]


def _ray_sums(
    coefficients: Floats, grid: Grid, start: Floats, down: Floats, line: Floats, steps: Floats
) -> Floats:
    """Integrals along parallel rays that start on a line, one for each step down."""
    from scipy.ndimage import map_coordinates

    places = start + steps[:, None, None] * down + steps[:, None] * line
    at = places[..., ::-1] / grid.spacing + (np.array(coefficients.shape) - 1) / 2
    values = map_coordinates(coefficients, np.moveaxis(at, -1, 0), order=5, prefilter=False)
    return np.asarray(values.sum(1) * (steps[1] - steps[0]), np.float64)


def _spline_response(cycles: Floats) -> Floats:
    """The transform of the quintic spline that interpolates a unit sample (Unser 1999)."""
    turn = 2 * np.pi * cycles
    return np.asarray(np.sinc(cycles) ** 6 * 60 / (33 + 26 * np.cos(turn) + np.cos(2 * turn)))


def _frame(line: Floats) -> tuple[Floats, Floats]:
    """Two unit vectors at right angles to a line and to each other."""
    least = np.eye(3)[int(np.argmin(np.abs(line)))]
    across = np.cross(line, least)
    across /= np.linalg.norm(across)
    return across, np.cross(line, across)


def _angle(direction: float | ArrayLike) -> float:
    angle = one_number(direction)
    if np.isnan(angle):
        raise InputError(f"direction is {direction!r}, wanted an angle in radians or a vector")
    return angle


def _line(direction: ArrayLike, grid: Grid) -> Floats:
    line = real_numbers(direction)
    if line is None or line.shape != (3,) or len(grid.shape) != 3:
        raise ShapeError(
            f"direction is {direction!r}, wanted an angle, or for a volume a vector (x, y, z)"
        )
    length = np.linalg.norm(line)
    if not (np.isfinite(length) and length > 0):
        raise InputError(f"direction is {direction!r}, wanted a finite vector that is not zero")
    return line / length
