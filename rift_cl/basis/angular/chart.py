"""One lobe with an axis and a width: Hermite- or Laguerre-Gaussian modes on Lambert's chart.

Lambert's map keeps areas: with z = d . a it takes a direction to sqrt(2 / (1 + z)) (d . t, d . b),
2 sin(angle / 2) from the middle, so that the modes, orthonormal on the plane, are orthogonal on
the sphere up to what their tails have beyond its edge. All ways round, the map spreads the
antipode of the axis into a circle; within 0.8 degrees of it the modes fade to nothing.

The modes of the plane are in standard form and in graded order, two orthonormal sets. An order N
has N + 1 modes of either kind, which span the same functions: Laguerre modes and their derivatives
are mixtures of the Hermite ones.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from rift_cl.basis import hermite_functions as hermite
from rift_cl.basis.angular.frame import frames_of, quaternion_towards, unit_directions
from rift_cl.basis.angular.protocol import CONSTANT, AngularFunctions, Slopes, last_axis
from rift_cl.basis.conversion import laguerre_matrices
from rift_cl.basis.indices import graded
from rift_cl.basis.numbers import whole

Floats = NDArray[np.float64]
MOST_FUNCTIONS = 36
# Widths are held between these, and 1 + z below this fades the modes.
LEAST_WIDTH, MOST_WIDTH = 0.02, 1.0
LEAST_HEIGHT = 1e-4
# A width that covers most of what a highlight covers, and leaves 4e-3 at the antipode.
_START_WIDTH = 0.6


class PlaneModes(NamedTuple):
    """K modes at points: (..., K) values, and derivatives by x and by y."""

    values: Floats
    by_x: Floats
    by_y: Floats


def hermite_modes(x: Floats, y: Floats, count: int) -> PlaneModes:
    """The first modes h_m(x) h_n(y), in the order (0,0), (1,0), (0,1), (2,0), (1,1)..

    h_n is H_n(x) exp(-x^2 / 2) / sqrt(2^n n! sqrt(pi)), H_n the physicists' polynomials.
    """
    order = _order(count)
    modes = graded(order, 2)[:count]
    table = hermite.functions(np.stack([x, y], -1), order + 1, "std")
    steep = hermite.derivatives(table, "std")
    flat = table[..., : order + 1]
    by_x = np.stack([steep[..., 0, :], flat[..., 1, :]], -2)
    by_y = np.stack([flat[..., 0, :], steep[..., 1, :]], -2)
    return PlaneModes(*(hermite.products(tables, modes) for tables in (flat, by_x, by_y)))


def laguerre_modes(x: Floats, y: Floats, count: int) -> PlaneModes:
    """The first real modes, by total order 2 p + l; l goes down, cosine before sine.

    For l > 0 they are sqrt(2) Re and sqrt(2) Im of
    (-1)^p sqrt(p! / (pi (p + l)!)) (x + i y)^l L_p^l(r^2) exp(-r^2 / 2); for l = 0 that itself.
    """
    order = _order(count)
    whole_orders = hermite_modes(x, y, len(graded(order, 2)))
    mixtures = laguerre_matrices(order, "real")
    ends = np.cumsum([len(matrix) for matrix in mixtures])[:-1]

    def mixed(modes: Floats) -> Floats:
        parts = np.split(modes, ends, axis=-1)
        mixes = [part @ matrix.T for part, matrix in zip(parts, mixtures, strict=True)]
        return np.concatenate(mixes, -1)[..., :count]

    return PlaneModes(*(mixed(modes) for modes in whole_orders))


def _order(count: int) -> int:
    """The lowest order that has this many modes up to it."""
    return next(n for n in range(count + 1) if (n + 1) * (n + 2) // 2 >= count)


class _ChartLobe(AngularFunctions):
    """What both kinds of modes share."""

    _widths: int
    _modes: Callable[[Floats, Floats, int], PlaneModes]

    def __init__(self, modes: int) -> None:
        name, hint = f"{type(self).__name__}: modes", ", the constant included"
        self.n_linear = whole(modes, name, 1, MOST_FUNCTIONS, hint)
        self.n_geometry = 4 + self._widths

    def slopes(self, geometry: ArrayLike | None, directions: ArrayLike) -> Slopes:
        """All functions with their derivatives."""
        name = type(self).__name__
        shapes = last_axis(geometry, self.n_geometry, f"{name}: geometry")
        given = last_axis(directions, 3, f"{name}: directions")
        with np.errstate(all="ignore"):
            shapes = np.where(np.isfinite(shapes).all(-1, keepdims=True), shapes, np.nan)
            units, frames = unit_directions(given), frames_of(shapes[..., :4])
            local = np.einsum("...ij,...i->...j", frames.matrices, units.vectors)
            functions = self._on_chart(shapes[..., 4:], local)
            by_quat = np.einsum(
                "...kj,...ija,...i->...ka", functions.by_local, frames.slopes, units.vectors
            )
            by_unit = np.einsum("...kj,...ij->...ki", functions.by_local, frames.matrices)
            by_directions = np.einsum("...ki,...ij->...kj", by_unit, units.slopes)
        by_geometry = np.concatenate([by_quat, functions.by_widths], -1)
        return Slopes(functions.values, by_geometry, by_directions)

    def _on_chart(self, log_widths: Floats, local: Floats) -> _ChartFunctions:
        """Functions of directions in the lobe's own frame, the constant first."""
        height = 1 + local[..., 2]
        held = np.maximum(height, LEAST_HEIGHT)
        fade = np.minimum(height / LEAST_HEIGHT, 1)[..., None]
        widths = np.exp(np.clip(log_widths, np.log(LEAST_WIDTH), np.log(MOST_WIDTH)))
        scale = np.sqrt(2 / held)[..., None] / np.broadcast_to(widths, (*widths.shape[:-1], 2))
        x, y = np.moveaxis(scale * local[..., :2], -1, 0)
        modes = type(self)._modes(x, y, self.n_linear - 1)
        outward = np.stack([x[..., None] * modes.by_x, y[..., None] * modes.by_y], -1)
        # The chart's scale falls with the height, x -> -x / (2 height), where that is not held.
        inside = (height > LEAST_HEIGHT)[..., None]
        sinking = -outward.sum(-1) / (2 * held[..., None])
        by_height = np.where(inside, sinking, modes.values / LEAST_HEIGHT)
        by_local = np.stack(
            [fade * scale[..., :1] * modes.by_x, fade * scale[..., 1:] * modes.by_y, by_height], -1
        )
        if self._widths == 1:
            outward = outward.sum(-1, keepdims=True)
        free = (log_widths > np.log(LEAST_WIDTH)) & (log_widths < np.log(MOST_WIDTH))
        by_widths = -fade[..., None] * outward * free[..., None, :]
        # NaN of unusable geometry reaches the constant as well.
        first = CONSTANT + 0 * (x + y)[..., None]
        return _ChartFunctions(
            np.concatenate([first, fade * modes.values], -1), _led(by_local), _led(by_widths)
        )

    def start_geometry(self, axes: ArrayLike) -> Floats:
        """A round lobe of width 0.6 along each axis; along z where an axis has no direction."""
        along = unit_directions(last_axis(axes, 3, f"{type(self).__name__}: axes")).vectors
        widths = np.full((*along.shape[:-1], self._widths), np.log(_START_WIDTH))
        return np.concatenate([quaternion_towards(along), widths], -1)


