"""The search for the rotation axis: a measure that the views allow, several rows, one answer.

Each row is searched by itself, first coarsely everywhere and then finely at the best, and a line
through the rows' centres, weighted by how sure each is, is the axis. Where rows or frequencies
contradict each other, nothing stands out, or the interval comes out too wide, no answer is given.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from rift_cl.errors import InputError
from rift_cl.reconstruct.axis.estimate import AxisEstimate
from rift_cl.reconstruct.axis.measures import RowAxis, chosen_measure
from rift_cl.reconstruct.axis.moments import mass_doubt
from rift_cl.reconstruct.axis.repeated import repeated_angles
from rift_cl.reconstruct.axis.shown_rows import Look, evenly, rows_beside_air
from rift_cl.reconstruct.axis.turn import other_turn
from rift_cl.reconstruct.axis.view_order import jump_doubt, order_doubt
from rift_cl.reconstruct.axis.views import Views, is_cut, without_rings

Floats = NDArray[np.float64]

# How a refusal ends.
GIVE_IT = (
    "; give it yourself (--center, or the scan's center in Python), by the slices that "
    "'rift center' shows"
)
# A search needs some detail, and views from several directions.
_FEWEST_BINS, _FEWEST_VIEWS = 8, 4
# Most rows that are looked at.
_ROWS = 5
# Half a 95 % interval in standard errors, which are themselves estimated from 16 bands.
_HALF_INTERVAL = 2.3
# The least standard error: views are sums over bins, and detectors are not perfect.
_FINEST = 0.01
# The widest half interval that is still an answer, in bins, and that of a single row: an axis that
# is off by more than half a bin doubles edges, and of fans and cones rays read by wrong angles or
# lengths can agree on an axis to no better than that.
_WIDEST, _WIDEST_ROW = 0.5, 2.0
# A rival's share of the best log-likelihood from which on neither is believed; the least of the
# best, and the least share of it of what it were if all frequencies agreed.
_RIVAL, _SCORE, _COHERENCE = 0.75, 25.0, 0.5
# Rows further from the line than so many standard errors, and than this many bins, do not count.
_OUTLIER, _STRAY = 6.0, 2.0
# From how many standard errors on, and how many bins, rows off the axis are worth a doubt.
_DISAGREED, _NOTED = 3.0, 0.1
# How far from the best the reported scores reach, in bins, and their step.
_REACH, _STEP = 8.0, 0.05


def searched_rows(count: int) -> list[int]:
    """Detector rows used by a search: evenly spaced, the middle one included."""
    return evenly(count, _ROWS)


def axis_of_stack(
    read: Callable[[int], Views],
    look: Look,
    count: int,
    angles: Floats,
    span: tuple[float, float] | None = None,
    within: tuple[int, int] | None = None,
) -> AxisEstimate:
    """Find the axis from rows that are evenly spread, or else from those that show the object.

    Args:
        read: gives the line integrals of a row, (angle, bin).
        look: gives some rows of some views, as for ``rows_beside_air``.
        count: of the detector's rows.
        angles: directions in radians.
        span: where to search, in bins.
        within: the first row and the one after the last among which rows that show the object are
            chosen; all if not given.

    Raises:
        InputError: as for ``axis_of_rows``.
    """

    def found(rows: list[int], place: float) -> AxisEstimate:
        return axis_of_rows((read(row) for row in rows), rows, place, angles, span)

    usual = searched_rows(count)
    try:
        return found(usual, (count - 1) / 2)
    except InputError as error:
        if GIVE_IT not in str(error):
            raise
        shown = rows_beside_air(usual, look, angles.size, within or (0, count))
        if shown is None:
            raise
    beside = (shown[0] + shown[-1]) / 2
    return _moved(found(shown, beside), (count - 1) / 2 - beside)


def _moved(found: AxisEstimate, away: float) -> AxisEstimate:
    """The axis of rows beside air, moved so many rows to the detector's middle.

    It goes along a tilt that is sure; one that is not would move it by what is noise, and the axis
    is taken as upright.

    Raises:
        InputError: the interval there is too wide.
    """
    if not found.tilt_is_sure:
        return replace(found, tilt=0.0, beside_air=True)
    center = found.center + found.tilt * away
    half = (found.interval[1] - found.interval[0]) / 2
    half = float(np.hypot(half, _HALF_INTERVAL * found.tilt_error * away))
    if not half <= _WIDEST:
        raise _refusal(_too_wide(half))
    return replace(
        found,
        center=center,
        interval=(center - half, center + half),
        scores=found.scores + np.array([[found.tilt * away], [0.0]]),
        beside_air=True,
    )


def axis_of_rows(
    sinograms: Iterable[Views],
    rows: Sequence[float],
    place: float,
    angles: Floats,
    span: tuple[float, float] | None = None,
) -> AxisEstimate:
    """Find the axis from some rows of a detector, and what they have against the angles.

    Args:
        sinograms: line integrals of each row, (angle, bin).
        rows: their numbers.
        place: the row that the estimate is for.
        angles: directions in radians.
        span: where to search, in bins.

    Raises:
        InputError: the data do not tell the axis: no contrast, too few views, a wide gap between
            them, or nothing that stands out of the noise; or the span is not on the detector.
    """
    middle: list[Views] = []

    def watched() -> Iterator[Views]:
        for index, views in enumerate(sinograms):
            if index == len(rows) // 2:
                middle.append(np.asarray(views, np.float32))
            yield views

    try:
        found = searched_axis(watched(), rows, place, angles, span)
    except InputError as error:
        doubt = angle_doubt(middle[0], angles) if middle else ""
        if not doubt:
            raise
        raise type(error)(f"{error}; {doubt}") from error
    return replace(found, doubt=angle_doubt(middle[0], angles) or _scatter_doubt(found))


def angle_doubt(views: Views, angles: Floats) -> str:
    """What the views of a row of parallel rays have against their angles; empty where nothing.

    Args:
        views: line integrals, (angle, bin), in the order in which they were taken.
        angles: their directions in radians.

    Returns:
        The end of a sentence.
    """
    found = repeated_angles(views, angles) or other_turn(views, angles)
    told = order_doubt(views, angles) or ("" if found is None else found.in_words())
    told = told or jump_doubt(views, angles)
    return told or ("" if is_cut(views) else mass_doubt(views, angles))


def _scatter_doubt(found: AxisEstimate) -> str:
    """A doubt where rows disagree on the axis by more than their errors and by what matters."""
    if found.scatter <= _DISAGREED or found.spread <= _NOTED:
        return ""
    return (
        f"the rows lie {found.spread:.2f} bins off it, {found.scatter:.2g} times what their errors "
        "explain, as where angles are a little wrong (an encoder that slipped), the axis moved or "
        "the detector is distorted"
    )


def searched_axis(
    sinograms: Iterable[Views],
    rows: Sequence[float],
    place: float,
    angles: Floats,
    span: tuple[float, float] | None = None,
    seen: Floats | None = None,
) -> AxisEstimate:
    """The axis of ``axis_of_rows``, the angles taken as they are.

    ``seen`` is as for ``chosen_measure``.
    """
    measure = chosen_measure(angles, span, seen)
    places, found, why = [], [], ""
    for row, sinogram in zip(rows, sinograms, strict=True):
        views = np.ascontiguousarray(sinogram, np.float32)
        _check_searchable(views, span)
        told = measure.find(views) if np.ptp(views) > 0 else None
        doubt = _doubt(told, span, views)
        if told is not None and doubt:
            told = measure.find(without_rings(views))
            doubt = doubt and _doubt(told, span, views)
        if told is None or doubt:
            why = why or doubt
        else:
            places.append(row)
            found.append(told)
    if 2 * len(found) <= len(rows):
        raise _refusal(why)
    return _line(np.array(places, float), found, place)


def _check_searchable(views: Views, span: tuple[float, float] | None) -> None:
    count, bins = views.shape
    if bins < _FEWEST_BINS or count < _FEWEST_VIEWS:
        raise _refusal(
            f"a search takes {_FEWEST_VIEWS} views of {_FEWEST_BINS} bins at least, there are "
            f"{count} of {bins}"
        )
    if span is not None and not 0 <= span[0] < span[1] <= bins - 1:
        raise InputError(
            f"span is {span}, wanted two bins in ascending order, between 0 and {bins - 1}"
        )


def _doubt(told: RowAxis | None, span: tuple[float, float] | None, views: Views) -> str:
    """Why the answer of one row cannot be trusted; empty where it can."""
    bins = views.shape[1]
    if not np.ptp(views) > 0:
        return "the sinogram has no contrast"
    if told is None:
        return (
            "the views go round less than half a turn, which takes at least 60 degrees, all of the "
            "object in every view, and air at zero"
        )
    low, high = span or (0, bins - 1)
    if not low <= told.center <= high:
        return f"nothing between the bins {low:g} and {high:g} stands out"
    weak = told.score < _SCORE or told.coherence < _COHERENCE or told.error == np.inf
    if weak or told.rival > _RIVAL * told.score:
        return "no place on the detector stands out from the others"
    if not _HALF_INTERVAL * told.error <= _WIDEST_ROW:
        return _too_wide(_HALF_INTERVAL * told.error)
    return ""


def _too_wide(half: float) -> str:
    return f"the data tell it to no better than {half:.2g} bins either way"


def _refusal(why: str) -> InputError:
    return InputError(f"the rotation axis cannot be found: {why}{GIVE_IT}")


def _line(places: Floats, found: list[RowAxis], middle: float) -> AxisEstimate:
    """The axis through the rows' centres.

    Raises:
        InputError: rows contradict each other, or the interval is too wide.
    """
    centers = np.array([row.center for row in found])
    errors = np.hypot(_FINEST, [row.error for row in found])
    kept = np.ones(places.size, bool)
    while True:
        center, tilt, error = _fitted(places[kept] - middle, centers[kept], errors[kept])
        away = np.abs(centers - center - tilt * (places - middle))
        far = kept & (away > np.maximum(_OUTLIER * errors, _STRAY))
        if not far.any():
            break
        kept &= away < away[far].max()
        if 2 * np.count_nonzero(kept) <= places.size:
            raise _refusal("rows of the detector contradict each other")
    # Rows share what the axis moved by, so that no number of them averages it out.
    drift = np.median([row.drift for row, counts in zip(found, kept, strict=True) if counts])
    half = _HALF_INTERVAL * float(np.hypot(error, drift))
    if not half <= _WIDEST:
        raise _refusal(_too_wide(half))
    used = [row for row, counts in zip(found, kept, strict=True) if counts]
    said = [part for row in used for part in (row.evidence, row.mass) if part is not None]
    trial = center + np.arange(-_REACH, _REACH + _STEP / 2, _STEP)
    scores = sum(part.scores(trial) for part in said)
    return AxisEstimate(
        center=float(center),
        interval=(float(center - half), float(center + half)),
        tilt=float(tilt),
        spread=float(np.sqrt(np.mean(away[kept] ** 2))) if kept.sum() > 1 else 0.0,
        by=max((row.by for row in used), key=len),
        rows=places[kept],
        centers=centers[kept],
        errors=errors[kept],
        scores=np.stack([trial, scores]),
    )


def _fitted(places: Floats, centers: Floats, errors: Floats) -> tuple[float, float, float]:
    """Centre at 0, tilt, and the centre's standard error, of a weighted line through centres.

    With fewer than three rows a slope would be noise, and the axis is taken as upright. Where rows
    scatter more than their errors explain, the error grows accordingly.
    """
    terms = 2 if places.size >= 3 else 1
    model = np.stack([np.ones_like(places), places], axis=1)[:, :terms] / errors[:, None]
    inverse = np.linalg.pinv(model)
    fit = inverse @ (centers / errors)
    left = centers / errors - model @ fit
    free = places.size - terms
    scatter = max(1.0, float(np.sqrt((left**2).sum() / free))) if free else 1.0
    tilt = float(fit[1]) if terms == 2 else 0.0
    return float(fit[0]), tilt, scatter * float(np.linalg.norm(inverse[0]))
