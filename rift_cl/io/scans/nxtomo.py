"""NXtomo: a NeXus group in which projections, flats and darks are frames of one array.

``instrument/detector/image_key`` says what each frame is: 0 a projection, 1 a flat, 2 a dark,
3 invalid. Source: the NXtomo application definition of the NeXus format.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from itertools import islice
from typing import Any

import h5py

from rift_cl.errors import FileFormatError, InputError
from rift_cl.io.hdf5_tree import Hdf5Tree
from rift_cl.io.scans.hdf5_values import (
    axes_stated,
    read_beam,
    read_length,
    read_pitches,
    text_attribute,
    unit_of,
)
from rift_cl.io.scans.named_arrays import Layout

_KEY = "instrument/detector/image_key"
_DATA = "instrument/detector/data"
_ANGLE = "sample/rotation_angle"
# Along the rows, and along the bins.
_PIXELS = ("instrument/detector/y_pixel_size", "instrument/detector/x_pixel_size")
# Of the source, which is negative by convention, and of the detector from the sample.
_DISTANCES = ("instrument/source/distance", "instrument/detector/distance")
# What says that frames are mirrored: truth values in the layout of nxtomo before version 1.3, and
# half turns of the detector since.
_MIRRORED = ("x_flipped", "y_flipped")
_TURNS, _MOST_TURNS, _HALF_TURN = "transformations", 20, 180.0
_DEEPEST = 2
_MOST_GROUPS = 500


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


def entry_of(tree: Hdf5Tree, dataset: str) -> str | None:
    """Name of the NXtomo group whose projections a dataset's name leads to, or None."""
    group = dataset.removesuffix(_DATA).rstrip("/")
    return group if dataset.endswith(_DATA) and _is_entry(tree, group) else None


def nxtomo_layout(tree: Hdf5Tree, group: str) -> Layout:
    """Where an NXtomo group keeps the parts of a scan.

    Raises:
        InputError: the pixel size is no number.
    """
    row, bin = (read_length(tree, f"{group}/{name}") for name in _PIXELS)
    pitches, doubts = read_pitches(row, bin)
    source, detector = (f"{group}/{name}" for name in _DISTANCES)
    beam, notes = read_beam(tree, (source, detector), (row, bin))
    return Layout(
        source=f"NXtomo {group or '/'}",
        projections=f"{group}/{_DATA}",
        theta=f"{group}/{_ANGLE}",
        image_key=f"{group}/{_KEY}",
        axes={2: "nb", 3: axes_stated(tree, f"{group}/{_DATA}") or "nrb"},
        beam=beam,
        notes=(*doubts, *notes, *_mirrored(tree, f"{group}/instrument/detector")),
        pitch=pitches.bin,
        row_pitch=pitches.row,
        unit=pitches.unit,
    )


def _mirrored(tree: Hdf5Tree, detector: str) -> tuple[str, ...]:
    """A doubt about frames that are said to be stored mirrored, which are taken as they are.

    ESRF's programs agree on what is mirrored, and not on what follows: nabu mirrors the slices of
    such a scan, and its stitching mirrors the frames, which turns slices by half a turn.
    """
    named = [name for name in _MIRRORED if _is_true(tree, f"{detector}/{name}")]
    turns = tree.find(f"{detector}/{_TURNS}")
    if isinstance(turns, h5py.Group):
        names = [f"{_TURNS}/{name}" for name in islice(turns, _MOST_TURNS)]
        named += [name for name in names if _is_half_turn(tree, f"{detector}/{name}")]
    if not named:
        return ()
    return (
        f"The file says that its frames are mirrored ({', '.join(map(repr, named))}), and they are "
        "taken as they are stored: slices may be turned by half a turn, mirrored (--reversed), or "
        "in the opposite order.",
    )


def _is_true(tree: Hdf5Tree, name: str) -> bool:
    node = _single(tree, name, "biu")
    return node is not None and bool(node)


def _is_half_turn(tree: Hdf5Tree, name: str) -> bool:
    angle = _single(tree, name, "iuf")
    if angle is None or text_attribute(tree, name, "transformation_type") != "rotation":
        return False
    degrees = math.degrees(angle) if unit_of(tree, name).startswith("rad") else angle
    return math.isclose(abs(degrees) % 360, _HALF_TURN, rel_tol=1e-3)


def _single(tree: Hdf5Tree, name: str, kinds: str) -> float | None:
    """The number of a dataset that holds one of certain kinds; None where there is none."""
    if not isinstance(tree.find(name), h5py.Dataset):
        return None
    node = tree.dataset(name)
    return float(node[()].item()) if node.size == 1 and node.dtype.kind in kinds else None


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
