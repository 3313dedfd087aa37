"""Means and spreads over seeds, and what they say: which basis wins, and which one loses.

A verdict is about pairs of runs that share everything but the basis. It is a win or a loss where
the mean difference is over twice its standard error (about 95 %), and no clear difference
elsewhere; with a single pair there is no spread, which the sentence says.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

Run = Mapping[str, Any]
# A difference below this many of its standard errors may be chance.
_CLEAR = 2.0


def spread(values: Sequence[float], form: str = ".2f") -> str:
    """Mean and standard deviation, or the one value there is, or a dash."""
    if not values:
        return "–"
    if len(values) == 1:
        return format(values[0], form)
    return f"{np.mean(values):{form}} ± {np.std(values, ddof=1):{form}}"


def chosen(runs: Iterable[Any], **wanted: Any) -> list[Any]:
    """The runs that have these values."""
    return [run for run in runs if all(run.get(key) == value for key, value in wanted.items())]


def values(runs: Iterable[Run], what: str, **wanted: Any) -> list[float]:
    """One figure of the runs that have these values."""
    return [run[what] for run in chosen(runs, **wanted) if run.get(what) is not None]


def distinct(runs: Iterable[Run], what: str) -> list[Any]:
    """The values of a key, in the order in which they came."""
    return list(dict.fromkeys(run[what] for run in runs if what in run))


@dataclass(frozen=True)
class Difference:
    """Of a basis to the one that it is measured by, over pairs of runs.

    Args:
        mean: positive where it is better, in the figure's unit.
        error: standard error of the mean; None with a single pair.
        pairs: how many there were.
        better: in how many of them it was better.
    """

    mean: float
    error: float | None
    pairs: int
    better: int

    @property
    def word(self) -> str:
        """What to call it: wins, loses, or neither."""
        if self.error is None:
            return "is ahead" if self.mean > 0 else "is behind" if self.mean < 0 else "is even"
        if abs(self.mean) <= _CLEAR * self.error:
            return "shows no clear difference"
        return "wins" if self.mean > 0 else "loses"

    @classmethod
    def of(cls, gains: Sequence[float]) -> Difference:
        """The difference that these pairs show; positive gains are better."""
        array = np.asarray(gains, float)
        error = float(array.std(ddof=1) / np.sqrt(array.size)) if array.size > 1 else None
        return cls(float(array.mean()), error, array.size, int((array > 0).sum()))


def paired(
    runs: Iterable[Run],
    basis: str,
    baseline: str,
    *,
    what: str,
    keys: Sequence[str],
    lower_is_better: bool = False,
    gain: Callable[[float, float], float] | None = None,
) -> Difference | None:
    """A basis against another over the runs that agree in all of ``keys``; None without pairs.

    Args:
        runs: of all bases.
        basis: name of the one.
        baseline: name of the other.
        what: the figure that is compared.
        keys: what two runs of a pair have in common.
        lower_is_better: whether the figure is an error.
        gain: of the basis's figure and the other's, positive where better; the difference if not
            given.
    """
    ready = [run for run in runs if run.get(what) is not None]
    other = {tuple(run[k] for k in keys): run[what] for run in chosen(ready, basis=baseline)}
    sign = -1 if lower_is_better else 1
    gains = []
    for run in chosen(ready, basis=basis):
        mate = other.get(tuple(run[k] for k in keys))
        if mate is not None:
            gains.append(gain(run[what], mate) if gain else sign * (run[what] - mate))
    return Difference.of(gains) if gains else None


def sentence(
    basis: str, baseline: str, difference: Difference | None, unit: str, where: str
) -> str:
    """What a difference says, for people."""
    if difference is None:
        return f"{basis} against {baseline}, {where}: not run."
    d = difference
    amount = f"{d.mean:+.3g} {unit}".rstrip()
    doubt = "one pair, no spread known" if d.error is None else f"standard error {d.error:.2g}"
    return (
        f"{basis} {d.word} against {baseline}, {where}: {amount} on average ({doubt}; better in "
        f"{d.better} of {d.pairs} pairs)."
    )
