"""A round object of one material: its outline and its attenuation, from the sinogram alone.

The two edges of a disc's shadow are seen in every view, whatever lies inside it, so that a few
views give its centre and radius to a fraction of a bin:

    t = x cos(angle) + y sin(angle) -+ radius.

Close to an edge the squared line integral is linear, ``p^2 = 4 mu^2 (2 radius d - d^2)`` at the
distance d, and its zero is the edge. Rays through the rim, where the disc is solid, cross a known
length of material; ``length = a p + b p^2`` fitted to them turns line integrals into lengths and
undoes the hardening of a polychromatic beam (Herman, Phys. Med. Biol. 24, 1979).

For limited angles that is most of what can be known without a trained prior: outside the disc there
is nothing, and inside no more than the full material (see ``few_levels``).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from rift_cl.cl.host_arrays import as_real_array
from rift_cl.errors import InputError, ShapeError
from rift_cl.geometry import Grid, Parallel

Floats = NDArray[np.float64]
# An edge is looked for where the line integral first exceeds this share of the largest ones, and
# read from so many bins after that; outside it as many of air are wanted.
_FOOT, _BINS = 0.15, 5
# How well the edges place the disc along the rays beside across them, at least.
_PLACED = 0.01
# Edges further than this share of the radius, and than a bin, from the fitted disc are not its own.
_ROUND = 0.02
# The share of edges, and of rays through the rim, that must agree on one disc of one material.
_AGREE = 0.7
# Lengths through the rim that differ by less than this share are the same.
_SAME_LENGTH = 0.1


@dataclass(frozen=True)
class Disc:
    """A disc in the plane of a slice.

    Args:
        x: of the centre, in the grid's unit of length.
        y: of the centre.
        radius: in the same unit.
        misfit: root mean square distance of the edges that were seen from the disc's, without
            those that are no edges of it.
    """

    x: float
    y: float
    radius: float
    misfit: float = 0.0

    def coverage(self, grid: Grid) -> NDArray[np.float32]:
        """Approximate fraction of each pixel inside the disc, (y, x)."""
        y, x = np.meshgrid(grid.coordinates(-2), grid.coordinates(-1), indexing="ij")
        pixel = float(np.sqrt(np.prod(grid.spacing[-2:])))
        inside = (self.radius - np.hypot(x - self.x, y - self.y)) / pixel
        return np.clip(inside + 0.5, 0, 1).astype(np.float32)

    def distances(self, scan: Parallel) -> Floats:
        """How far every ray passes from the centre, (angle, bin)."""
        middle = self.x * np.cos(scan.angles) + self.y * np.sin(scan.angles)
        distances: Floats = np.abs(scan.coordinates() - middle[:, None])
        return distances

    def chords(self, scan: Parallel) -> Floats:
        """The length of every ray inside the disc, (angle, bin)."""
        chords: Floats = 2 * np.sqrt(np.maximum(self.radius**2 - self.distances(scan) ** 2, 0))
        return chords


class MaterialLengths(NamedTuple):
    """Lengths of material along rays.

    Args:
        lengths: float32, in the scan's unit of length; 0 where a ray was not seen.
        linear: length for each unit of line integral of a thin layer: one over its attenuation.
        hardening: what the square of the line integral adds.
        air: mean line integral outside the disc, which was taken off.
        attenuation: line integral over length along the rays that pass through the rim, all
            together; of a hardened beam, less than that of a thin layer.
    """

    lengths: NDArray[np.float32]
    linear: float
    hardening: float
    air: float
    attenuation: float


def find_disc(sinogram: ArrayLike, scan: Parallel, *, seen: ArrayLike | None = None) -> Disc:
    """The disc whose edges the views show.

    Args:
        sinogram: line integrals (angle, bin); the material attenuates, air lies to both sides.
        scan: the views.
        seen: (angle, bin) whether a ray was measured; all if not given.

    Raises:
        ShapeError: the sinogram or ``seen`` is not the scan's.
        InputError: fewer than three edges are seen, or they are not those of one disc.
    """
    values, measured = _checked(sinogram, scan, seen)
    top = float(np.percentile(values[measured], 95)) if measured.any() else 0.0
    if not top > 0:
        raise InputError("the sinogram holds no positive line integrals: there is no disc in it")
    edges = [
        (angle, side, *found)
        for angle, row, mask in zip(scan.angles, values, measured, strict=True)
        for side in (1, -1)
        if (found := _edge_bins(scan.coordinates(), row, mask, side, top)) is not None
    ]
    if len(edges) < 3:
        raise InputError(
            f"{len(edges)} edges with air beside them are seen, and a disc wants three or more: "
            "is the object wider than the detector?"
        )
    return _fitted(edges)


def _fitted(edges: list[tuple[float, int, Floats, Floats]]) -> Disc:
    """The disc through the zeros of squared line integrals, by robust least squares."""
    from scipy.optimize import least_squares

    angles, sides = (np.array([edge[k] for edge in edges]) for k in (0, 1))
    design = np.stack([np.cos(angles), np.sin(angles), -sides], axis=1)
    strengths = np.linalg.svd(design, compute_uv=False)
    if strengths[-1] < _PLACED * strengths[0]:
        raise InputError(
            "the views in which edges are seen differ too little in direction to say how far along "
            "the rays the disc lies: two degrees between them are wanted, better twenty"
        )
    places = np.array([_zero(t, square) for _, _, t, square in edges])
    for _ in range(3):
        least = np.linalg.lstsq(design, places, rcond=None)[0]
        pitch = float(np.abs(np.diff(edges[0][2])).mean())
        fit = least_squares(
            lambda disc, places=places: design @ disc - places, least, loss="soft_l1", f_scale=pitch
        )
        radius = float(fit.x[2])
        if not radius > 0:
            break
        # What the curvature of the square does to its straight line is known once the radius is.
        depths = [(t - (design[k] @ fit.x)) * sides[k] for k, (_, _, t, _) in enumerate(edges)]
        bent = [_zero(d, 2 * radius * d - d * d) for d in depths]
        found = np.array([_zero(t, square) for _, _, t, square in edges])
        places = found - sides * np.array(bent)
    misses = np.abs(design @ fit.x - places)
    round_ = misses < max(_ROUND * radius, pitch)
    if not (radius > 0 and round_.mean() >= _AGREE):
        nearest = f"the nearest one, of radius {radius:.3g}" if radius > 0 else "any disc"
        raise InputError(
            "the edges of the views are not those of a disc: "
            f"{1 - round_.mean():.0%} of them are not those of {nearest}"
        )
    misfit = float(np.sqrt(np.mean(misses[round_] ** 2)))
    return Disc(float(fit.x[0]), float(fit.x[1]), radius, misfit)


def _edge_bins(
    t: Floats, row: Floats, mask: NDArray[np.bool_], side: int, top: float
) -> tuple[Floats, Floats] | None:
    """Places and squared line integrals just inside an edge; None where it is not seen."""
    bins = np.flatnonzero(mask)[::side]
    if bins.size < 3 * _BINS:
        return None
    beside = row[bins[:_BINS]]
    values = row[bins] - np.median(beside)
    above = np.flatnonzero(values > _FOOT * top)
    if beside.max() > _FOOT * top or not above.size:
        return None
    if not _BINS <= above[0] <= bins.size - _BINS:
        return None
    inside = slice(above[0], above[0] + _BINS)
    if values[inside].min() <= 0:
        return None
    return t[bins[inside]], values[inside] ** 2


def _zero(t: Floats, square: Floats) -> float:
    """Where the straight line through values is zero; far away if it is level."""
    slope, level = np.polyfit(t - t[0], square, 1)
    return float(t[0] - level / slope) if slope else float("1e9")


def material_lengths(
    sinogram: ArrayLike,
    scan: Parallel,
    disc: Disc,
    *,
    rim: float = 0.1,
    seen: ArrayLike | None = None,
) -> MaterialLengths:
    """Line integrals as lengths of material, by the disc's solid rim.

    Args:
        sinogram: line integrals (angle, bin).
        scan: the views.
        disc: the outline of the object.
        rim: how deep the solid rim is at least, as a share of the radius.
        seen: (angle, bin) whether a ray was measured; all if not given.

    Raises:
        ShapeError: the sinogram or ``seen`` is not the scan's.
        InputError: ``rim`` is not between 0 and 1, no ray passes through it, or it is not solid.
    """
    values, measured = _checked(sinogram, scan, seen)
    if not 0 < rim <= 1:
        raise InputError(f"rim is {rim!r}, wanted a share of the radius, above 0 and at most 1")
    distances = disc.distances(scan)
    outside = measured & (distances > disc.radius + 3 * scan.pitch)
    air = float(np.median(values[outside])) if outside.any() else 0.0
    values = values - air
    inner, outer = (1 - rim) * disc.radius, disc.radius - 2 * scan.pitch
    chosen = measured & (distances > inner) & (distances < outer)
    p, length = values[chosen], disc.chords(scan)[chosen]
    if p.size < 4 or not p.max(initial=0.0) > 0:
        raise InputError(
            f"no ray passes through the disc's rim, {rim:.2g} of the radius less two bins: give a "
            "larger rim if the disc is solid there"
        )
    design = np.stack([p, p * p], axis=1)
    kept = np.ones(p.size, bool)
    for _ in range(6):
        found = np.linalg.lstsq(design[kept], length[kept], rcond=None)[0]
        misses = np.abs(length - design @ found)
        kept = misses <= 3 * 1.4826 * np.median(misses[kept]) + 1e-6 * disc.radius
    agree = float((misses <= _SAME_LENGTH * length).mean())
    if agree < _AGREE or not found[0] > 0:
        raise InputError(
            f"the rim of the disc is not solid {rim:.2g} of the radius deep: {1 - agree:.0%} of "
            "its rays disagree with the others; give a smaller rim"
        )
    lengths = np.where(measured, found[0] * values + found[1] * values**2, 0)
    attenuation = float(p[kept].sum() / length[kept].sum())
    linear, hardening = (float(term) for term in found)
    return MaterialLengths(lengths.astype(np.float32), linear, hardening, air, attenuation)


def _checked(
    sinogram: ArrayLike, scan: Parallel, seen: ArrayLike | None
) -> tuple[Floats, NDArray[np.bool_]]:
    values = as_real_array(sinogram, name="sinogram").astype(np.float64)
    shape = (len(scan.angles), scan.bins)
    mask = np.ones(shape, bool) if seen is None else np.asarray(seen, bool)
    for name, array in (("sinogram", values), ("seen", mask)):
        if array.shape != shape:
            raise ShapeError(f"{name} has shape {array.shape}, wanted the scan's {shape}")
    if not np.isfinite(values[mask]).all():
        raise InputError("the sinogram holds NaN or infinity where it was seen")
    return np.where(mask, values, 0.0), mask
