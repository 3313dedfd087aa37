"""Small things in HDF5 datasets: angles, image keys, pixel sizes and their units."""

from __future__ import annotations

import math

import h5py
import numpy as np
from numpy.typing import NDArray

from rift_cl.errors import ShapeError
from rift_cl.geometry.length_units import length_of, length_unit
from rift_cl.io.boundary import check_claim, check_numeric
from rift_cl.io.hdf5_heaps import check_text_heap
from rift_cl.io.hdf5_tree import Hdf5Tree
from rift_cl.io.scans.angle_list import AngleList, stated_unit
from rift_cl.io.scans.axes import spelled
from rift_cl.io.scans.beam import PARALLEL_BELOW, Beam
from rift_cl.io.scans.scan_file import Pitches, usable_pitch

# Eight million frames: no scan has more, and a forged header may not ask for gigabytes.
_LONGEST_VECTOR = 64 << 20
# Bytes of a text that is a length, at most.
_LONGEST_TEXT = 1000


def numeric_shape(tree: Hdf5Tree, name: str) -> tuple[int, ...]:
    """Shape of a dataset that holds real numbers.

    Raises:
        FileFormatError: there is no such dataset.
        DTypeError: it does not hold real numbers.
        ShapeError: it is empty.
    """
    node = tree.dataset(name)
    check_numeric(tree.path, name, node.dtype)
    if node.shape is None or 0 in node.shape:
        raise ShapeError(f"{tree.path}: {name!r} has shape {node.shape}, it holds nothing")
    return tuple(int(n) for n in node.shape)


def read_vector(tree: Hdf5Tree, name: str) -> NDArray[np.float64]:
    """Read one number per frame; axes of length 1 are dropped.

    Raises:
        FileFormatError: there is no such dataset.
        DTypeError: it does not hold real numbers.
        ShapeError: it is no vector.
        ResourceLimitError: it claims to be far longer than any scan.
    """
    shape = numeric_shape(tree, name)
    size = math.prod(shape)
    if size != max(shape, default=1):
        raise ShapeError(f"{tree.path}: {name!r} has shape {shape}, wanted one number per frame")
    node = tree.dataset(name)
    chunk = math.prod(node.chunks) if node.chunks else 0
    check_claim(tree.path, f"{name!r}", 8 * max(size, chunk), _LONGEST_VECTOR)
    values = np.empty(shape, np.float64)
    node.read_direct(values)
    return values.reshape(size)


def read_length(tree: Hdf5Tree, name: str) -> tuple[float, str] | None:
    """The first number of a dataset and its unit, or None where there is no such dataset.

    A text is read as a number, with its unit behind it or as the attribute ``units``; the number is
    NaN where it is no such text.
    """
    if tree.find(name) is None:
        return None
    unit = unit_of(tree, name)
    if h5py.check_string_dtype(tree.dataset(name).dtype) is None:
        return float(read_vector(tree, name)[0]), unit
    value, own = length_of(_read_text(tree, name)) or (math.nan, "")
    return value, own or unit


def _read_text(tree: Hdf5Tree, name: str) -> str:
    """The text of a dataset, empty where it holds several or none, or is stored in chunks.

    Raises:
        FileFormatError: the heap that keeps it is damaged.
    """
    node = tree.dataset(name)
    if node.size != 1 or node.id.get_offset() is None or node.dtype.itemsize > _LONGEST_TEXT:
        return ""
    if h5py.check_string_dtype(node.dtype).length is None:
        check_text_heap(node)
    text = _decoded(np.asarray(node[()]).item())
    return text if len(text) <= _LONGEST_TEXT else ""


