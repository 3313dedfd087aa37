"""Few values that stand for many: Lloyd's k-means, of numbers and of vectors, the same every time.

Nothing is drawn by chance: numbers begin as dense as suits theirs, vectors evenly along the
direction that they differ most in. Vectors are clustered in two stages, first into about sqrt(k)
groups and then each group by itself, so that n vectors cost n sqrt(k) distances and not n k.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float32]

# Rounds of Lloyd's method, and how many vectors are looked at while groups are found.
_ROUNDS, _SAMPLE = 12, 1 << 16
# Of a histogram at most, and numbers in a bin on average.
_BINS, _EACH = 4096, 32
# Numbers in a table of distances at a time.
_TABLE = 1 << 24


def number_palette(values: NDArray[np.float32], count: int) -> tuple[Floats, NDArray[np.uint8]]:
    """Numbers that stand for others.

    Args:
        values: of any shape.
        count: how many there may be, 256 at most.

    Returns:
        The palette (count,), growing, and for each value the number of its entry.
    """
    flat = np.sort(values.reshape(-1).astype(np.float64))
    centers = _spread(flat, count)
    total = np.concatenate([[0.0], np.cumsum(flat)])
    for _ in range(_ROUNDS):
        edges = np.searchsorted(flat, (centers[1:] + centers[:-1]) / 2)
        edges = np.concatenate([[0], edges, [len(flat)]])
        members = np.diff(edges)
        sums = np.diff(total[edges])
        centers = np.where(members > 0, sums / np.maximum(members, 1), centers)
    palette = np.sort(centers).astype(np.float32)
    labels = np.searchsorted((palette[1:] + palette[:-1]) / 2, values)
    return palette, labels.astype(np.uint8)


def _spread(flat: NDArray[np.float64], count: int) -> NDArray[np.float64]:
    """Numbers as dense as the cube root of the density, as the least error wants them (Bennett)."""
    density, edges = np.histogram(flat, int(np.clip(len(flat) // _EACH, 1, _BINS)))
    share = np.concatenate([[0.0], np.cumsum(np.cbrt(density))])
    return np.asarray(np.interp((np.arange(count) + 0.5) / count * share[-1], share, edges))


def vector_palette(vectors: Floats, count: int) -> tuple[Floats, NDArray[np.intp]]:
    """Vectors that stand for others.

    Args:
        vectors: (N, D).
        count: how many there may be; all of them where there are no more.

    Returns:
        The palette (at most count, D), and for each vector the number of its entry (N,).
    """
    if len(vectors) <= count:
        return vectors.copy(), np.arange(len(vectors))
    few = vectors[:: -(-len(vectors) // _SAMPLE)]
    coarse = _clustered(few, max(1, round(count**0.5)))
    group = _nearest(vectors, coarse)
    shares = _shares(np.bincount(group, minlength=len(coarse)), count)
    palettes, labels, start = [], np.empty(len(vectors), np.intp), 0
    for number in np.flatnonzero(shares):
        here = np.flatnonzero(group == number)
        part = _clustered(vectors[here], int(shares[number]))
        labels[here] = start + _nearest(vectors[here], part)
        palettes.append(part)
        start += len(part)
    return np.concatenate(palettes), labels


def _shares(members: NDArray[np.intp], count: int) -> NDArray[np.intp]:
    """How many entries each group gets by the number of its vectors, one at least, of ``count``."""
    shares: NDArray[np.intp] = np.maximum(members * count // members.sum(), members > 0)
    # What the smallest get beyond their due, the largest go without.
    while shares.sum() > count:
        shares[shares.argmax()] -= 1
    return shares


def _clustered(vectors: Floats, count: int) -> Floats:
    """(count, D) means of clusters."""
    order = np.argsort(vectors @ _widest(vectors), kind="stable")
    places = (np.arange(count) + 0.5) / count * (len(vectors) - 1)
    centers = vectors[order[np.rint(places).astype(np.intp)]]
    for _ in range(_ROUNDS if count < len(vectors) else 0):
        labels = _nearest(vectors, centers)
        members = np.bincount(labels, minlength=count)
        ranked = np.argsort(labels, kind="stable")
        starts = np.concatenate([[0], np.cumsum(members)[:-1]])
        full = members > 0
        sums = np.add.reduceat(vectors[ranked].astype(np.float64), starts[full])
        centers = centers.copy()
        centers[full] = sums / members[full, None]
    return centers


def _widest(vectors: Floats) -> Floats:
    """(D,) the direction along which vectors differ most."""
    away = vectors - vectors.mean(axis=0)
    return np.asarray(np.linalg.eigh(away.T @ away)[1][:, -1], np.float32)


def _nearest(vectors: Floats, centers: Floats) -> NDArray[np.intp]:
    """(N,) the nearest centre of each vector."""
    found = np.empty(len(vectors), np.intp)
    lengths = np.square(centers).sum(axis=1)
    rows = max(1, _TABLE // len(centers))
    for start in range(0, len(vectors), rows):
        part = vectors[start : start + rows]
        found[start : start + rows] = (lengths - 2 * (part @ centers.T)).argmin(axis=1)
    return found
