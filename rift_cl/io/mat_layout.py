"""What the arrays of a MAT file mean, whichever version of the format they are in.

MATLAB writes the axes of an array in its own order, and names are all there is to go by. Two
layouts are known: the Helsinki Tomography Challenge 2022 (fan beam; Meaney et al.,
doi:10.5281/zenodo.6984868) and the dendrites that come with ToMoBAR (D. Kazantsev). Everything
else is named by the caller.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from rift_cl.errors import FileFormatError, InputError, ShapeError
from rift_cl.geometry.fan import FanBeam
from rift_cl.io import angle_list
from rift_cl.io.mat_file import MatFile, MatStack, array_of, contents
from rift_cl.io.scan_file import ArrayNames, Kind, check_angles, usable_pitch

# Bins at each end of the dendrites' detector that lie well outside the sample.
_DENDRITES_BACKGROUND = 20


@dataclass(frozen=True, eq=False, kw_only=True)
class MatLayout:
    """Which arrays of a file are a scan; as in ``ScanFile`` where the names agree."""

    projections: MatStack
    angles: NDArray[np.float64]
    source: str
    flats: MatStack | None = None
    darks: MatStack | None = None
    fan: FanBeam | None = None
    unit: str = ""
    background: int = 0
    notes: tuple[str, ...] = ()

    @property
    def kind(self) -> Kind:
        """Counts have flats."""
        return "attenuation" if self.flats is None else "transmission"


def find_layout(file: MatFile, names: ArrayNames) -> MatLayout:
    """Find the scan among the arrays of a file.

    Raises:
        FileFormatError: there is none that is known, and none was named.
        InputError: other reasons why the arrays cannot be used.
    """
    challenges = [
        name.removesuffix(".sinogram")
        for name in file.arrays
        if name.endswith(".sinogram")
        and f"{name.removesuffix('.sinogram')}.parameters.angles" in file.arrays
    ]
    if names.dataset in challenges:
        challenges = [names.dataset]
    elif names.dataset is not None:
        return _named(file, names.dataset, names)
    if len(challenges) > 1:
        listed = ", ".join(repr(name) for name in challenges)
        raise FileFormatError(
            f"{file.path}: holds several scans ({listed}); name one with dataset= (--dataset)"
        )
    if challenges:
        return _challenge(file, challenges[0], names)
    if "sinoRD" in file.arrays and "anglesRad" in file.arrays:
        return _dendrites(file, names)
    raise FileFormatError(f"{file.path}: holds no layout of a scan that is known; {contents(file)}")


def _challenge(file: MatFile, scan: str, names: ArrayNames) -> MatLayout:
    about = f"{scan}.parameters."
    projections, angles, notes = _views(
        file, f"{scan}.sinogram", names.theta or f"{about}angles", flat="nb"
    )
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
    try:
        fan = FanBeam(to_axis, to_detector, pitch, (projections.size("b") - 1) / 2)
    except InputError as error:
        raise InputError(f"{file.path}: {scan!r} is no fan beam ({error})") from error
    return MatLayout(
        projections=projections,
        angles=angles,
        source=f"MAT, Helsinki Tomography Challenge {scan}",
        fan=fan,
        unit=file.text(f"{about}distanceUnit"),
        notes=notes,
    )


def _dendrites(file: MatFile, names: ArrayNames) -> MatLayout:
    projections, angles, notes = _views(file, "sinoRD", names.theta or "anglesRad", flat="bn")
    bins = min(_DENDRITES_BACKGROUND, projections.size("b") // 4)
    return MatLayout(
        projections=projections,
        angles=angles,
        source="MAT, ToMoBAR sinoRD",
        background=bins,
        notes=notes,
    )


def _named(file: MatFile, dataset: str, names: ArrayNames) -> MatLayout:
    if names.theta is None:
        raise FileFormatError(
            f"{file.path}: the angles of {dataset!r} are not known; name them with theta= "
            f"(--theta); {contents(file)}"
        )
    projections, angles, notes = _views(file, dataset, names.theta)
    return MatLayout(
        projections=projections,
        angles=angles,
        source=f"MAT, array {dataset}",
        flats=_calibration(file, names.flats, projections) if names.flats else None,
        darks=_calibration(file, names.darks, projections) if names.darks else None,
        notes=notes,
    )


def _views(
    file: MatFile, name: str, theta: str, *, flat: str | None = None
) -> tuple[MatStack, NDArray[np.float64], tuple[str, ...]]:
    """The projections and their angles, and what was assumed about them.

    Args:
        file: the file.
        name: the projections.
        theta: the angles.
        flat: axes of a sinogram; where they are not known, the number of angles tells.
    """
    shape = array_of(file, name).shape
    if len(shape) not in (2, 3) or 0 in shape:
        raise ShapeError(
            f"{file.path}: {name!r} has shape {shape}, wanted (angle, row, bin) or (angle, bin)"
        )
    given = file.arrays.get(theta)
    turned = given is not None and shape[1] == np.prod(given.shape, dtype=float) != shape[0]
    axes = "nrb" if len(shape) == 3 else flat or ("bn" if turned else "nb")
    stack = MatStack(name, shape, axes)
    angles, notes = _angles(file, theta, stack.size("n"))
    if axes == "nb" and flat is None and given is None:
        notes += (
            f"Array {name!r} {shape} is taken as (angle, bin); if it is (bin, angle), name an "
            "array of its angles.",
        )
    if stack.axes == "bn" and flat is None:
        notes += (f"Array {name!r} {shape} is (bin, angle), as there are {angles.size} angles.",)
    return stack, angles, notes


def _angles(file: MatFile, theta: str, count: int) -> tuple[NDArray[np.float64], tuple[str, ...]]:
    if theta not in file.arrays:
        angles = angle_list.given_angles(theta, count)
        if angles is not None:
            return angles, angle_list.unit_note(angles)
    array_of(file, theta)
    values = file.vector(theta)
    if "rad" in theta.rsplit(".", maxsplit=1)[-1].lower():
        return check_angles(file.path, theta, values, projections=count), ()
    angles = check_angles(file.path, theta, np.deg2rad(values), projections=count)
    return angles, angle_list.unit_note(angles)


def _calibration(file: MatFile, name: str, projections: MatStack) -> MatStack:
    """Frames like the projections, or a single one of them without the axis of frames."""
    shape, axes = array_of(file, name).shape, projections.axes
    stack = MatStack(name, shape, axes if len(shape) == len(axes) else axes.replace("n", ""))
    agree = len(stack.axes) == len(shape) and all(
        stack.size(axis) == projections.size(axis) for axis in "rb"
    )
    if not agree or 0 in shape:
        raise ShapeError(
            f"{file.path}: {name!r} has shape {shape}, the projections {projections.name!r} have "
            f"{projections.shape}: rows and bins must agree"
        )
    return stack


def _number(file: MatFile, name: str) -> float | None:
    array = file.arrays.get(name)
    if array is None or not array.real or np.prod(array.shape, dtype=float) != 1:
        return None
    return usable_pitch(float(file.vector(name)[0]))
