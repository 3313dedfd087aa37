"""The options of ``rift fit --mode xray``, and which options have no meaning in which mode.

An option that is not heeded is a result that was not asked for: whatever is given and belongs to
the other mode is refused by name.
"""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass
from typing import Any, Literal

from rift_cl.cl.budget import parse_bytes
from rift_cl.errors import InputError
from rift_cl.io.scans.literals import AngleUnit, Kind

# What photographs alone know.
_LIGHT = (
    *("test", "light", "downscale", "frames", "sh_degree", "strategy", "absgrad", "first_splats"),
    *("refine_poses", "refine_exposures", "color_order", "activation", "angular", "modes"),
)


@dataclass(frozen=True, kw_only=True)
class XrayOptions:
    """Where the projections of a parallel-beam scan are and how they are read."""

    mode: Literal["light", "xray"] = "light"
    """Photographs that show surfaces (light), or a parallel-beam scan whose densities add up
    (xray): everything that 'rift reconstruct' reads."""
    dataset: str | None = None
    """X-rays: name of the projections in the file, where it is not the layout's own."""
    theta: str | None = None
    """X-rays: name of the angles in the file."""
    flats: str | None = None
    """X-rays: name of the frames without the sample; air or mean where there are none."""
    darks: str | None = None
    """X-rays: name of the frames without the beam."""
    image_key: str | None = None
    """X-rays: name of the array that says what each frame is, as in NXtomo."""
    kind: Kind | None = None
    """X-rays: what the values are: counts, transmission or attenuation."""
    axes: str | None = None
    """X-rays: which axis of the projections is which, such as angle,row,bin."""
    angle_unit: AngleUnit | None = None
    """X-rays: unit of the angles."""
    center: float | None = None
    """X-rays: detector bin of the rotation axis; found automatically when not given."""
    rows: tuple[int, int] | None = None
    """X-rays: first detector row, and the one after the last."""
    pitch: float | None = None
    """X-rays: distance between detector bins; the file's own, or 1 bin, when not given."""
    unit: str | None = None
    """X-rays: unit of the pitch, such as mm."""
    format: Literal["tiff", "zarr", "h5"] = "tiff"
    """X-rays: the slices as a folder of TIFF files, a Zarr store, or one HDF5 file."""
    memory: str | None = None
    """X-rays: most memory to use, such as 512M or 4G."""
    solve: int = 0
    """X-rays: steps between two solves of all densities, and their modes, by least squares, such as
    100; between them only places and shapes move. 0 for none."""

    def check_mode(self) -> None:
        """Refuse what has no meaning in this mode.

        Raises:
            InputError: an option of the other mode was given.
        """
        wrong = XRAY_ONLY if self.mode == "light" else _LIGHT
        given = next((name for name in wrong if self._given(name)), None)
        if given is None:
            return
        option = "--" + given.replace("_", "-")
        if self.mode == "light":
            raise InputError(f"{option} is for X-ray scans: add --mode xray, or leave it out")
        raise InputError(f"{option} has no meaning with --mode xray: leave it out")

    def budget(self) -> int | None:
        """Bytes that --memory allows; None where it was not given."""
        return None if self.memory is None else parse_bytes(self.memory)

    def _given(self, name: str) -> bool:
        field = next(field for field in dataclasses.fields(self) if field.name == name)
        found: Any = getattr(self, name)
        return bool(found != field.default)


XRAY_ONLY = tuple(f.name for f in dataclasses.fields(XrayOptions) if f.name != "mode")
