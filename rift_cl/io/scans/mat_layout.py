"""What the arrays of a MAT file mean, whichever version of the format they are in.

MATLAB writes the axes of an array in its own order, and names are all there is to go by. Two
layouts are known: the Helsinki Tomography Challenge 2022 (fan beam; Meaney et al.,
doi:10.5281/zenodo.6984868) and the dendrites that come with ToMoBAR (D. Kazantsev). Everything
else is named by the caller. The readers of both versions give a table of arrays by name
(``MatFile``).
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from rift_cl.errors import DTypeError, FileFormatError, InputError, ShapeError
from rift_cl.geometry.fan import FanBeam
from rift_cl.io.boundary import HOW_TO_NAME
from rift_cl.io.scans.angle_list import AngleList, named_unit
from rift_cl.io.scans.frame_stack import FrameStack
from rift_cl.io.scans.named_arrays import Layout, layout_by_name
from rift_cl.io.scans.scan_file import RowSource, ScanRequest, usable_pitch

_LISTED = 8


class MatArray(Protocol):
    """An array of a MAT file."""

    @property
    def shape(self) -> tuple[int, ...]:
        """Its shape as MATLAB has it."""

    @property
    def dtype(self) -> str:
        """Type of the numbers as they are stored."""

    @property
    def real(self) -> bool:
        """It holds real numbers."""


class MatFile(Protocol):
    """The arrays of a MAT file by name; those inside structures as ``structure.field``."""

    path: Path

    @property
    def arrays(self) -> Mapping[str, MatArray]:
        """What there is."""

    def vector(self, name: str) -> NDArray[np.float64]:
        """The numbers of an array that has them in a row; ShapeError if it has not."""

    def text(self, name: str) -> str:
        """A short text, or nothing where the array is none."""


def contents(file: MatFile) -> str:
    """A phrase that lists the first arrays of numbers, the largest first, and how to name one."""
    found = [(name, array.shape) for name, array in file.arrays.items() if array.real]
    if not found:
        return "it holds no array of real numbers at all"
    found.sort(key=lambda one: -np.prod(one[1], dtype=float))
    listed = ", ".join(f"{name!r} {shape}" for name, shape in found[:_LISTED])
    more = ", ..." if len(found) > _LISTED else ""
    return f"it holds {listed}{more}: {HOW_TO_NAME}"


def array_of(file: MatFile, name: str) -> MatArray:
    """An array of real numbers.

    Raises:
        FileFormatError: there is no such array; the error lists those that there are.
        DTypeError: it does not hold real numbers.
    """
    array = file.arrays.get(name)
    if array is None:
        raise FileFormatError(f"{file.path}: has no array {name!r}; {contents(file)}")
    if not array.real:
        raise DTypeError(f"{file.path}: {name!r} does not hold real numbers")
    return array


# Bins at each end of the dendrites' detector that lie well outside the sample.
_DENDRITES_BACKGROUND = 20


@dataclass(frozen=True)
class MatStore:
    """The arrays of a MAT file (an ``ArrayStore``), with the axes in MATLAB's order.

    Args:
        file: the file.
        reader: gives what reads stacks of frames.
    """

    file: MatFile
    reader: Callable[[FrameStack, FrameStack | None, FrameStack | None], RowSource]

    @property
    def path(self) -> Path:
        """The file."""
        return self.file.path

    def __contains__(self, name: str) -> bool:
        return name in self.file.arrays

    def shape(self, name: str) -> tuple[int, ...]:
        """Shape of an array of real numbers."""
        shape = array_of(self.file, name).shape
        if 0 in shape:
            raise ShapeError(f"{self.path}: {name!r} has shape {shape}, it holds nothing")
        return shape

    def dtype(self, name: str) -> np.dtype[np.generic]:
        """Type of the numbers as they are stored."""
        return np.dtype(array_of(self.file, name).dtype)

    def vector(self, name: str) -> NDArray[np.float64]:
        """An array of one number per frame."""
        array_of(self.file, name)
        return self.file.vector(name)

    def angles(self, name: str) -> AngleList:
        """The angles in an array, in the unit that its name states."""
        return AngleList(name, self.vector(name), unit=named_unit(name.rsplit(".", maxsplit=1)[-1]))

    def unit(self, name: str) -> str:
        """Nothing: MAT states no units."""
        return ""

    def axes(self, name: str) -> str | None:
        """None: MAT states no axes."""
        return None

    def beside(self, name: str) -> list[str]:
        """Names of the arrays of numbers in the same structure."""
        structure = name.rpartition(".")[0]
        arrays = self.file.arrays.items()
        return [place for place, a in arrays if a.real and place.rpartition(".")[0] == structure]

    def contents(self) -> str:
        """A phrase that lists the first arrays of numbers."""
        return contents(self.file)

    def rows(
        self, projections: FrameStack, flats: FrameStack | None, darks: FrameStack | None
    ) -> RowSource:
        """What reads these stacks."""
        return self.reader(projections, flats, darks)


def find_layout(store: MatStore, request: ScanRequest) -> Layout:
    """Find the scan among the arrays of a file.

    Raises:
        FileFormatError: there is none that is known, and none was named.
        InputError: other reasons why the arrays cannot be used.
    """
    file = store.file
    challenges = [
        name.removesuffix(".sinogram")
        for name in file.arrays
        if name.endswith(".sinogram")
        and f"{name.removesuffix('.sinogram')}.parameters.angles" in file.arrays
    ]
    if request.dataset in challenges:
        challenges = [str(request.dataset)]
    elif request.dataset is not None:
        name = request.dataset
        return Layout(source=f"MAT, array {name}", projections=name, search=True)
    if len(challenges) > 1:
        listed = ", ".join(repr(name) for name in challenges)
        raise FileFormatError(
            f"{file.path}: holds several scans ({listed}); name one with dataset= (--dataset)"
        )
    if challenges:
        return _challenge(file, challenges[0])
    if "sinoRD" in file.arrays and "anglesRad" in file.arrays:
        return _dendrites(file)
    called = layout_by_name(store, "MAT", file.arrays)
    if called is None:
        raise FileFormatError(
            f"{file.path}: holds no layout of a scan that is known; {contents(file)}"
        )
    return called


def _challenge(file: MatFile, scan: str) -> Layout:
    about = f"{scan}.parameters."
    pitch = _number(file, f"{about}pixelSizePost")
    if pitch is None:
        pitch = _number(file, f"{about}pixelSize")
    to_axis = _number(file, f"{about}distanceSourceOrigin")
    to_detector = _number(file, f"{about}distanceSourceDetector")
    if pitch is None or to_axis is None or to_detector is None:
        raise FileFormatError(
            f"{file.path}: {scan!r} looks like a scan of the Helsinki Tomography Challenge, but "
            "lacks distanceSourceOrigin, distanceSourceDetector or a pixel size that is positive"
        )
    shape = array_of(file, f"{scan}.sinogram").shape
    try:
        fan = FanBeam(to_axis, to_detector, pitch, (shape[-1] - 1) / 2)
    except InputError as error:
        raise InputError(f"{file.path}: {scan!r} is no fan beam ({error})") from error
    return Layout(
        source=f"MAT, Helsinki Tomography Challenge {scan}",
        projections=f"{scan}.sinogram",
        theta=f"{about}angles",
        axes={2: "nb"},
        fixed=True,
        kind="attenuation",
        fan=fan,
        pitch=pitch,
        unit=file.text(f"{about}distanceUnit"),
    )


def _dendrites(file: MatFile) -> Layout:
    return Layout(
        source="MAT, ToMoBAR sinoRD",
        projections="sinoRD",
        theta="anglesRad",
        axes={2: "bn"},
        fixed=True,
        kind="attenuation",
        background=min(_DENDRITES_BACKGROUND, array_of(file, "sinoRD").shape[0] // 4),
    )


def _number(file: MatFile, name: str) -> float | None:
    array = file.arrays.get(name)
    if array is None or not array.real or np.prod(array.shape, dtype=float) != 1:
        return None
    return usable_pitch(float(file.vector(name)[0]))
