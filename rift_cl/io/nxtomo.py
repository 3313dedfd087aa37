"""NXtomo: a NeXus group in which projections, flats and darks are frames of one array.

``instrument/detector/image_key`` says what each frame is: 0 a projection, 1 a flat, 2 a dark,
3 invalid. Source: the NXtomo application definition of the NeXus format.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import Any

import h5py
import numpy as np
from numpy.typing import NDArray

from rift_cl.errors import FileFormatError, InputError, ShapeError
from rift_cl.io.hdf5_frames import FrameStack, calibration_stack, projection_stack, runs_of
from rift_cl.io.hdf5_tree import Hdf5Tree
from rift_cl.io.hdf5_values import read_angles, read_length, read_vector
from rift_cl.io.scan_file import ArrayNames, check_angles, usable_pitch

_KEY = "instrument/detector/image_key"
_DATA = "instrument/detector/data"
_ANGLE = "sample/rotation_angle"
_PIXEL = "instrument/detector/x_pixel_size"
_DEEPEST = 2
_MOST_GROUPS = 500


@dataclass(frozen=True, eq=False)
class TomoEntry:
    """What one NXtomo group holds.

    Args:
        group: name of the group.
        projections: frames of the sample.
        flats: frames without the sample, or None.
        darks: frames without the beam, or None.
        angles: direction of each projection in radians.
        pitch: pixel size, or None.
        unit: unit of ``pitch``.
    """

    group: str
    projections: FrameStack
    flats: FrameStack | None
    darks: FrameStack | None
    angles: NDArray[np.float64]
    pitch: float | None
    unit: str


def find_entry(tree: Hdf5Tree, within: str) -> str | None:
    """Name of the one NXtomo group in a group, at most two levels down, or None.

    Raises:
        FileFormatError: there are several.
        PathEscapeError: there is none, but a link leads outside the file's folder.
    """
    found: dict[Any, str] = {}
    blocked: InputError | None = None
    for name in _groups(tree, within):
        try:
            if _is_entry(tree, name):
                found.setdefault(_address(tree, name), name)
        except InputError as error:
            blocked = error
    if len(found) > 1:
        names = ", ".join(repr(name or "/") for name in found.values())
        raise FileFormatError(
            f"{tree.path}: holds several NXtomo scans ({names}); name one with dataset= (--dataset)"
        )
    if blocked and not found:
        raise blocked
    return next(iter(found.values()), None)


def read_entry(tree: Hdf5Tree, group: str, names: ArrayNames) -> TomoEntry:
    """Sort the frames of an NXtomo group by their image key.

    Raises:
        FileFormatError: part of the group is missing, or no frame is a projection.
        ShapeError: the numbers of frames, keys and angles differ.
        InputError: other reasons why the arrays cannot be used.
    """
    frames = projection_stack(tree, f"{group}/{_DATA}")
    keys = read_vector(tree, f"{group}/{_KEY}")
    if keys.size != frames.frames:
        raise ShapeError(
            f"{tree.path}: {group or '/'!r} has {keys.size} image keys for {frames.frames} frames"
        )
    projections = _select(frames, keys, 0)
    if projections is None:
        raise FileFormatError(
            f"{tree.path}: no frame of {group or '/'!r} has image key 0, a projection"
        )
    pixel, unit = read_length(tree, f"{group}/{_PIXEL}") or (0.0, "")
    return TomoEntry(
        group,
        projections,
        _calibration(tree, frames, _select(frames, keys, 1), names.flats),
        _calibration(tree, frames, _select(frames, keys, 2), names.darks),
        _angles(tree, names.theta or f"{group}/{_ANGLE}", keys),
        usable_pitch(pixel),
        unit,
    )


def _calibration(
    tree: Hdf5Tree, frames: FrameStack, keyed: FrameStack | None, name: str | None
) -> FrameStack | None:
    return keyed if name is None else calibration_stack(tree, name, frames)


def _select(frames: FrameStack, keys: NDArray[np.float64], key: int) -> FrameStack | None:
    runs = runs_of(np.flatnonzero(keys == key))
    return replace(frames, runs=runs) if runs else None


def _angles(tree: Hdf5Tree, name: str, keys: NDArray[np.float64]) -> NDArray[np.float64]:
    angles = read_angles(tree, name)
    if angles.size == keys.size:
        angles = angles[keys == 0]
    return check_angles(tree.path, name, angles, projections=int(np.count_nonzero(keys == 0)))


def _groups(tree: Hdf5Tree, top: str) -> Iterator[str]:
    level = [top.rstrip("/")]
    left = _MOST_GROUPS
    for _ in range(_DEEPEST + 1):
        level, above = [], level[:left]
        left -= len(above)
        for name in above:
            yield name
            level += _children(tree, name)


def _children(tree: Hdf5Tree, name: str) -> list[str]:
    # A link that leads astray hides a group; it need not be the one that is wanted.
    try:
        node = tree.find(name or "/")
    except InputError:
        return []
    return [f"{name}/{child}" for child in node] if isinstance(node, h5py.Group) else []


def _is_entry(tree: Hdf5Tree, group: str) -> bool:
    nodes = (tree.find(f"{group}/{name}") for name in (_KEY, _DATA))
    return all(isinstance(node, h5py.Dataset) for node in nodes)


def _address(tree: Hdf5Tree, group: str) -> Any:
    node = tree.find(f"{group}/{_DATA}")
    return node.file.filename, h5py.h5o.get_info(node.id).addr
