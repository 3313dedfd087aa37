"""From detector counts to line integrals: dark and flat correction, then -log.

By Beer and Lambert a ray that arrives with I of its I0 quanta has the line integral
``-log(I / I0)`` of attenuation. Counts are corrected by the means of the dark frames (no beam)
and of the flat frames (beam, no sample), in which outliers among three frames or more do not count;
flats that were taken at several times are interpolated between them, because beams drift. Two kinds
of samples tell nothing:

- a *dead* detector pixel does not answer to the beam, or reads the same whatever turns before it;
- a *starved* sample has no more signal than the darks' noise. Its logarithm would be that of a
  number nobody measured: a floor of some fraction of a quantum gives spikes of 10 to 16, in the
  middle of line integrals of 4 or 5, which become streaks across the slice.

Both are interpolated along the detector between the nearest samples that were measured, in line
integrals. Inside a wide run of starved samples, behind metal, say, that is a lower bound, and not
an invented peak. One such column would otherwise be a ring, and one NaN a ruined slice.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from rift_cl.errors import InputError, ShapeError

Floats = NDArray[np.float32]
Counts = NDArray[np.int64]
# A pixel is dead when the beam raises it by less than this share of what is usual in its row.
_DEAD = 0.05
# Fewer quanta than this share of the beam are not told from none, whatever the darks' noise.
_FAINTEST = 1e-7
# Flats or darks from which on an outlier among them can be told, and from which on the median
# deviation of a pixel tells their spread; how many standard deviations an outlier is away, of which
# a median deviation is one over 1.48.
_ENOUGH_FRAMES, _MANY_FRAMES, _OUTLIER, _SIGMAS = 3, 5, 8.0, 1.48
# Views and angle from which on a pixel that reads the same in all of them is told; by how much it
# may vary, and how far from its neighbours it is in some view, as shares of what its row spans.
_ENOUGH_VIEWS, _ENOUGH_TURN, _STUCK, _APART = 12, np.radians(150), 1e-6, 1e-3
# What float32 leaves of the logarithm of a transmission near 1.
_ROUNDED = 1e-6
# Dark frames from which on their noise can be told.
_ENOUGH_DARKS = 3


@dataclass(frozen=True)
class Attenuation:
    """Line integrals, and what had to be mended to get them.

    Args:
        projections: line integrals of attenuation, (angle, row, bin), no unit.
        dead_of_rows: detector pixels of each row that were filled from their neighbours, (row,).
        starved_of_rows: samples of each row without a signal above the darks' noise, filled in the
            same way, (row,).
        dead_bins: bins of which a pixel was filled in some of the rows, ascending.
        stuck_bins: those of them that answer to the beam and read the same in all views.
        dead_rows: numbers of rows without a pixel that answers, which were filled from the rows on
            either side, ascending.
    """

    projections: Floats
    dead_of_rows: Counts
    starved_of_rows: Counts
    dead_bins: tuple[int, ...] = ()
    stuck_bins: tuple[int, ...] = ()
    dead_rows: tuple[int, ...] = ()

    def of_row(self, row: int) -> Attenuation:
        """Those of one row, which keeps its axis; bins and dead rows are those of all rows."""
        one = slice(row, row + 1)
        counts = self.dead_of_rows[one], self.starved_of_rows[one]
        bins = self.dead_bins, self.stuck_bins
        return Attenuation(self.projections[:, one], *counts, *bins, self.dead_rows)

    @property
    def dead(self) -> int:
        """Detector pixels that were filled from their neighbours."""
        return int(self.dead_of_rows.sum())

    @property
    def starved(self) -> int:
        """Samples without a signal above the darks' noise, filled in the same way."""
        return int(self.starved_of_rows.sum())


def joined(parts: Sequence[Attenuation]) -> Attenuation:
    """Those of rows that follow each other."""
    return Attenuation(
        np.concatenate([part.projections for part in parts], axis=1),
        np.concatenate([part.dead_of_rows for part in parts]),
        np.concatenate([part.starved_of_rows for part in parts]),
        tuple(sorted({bin for part in parts for bin in part.dead_bins})),
        tuple(sorted({bin for part in parts for bin in part.stuck_bins})),
        tuple(row for part in parts for row in part.dead_rows),
    )


