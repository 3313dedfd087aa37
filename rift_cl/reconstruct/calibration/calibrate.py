"""The geometry of a circular scan as its own data tell it."""

from __future__ import annotations

from dataclasses import dataclass, replace
from importlib import import_module
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rift_cl.cl.device import Device
from rift_cl.cl.host_arrays import as_host_array
from rift_cl.errors import checked_flag
from rift_cl.geometry import Cone, Fan, Vectors
from rift_cl.reconstruct.axis import AxisEstimate, axis_of_scan
from rift_cl.reconstruct.calibration.opposite_fit import fit_opposite_rays
from rift_cl.reconstruct.calibration.orbit_row import orbit_row
from rift_cl.reconstruct.calibration.turned_detector import turned
from rift_cl.reconstruct.direct.padding import is_truncated

# Half a 95 % interval in standard errors, as for the axis.
_HALF_INTERVAL = 2.3
# The widest half intervals that are still an answer: radians, and a share of the distance.
_WIDEST_ROLL, _WIDEST_SLANT, _WIDEST_DISTANCE = np.deg2rad(1.0), np.deg2rad(2.0), 0.1
# A value and half its 95 % interval; None where the data do not tell.
Told = tuple[float, float] | None
# Fewest rows of a detector on which the orbit's row is looked for.
_FEWEST_ROWS = 12


@dataclass(frozen=True, eq=False)
class Calibration:
    """What the data say of a scan's geometry.

    Args:
        scan: the scan with what was found put right: sense and centre; the orbit's row where it is
            surely another; a roll or a slant that is surely there makes a flat ``Cone`` a
            ``Vectors``; the distance only where that was asked for.
        axis: bin of the axis, its interval, and the sense of rotation.
        roll: of the detector in its plane, in radians, and half its 95 % interval; positive where
            the axis is seen at greater bins in greater rows; None where the data do not tell.
        distance: source to detector as a share of the given one, and half its 95 % interval; None
            where the data do not tell.
        disagreement: root mean square difference of opposite rays as a share of the contrast, at
            the axis that was found and after the fit of roll and distance.
        row: of the source's orbit, and half its 95 % interval; None where the data do not tell, or
            were not asked (``orbit``).
        asked: whether the row was looked for.
        slant: of a flat detector about its columns, out of its plane, in radians, and half its 95 %
            interval; positive where greater bins are farther from the source; None where the data
            do not tell. A ``Fan`` cannot hold it.
    """

    scan: Fan | Cone | Vectors
    axis: AxisEstimate
    roll: Told
    distance: Told
    disagreement: tuple[float, float]
    row: Told = None
    asked: bool = False
    slant: Told = None

    def _repr_html_(self) -> str:
        """What a notebook shows: the curve of the axis, and what was found besides."""
        html: str = import_module("rift_cl.report.notebook").calibration_card(self)
        return html

    def in_words(self) -> str:
        """What was found, a line for each quantity, and what cannot be told."""
        lines = [f"rotation axis {self.axis.in_words()}"]
        lines.append(f"roll of the detector: {_degrees(self.roll)}")
        lines.append(f"slant of the detector about its columns: {_degrees(self.slant)}")
        if isinstance(self.scan, Fan) and _is_sure(self.slant):
            lines[-1] += "; a Fan has no slant: make it a Cone of one row and turn its vectors()"
        if self.distance is None:
            lines.append("source to detector: the data do not tell")
        else:
            share, half = self.distance
            lines.append(f"source to detector: {share:.4f} times what is given (+- {half:.4f})")
        if self.asked:
            told = "the data do not tell"
            if self.row is not None:
                told = f"{self.row[0]:.2f} (+- {self.row[1]:.2f})"
            lines.append(f"row of the source's orbit: {told}")
        left = "" if self.asked else ", the orbit's row (orbit=True looks for it)"
        lines.append(
            f"source to axis{left} and a tilt of the detector about its rows are taken as given: "
            "the data hardly tell them"
        )
        return "\n".join(lines)

    def record(self) -> dict[str, Any]:
        """The calibration in words and numbers, as reports keep it."""
        return {
            "axis": self.axis.record(),
            "roll": None if self.roll is None else list(self.roll),
            "distance": None if self.distance is None else list(self.distance),
            "row": None if self.row is None else list(self.row),
            "slant": None if self.slant is None else list(self.slant),
            "in_words": self.in_words(),
        }


