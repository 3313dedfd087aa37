"""What each view of a set stands for at each frequency: responses of density-compensated filters.

The weights of ``rift_cl.operators.filters.compensation`` (views of a slice) and ``compensation_3d``
(views of a volume) under one name, and beside them the inverse of the coverage that plans are made
with:

- ``capped-voronoi``, ``pipe-menon``, ``exact``: as there;
- ``coverage``: 1 / L on each view's slice, L the sum over all views of rho(n . k)^2 with the smooth
  window of ``rift_cl.sampling.coverage.device``, scaled as ``exact`` is, to what all views know at
  each frequency, so that the level at frequency zero is right.

The last is ``exact`` with a Gaussian slab 0.63 / D thick in place of a triangular one of 1 / D: at
equal thickness slices filtered by the two score the same within 0.3 dB in all but clusters of
views, and thinner slabs come nearer to ``capped-voronoi``, which is ahead of both on irregular
angles. So it is no kind of ``fbp``; it is for comparing plans with filters.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from rift_cl.cl.device import Device
from rift_cl.errors import InputError, ShapeError
from rift_cl.geometry import Parallel
from rift_cl.geometry.numbers import real_numbers
from rift_cl.operators.filters.compensation import COMPENSATIONS, Compensation
from rift_cl.operators.filters.compensation_3d import central_planes
from rift_cl.sampling.coverage.device import coverage
from rift_cl.sampling.targets.observations import Observations
from rift_cl.sampling.targets.target import Target

Floats = NDArray[np.float64]
KINDS = (*COMPENSATIONS, "coverage")
# Planes, and points along a ring in each, that the mean over all rings is taken from.
_PLANES, _RING = 64, 48


def density_weights(
    views: Parallel | ArrayLike,
    diameter: float,
    kind: str = "capped-voronoi",
    *,
    frequencies: ArrayLike | None = None,
    device: Device | None = None,
) -> Floats:
    """Responses of filters that make up for uneven views, ramp included.

    They are samples of the continuous response, 0 at frequency zero. To filter rows that end, hand
    shares to ``ViewFilter``, as ``fbp(compensate=...)`` does, which knows the ramp's mean there.

    Args:
        views: a parallel scan, for a slice; or for a volume the views' directions (V, 3), or the
            axes (V, 2, 3) of their detectors, unit vectors at right angles. Detectors of bare
            directions stand upright about z.
        diameter: of the object, in the unit whose inverse frequencies are given in.
        kind: one of ``KINDS``.
        frequencies: (n,) for a scan, where those of its detector are taken if not given; (n, 2)
            along the two axes of each detector for a volume.
        device: where ``coverage`` is counted; the default device if not given.

    Returns:
        H (V, n): |k| times a share in radians of the half-circle for a slice, 2 |k| times a part of
        the whole for a volume.

    Raises:
        ShapeError: an array has the wrong shape.
        InputError: the kind is unknown, the diameter no length, or a number not finite.
    """
    if kind not in KINDS:
        raise InputError(f"kind is {kind!r}, wanted one of {', '.join(map(repr, KINDS))}")
    if isinstance(views, Parallel):
        given = np.fft.rfftfreq(views.bins, views.pitch) if frequencies is None else frequencies
        return _of_scan(views, diameter, kind, _frequencies(given, 1), device)
    if frequencies is None:
        raise InputError("frequencies: wanted (n, 2) along the detectors' axes")
    axes = _axes(views)
    return _of_planes(axes, diameter, kind, _frequencies(frequencies, 2), device)


def _of_scan(
    scan: Parallel, diameter: float, kind: str, k: Floats, device: Device | None
) -> Floats:
    capped = Compensation(scan.angles, "capped-voronoi" if kind == "coverage" else kind, diameter)
    shares = capped(k)
    if kind == "coverage":
        along = np.stack([np.cos(scan.angles), np.sin(scan.angles)], axis=1)
        slices = np.zeros((len(along), len(k), 3))
        slices[..., :2] = along[:, None] * k[:, None]
        sight = np.stack([-along[:, 1], along[:, 0], np.zeros(len(along))], axis=1)
        inverse = 1 / _covered(sight, slices, diameter, device)
        shares = inverse * (shares.sum(0) / inverse.sum(0))
    return np.asarray(np.abs(k) * shares)


def _of_planes(
    axes: Floats, diameter: float, kind: str, k: Floats, device: Device | None
) -> Floats:
    shares = central_planes(axes, k, diameter, "capped-voronoi" if kind == "coverage" else kind)
    if kind == "coverage":
        normals = np.cross(axes[:, 0], axes[:, 1])
        slices = np.einsum("nd,vdx->vnx", k, axes)
        inverse = 1 / _covered(normals, slices, diameter, device)
        shares = inverse * (shares.sum(0) / _over_rings(normals, axes, k, diameter, device))
    return np.asarray(2 * np.linalg.norm(k, axis=1) * shares)


def _covered(normals: Floats, k: Floats, diameter: float, device: Device | None) -> Floats:
    """The coverage (V, n) by bare directions at frequencies (V, n, 3); a view knows its own."""
    observations, target = Observations.along(normals), Target(np.zeros(3), diameter)
    found = coverage(observations, target, k.reshape(-1, 3), device=device)[0]
    counted = found.reshape(k.shape[:2]).astype(np.float64)
    return np.asarray(np.maximum(counted, 1))


def _over_rings(
    normals: Floats, axes: Floats, k: Floats, diameter: float, device: Device | None
) -> Floats:
    """The sum over views of 1 / L, its mean over rings of each radius, (n,)."""
    radii, place = np.unique(np.linalg.norm(k, axis=1), return_inverse=True)
    some = axes[np.unique(np.linspace(0, len(axes) - 1, _PLANES).astype(int))]
    angles = (np.arange(_RING) + 0.5) * np.pi / _RING
    circle = np.stack([np.cos(angles), np.sin(angles)], axis=1)
    rings = np.einsum("r,cd,vdx->vrcx", radii, circle, some)
    flat = rings.reshape(len(some), -1, 3)
    inverse = 1 / _covered(normals, flat, diameter, device)
    means = inverse.reshape(len(some), len(radii), _RING).mean(axis=(0, 2))
    return np.asarray(len(axes) * means[place.ravel()])


def _axes(views: ArrayLike) -> Floats:
    """Axes (V, 2, 3) of detectors, those of bare directions level and upright."""
    values = real_numbers(views)
    if values is None or values.ndim not in (2, 3):
        raise ShapeError(
            "views: wanted a Parallel scan, directions (V, 3), or detectors' axes (V, 2, 3)"
        )
    if values.ndim == 3:
        return values
    sight = Observations.along(values).direction[:, 0]
    level = np.cross(sight, (0.0, 0.0, 1.0))
    lengths = np.linalg.norm(level, axis=1, keepdims=True)
    level = np.where(lengths > 1e-9, level / np.maximum(lengths, 1e-9), (1.0, 0.0, 0.0))
    return np.stack([level, np.cross(sight, level)], axis=1)


def _frequencies(values: ArrayLike, axes: int) -> Floats:
    k = real_numbers(values)
    if k is None or k.ndim != axes or (axes == 2 and k.shape[1] != 2):
        raise ShapeError(f"frequencies: wanted real numbers, {'(n, 2)' if axes == 2 else '(n,)'}")
    return k
