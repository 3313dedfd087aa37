"""A scan as the commands take it: a file, what to call its arrays, and how to read its rows.

What the methods need is imported by them, so that a command's help loads no reader and no device.
"""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from tyro.conf import Positional

from rift_cl.errors import InputError
from rift_cl.io.scans.literals import AngleUnit, Kind

if TYPE_CHECKING:
    from rift_cl.cl.device import Device
    from rift_cl.io.scans.scan_file import ScanFile


@dataclass(frozen=True)
class ScanInput:
    """Where a scan is and how to read it."""

    scan: Annotated[Path, Positional]
    """HDF5 (Data Exchange, NXtomo, or any named dataset), NPZ, MAT or TIFF file, or a folder of
    TIFF files."""
    dataset: str | None = None
    """Name of the projections in the file, where it is not the layout's own."""
    theta: str | None = None
    """Name of the angles in the file; or a file of angles (.txt, .csv, .npy); or a turn in degrees
    that is evenly divided, 0:180 or 360, its end left out."""
    flats: str | None = None
    """Name of the frames without the sample; for TIFF, their folder or file. For counts without
    any: 'air' takes the beam of every view from the outermost bins at both ends of the detector,
    which must see nothing but air; 'mean' takes it to be the mean of the view."""
    darks: str | None = None
    """Name of the frames without the beam; for TIFF, their folder or file."""
    image_key: str | None = None
    """Name of the array that says what each frame is: 0 a projection, 1 a flat, 2 a dark, 3
    invalid; NXtomo's own if not given."""
    kind: Kind | None = None
    """What the values are: counts of a detector, transmission (counts divided by those of the
    beam), or attenuation (line integrals); told by flats, names, units and values if not given."""
    axes: str | None = None
    """Which axis of the projections is which, in the file's order: angle,row,bin, or
    row,angle,bin for sinograms; of a single sinogram angle,bin or bin,angle. Told by the number of
    angles if not given."""
    angle_unit: AngleUnit | None = None
    """Unit of the angles; what the file says, checked against their span, if not given."""
    device: str | None = None
    """Device to use: its number, cpu, gpu, or a part of its name; see 'rift devices'."""
    memory: str | None = None
    """Most memory to use, such as 512M or 4G."""
    background: int | None = None
    """For line integrals that are not zero in air: bins at each end of the detector, beyond the
    object, whose mean is subtracted from every view; what the file's layout says if not given."""

    def open_device(self) -> Device:
        """The chosen device."""
        from rift_cl.cl.discovery import open_device

        return open_device(self.device, self._memory_limit())

    def open_scan(self, *, fan: bool = False) -> ScanFile:
        """The file's description.

        Args:
            fan: whether the rays may be those of a fan beam.

        Raises:
            InputError: they are and may not be, or the background is wider than the detector.
        """
        from rift_cl.io.scans.formats import open_scan

        scan = open_scan(
            self.scan,
            dataset=self.dataset,
            theta=self.theta,
            flats=self.flats,
            darks=self.darks,
            image_key=self.image_key,
            kind=self.kind,
            axes=self.axes,
            angle_unit=self.angle_unit,
            budget=self._memory_limit(),
        )
        if scan.fan is not None and not fan:
            raise InputError(
                f"{scan.path}: its rays are those of a fan beam, this command takes parallel ones; "
                "'rift reconstruct' takes both"
            )
        if self.background is None:
            return scan
        if not 0 <= 2 * self.background <= scan.shape[2]:
            raise InputError(
                f"--background is {self.background}, wanted 0 to {scan.shape[2] // 2}: so many "
                "bins at each end of the detector"
            )
        return dataclasses.replace(scan, background=self.background)

    def _memory_limit(self) -> int | None:
        """``--memory`` in bytes; None if not given."""
        from rift_cl.cl.budget import parse_bytes

        return None if self.memory is None else parse_bytes(self.memory)
