"""The projections of a fit to X-rays: read, corrected, in one scale, as orthographic views.

A fit works in lengths of detector bins and in shares of the strongest line integrals, so that its
rates and its noise mean the same for every scan; ``scene_of`` gives the scan's units back.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rift_cl.cl.device import Device
from rift_cl.commands.fit_photos.pictures import Light
from rift_cl.commands.fit_xray.settings import FitXraySettings
from rift_cl.commands.inputs.scan_axis import find_axis
from rift_cl.commands.inputs.scan_input import ScanInput
from rift_cl.commands.inputs.scan_rows import (
    check_center,
    chosen_rows,
    read_attenuation,
)
from rift_cl.errors import InputError
from rift_cl.geometry import Camera, Grid, Parallel
from rift_cl.io.boundary import check_claim
from rift_cl.io.scans.scan_file import ScanFile

# Line integrals are measured by the value that this share of them stays below.
_STRONG = 0.999
# Volumes of float64 that start, slices and scores take together, and stacks of projections.
_VOLUMES, _STACKS = 5, 5
# Stacks of float64 of the views that densities are solved for.
_SOLVED = 6

Floats = NDArray[np.float32]


class XrayInput:
    """A scan that a fit will read.

    Args:
        settings: where it is and how it is read.
        device: where the rotation axis is looked for.

    Raises:
        RiftError: the scan cannot be read, or an option does not fit it.
    """

    def __init__(self, settings: FitXraySettings, device: Device) -> None:
        self.source = ScanInput(
            settings.capture,
            dataset=settings.dataset,
            theta=settings.theta,
            flats=settings.flats,
            darks=settings.darks,
            image_key=settings.image_key,
            kind=settings.kind,
            axes=settings.axes,
            angle_unit=settings.angle_unit,
            memory=settings.memory,
        )
        self.scan: ScanFile = self.source.open_scan()
        self.device = device
        self.rows = chosen_rows(settings.rows, self.scan)
        check_center(settings.center, self.scan)
        self.center = settings.center
        solve = settings.training.solve
        self._solved = solve.views if solve.every else 0
        self.pitch = (self.scan.pitch or 1.0) if settings.pitch is None else settings.pitch
        self.unit = settings.unit or self.scan.unit or ("bin" if self.pitch == 1.0 else "")
        # Made now, so that a bad pitch is told before any work.
        Parallel(self.scan.angles, self.scan.shape[2], self.pitch, self.center)
        check_claim(self.scan.path, "a fit of these rows", self.need, settings.budget())

    @property
    def need(self) -> int:
        """Bytes of host memory that a fit takes."""
        views, _, bins = self.scan.shape
        each = 8 * _VOLUMES * bins * bins + 4 * _STACKS * views * bins
        each += 8 * _SOLVED * min(self._solved, views) * bins
        return each * (self.rows[1] - self.rows[0])

    def read(self) -> Projections:
        """All line integrals, and the rotation axis.

        Raises:
            InputError: nothing is attenuated.
        """
        integrals = read_attenuation(self.scan, *self.rows).projections
        center = self.center
        if center is None:
            center = find_axis(self.scan, self.device).center
        scale = float(np.quantile(integrals, _STRONG))
        if scale <= 0:
            raise InputError(
                f"{self.scan.path}: the line integrals are {scale:g} at most, wanted some above 0: "
                "there is nothing to fit"
            )
        values = integrals / np.float32(scale)
        return Projections(np.asarray(self.scan.angles), values, float(center), scale)


@dataclass(frozen=True)
class Projections:
    """Line integrals of a parallel beam.

    Args:
        angles: (V,) in radians.
        values: (V, rows, bins), times ``scale`` the line integrals.
        center: bin of the rotation axis.
        scale: what a value of one stands for.
    """

    angles: NDArray[np.float64]
    values: Floats
    center: float
    scale: float

    def of(self, numbers: Sequence[int]) -> Projections:
        """Some of the views."""
        chosen = list(numbers)
        return Projections(self.angles[chosen], self.values[chosen], self.center, self.scale)

    @property
    def grid(self) -> Grid:
        """The voxels of a reconstruction: a slice for each row, as wide as the detector."""
        _, rows, bins = self.values.shape
        return Grid((rows, bins, bins))

    @property
    def geometry(self) -> Parallel:
        """The rays, in lengths of bins."""
        return Parallel(self.angles, self.values.shape[2], 1.0, self.center)

    @property
    def reach(self) -> float:
        """Distance from the rotation axis to the farther end of the detector, in bins."""
        return float(max(self.center + 0.5, self.values.shape[2] - 0.5 - self.center))

    def cameras(self) -> list[Camera]:
        """Every view as an orthographic camera: x along the detector, y along the rotation axis."""
        _, rows, bins = self.values.shape
        K = [[1, 0, self.center + 0.5], [0, 1, rows / 2], [0, 0, 1]]
        cameras = []
        for cos, sin in zip(np.cos(self.angles), np.sin(self.angles), strict=True):
            view = np.eye(4)
            view[:3, :3] = [[cos, sin, 0], [0, 0, 1], [sin, -cos, 0]]
            # All that any view sees lies before it.
            view[2, 3] = 2 * self.reach
            cameras.append(Camera((rows, bins), K, view, "ortho"))
        return cameras


class XrayPictures:
    """Training views; see ``rift_cl.train.TrainingViews``.

    Args:
        device: where projections are sent.
        projections: the views.
    """

    light: Light = "display"

    def __init__(self, device: Device, projections: Projections) -> None:
        self.device = device
        self.projections = projections
        self.cameras: Sequence[Camera] = projections.cameras()
        self.behind: Floats = np.zeros(3, np.float32)

    def begin(self, step: int) -> None:
        """Nothing depends on the step."""

    def target(self, number: int) -> Any:
        """(rows, bins, 1) line integrals on the device."""
        return self.device.array(np.ascontiguousarray(self.projections.values[number][..., None]))

    def weights(self, number: int) -> Any:
        """None: every ray counts."""
        return None

    def background(self, number: int) -> Any:
        """None: there is nothing behind X-rays."""
        return None
