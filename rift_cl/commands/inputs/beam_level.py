"""Whether the beam of a scan was as strong as its flats say, told by the ends of the detector.

Air reads zero in line integrals. Where the beam was weaker by a factor, every line integral is too
large by that factor's logarithm, and so is that of air: by one number for the whole view, however
the beam changes between views. An object that reaches both ends of the detector does otherwise:
what turns is not the same at both ends, and what it is thick at an end falls along the bins.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float32]
Levels = NDArray[np.float64]
# Bins at each end, as a share of the detector, and at least: by fewer than three, noise of flats
# cannot be told from an object that falls along the bins.
_END, _FEWEST = 1 / 20, 3
# Least level that is worth a doubt, and the highest that is a beam's, as shares of this percentile
# of the line integrals: of an object that covers the detector, ends are either near that or steep.
_OFF, _MOST, _STRONG = 0.01, 0.5, 99.5
# By how much of the level the two ends may differ, and each of them along its bins, from view to
# view and in the mean; and the least share of a level's changes that the means of views show: all
# of them, but for what fans and cones magnify on its way round.
_ALIKE, _FLAT, _LIFT = 0.1, 0.02, 0.3
# Views over which differences are averaged before they are compared, at least and as a share.
_BLUR, _BLUR_SHARE = 5, 1 / 20
# Standard errors from which on a level, or what belies it, is no noise.
_SURE = 4.0
# The same of a fall over twice the ends' bins; the ends are part of it where they are at least this
# share as steep.
_LIKELY, _AS_STEEP = 3.0, 0.5
# A level is constant if it varies by less than this share of itself; a line or a step is what it
# follows if that explains this share of its variance, and a slow change half of it.
_CONSTANT, _EXPLAINED, _SLOW = 0.2, 0.8, 0.5


@dataclass(frozen=True, eq=False)
class BeamLevel:
    """Line integral of air at both ends of the detector, which is none of the object.

    Args:
        bins: at each end.
        levels: (angle,) mean of both ends in each view; above zero where the beam was weaker than
            in the flats.
        noise: variance of such a mean.
    """

    bins: int
    levels: Levels
    noise: float

    @property
    def constant(self) -> bool:
        """Whether it is the same in all views."""
        spread = max(float(self.levels.var()) - self.noise, 0.0)
        return bool(np.sqrt(spread) <= _CONSTANT * abs(self.levels.mean()))

    @property
    def change(self) -> LevelChange:
        """How it differs from view to view."""
        levels = self.levels
        view, last = np.arange(len(levels)), len(levels) - 1
        variance = max(float(levels.var()) - self.noise, 0.0)
        slope, begin = np.polyfit(view, levels, 1)
        line = float((begin + slope * view).var())
        at, rise = _step(levels)
        jump = rise**2 * at * (last + 1 - at) / (last + 1) ** 2
        if max(line, jump) >= _EXPLAINED * variance:
            if line >= jump:
                return LevelChange("moved", float(slope * last), "from the first view to the last")
            return LevelChange("moved", rise, f"at view {at}")
        slow = _blurred(levels)
        if float(slow.var()) >= _SLOW * variance:
            return LevelChange("changed", float(np.ptp(slow)), "in the course of the views")
        return LevelChange("flickered", float(np.sqrt(variance)), "from view to view")


@dataclass(frozen=True)
class LevelChange:
    """By how much the line integrals of air differ between views, and where.

    Args:
        kind: "moved" along a line or in a step, "changed" slowly or "flickered".
        rise: in the unit of the line integrals; below zero where they fell, of a move alone.
        where: among the views, the end of a sentence.
    """

    kind: Literal["moved", "changed", "flickered"]
    rise: float
    where: str

    @property
    def of_beam(self) -> str:
        """What the beam did, where line integrals are logarithms of it."""
        moved = "fell" if self.rise > 0 else "rose"
        verb = moved if self.kind == "moved" else self.kind
        return f"{verb} by {abs(100 * (1 - np.exp(-self.rise))):.2g} % {self.where}"

    @property
    def of_values(self) -> str:
        """What air does in line integrals, in their own unit."""
        verb = "flickers" if self.kind == "flickered" else "changes"
        return f"{verb} by {abs(self.rise):.3g} {self.where}"


def beam_level(lines: Floats) -> BeamLevel | None:
    """The level of the beam against that of the flats, where both ends of the detector are air.

    Args:
        lines: line integrals of one row, (angle, bin).

    Returns:
        None where the ends read zero, or where they are not air for sure.
    """
    most = float(np.percentile(lines, _STRONG))
    count = max(_FEWEST, round(_END * lines.shape[1]))
    if most <= 0 or lines.shape[1] < 4 * count:
        return None
    ends = _inwards(lines, count)
    left, right = ends.mean(axis=2)
    found = BeamLevel(count, (left + right) / 2, _variance(left - right) / 4)
    level = _level(found, ends)
    if not _OFF * most < level <= _MOST * most or not _are_air(ends, level):
        return None
    if _falls_on(_inwards(lines, 2 * count), level, _bin_variance(ends)):
        return None
    return found if found.constant or _lifts_all(found, lines) else None


def _inwards(lines: Floats, count: int) -> Levels:
    """So many bins at each end, (2, angle, bin), both from the outermost bin inwards."""
    return np.stack([lines[:, :count], lines[:, : -count - 1 : -1]]).astype(np.float64)


def _are_air(ends: Levels, level: float) -> bool:
    """Whether both ends are level along their bins, and alike in every view.

    Args:
        ends: line integrals, (2, angle, bin), from the outermost bin inwards.
        level: root mean square of the views' levels.
    """
    count = ends.shape[2]
    half = count // 2
    falls = ends[:, :, half:].mean(axis=2) - ends[:, :, :half].mean(axis=2)
    # Variances, in those of a bin: of a fall at one end, and of the ends' difference.
    of_fall, of_apart = 1 / half + 1 / (count - half), 2 / count
    # That of a bin in all views alike, which no mean over views makes less.
    alike = _bin_variance(ends)
    if abs(falls.mean()) > _FLAT * level + _SURE * np.sqrt(alike * of_fall / 2):
        return False
    # Noise of a sample, by what bins of one view differ by: views may come in any order.
    noise = float((ends - ends.mean(axis=1, keepdims=True)).var(axis=2, ddof=1).mean())
    apart = ends[0].mean(axis=1) - ends[1].mean(axis=1)

    def steady(difference: Levels, share: float) -> bool:
        room = _ALIKE * level + _SURE * np.sqrt(alike * share)
        return bool(_change(difference, noise * share) <= room)

    return steady(apart, of_apart) and all(steady(fall, of_fall) for fall in falls)


def _falls_on(wide: Levels, level: float, alike: float) -> bool:
    """Whether ends that noise may have made level are part of a fall that goes on beside them.

    An object that reaches beyond the detector is as steep at its ends as beside them. One that
    begins beside air is steep there alone.

    Args:
        wide: line integrals of twice the ends' bins, (2, angle, bin), from the outermost inwards.
        level: root mean square of the views' levels.
        alike: variance of a bin in all views alike.
    """
    bins = wide.mean(axis=(0, 1))
    count = bins.size // 2
    half = count // 2
    fall = bins[count:].mean() - bins[:count].mean()
    if abs(fall) <= _FLAT * level + _LIKELY * np.sqrt(alike / count):
        return False
    # Between means that are count / 2 bins apart, as those of the fall are count.
    within = bins[half:count].mean() - bins[:half].mean()
    return bool(within / (fall / 2) > _AS_STEEP)


def _lifts_all(found: BeamLevel, lines: Floats) -> bool:
    """Whether the mean of a view rises with the level of its ends, as all bins do with a beam's.

    The more of an object lies beyond both ends, the less of it the detector sees: there it falls.
    """
    means = lines.mean(axis=1, dtype=np.float64)
    shared = float(np.mean((means - means.mean()) * (found.levels - found.levels.mean())))
    return shared > _LIFT * max(float(found.levels.var()) - found.noise, 0.0)


def _level(found: BeamLevel, ends: Levels) -> float:
    """Root mean square of the levels that noise does not explain, 0 where it explains them.

    Args:
        found: the levels.
        ends: line integrals, (2, angle, bin).
    """
    views = found.levels.size
    square = float(np.mean(found.levels**2)) - found.noise
    alike = _bin_variance(ends) / (2 * ends.shape[2])
    by_chance = _SURE * found.noise * np.sqrt(2 / views) + _SURE**2 * alike
    # The logarithm of a noisy count is that much too large in the mean.
    shift = float(ends.var(axis=2).mean()) / 2
    return float(np.sqrt(square)) if square > max(by_chance, (2 * shift) ** 2) else 0.0


def _bin_variance(ends: Levels) -> float:
    """Variance of a bin by what differs from bin to bin in all views, as noise of flats does.

    A slope that both ends share inwards is an object's, and is left out.

    Args:
        ends: line integrals, (2, angle, bin), from the outermost bin inwards.
    """
    rough = np.diff(ends.mean(axis=1), axis=1)
    return float(rough.var(ddof=1)) / 2


def _change(apart: Levels, noise: float) -> float:
    """Root mean square of a difference over the views, less that of its noise of this variance."""
    noise = min(noise, _variance(apart))
    square = float(np.mean(_blurred(apart) ** 2)) - noise / _window(apart)
    return float(np.sqrt(max(square, 0.0)))


def _variance(values: Levels) -> float:
    """Variance of what differs from view to view at random."""
    return float(np.mean(np.diff(values) ** 2)) / 2 if len(values) > 1 else 0.0


def _window(values: Levels) -> int:
    return min(max(_BLUR, round(_BLUR_SHARE * len(values))), len(values))


def _blurred(values: Levels) -> Levels:
    from scipy.ndimage import uniform_filter1d

    smooth: Levels = uniform_filter1d(values, _window(values), mode="nearest")
    return smooth


def _step(levels: Levels) -> tuple[int, float]:
    """The view before which a step fits levels best, and by how much they rise there."""
    if len(levels) < 2:
        return 0, 0.0
    after = np.arange(1, len(levels))
    sums = np.cumsum(levels)
    low, high = sums[:-1] / after, (sums[-1] - sums[:-1]) / (len(levels) - after)
    best = int(np.argmax(after * (len(levels) - after) * (high - low) ** 2))
    return int(after[best]), float(high[best] - low[best])
