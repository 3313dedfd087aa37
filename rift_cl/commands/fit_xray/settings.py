"""The settings of ``rift fit xray``."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path
from typing import Annotated, ClassVar, Literal

from tyro.conf import Positional

from rift_cl.cl.budget import parse_bytes
from rift_cl.commands.fit.settings import USUAL_ORDER, FitSettings
from rift_cl.errors import InputError
from rift_cl.io.scans.literals import AngleUnit, Kind
from rift_cl.splat.settings import SplatSettings
from rift_cl.train.basis_settings import BasisSettings
from rift_cl.train.settings import TrainSettings
from rift_cl.train.xray.solve_settings import SolveSettings
from rift_cl.train.xray.trainer import RIDGE, xray_settings

# Steps that no fit will ever take, and that every counter still holds.
_MOST_STEPS = 2**62


@dataclass(frozen=True)
class FitXraySettings(FitSettings):
    """Fit Gaussian densities to the projections of a parallel-beam X-ray scan.

    Example: rift fit xray scan.h5 --out fit --steps 3000 --splats 20000
    """

    job: ClassVar[str] = "fit xray"

    capture: Annotated[Path, Positional]
    """The scan: every file or folder that 'rift reconstruct' reads."""
    dataset: str | None = None
    """Name of the projections in the file, where it is not the layout's own."""
    theta: str | None = None
    """Name of the angles in the file."""
    flats: str | None = None
    """Name of the frames without the sample; air or mean where there are none."""
    darks: str | None = None
    """Name of the frames without the beam."""
    image_key: str | None = None
    """Name of the array that says what each frame is, as in NXtomo."""
    kind: Kind | None = None
    """What the values are: counts, transmission or attenuation. Default: read from the file."""
    axes: str | None = None
    """Which axis of the projections is which, such as angle,row,bin."""
    angle_unit: AngleUnit | None = None
    """Unit of the angles. Default: the file's."""
    center: float | None = None
    """Detector bin of the rotation axis. Default: found automatically."""
    rows: tuple[int, int] | None = None
    """First detector row, and the one after the last. Default: all rows."""
    pitch: float | None = None
    """Distance between detector bins. Default: the file's own, or 1 bin."""
    unit: str | None = None
    """Unit of the pitch, such as mm. Default: the file's."""
    format: Literal["tiff", "zarr", "h5"] = "tiff"
    """Format of the slices: a folder of TIFF files, a Zarr store, or one HDF5 file."""
    memory: str | None = None
    """Maximum memory to use, such as 512M or 4G."""
    homogenise: float = 0.0
    """Exponent of the ramp that weighs the frequencies of the residual along the detector's rows,
    so that fine detail counts as much as coarse (0 = none)."""
    solve: int = 0
    """Steps between two least-squares solves for all densities and their modes, such as 100;
    between them only positions and shapes are optimized (0 = none)."""

    def check(self) -> None:
        """Check what neither the trainer nor the rasterizer does; see ``FitSettings``."""
        super().check()
        self._check_least("solve", 0)
        if self.solve > _MOST_STEPS:
            raise InputError(f"--solve is {self.solve}, wanted at most {_MOST_STEPS}")

    @property
    def exponent(self) -> float:
        """Exponent of the frequency weight.

        Long fits of X-rays gained nothing by one, and lost where there was noise.
        """
        return self.homogenise

    def budget(self) -> int | None:
        """Bytes that --memory allows; None where it was not given."""
        return None if self.memory is None else parse_bytes(self.memory)

    def training(self) -> TrainSettings:
        """The trainer's settings."""
        basis = BasisSettings()
        if self.basis != "gaussian":
            basis = BasisSettings(self.basis, USUAL_ORDER if self.order is None else self.order)
        return xray_settings(
            steps=self.steps,
            seed=self.seed,
            splats=self.splats,
            exponent=self.exponent,
            weight=self.homogenise_by,
            band_limit=self.band_limit,
            basis=replace(basis, ridge=RIDGE),
            solve=SolveSettings(self.solve),
        )

    def drawing(self) -> SplatSettings:
        """The rasterizer's settings."""
        return SplatSettings(eps2d=self.eps2d, mode="xray")
