"""From a scan in a file to projections that a method can take: what is mended, and what assumed.

Rows go through these steps, each of which is said in ``notes``: line integrals, background,
rings, fan to parallel, offset axis, continuation beyond the detector.
"""

from __future__ import annotations

import dataclasses

import numpy as np
from numpy.typing import NDArray

from rift_cl.cl.device import Device
from rift_cl.errors import InputError
from rift_cl.geometry import Parallel
from rift_cl.jobs.reconstruct_settings import ReconstructSettings
from rift_cl.jobs.scan_input import check_center, chosen_rows, read_attenuation
from rift_cl.reconstruct import Attenuation, find_center
from rift_cl.reconstruct.fan_rebin import covered_rays, rebin_fan
from rift_cl.reconstruct.offset_axis import (
    find_offset_center,
    is_full_turn,
    is_offset,
    widened,
)
from rift_cl.reconstruct.padding import extended, is_truncated
from rift_cl.reconstruct.rings import remove_rings

Floats = NDArray[np.float32]
# Stripes are told from the object where views go round so far: a flat face is a stripe in fewer.
_RINGS_FROM = np.deg2rad(150)
# A gap between directions that is worth a word, in mean steps and in radians.
_GAP_STEPS, _GAP = 2.0, np.deg2rad(5)
# An axis found this far from the detector's middle, as a share of its width, is an offset one.
_MIDDLE = 0.25
# The detector is continued by this share of its width on each side.
_PAD_SHARE = 2