def calibrate(
    projections: NDArray[np.float32],
    scan: Fan | Cone,
    *,
    distance: bool = False,
    orbit: bool = False,
    device: Device | None = None,
) -> Calibration:
    """Find centre, sense of rotation, roll, slant and distance of the detector from a scan's data.

    Rays that measure the same line from both sides must agree. They tell the bin of the axis and
    the sense of rotation (as ``find_center`` does), the detector's roll in its plane, its slant
    about its columns, where the fan is wide enough, and the distance of the detector in bins, which
    is the scale of the fan angle. They do not tell the distance of the axis, since everything twice
    as large makes the same pictures, nor the orbit's row. A tilt about the detector's rows
    magnifies slices by their height, which an object could do as well: data hardly tell it. The row
    is told, with ``orbit``, by planes through two places of the source, of which both views must
    measure the same integral: of a flat ``Cone`` whose object leaves the detector at neither side.

    Args:
        projections: line integrals, (view, bin) or (view, row, bin).
        scan: the geometry as far as it is known; a circular ``Cone`` whose orbit's row
            (``center[0]``) is right, or a ``Fan``.
        distance: whether the returned scan has the distance of the detector that the data tell.
            The distance of the axis stays, so that lengths change with the magnification.
        orbit: whether the row of the orbit is looked for as well, within an eighth of the rows of
            the given one, which takes some seconds.
        device: accepted as by every method; the fit runs on the host.

    Returns:
        The corrected scan and what was found.

    Raises:
        InputError: the data do not tell the axis, or the scan is neither a ``Fan`` nor a circular
            ``Cone``.
        ShapeError: the projections do not fit the scan.
        NonFiniteError: a sample is not finite.
    """
    checked_flag("calibrate", "distance", distance)
    checked_flag("calibrate", "orbit", orbit)
    axis = axis_of_scan(projections, scan, wants="calibrate")
    sign = -1.0 if axis.sense is not None and axis.sense.sign < 0 else 1.0
    right: Fan | Cone
    if isinstance(scan, Fan):
        right = replace(scan.at(sign * scan.angles), center=axis.center)
    else:
        right = replace(scan.at(sign * scan.angles), center=(scan.center[0], axis.center))
    stack = as_host_array(projections, np.shape(projections), name="projections", wants="calibrate")
    if isinstance(right, Fan):
        stack = stack if stack.ndim == 2 else stack[:, stack.shape[1] // 2]
        fit = fit_opposite_rays(stack[:, None], _one_row(right))
    else:
        fit = fit_opposite_rays(stack, right)
    roll = _told(fit.roll, fit.errors[1], _WIDEST_ROLL)
    slant = _told(fit.slant, fit.errors[3], _WIDEST_SLANT)
    if isinstance(right, Cone) and _is_sure(slant):
        # The axis was found as if there were none, which moves it a little.
        right = replace(right, center=(right.center[0], fit.center))
    share = _told(fit.distance, fit.errors[2], _WIDEST_DISTANCE)
    if distance and share is not None:
        right = replace(right, source_to_detector=right.source_to_detector * share[0])
    row = None
    if orbit and isinstance(right, Cone) and _tells_planes(stack, right):
        row = orbit_row(stack, right, 0.0 if roll is None else roll[0])
        if row is not None and abs(row[0] - right.center[0]) > row[1]:
            right = replace(right, center=(row[0], right.center[1]))
    corrected: Fan | Cone | Vectors = right
    sure = [told[0] if told is not None and _is_sure(told) else 0.0 for told in (roll, slant)]
    if isinstance(right, Cone) and not right.curved and any(sure):
        corrected = turned(right, *sure)
    return Calibration(corrected, axis, roll, share, fit.disagreement, row, orbit, slant)


def _tells_planes(stack: NDArray[np.float32], scan: Cone) -> bool:
    """Whether views may be compared on planes: flat detectors that no side of the object leaves."""
    return not scan.curved and scan.rows >= _FEWEST_ROWS and not is_truncated(stack)


def _is_sure(told: Told) -> bool:
    """Whether a value differs from 0 by more than its interval."""
    return told is not None and abs(told[0]) > told[1]


def _degrees(told: Told) -> str:
    if told is None:
        return "the data do not tell"
    value, half = np.rad2deg(told)
    return f"{value:.3f} degrees (+- {half:.3f})"


def _one_row(fan: Fan) -> Cone:
    lengths = fan.pitch, fan.source_to_axis, fan.source_to_detector
    return Cone(fan.angles, 1, fan.bins, *lengths, (0.0, fan.center), curved=fan.curved)


def _told(value: float, error: float, widest: float) -> Told:
    half = _HALF_INTERVAL * float(error)
    return (value, half) if half <= widest else None
