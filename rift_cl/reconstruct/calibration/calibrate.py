"""The geometry of a circular scan as its own data tell it."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rift_cl.cl.device import Device
from rift_cl.cl.host_arrays import as_host_array
from rift_cl.geometry import Cone, Fan, Vectors
from rift_cl.reconstruct.axis import AxisEstimate, axis_of_scan
from rift_cl.reconstruct.calibration.opposite_fit import fit_opposite_rays

# Half a 95 % interval in standard errors, as for the axis.
_HALF_INTERVAL = 2.3
# The widest half intervals that are still an answer: radians, and a share of the distance.
_WIDEST_ROLL, _WIDEST_DISTANCE = np.deg2rad(1.0), 0.1


@dataclass(frozen=True, eq=False)
class Calibration:
    """What the data say of a scan's geometry.

    Args:
        scan: the scan with what was found put right: sense and centre; a roll that is surely there
            makes a flat ``Cone`` a ``Vectors``; the distance only where that was asked for.
        axis: bin of the axis, its interval, and the sense of rotation.
        roll: of the detector in its plane, in radians, and half its 95 % interval; positive where
            the axis is seen at greater bins in greater rows; None where the data do not tell.
        distance: source to detector as a share of the given one, and half its 95 % interval; None
            where the data do not tell.
        disagreement: root mean square difference of opposite rays as a share of the contrast, at
            the axis that was found and after the fit of roll and distance.
    """

    scan: Fan | Cone | Vectors
    axis: AxisEstimate
    roll: tuple[float, float] | None
    distance: tuple[float, float] | None
    disagreement: tuple[float, float]

    def in_words(self) -> str:
        """What was found, a line for each quantity, and what cannot be told."""
        lines = [f"rotation axis {self.axis.in_words()}"]
        if self.roll is None:
            lines.append("roll of the detector: the data do not tell")
        else:
            roll, half = np.rad2deg(self.roll)
            lines.append(f"roll of the detector: {roll:.3f} degrees (+- {half:.3f})")
        if self.distance is None:
            lines.append("source to detector: the data do not tell")
        else:
            share, half = self.distance
            lines.append(f"source to detector: {share:.4f} times what is given (+- {half:.4f})")
        lines.append(
            "source to axis, the orbit's row and tilts of the detector out of its plane are taken "
            "as given: opposite rays do not tell them"
        )
        return "\n".join(lines)

    def record(self) -> dict[str, Any]:
        """The calibration in words and numbers, as reports keep it."""
        return {
            "axis": self.axis.record(),
            "roll": None if self.roll is None else list(self.roll),
            "distance": None if self.distance is None else list(self.distance),
            "in_words": self.in_words(),
        }


def calibrate(
    projections: NDArray[np.float32],
    scan: Fan | Cone,
    *,
    distance: bool = False,
    device: Device | None = None,
) -> Calibration:
    """Find centre, sense of rotation, roll and detector distance of a scan from its data.

    Rays that measure the same line from both sides must agree. They tell the bin of the axis and
    the sense of rotation (as ``find_center`` does), the detector's roll in its plane, and the
    distance of the detector in bins, which is the scale of the fan angle. They do not tell the
    distance of the axis, since everything twice as large makes the same pictures, nor the orbit's
    row or tilts out of the detector's plane.

    Args:
        projections: line integrals, (view, bin) or (view, row, bin).
        scan: the geometry as far as it is known; a circular ``Cone`` whose orbit's row
            (``center[0]``) is right, or a ``Fan``.
        distance: whether the returned scan has the distance of the detector that the data tell.
            The distance of the axis stays, so that lengths change with the magnification.
        device: accepted as by every method; the fit runs on the host.

    Returns:
        The corrected scan and what was found.

    Raises:
        InputError: the data do not tell the axis, or the scan is neither a ``Fan`` nor a circular
            ``Cone``.
        ShapeError: the projections do not fit the scan.
        NonFiniteError: a sample is not finite.
    """
    axis = axis_of_scan(projections, scan)
    sign = -1.0 if axis.sense is not None and axis.sense.sign < 0 else 1.0
    right: Fan | Cone
    if isinstance(scan, Fan):
        right = replace(scan, angles=sign * scan.angles, center=axis.center)
    else:
        right = replace(scan, angles=sign * scan.angles, center=(scan.center[0], axis.center))
    stack = as_host_array(projections, np.shape(projections), name="projections", wants="calibrate")
    if isinstance(right, Fan):
        stack = stack if stack.ndim == 2 else stack[:, stack.shape[1] // 2]
        fit = fit_opposite_rays(stack[:, None], _one_row(right))
    else:
        fit = fit_opposite_rays(stack, right)
    roll = _told(fit.roll, fit.errors[1], _WIDEST_ROLL)
    share = _told(fit.distance, fit.errors[2], _WIDEST_DISTANCE)
    if distance and share is not None:
        right = replace(right, source_to_detector=right.source_to_detector * share[0])
    corrected: Fan | Cone | Vectors = right
    if isinstance(right, Cone) and not right.curved and roll is not None and abs(roll[0]) > roll[1]:
        corrected = rolled(right, roll[0])
    return Calibration(corrected, axis, roll, share, fit.disagreement)


def rolled(scan: Cone, angle: float) -> Vectors:
    """A flat cone whose detector is turned in its plane about the foot of the source.

    Args:
        scan: the cone with an upright detector.
        angle: in radians; positive where the axis is then seen at greater bins in greater rows.
    """
    upright = scan.vectors()
    cosine, sine = np.cos(angle), np.sin(angle)
    turn = scan.pitch[1] / scan.pitch[0]
    across = cosine * upright.across + sine * turn * upright.down
    down = cosine * upright.down - sine / turn * upright.across
    off = (np.array([scan.rows, scan.bins]) - 1) / 2 - scan.center
    foot = upright.middle - off[0] * upright.down - off[1] * upright.across
    middle = foot + off[0] * down + off[1] * across
    return Vectors(upright.source, middle, across, down, scan.rows, scan.bins)


def _one_row(fan: Fan) -> Cone:
    lengths = fan.pitch, fan.source_to_axis, fan.source_to_detector
    return Cone(fan.angles, 1, fan.bins, *lengths, (0.0, fan.center), curved=fan.curved)


def _told(value: float, error: float, widest: float) -> tuple[float, float] | None:
    half = _HALF_INTERVAL * float(error)
    return (value, half) if half <= widest else None