def attenuation(
    projections: Floats,
    flats: Floats,
    darks: Floats | None = None,
    *,
    flats_at: NDArray[np.float64] | None = None,
    first_row: int = 0,
) -> Attenuation:
    """Correct counts by flat and dark frames and take -log.

    Args:
        projections: counts, (angle, row, bin).
        flats: counts without a sample, (n, row, bin), n >= 1.
        darks: counts without the beam, (n, row, bin); zero if not given.
        flats_at: (n,) for each flat the number of projections taken before it. Those with the same
            number are averaged; between such groups the beam is interpolated linearly.
        first_row: number of the first row, for errors.

    Raises:
        ShapeError: frames and projections do not have the same rows and bins.
        InputError: there is no flat frame, the beam reaches no pixel of a row, or no sample of a
            row has any signal.
    """
    for name, frames in (("flats", flats), ("darks", darks)):
        if frames is not None and frames.shape[1:] != projections.shape[1:]:
            raise ShapeError(
                f"{name} have shape {frames.shape}, projections {projections.shape}: rows and "
                "bins must be the same"
            )
    if not len(flats):
        raise InputError("there is no flat frame: name one, or give data that is already -log")
    dark = _mean_dark(projections, darks)
    beam = _mean(flats) - dark
    dead = ~(beam > _DEAD * np.maximum(np.median(beam, axis=1, keepdims=True), 0)) | (beam <= 0)
    if dead.all(axis=1).any():
        row = first_row + int(np.flatnonzero(dead.all(axis=1))[0])
        raise InputError(
            f"flats are no brighter than darks anywhere in row {row}: are the two swapped, or "
            "is this row outside the beam (choose others, by --rows on a command line)?"
        )
    beam[dead] = 1
    transmission: Floats = projections - dark
    if flats_at is None or len(np.unique(flats_at)) < 2:
        transmission /= beam
    else:
        _divide(transmission, flats, dark, flats_at)
    return _minus_log(transmission, _dark_noise(darks) / beam, dead, first_row)


def attenuation_without_flats(
    projections: Floats,
    darks: Floats | None = None,
    *,
    incident: NDArray[np.float64] | None = None,
    masked: NDArray[np.bool_] | None = None,
    first_row: int = 0,
) -> Attenuation:
    """Take -log of transmission, or of counts whose beam is a number for each view.

    Args:
        projections: transmission or counts, (angle, row, bin).
        darks: counts without the beam, (n, row, bin); zero if not given.
        incident: (angle,) the beam's counts, less the darks; 1 if not given, which leaves counts
            with line integrals that are off by one number in each view and row.
        masked: (row, bin) pixels that hold nothing; they count as dead.
        first_row: number of the first row, for errors.

    Raises:
        InputError: no sample of a row has any signal.
    """
    signal: Floats = projections - _mean_dark(projections, darks)
    if incident is not None:
        signal /= incident[:, None, None].astype(np.float32)
    # Numbers of a beam that is not known are measured by the brightest sample of their row.
    beam = np.maximum(signal.max(axis=(0, 2)), 0)[:, None]
    scale = 1.0 if incident is None else float(np.mean(incident))
    faintest = np.maximum(_dark_noise(darks) / np.float32(scale), _FAINTEST * beam)
    dead = np.zeros(projections.shape[1:], np.bool_) if masked is None else masked
    return _minus_log(signal, faintest, dead, first_row)


def without_masked(lines: Floats, masked: NDArray[np.bool_], *, first_row: int = 0) -> Attenuation:
    """Line integrals as they are given, with pixels that hold nothing filled.

    Args:
        lines: line integrals (angle, row, bin); changed in place.
        masked: (row, bin) pixels that hold nothing.
        first_row: number of the first row, for errors.

    Raises:
        InputError: a row holds nothing else.
    """
    empty = np.zeros(lines.shape[1], np.int64)
    if not masked.any():
        return Attenuation(lines, empty, empty)
    for row in np.flatnonzero(masked.any(axis=1)):
        unknown = np.broadcast_to(masked[row], lines[:, row].shape)
        _fill(lines[:, row], unknown, first_row + int(row))
    return Attenuation(lines, masked.sum(axis=1), empty, _bins(masked))


def without_stuck(found: Attenuation, angles: NDArray[np.float64]) -> Attenuation:
    """Fill pixels that read the same in all views, as dead and saturated ones do.

    Whatever turns passes all bins up to its distance from the axis within half a turn, so that a
    bin between others that vary must vary too. Such pixels make rings, and a search that matches
    views finds the axis in their middle.

    Args:
        found: line integrals; changed in place.
        angles: of the views, in radians; less than half a turn tells nothing.
    """
    lines = found.projections
    if len(lines) < _ENOUGH_VIEWS or np.ptp(angles) < _ENOUGH_TURN:
        return found
    # Most pixels are seen to vary by a few views alone.
    few = lines[np.linspace(0, len(lines) - 1, _ENOUGH_VIEWS).astype(int)]
    span = np.ptp(few, axis=(0, 2))
    room = _STUCK * span[:, None]
    stuck = np.ptp(few, axis=0) <= room
    dead, bins = found.dead_of_rows.copy(), set(found.stuck_bins)
    for row in np.flatnonzero(stuck.any(axis=1)):
        varying = np.flatnonzero(~stuck[row])
        if not len(varying):
            continue
        between = np.flatnonzero(stuck[row, : varying[-1]])
        between = between[between > varying[0]]
        between = between[np.ptp(lines[:, row, between], axis=0) <= room[row]]
        if not 0 < len(between) <= len(varying) / 2:
            continue
        unknown = np.zeros(lines.shape[::2], np.bool_)
        unknown[:, between] = True
        filled = lines[:, row].copy()
        _fill(filled, unknown, int(row))
        # Air without noise reads the same as well, and what its neighbours read but for rounding.
        apart = np.abs(filled[:, between] - lines[:, row, between]).max(axis=0)
        wrong = between[apart > max(_APART * span[row], _ROUNDED)]
        lines[:, row, wrong] = filled[:, wrong]
        dead[row] += len(wrong)
        bins.update(map(int, wrong))
    of_both = tuple(sorted(bins.union(found.dead_bins)))
    told = tuple(sorted(bins))
    return replace(found, dead_of_rows=dead, dead_bins=of_both, stuck_bins=told)