class _ChartFunctions(NamedTuple):
    """(..., L) values, (..., L, 3) slopes by the local direction, (..., L, 1 or 2) by ln width."""

    values: Floats
    by_local: Floats
    by_widths: Floats


def _led(slopes: Floats) -> Floats:
    """Slopes of all modes after those of the constant, which has none."""
    none = np.zeros((*slopes.shape[:-2], 1, slopes.shape[-1]))
    return np.concatenate([none, slopes], -2)


class HGLobe(_ChartLobe):
    """A constant and Hermite-Gaussian modes of two widths.

    Args:
        modes: L, all functions with the constant: 1 to 36. The geometry has 6 numbers: a
            quaternion (w, x, y, z) of any length, whose rotation's columns are t, b and the axis,
            then the logarithms of the widths along t and b.

    Raises:
        InputError: the number is none of these.
    """

    name = "hg"
    _widths = 2
    _modes = staticmethod(hermite_modes)


class LGLobe(_ChartLobe):
    """A constant and real Laguerre-Gaussian modes of one width.

    Args:
        modes: L, all functions with the constant: 1 to 36. The geometry has 5 numbers: a
            quaternion (w, x, y, z) of any length, whose rotation's columns are t, b and the axis,
            then the logarithm of the width.

    Raises:
        InputError: the number is none of these.
    """

    name = "lg"
    _widths = 1
    _modes = staticmethod(laguerre_modes)
