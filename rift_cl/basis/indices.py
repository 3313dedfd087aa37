"""In what order the coefficients of a basis stand.

"Graded": by total order, and within an order lexicographically descending, so that a lower order is
a prefix of a higher one. (0, 0), (1, 0), (0, 1), (2, 0), (1, 1), (0, 2), ... in the plane.
"""

from __future__ import annotations

import itertools
import math
from functools import cache
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from rift_cl.basis.numbers import MAX_ORDER, whole
from rift_cl.errors import InputError

Kind = Literal["real", "complex"]
IntArray = NDArray[np.intp]


def n_coeff(order: int, dim: int) -> int:
    """How many modes of ``dim`` dimensions have a total order up to ``order``: C(order+dim, dim).

    Raises:
        InputError: the order or the dimension is out of range.
    """
    order, dim = _checked(order, dim)
    return math.comb(order + dim, dim)


def order_of(count: int, dim: int) -> int:
    """The order up to which ``count`` coefficients go; the inverse of ``n_coeff``.

    Raises:
        InputError: no order has that many.
    """
    dim = whole(dim, "dim", 1, 3)
    counts = [n_coeff(order, dim) for order in range(MAX_ORDER + 1)]
    if count not in counts:
        some = ", ".join(map(str, counts[:5]))
        raise InputError(
            f"{count!r} coefficients fit no order in {dim}D, wanted one of {some}, ..."
        )
    return counts.index(count)


def graded(order: int, dim: int) -> IntArray:
    """Every mode up to a total order, (n_coeff, dim), read-only.

    Raises:
        InputError: the order or the dimension is out of range.
    """
    return _graded(*_checked(order, dim))


def of_order(order: int, dim: int) -> IntArray:
    """The modes of one total order alone, (C(order+dim-1, dim-1), dim), read-only.

    Raises:
        InputError: the order or the dimension is out of range.
    """
    return _of_order(*_checked(order, dim))


def order_slices(order: int, dim: int) -> tuple[slice, ...]:
    """Where each total order stands among the coefficients.

    Raises:
        InputError: the order or the dimension is out of range.
    """
    order, dim = _checked(order, dim)
    ends = [math.comb(n + dim, dim) for n in range(-1, order + 1)]
    return tuple(slice(start, stop) for start, stop in itertools.pairwise(ends))


def place_in_order(modes: NDArray[Any]) -> IntArray:
    """Where modes stand within their own total order.

    Args:
        modes: (..., dim) indices.

    Returns:
        (...) places, from 0.
    """
    modes = np.asarray(modes, np.intp)
    if modes.shape[-1] == 3:
        beyond = modes[..., 1] + modes[..., 2]
        return np.asarray(beyond * (beyond + 1) // 2 + modes[..., 2])
    return np.asarray(modes[..., 1] if modes.shape[-1] == 2 else modes[..., 0] * 0)


def place(modes: NDArray[Any]) -> IntArray:
    """Where modes (..., dim) stand among the graded ones, (...)."""
    modes = np.asarray(modes, np.intp)
    dim, total = modes.shape[-1], modes.sum(-1)
    before = np.ones_like(total)
    for step in range(dim):
        before = before * (total + step) // (step + 1)
    return np.asarray(before + place_in_order(modes))


@cache
def rows(order: int, dim: int) -> IntArray:
    """The row set {max(n) <= order}, row after row, (..., dim), read-only.

    Row s = {max(n) = s} has 2s + 1 members in the plane, as row s of the spherical harmonics has.
    """
    modes = list(itertools.product(range(order, -1, -1), repeat=dim))
    modes.sort(key=max)
    return _frozen(modes)


@cache
def laguerre_graded(order: int, kind: Kind) -> IntArray:
    """Laguerre modes of total order 2 p + |l| up to ``order``, read-only.

    Within a total order by descending |l|, the cosine before the sine (real, (K, 3): p, l and 0 or
    1), or by descending l (complex, (K, 2): p and l).
    """
    return _frozen([mode for n in range(order + 1) for mode in _of_laguerre_order(n, kind)])


@cache
def laguerre_rows(order: int, kind: Kind) -> IntArray:
    """The row set {p + |l| <= order}, (order + 1)^2 modes, row after row, read-only.

    Row s = {p + |l| = s} has 2 s + 1 members, in the order of ``laguerre_graded``; as Zernike's
    polynomials do in the "fringe" ordering.
    """
    modes = [tuple(mode) for mode in laguerre_graded(2 * order, kind).tolist()]
    chosen = [mode for mode in modes if mode[0] + abs(mode[1]) <= order]
    chosen.sort(key=lambda m: (m[0] + abs(m[1]), -abs(m[1]), -m[1], m[2:]))
    return _frozen(chosen)


def laguerre_place(modes: IntArray) -> IntArray:
    """Where Laguerre modes (K, 2) or (K, 3) stand among the graded ones of their kind, (K,)."""
    p, turns = modes[:, 0], modes[:, 1]
    total = 2 * p + np.abs(turns)
    own = total - turns + modes[:, 2] if modes.shape[1] == 3 else (total - turns) // 2
    return np.asarray(total * (total + 1) // 2 + own)


def _of_laguerre_order(order: int, kind: Kind) -> list[tuple[int, ...]]:
    if kind == "complex":
        return [((order - abs(turns)) // 2, turns) for turns in range(order, -order - 1, -2)]
    sizes = range(order, -1, -2)
    return [((order - n) // 2, n, part) for n in sizes for part in range(2 if n else 1)]


@cache
def _graded(order: int, dim: int) -> IntArray:
    return _frozen(np.concatenate([_of_order(n, dim) for n in range(order + 1)]))


@cache
def _of_order(order: int, dim: int) -> IntArray:
    if dim == 1:
        return _frozen([[order]])
    heads = range(order, -1, -1)
    return _frozen([(n, *rest) for n in heads for rest in _of_order(order - n, dim - 1)])


def _frozen(modes: Any) -> IntArray:
    array = np.array(modes, np.intp)
    array.flags.writeable = False
    return array


def _checked(order: int, dim: int) -> tuple[int, int]:
    return whole(order, "order", 0, MAX_ORDER), whole(dim, "dim", 1, 3)
