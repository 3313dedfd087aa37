"""The axis of fans and cones: rows read as parallel views about a trial axis, until it stays.

A reading with a wrong centre turns about another bin, nearly by as much as the centre was wrong,
so that two or three readings end where the bin that the parallel search finds is the centre that
was assumed. Nothing is approximate there: the fan's rays are read where they are.

Rows of a cone are no fans, but near the source's orbit almost: a line and the opposite one cross
halfway between the sources, and part by ``2 d sin(gamma)`` rows at the edge of the object, d rows
off the orbit. The search keeps to rows where that is small.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from rift_cl.cl.host_arrays import as_host_array
from rift_cl.errors import InputError
from rift_cl.geometry import Cone, Fan, Scan
from rift_cl.reconstruct.axis.estimate import AxisEstimate
from rift_cl.reconstruct.axis.fan_doubt import fan_doubt
from rift_cl.reconstruct.axis.fan_rays import ParallelViews, parallel_views
from rift_cl.reconstruct.axis.lying_axis import looked_at, lying_axis
from rift_cl.reconstruct.axis.opposite_views import enough_pairs, shared_views
from rift_cl.reconstruct.axis.search import searched_axis, searched_rows
from rift_cl.reconstruct.axis.sense import sense_of
from rift_cl.reconstruct.axis.view_order import jump_doubt, order_doubt
from rift_cl.reconstruct.axis.views import Views

Floats = NDArray[np.float64]

# Most groups of a cone's rows, and by how many rows opposite rays may part at the object's edge.
_GROUPS, _PARTED = 5, 2.0
# Parts of views are compared if they make pairs so many times as many.
_MORE = 1.5
# Most readings, and the change of the centre that ends them, in bins.
_READINGS, _SETTLED = 6, 0.01


def axis_of_scan(
    projections: Views,
    scan: Scan,
    span: tuple[float, float] | None = None,
    *,
    wants: str = "find_center",
) -> AxisEstimate:
    """Find the axis of a fan or of a circular cone, and the sense of its rotation.

    Args:
        projections: line integrals, (view, bin) or (view, row, bin); rows of a fan are slices.
        scan: the geometry; its centre (bin) is a first guess, and the angles' sign is checked.
        span: where to search, in bins; as for ``find_center`` if not given.
        wants: the function that errors name.

    Raises:
        InputError: as for ``find_center``.
        ShapeError: the projections do not fit the scan.
        NonFiniteError: a sample is not finite.
    """
    fan = _fan_of(scan, wants)
    shape = np.shape(projections)
    if isinstance(scan, Cone):
        wanted: tuple[int, ...] = (scan.views, scan.rows, scan.bins)
    elif len(shape) == 3:
        wanted = (scan.views, shape[1], fan.bins)
    else:
        wanted = (scan.views, fan.bins)
    y = as_host_array(projections, wanted, name="projections", wants=wants)
    stack = y if y.ndim == 3 else y[:, None]
    if isinstance(scan, Cone):
        groups, middle = orbit_rows(scan), scan.center[0]
    else:
        groups = [np.array([row]) for row in searched_rows(stack.shape[1])]
        middle = (stack.shape[1] - 1) / 2
    rows = np.stack([stack[:, group].mean(axis=1) for group in groups], axis=1)
    places = np.array([group.mean() for group in groups])
    lying = lying_axis(stack[np.ix_(*looked_at(scan))], scan) if isinstance(scan, Cone) else ""
    return axis_of_fan(rows, places, middle, fan, span, lying)


def orbit_rows(scan: Cone) -> list[NDArray[np.intp]]:
    """Groups of rows so near the source's orbit that opposite rays are almost the same lines.

    Raises:
        InputError: the orbit's row is not on the detector.
    """
    orbit = scan.center[0]
    if not 0 <= orbit <= scan.rows - 1:
        raise InputError(
            f"Cone: center is {scan.center}, its row off the detector of {scan.rows} rows; "
            "opposite rays are compared near the orbit's row: give the axis yourself "
            "(--center, or the scan's center in Python)"
        )
    widest = float(np.abs(np.sin(scan.fan_angles()[[0, -1]])).max())
    reach = max(_PARTED / (2 * widest), 0.5)
    rows = np.arange(max(0, np.ceil(orbit - reach)), min(scan.rows, np.floor(orbit + reach) + 1))
    return np.array_split(rows.astype(np.intp), min(_GROUPS, rows.size))


def axis_of_fan(
    rows: Views,
    places: Floats,
    middle: float,
    fan: Fan,
    span: tuple[float, float] | None = None,
    doubted: str = "",
) -> AxisEstimate:
    """Find the axis from some rows that are fans.

    Args:
        rows: line integrals, (view, row, bin).
        places: the rows' numbers on the detector, ascending.
        middle: the row that the estimate is for.
        fan: the geometry; its centre is a first guess.
        span: where to search, in bins.
        doubted: what the data are known to have against the scan already; nothing else is then
            looked for.

    Raises:
        InputError: the data do not tell the axis.
    """
    if span is not None and not 0 <= span[0] < span[1] <= fan.bins - 1:
        raise InputError(
            f"span is {span}, wanted two bins in ascending order, between 0 and {fan.bins - 1}"
        )
    mean = rows.mean(axis=1, keepdims=True)
    middle_row = mean[:, 0], fan.angles
    doubted = doubted or order_doubt(*middle_row) or jump_doubt(*middle_row)
    ways = fan, fan.at(-fan.angles)
    try:
        found, told = _either_way(rows, mean, places, middle, ways, span)
    except InputError as error:
        doubt = doubted or fan_doubt(mean[:, 0], ways[0]) or fan_doubt(mean[:, 0], ways[1])
        if not doubt:
            raise
        raise type(error)(f"{error}; {doubt}") from error
    doubt = doubted or fan_doubt(mean[:, 0], replace(told, center=found.center))
    return replace(found, doubt=doubt)


def _either_way(
    rows: Views,
    mean: Views,
    places: Floats,
    middle: float,
    ways: tuple[Fan, Fan],
    span: tuple[float, float] | None,
) -> tuple[AxisEstimate, Fan]:
    """The axis in the sense of rotation that the data tell, and the fan that turns in it."""
    found, refusals = [], []
    for way in ways:
        try:
            found.append(_settled(mean, np.array([middle]), middle, way, span).center)
        except InputError as error:
            refusals.append(error)
    if not found:
        raise refusals[0]
    sense = sense_of(mean[:, 0], ways[0], found)
    told = replace(ways[sense.sign < 0], center=found[0])
    return replace(_settled(rows, places, middle, told, span), sense=sense), told


def _settled(
    rows: Views, places: Floats, middle: float, fan: Fan, span: tuple[float, float] | None
) -> AxisEstimate:
    """The axis about which the reading that assumes it turns."""
    for _ in range(_READINGS):
        read, seen = _compared(parallel_views(rows, fan))
        views, bins = read.views, read.bins
        within = None
        if span is not None:
            low, high = np.interp(span, bins, np.arange(bins.size)).tolist()
            within = (low, high)
        sinograms = (views[:, row] for row in range(views.shape[1]))
        # Rows counted from the one that the estimate is for.
        offsets = list(places - middle)
        told = searched_axis(sinograms, offsets, 0.0, read.directions, within, seen)
        found = _on_detector(told, bins, middle)
        change = found.center - fan.center
        fan = replace(fan, center=found.center)
        if abs(change) < _SETTLED:
            break
    return found


def _compared(read: ParallelViews) -> tuple[ParallelViews, Floats | None]:
    """The views to compare, and where each ends, if they do not hold all rays.

    Scans of half a turn and the fan's angle have hardly a whole view's opposite, but that of a part
    of many: without these, half a turn would have to do, which tells the axis much less surely.
    """
    whole = read.whole()
    parts = enough_pairs(read.directions, read.seen)
    pairs = enough_pairs(whole.directions)
    if parts is None:
        return whole, None
    wholly = 0.0 if pairs is None else shared_views(pairs, whole.directions, None)
    if shared_views(parts, read.directions, read.seen) < _MORE * wholly:
        return whole, None
    return read, read.seen


def _on_detector(read: AxisEstimate, bins: Floats, middle: float) -> AxisEstimate:
    """An estimate in bins of the parallel views, in the fan's; next to the axis they are alike."""
    center = float(np.interp(read.center, np.arange(bins.size), bins))
    shift = center - read.center
    return replace(
        read,
        center=center,
        interval=(read.interval[0] + shift, read.interval[1] + shift),
        rows=read.rows + middle,
        centers=read.centers + shift,
        scores=np.stack([read.scores[0] + shift, read.scores[1]]),
    )


def _fan_of(scan: Scan, wants: str) -> Fan:
    if isinstance(scan, Fan):
        return scan
    if not isinstance(scan, Cone):
        raise InputError(
            f"{wants}: scan is a {type(scan).__name__}, wanted a Fan or a Cone "
            "(rift.Cone.of_vectors makes one of circular vectors)"
        )
    if not scan.circular:
        raise InputError(
            f"{wants}: heights differ; opposite rays meet only where the source goes round in "
            "one plane: find the axis of a circular scan"
        )
    return scan.fan()
