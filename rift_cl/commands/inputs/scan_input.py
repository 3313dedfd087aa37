"""A scan as the commands take it: a file, what its arrays are called, and how to read its rows.

What the methods need is imported by them, so that a command's help loads no reader and no device.
"""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, ClassVar

from tyro.conf import Positional

from rift_cl.errors import InputError
from rift_cl.io.scans.literals import AngleUnit, Kind
from rift_cl.option_marks import Auto, AutoExpert, Expert

if TYPE_CHECKING:
    from rift_cl.io.scans.scan_file import ScanFile


@dataclass(frozen=True, kw_only=True)
class ScanArrays:
    """Which arrays of a file are a scan's, and what their values are."""

    dataset: Auto[str] = None
    """Name of the projections in the file. Default: that of the file's layout."""
    theta: Auto[str] = None
    """Angles: their name in the file, a file of them (.txt, .csv, .npy; FILE.csv:COLUMN for a
    column of a table), or a range in degrees that is divided evenly, such as 0:180 (its end
    excluded) or 0:180:endpoint. Default: those of the file."""
    flats: Auto[str] = None
    """Flat fields (beam without sample): their name in the file; for TIFF, their folder or file;
    for NPY, their file; for HDF5 also FILE.h5:/name, or FILE.h5 if one array alone fits. For counts
    without flat fields, 'air' estimates the incident beam of each view from the outermost bins at
    both ends, which must see only air, 'mean' from the mean of the view."""
    darks: Auto[str] = None
    """Dark fields (no beam): their name in the file, or as for --flats another file or folder."""
    kind: Auto[Kind] = None
    """What the values are: detector counts, transmission (counts divided by those of the beam), or
    attenuation (line integrals). Default: inferred from flat fields, names, units and values."""
    image_key: AutoExpert[str] = None
    """Name of the array that tells what each frame is: 0 projection, 1 flat, 2 dark, 3 invalid.
    Default: that of an NXtomo file."""
    axes: AutoExpert[str] = None
    """Order of the axes of the projections: angle,row,bin, or row,angle,bin for sinograms;
    angle,bin or bin,angle for a single sinogram; angle,bin,row if the rotation axis lies along the
    images' rows. Default: inferred from the number of angles."""
    angle_unit: AutoExpert[AngleUnit] = None
    """Unit of the angles. Default: that of the file, checked against their range."""
    geometry: Auto[Path] = None
    """File with the positions of source and detector for fan and cone beams: Nikon .xtekct, SkyScan
    .log, RTK .xml, ASTRA vectors (.geom, .npy, .txt; 12 numbers per view), or .yaml or .json as in
    docs/how-to/scan_cones.md. Default: that of the scan, otherwise parallel rays."""
    reversed: Expert[bool] = False
    """Negate the angles, for an object that turned in the other sense than assumed (see
    docs/reference/conventions.md); a wrong sense doubles edges in fan and cone beams, and mirrors
    the slices of parallel beams, whose data do not show it."""
    repeat: AutoExpert[int] = None
    """For a sample that is symmetric about the axis: number of views over a full turn that its one
    TIFF image is taken for. Default: every image is one view."""
    background: AutoExpert[int] = None
    """For line integrals that are not zero in air: number of bins at each end of the detector whose
    mean is subtracted from every view. Default: what the file's layout says, usually 0."""

    def open_file(self, path: Path, *, values: bool = True, budget: int | None = None) -> ScanFile:
        """The description of a file, read as the options say.

        Args:
            path: the file or the folder.
            values: as for ``rift_cl.open_scan``.
            budget: bytes that one reading may take.

        Raises:
            InputError: it cannot be read so, or the background is wider than the detector.
        """
        from rift_cl.io.scans.formats import open_scan

        scan = open_scan(
            path,
            dataset=self.dataset,
            theta=self.theta,
            flats=self.flats,
            darks=self.darks,
            image_key=self.image_key,
            kind=self.kind,
            axes=self.axes,
            angle_unit=self.angle_unit,
            geometry=self.geometry,
            reversed=self.reversed,
            repeat=self.repeat,
            values=values,
            budget=budget,
        )
        if self.background is None:
            return scan
        if not 0 <= 2 * self.background <= scan.shape[2]:
            raise InputError(
                f"--background is {self.background}, wanted 0 to {scan.shape[2] // 2} bins at each "
                "end of the detector"
            )
        return dataclasses.replace(scan, background=self.background)


@dataclass(frozen=True)
class ScanInput(ScanArrays):
    """The scan, and how to read it."""

    group: ClassVar[str] = "input"

    scan: Annotated[Path, Positional]
    """HDF5 (Data Exchange, NXtomo, or any named dataset), NPZ, NPY, MAT, MRC, TXRM or TIFF file,
    folder of TIFF files, or a file that describes one: a scanner's .xtekct or .log, or .yaml or
    .json as in docs/how-to/scan_cones.md."""
    memory: Auto[str] = None
    """Maximum memory to use, such as 512M or 4G. Default: a share of what is free."""

    @property
    def memory_limit(self) -> int | None:
        """``--memory`` in bytes; None if not given."""
        from rift_cl.cl.budget import parse_bytes

        return None if self.memory is None else parse_bytes(self.memory)

    def open_scan(self, *, fan: bool = False) -> ScanFile:
        """The file's description.

        Args:
            fan: whether fan-beam and cone-beam scans are accepted.

        Raises:
            InputError: it is one of these and they are not accepted, or the background is wider
                than the detector.
        """
        scan = self.open_file(self.scan, budget=self.memory_limit)
        if not (fan or (scan.fan is None and scan.cone is None)):
            beam = "fan" if scan.cone is None else "cone"
            raise InputError(
                f"{scan.path}: is a {beam}-beam scan, this command takes parallel beams; "
                "'rift reconstruct' takes both"
            )
        return scan