def _mean_dark(projections: Floats, darks: Floats | None) -> Floats:
    return np.zeros(projections.shape[1:], np.float32) if darks is None else _mean(darks)


def _mean(frames: Floats) -> Floats:
    """Mean of flats or darks, without the hits of single quanta on the sensor (zingers)."""
    if len(frames) >= _ENOUGH_FRAMES:
        middle = np.median(frames, axis=0)
        away = np.abs(frames - middle)
        # Of the pixel and of its row, the wider spread: that of few frames may be none by chance.
        usual = _SIGMAS * np.median(away, axis=0)
        # Half of three or four frames tell too little; most pixels of the row have no hit at all.
        of_row = usual if len(frames) >= _MANY_FRAMES else frames.std(axis=0, ddof=1)
        usual = np.maximum(usual, np.median(of_row, axis=1, keepdims=True))
        hit = (away > _OUTLIER * usual) & (usual > 0)
        if hit.any():
            frames = np.where(hit, middle, frames)
    mean: Floats = frames.mean(axis=0, dtype=np.float64).astype(np.float32)
    return mean


def _dark_noise(darks: Floats | None) -> Floats:
    """Standard deviation of a dark sample, one for each row, (row, 1); 0 where it is not known."""
    if darks is None or len(darks) < _ENOUGH_DARKS:
        return np.zeros((1, 1), np.float32)
    spread = darks.std(axis=0, ddof=1, dtype=np.float64)
    noise: Floats = np.median(spread, axis=1, keepdims=True).astype(np.float32)
    return noise


def _divide(
    transmission: Floats, flats: Floats, dark: Floats, flats_at: NDArray[np.float64]
) -> None:
    """Divide each view by the beam at its time."""
    times = np.unique(flats_at)
    beams = np.stack([_mean(flats[flats_at == time]) - dark for time in times])
    # A pixel that is dead at one time alone is filled all the same: its beam is 0 or less.
    for view in range(len(transmission)):
        place = float(np.interp(view + 0.5, times, np.arange(len(times))))
        first = min(int(place), len(times) - 2)
        share = np.float32(place - first)
        beam = (1 - share) * beams[first] + share * beams[first + 1]
        transmission[view] /= np.where(beam > 0, beam, np.inf)


def _minus_log(
    transmission: Floats, faintest: Floats, dead: NDArray[np.bool_], first_row: int
) -> Attenuation:
    """-log in place, with dead pixels and what is not above ``faintest`` filled."""
    unknown = ~(transmission > np.maximum(faintest, np.float32(_FAINTEST)))
    unknown |= dead
    dead_of_rows = dead.sum(axis=1)
    starved_of_rows = unknown.sum(axis=(0, 2)) - len(transmission) * dead_of_rows
    transmission[unknown] = 1
    np.negative(np.log(transmission, out=transmission), out=transmission)
    if unknown.any():
        for row in np.flatnonzero(unknown.any(axis=(0, 2))):
            _fill(transmission[:, row], unknown[:, row], first_row + int(row))
    return Attenuation(transmission, dead_of_rows, starved_of_rows, _bins(dead))


def _bins(dead: NDArray[np.bool_]) -> tuple[int, ...]:
    return tuple(map(int, np.flatnonzero(dead.any(axis=0))))


def _fill(lines: Floats, unknown: NDArray[np.bool_], row: int) -> None:
    """Interpolate along each line of one row (angle, bin), and lines that are lost between views.

    Raises:
        InputError: nothing is known of any line.
    """
    bins = np.arange(lines.shape[1])
    lost = unknown.all(axis=1)
    if lost.all():
        raise InputError(
            f"row {row} holds no sample with a signal above the darks: choose other rows "
            "(--rows on a command line), or check which frames are darks (--darks)"
        )
    for view in np.flatnonzero(unknown.any(axis=1) & ~lost):
        gaps = unknown[view]
        lines[view, gaps] = np.interp(bins[gaps], bins[~gaps], lines[view, ~gaps])
    if lost.any():
        known = np.flatnonzero(~lost)
        for view in np.flatnonzero(lost):
            after = min(int(np.searchsorted(known, view)), len(known) - 1)
            before = max(after - 1, 0) if known[after] > view else after
            first, last = known[before], known[after]
            share = np.float32((view - first) / (last - first) if last != first else 0)
            share = np.clip(share, 0, 1)
            lines[view] = (1 - share) * lines[first] + share * lines[last]