def read_pitches(
    row: tuple[float, str] | None, bin: tuple[float, str] | None
) -> tuple[Pitches, tuple[str, ...]]:
    """The sizes of a pixel along the rows and along the bins in one unit, and a note.

    Args:
        row: the first, with its unit; None where there is none.
        bin: the second.
    """
    if bin is None:
        return Pitches(), ()
    if usable_pitch(bin[0]) is None:
        return Pitches(), (
            f"The size of a pixel that the file tells, {bin[0]:g}, is no length: it is not used "
            "(--pitch).",
        )
    height = None if row is None else in_unit(row, bin[1])
    notes: tuple[str, ...] = ()
    if row is not None and height is None:
        notes = (
            f"The size of a pixel along the rows is in the unit {row[1]!r}, along the bins in "
            f"{bin[1]!r}, one of which is not known: pixels are taken to be square.",
        )
    return Pitches(height, bin[0], bin[1]).usable, notes


def read_beam(
    tree: Hdf5Tree, distances: tuple[str, str], pixels: tuple[tuple[float, str] | None, ...]
) -> tuple[Beam | None, tuple[str, ...]]:
    """Source and detector where a file tells their distances from the axis, and what is said of it.

    Args:
        tree: the file.
        distances: names of the distances of the source and of the detector from the axis.
        pixels: sizes of a detector pixel, along the rows and along the bins, with their units.

    Returns:
        None, and a note where there is one, of a source that is far away: its rays are parallel.
    """
    to_axis, beyond = (read_length(tree, name) for name in distances)
    row, bin = pixels
    if to_axis is None or beyond is None or bin is None:
        return None, ()
    unit = bin[1]
    lengths = [in_unit(length, unit) for length in (to_axis, beyond, row or bin, bin)]
    if any(value is None or not math.isfinite(value) for value in lengths) or not lengths[0]:
        return None, (
            "The distances of source and detector are in a unit that is not known, so that they "
            "are not used: rays are taken as parallel (--geometry).",
        )
    source, detector, pitch_row, pitch_bin = (abs(value or 0.0) for value in lengths)
    magnification = 1 + detector / source
    if magnification < PARALLEL_BELOW:
        return None, (
            f"The source is far away, magnification {magnification:.5g}: rays are taken as "
            "parallel (--geometry for a cone).",
        )
    return Beam(
        source_to_axis=source,
        source_to_detector=source + detector,
        pitch=(pitch_row, pitch_bin),
        unit=unit,
    ), ("The pixel size is taken to be that of the detector, not that at the object.",)


def in_unit(length: tuple[float, str], unit: str) -> float | None:
    """A length in another unit, as it is where neither is stated; None where one is unknown."""
    value, own = length
    if own == unit:
        return value
    one, other = length_unit(own), length_unit(unit)
    return None if one is None or other is None else value * one.metres / other.metres


def read_angles(tree: Hdf5Tree, name: str) -> AngleList:
    """Read angles, in the unit that the dataset's ``units`` state, else its name.

    Raises:
        FileFormatError: there is no such dataset, or its unit is unknown.
        InputError: it is no vector of numbers; see ``read_vector``.
    """
    unit = stated_unit(tree.path, name, unit_of(tree, name))
    return AngleList(name, read_vector(tree, name), unit=unit)


def axes_stated(tree: Hdf5Tree, name: str) -> str | None:
    """The letters of the axes that a dataset's attribute ``axes`` states, or None."""
    text = text_attribute(tree, name, "axes")
    # Data Exchange calls the frame axis of the projections theta.
    return spelled(text) if text else None


def unit_of(tree: Hdf5Tree, name: str) -> str:
    """The ``units`` attribute of a dataset, empty where it has none."""
    return text_attribute(tree, name, "units")


def text_attribute(tree: Hdf5Tree, name: str, key: str) -> str:
    """An attribute of a dataset that is a text, empty where it has none."""
    value = tree.dataset(name).attrs.get(key, "")
    return _decoded(value.item() if isinstance(value, np.ndarray) and value.size == 1 else value)


def _decoded(value: object) -> str:
    """A text as h5py gives it; empty where it is none."""
    if isinstance(value, bytes):
        value = value.decode(errors="replace")
    return value if isinstance(value, str) else ""
