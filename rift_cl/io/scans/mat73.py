"""MATLAB's files of version 7.3, which are HDF5 with the axes in the opposite order.

They are read by the same guarded tree as every HDF5 file; a structure is a group, and what an
array is for MATLAB stands in its attribute ``MATLAB_class``.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import h5py
import numpy as np
from numpy.typing import NDArray

from rift_cl.errors import FileFormatError
from rift_cl.io.hdf5_tree import Hdf5Tree
from rift_cl.io.scans.frame_stack import FrameStack
from rift_cl.io.scans.hdf5_values import read_vector

_DEEPEST = 8
_MOST_ARRAYS = 4096
_LONGEST_TEXT = 1 << 16
_NO_NUMBERS = ("char", "logical", "cell", "struct", "function_handle")


@dataclass(frozen=True)
class Mat73Array:
    """An array in the file.

    Args:
        shape: its shape as MATLAB has it.
        dtype: type of the numbers as they are stored.
        real: it holds real numbers.
        text: it holds text.
    """

    shape: tuple[int, ...]
    dtype: str
    real: bool
    text: bool


class Mat73File:
    """The arrays of a file by name; those inside structures as ``structure.field``.

    Args:
        tree: the file, open.

    Raises:
        FileFormatError: the file is damaged.
        PathEscapeError: a link leads outside the file's folder.
    """

    def __init__(self, tree: Hdf5Tree) -> None:
        self.path: Path = tree.path
        self._tree = tree
        self.arrays: dict[str, Mat73Array] = {}
        for place, node in _datasets(tree, "", 0):
            self.arrays[place.replace("/", ".")] = _described(node)
            if len(self.arrays) > _MOST_ARRAYS:
                raise FileFormatError(f"{self.path}: holds more than {_MOST_ARRAYS} arrays")

    def vector(self, name: str) -> NDArray[np.float64]:
        """Read numbers that stand in a row; errors are those of ``read_vector``."""
        return read_vector(self._tree, name.replace(".", "/"))

    def text(self, name: str) -> str:
        """A short text, or nothing where the array is none."""
        array = self.arrays.get(name)
        if array is None or not array.text or not 0 < np.prod(array.shape) < _LONGEST_TEXT:
            return ""
        codes = read_vector(self._tree, name.replace(".", "/"))
        return "".join(chr(int(code)) for code in codes if 0 < code < 0xD800)

    def stored(self, stack: FrameStack) -> FrameStack:
        """The same frames as HDF5 has them; the dataset was found to lie in the file's folder."""
        place = stack.name.replace(".", "/")
        self._tree.dataset(place)
        return FrameStack(place, stack.shape[::-1], stack.axes[::-1], stack.runs)


def _datasets(tree: Hdf5Tree, group: str, depth: int) -> Iterator[tuple[str, Any]]:
    node = tree.find(group or "/")
    if isinstance(node, h5py.Dataset):
        yield group, node
    elif isinstance(node, h5py.Group) and depth <= _DEEPEST:
        for name in node:
            # MATLAB keeps what cells and objects refer to in '#refs#' and '#subsystem#'.
            if not name.startswith("#") and "." not in name:
                yield from _datasets(tree, f"{group}/{name}" if group else name, depth + 1)


def _described(node: Any) -> Mat73Array:
    kind = node.attrs.get("MATLAB_class", b"")
    kind = kind.decode("latin-1") if isinstance(kind, bytes) else str(kind)
    shape = tuple(int(n) for n in (node.shape or ()))[::-1]
    # An array without elements is stored as its shape.
    empty = "MATLAB_empty" in node.attrs or node.shape is None
    numbers = node.dtype.kind in "iuf" and not empty
    real, text = numbers and kind not in _NO_NUMBERS, numbers and kind == "char"
    return Mat73Array(shape, node.dtype.str, real, text)