class SliceInput:
    """The projections of some rows, as parallel ones about a known axis.

    Args:
        settings: where the scan is and what is to be done with it.
        device: where the rotation axis is looked for.

    Raises:
        RiftError: the scan cannot be read, or an option does not fit it.
    """

    def __init__(self, settings: ReconstructSettings, device: Device) -> None:
        self.settings, self.device = settings, device
        self.scan = settings.open_scan(fan=True)
        self.rows = chosen_rows(settings.rows, self.scan)
        check_center(settings.center, self.scan)
        self.fan = self.scan.fan
        if self.fan is not None:
            pitch = self.fan.pitch if settings.pitch is None else settings.pitch
            center = self.fan.center if settings.center is None else settings.center
            self.fan = dataclasses.replace(self.fan, pitch=pitch, center=center)
        pitch = (self.scan.pitch or 1.0) if settings.pitch is None else settings.pitch
        unit = self.scan.unit or ("bin" if pitch == 1.0 else "")
        self.unit = unit if settings.unit is None else settings.unit
        self._pitch = pitch
        self.center = settings.center
        self.pad = 0
        # (angle, bin) whether a ray was measured, where some were not.
        self.seen: NDArray[np.bool_] | None = None
        self._offset = False
        self.notes: list[str] = [*self.scan.notes]
        # Made now, so that a bad pitch or center is told before any work.
        self.geometry = self._parallel()
        self.rings = self._rings_wanted()

    @property
    def pitch(self) -> float:
        """Distance between parallel rays, at the rotation axis."""
        return self.geometry.pitch

    @property
    def bins(self) -> int:
        """Bins between the farther end of the detector and its mirror image, or the detector's."""
        if not self._offset:
            return self.geometry.bins
        return self.geometry.bins + int(np.ceil(abs(self.geometry.bins - 1 - 2 * self._axis)))

    @property
    def _axis(self) -> float:
        return self.geometry.center

    def locate(self) -> None:
        """Find the axis, and whether it is offset and the object wider than the detector.

        Looks at the middle row.

        Raises:
            InputError: the axis cannot be found.
        """
        middle = sum(self.rows) // 2
        row = self._mended(middle, middle + 1).projections
        if self.fan is None and self.center is None:
            self.center = self._find_center(np.ascontiguousarray(row[:, 0]))
            self.notes.append(f"The rotation axis was found at bin {self.center:.2f}.")
        self.geometry = self._parallel()
        self._offset = self.fan is None and is_offset(self.geometry)
        self._say_directions()
        if self.rings:
            self.notes.append("Stripes were taken out of the projections (rings).")
        if self.scan.background:
            self.notes.append(
                f"Air was brought to zero by the outermost {self.scan.background} bins of each end."
            )
        wide = self.settings.pad == "on"
        if self.settings.pad == "auto":
            wide = not self._offset and is_truncated(row)
        if wide:
            self.pad = max(1, self.scan.shape[2] // _PAD_SHARE)
            self.notes.append(
                "The object is wider than the detector, or was said to be: projections were "
                "continued smoothly beyond its ends, and what lies outside is a guess."
            )

    def identity(self) -> dict[str, str]:
        """The file and the axis, which decide the slices besides the settings."""
        path = self.scan.path
        return {
            "scan file": f"{path}, changed at {path.stat().st_mtime_ns}",
            "axis": repr(self.center),
        }

    def read(self, start: int, stop: int) -> Attenuation:
        """Parallel projections of some rows of the file, before a formula's weights and margins."""
        integrals = self._mended(start, stop)
        if self.fan is None:
            return integrals
        parallel, _ = rebin_fan(
            integrals.projections, self.scan.angles, self.fan, whole=not self.settings.iterative
        )
        return dataclasses.replace(integrals, projections=parallel)

    def for_formula(self, projections: Floats) -> tuple[Floats, Parallel]:
        """Projections as a backprojection wants them, and their geometry."""
        scan = self.geometry
        if self._offset:
            projections, scan = widened(projections, scan)
        if self.pad:
            projections, scan = extended(projections, scan, bins=self.pad)
        return np.ascontiguousarray(projections), scan

    def formula_geometry(self) -> Parallel:
        """What ``for_formula`` would say of the geometry."""
        return self.for_formula(np.zeros((1, 1, self.geometry.bins), np.float32))[1]

    def _mended(self, start: int, stop: int) -> Attenuation:
        integrals = read_attenuation(self.scan, start, stop)
        if not self.rings:
            return integrals
        return dataclasses.replace(integrals, projections=remove_rings(integrals.projections))

    def _parallel(self) -> Parallel:
        if self.fan is not None:
            whole = not self.settings.iterative
            bins = self.scan.shape[2]
            scan, rays = covered_rays(self.scan.angles, bins, self.fan, whole=whole)
            self.seen = None if rays.all() else rays
            return scan
        return Parallel(self.scan.angles, self.scan.shape[2], self._pitch, self.center)

    def _find_center(self, row: Floats) -> float:
        angles, bins = self.scan.angles, self.scan.shape[2]
        if is_full_turn(angles) and bins >= 4 * 8:
            found, _ = find_offset_center(row, angles)
            if abs(found - (bins - 1) / 2) > _MIDDLE * bins:
                return found
        return find_center(row, angles, device=self.device).center

    def _rings_wanted(self) -> bool:
        if self.settings.rings != "auto":
            return self.settings.rings == "on"
        counts = self.scan.kind == "transmission"
        return counts and bool(np.ptp(self.scan.angles) >= _RINGS_FROM)

    def _say_directions(self) -> None:
        """Note what was made of the angles."""
        angles = self.geometry.angles
        if self.fan is not None:
            self.notes.append(
                f"Fan-beam views were resampled to {len(angles)} parallel ones, over "
                f"{np.rad2deg(np.ptp(angles)):.1f} degrees."
            )
        if self._offset:
            self.notes.append(
                f"The axis, bin {self.geometry.center:.2f}, lies off the middle of the detector in "
                "a full turn: opposite views were joined, and slices reach to the farther end."
            )
        directions = np.sort(np.mod(angles, np.pi))
        gaps = np.diff(directions, append=directions[0] + np.pi)
        gap = float(gaps.max())
        if gap > max(_GAP_STEPS * np.pi / len(angles), _GAP):
            self.notes.append(
                f"No view looks along {np.rad2deg(gap):.0f} degrees of the half-circle: edges "
                "in these directions are blurred."
            )


def demand_window(roi: tuple[int, int, int, int], size: int) -> None:
    """Make sure that a part of a slice is inside it.

    Raises:
        InputError: it is not.
    """
    left, right, top, bottom = roi
    if not (0 <= left < right <= size and 0 <= top < bottom <= size):
        raise InputError(
            f"--roi is {left} {right} {top} {bottom}, the slice has the columns and lines 0 to "
            f"{size}: give the first column and the one after the last, then the same of lines"
        )
