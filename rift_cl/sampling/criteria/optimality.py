"""The criteria of a plan: A-optimal (``wiener``), D-optimal (``logdet``), E-optimal (``worst``).

Each turns coverage into one number that says how much of a target stays unknown; lower is better.
All are functions of the coverage at each frequency alone (the diagonal approximation), with a
derivative by it, along which views can be moved.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from rift_cl.errors import InputError

Floats = NDArray[np.float64]
# Exponent of the mean over directions: 1 would be the Wiener error, infinity the worst one alone.
_SHARPNESS = 8
# Frequencies that one direction should have, so that its error does not hang on a few.
_PER_DIRECTION = 12


class Scored(NamedTuple):
    """A score of coverage.

    Args:
        value: the score; lower is better.
        gradient: (P, K) its derivative by the coverage at each point and frequency.
    """

    value: float
    gradient: Floats


def scored(kind: str, coverage: Floats, power: Floats, snr: float, k: Floats) -> Scored:
    """The score of a kind, ``wiener``, ``logdet`` or ``worst``; arguments are those of ``worst``.

    Raises:
        InputError: the kind is another.
    """
    if kind == "worst":
        return worst(coverage, power, snr, k)
    if kind not in ("wiener", "logdet"):
        raise InputError(f"merit: kind is {kind!r}, wanted wiener, logdet or worst")
    return (wiener if kind == "wiener" else logdet)(coverage, power, snr)


def wiener(coverage: Floats, power: Floats, snr: float) -> Scored:
    """Posterior variance of the best linear estimator, as a fraction of the power (A-optimal).

    ``mean S / (1 + snr S L)`` over points and frequencies, over ``mean S``: from 0, all is known,
    to 1, nothing is.

    Args:
        coverage: (P, K) L.
        power: (K,) S.
        snr: signal to noise of a frequency whose power and coverage are 1.
    """
    total = power.sum() * len(coverage)
    known = 1 + snr * power * coverage
    return Scored(float((power / known).sum() / total), -snr * (power / known) ** 2 / total)


def logdet(coverage: Floats, power: Floats, snr: float) -> Scored:
    """Minus the information in bits per frequency (D-optimal): ``-mean log2(1 + snr S L)``.

    It is concave in the coverage, so that the gain of a view only shrinks as others are added,
    and greedy choice reaches 1 - 1/e of what is possible. Arguments are those of ``wiener``.
    """
    information = snr * power * coverage
    scale = coverage.size * np.log(2)
    return Scored(
        float(-np.log1p(information).sum() / scale), -snr * power / (1 + information) / scale
    )


def worst(coverage: Floats, power: Floats, snr: float, k: Floats) -> Scored:
    """Posterior variance in the worst direction, as a soft maximum over directions (E-optimal).

    Frequencies are grouped by direction; the Wiener error of each group goes into a mean of power
    8, weighted by the group's power. So it lies between 0 and 1, never below ``wiener``, and what
    pays most is to close a missing cone. First three arguments are those of ``wiener``.

    Args:
        coverage: (P, K) L.
        power: (K,) S.
        snr: as for ``wiener``.
        k: (K, 3) the frequencies.
    """
    group, count = _groups(k)
    known = 1 + snr * power * coverage
    held = np.bincount(group, power, count)
    present = held > 0
    unknown = np.stack([np.bincount(group, row, count) for row in power / known])
    share = unknown[:, present] / held[present]
    weight = held[present] / (held.sum() * len(coverage))
    value = float((weight * share**_SHARPNESS).sum() ** (1 / _SHARPNESS))
    by_group = np.zeros_like(unknown)
    # Shares are above zero, since the noise is, but may be too small to be raised to a power.
    if value > 0:
        by_group[:, present] = weight * (share / value) ** (_SHARPNESS - 1) / held[present]
    return Scored(value, -by_group[:, group] * snr * (power / known) ** 2)


def _groups(k: Floats) -> tuple[NDArray[np.intp], int]:
    """The direction of even ones that each frequency is nearest to, and how many there are."""
    from scipy.spatial import cKDTree

    from rift_cl.sampling.targets.prior import directions_for

    axes = 3 if np.abs(k[:, 2]).max(initial=0) > 0 else 2
    count = max(len(k) // _PER_DIRECTION, 1)
    lines = directions_for(axes, count)
    tree = cKDTree(np.concatenate([lines, -lines]))
    length = np.linalg.norm(k, axis=1, keepdims=True)
    nearest = tree.query(k / np.where(length > 0, length, 1))[1] % count
    return np.asarray(nearest, np.intp), count
