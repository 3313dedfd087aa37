"""The settings of ``rift fit xray``."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated, ClassVar, Literal

from tyro.conf import Positional

from rift_cl.commands.fit.settings import FitOutput, FitSettings
from rift_cl.commands.options import RepeatableRun, check_tilt
from rift_cl.io.scans.literals import AngleUnit, Kind
from rift_cl.option_marks import Auto, AutoExpert, Expert, Short, ShortSplats
from rift_cl.splat.settings import SplatSettings
from rift_cl.train.settings import TrainSettings
from rift_cl.train.xray.settings import XrayBasisSettings, XrayTrainSettings


@dataclass(frozen=True, kw_only=True)
class XrayInput:
    """The scan, how it is read, and what of it is scored."""

    group: ClassVar[str] = "input"

    capture: Annotated[Path, Positional]
    """The scan: every file or folder that 'rift reconstruct' reads."""
    hold_out: int = 8
    """Hold out every Nth projection for evaluation (0 = none)."""
    views: int = 0
    """Train on this many projections, evenly spaced among those not held out (0 = all)."""
    dataset: Auto[str] = None
    """Name of the projections in the file. Default: that of the file's layout."""
    theta: Auto[str] = None
    """Name of the angles in the file. Default: that of the file's layout."""
    flats: Auto[str] = None
    """Name of the flat fields (no sample) in the file. Without flat fields, 'air' estimates the
    incident beam of each view from the outermost bins at both ends, which must see only air, 'mean'
    from the mean of the view. Default: that of the file's layout."""
    darks: Auto[str] = None
    """Name of the dark fields (no beam) in the file. Default: that of the file's layout."""
    image_key: AutoExpert[str] = None
    """Name of the array that says what each frame is, as in NXtomo. Default: that of the file's
    layout."""
    kind: Auto[Kind] = None
    """What the values are: counts, transmission or attenuation. Default: read from the file."""
    axes: AutoExpert[str] = None
    """Which axis of the projections is which, such as angle,row,bin. Default: read from the
    file."""
    angle_unit: AutoExpert[AngleUnit] = None
    """Unit of the angles. Default: read from the file."""
    geometry: Auto[Path] = None
    """File with the positions of source and detector for cone beams; see rift reconstruct. Default:
    that of the scan, otherwise parallel rays."""
    reversed: Expert[bool] = False
    """Negate the angles, for an object that turned in the other sense than assumed."""
    center: Auto[float] = None
    """Detector bin of the rotation axis. Default: found automatically; if the data of a cone do not
    tell it, that of the file, or the middle of the detector."""
    tilt: Auto[float] = None
    """Tilt of the rotation axis in the detector plane in degrees, positive where its bin grows with
    the row. Default: the tilt found with the axis if it moves the axis by a quarter of a bin or
    more and the rows agree on it, otherwise 0."""
    rows: Auto[tuple[int, int]] = None
    """First detector row, and the one after the last, of parallel beams. Default: all rows."""
    pitch: Auto[float] = None
    """Distance between detector bins of parallel beams, in --unit; that between rows is scaled
    alike, unless --row-pitch says it. Default: the file's own, or 1 bin."""
    row_pitch: AutoExpert[float] = None
    """Distance between detector rows of parallel beams, in --unit. Default: the file's own, or that
    between bins."""
    unit: Auto[str] = None
    """Unit of length of pitch, voxels and values: m, cm, mm, um, nm, pm, angstrom or inch. A file's
    lengths in another unit are converted to it. Default: the file's, or bin."""
    memory: Auto[str] = None
    """Maximum memory to use, such as 512M or 4G. Default: what is free."""


@dataclass(frozen=True, kw_only=True)
class XrayOutput(FitOutput):
    """What is written, and when."""

    group: ClassVar[str] = "output"

    format: Literal["tiff", "zarr", "h5"] = "tiff"
    """Format of the slices: a folder of TIFF files, a Zarr store, or one HDF5 file."""


def _training() -> XrayTrainSettings:
    """The trainer's defaults, with the choice left open that a fit makes."""
    return XrayTrainSettings(basis=XrayBasisSettings(order=None))


def _rendering() -> SplatSettings:
    """The rasterizer's defaults for densities, but less blur; see the help of eps2d."""
    return SplatSettings(eps2d=0.1, mode="xray")


@dataclass(frozen=True, kw_only=True)
class XrayTraining:
    """The optimization."""

    group: ClassVar[str] = "training"

    training: Short[TrainSettings] = field(default_factory=_training)
    """The optimization."""
    rendering: ShortSplats[SplatSettings] = field(default_factory=_rendering)
    """The rasterizer."""


@dataclass(frozen=True, kw_only=True)
class FitXraySettings(RepeatableRun, XrayOutput, XrayTraining, XrayInput, FitSettings):
    """Fit Gaussian densities to the projections of a parallel-beam or cone-beam X-ray scan.

    Example: rift fit xray scan.h5 --out fit --steps 3000 --splats 20000
    """

    job: ClassVar[str] = "fit xray"

    def check(self) -> None:
        """Check what neither the trainer nor the rasterizer does.

        Raises:
            InputError: a setting is out of its range, or has no meaning beside the others.
        """
        super().check()
        check_tilt(self.tilt)

    def budget(self) -> int | None:
        """Bytes that --memory allows; None where it was not given."""
        from rift_cl.cl.budget import parse_bytes

        return None if self.memory is None else parse_bytes(self.memory)
