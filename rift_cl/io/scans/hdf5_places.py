"""Arrays of an HDF5 scan by their names, those that lie in another file too: ``FILE.h5:/name``.

Beamlines often write flats, darks and angles into files of their own. A person names such a file,
with or without an array in it; nothing in a scan's file leads to one.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path
from typing import Literal

from rift_cl.errors import FileFormatError, InputError
from rift_cl.io.hdf5_tree import Hdf5Tree, open_tree
from rift_cl.io.scans.frame_words import is_said, says_angles

HDF5_SUFFIXES = (".h5", ".hdf5", ".hdf", ".nxs", ".nx")
_PLACE = re.compile(rf"(.+(?:{'|'.join(map(re.escape, HDF5_SUFFIXES))}))(?::(.+))?", re.IGNORECASE)
# Datasets among which the one that is meant is looked for.
_MOST_NAMED = 1000
Part = Literal["theta", "flats", "darks"]


class Hdf5Files:
    """A scan's file, and others in which a person named arrays.

    Args:
        tree: the scan's.
        files: closes the others.
    """

    def __init__(self, tree: Hdf5Tree, files: ExitStack) -> None:
        self.tree = tree
        self._files = files
        self._others: dict[Path, Hdf5Tree] = {}

    def at(self, name: str) -> tuple[Hdf5Tree, str]:
        """The file of an array, and its name there."""
        place = _PLACE.fullmatch(name)
        if place is None or place[2] is None or self.tree.find(name) is not None:
            return self.tree, name
        return self.other(Path(place[1])), place[2]

    def other(self, path: Path) -> Hdf5Tree:
        """Another file.

        Raises:
            InputError, FileFormatError: it is not there, or damaged.
        """
        if path not in self._others:
            self._others[path] = self._files.enter_context(open_tree(path))
        return self._others[path]

    @property
    def others(self) -> tuple[Path, ...]:
        """Files besides the scan's in which arrays that were asked for lie, or that led to them."""
        found = set(self.tree.others)
        for path, tree in self._others.items():
            found |= {path, *tree.others}
        return tuple(sorted(found))

    def settled(self, part: Part, name: str | None, frame: tuple[int, ...]) -> str | None:
        """The name of an array as ``at`` takes it, where a person names a file alone.

        Args:
            part: what the array is to be.
            name: what a person says.
            frame: shape of the projections.

        Raises:
            InputError: the file is not there.
            FileFormatError: none of its arrays can be meant, or several.
        """
        place = None if name is None else _PLACE.fullmatch(name)
        if name is None or place is None or self.tree.find(name) is not None:
            return name
        paths = Path(place[1]).absolute(), self.tree.path.parent / place[1]
        path = next((path for path in paths if path.is_file()), None)
        if path is None:
            raise InputError(
                f"{self.tree.path}: has no dataset {name!r}, and there is no file {paths[0]} "
                f"(--{part})"
            )
        return f"{path}:{place[2] or _meant(self.other(path), part, frame)}"


@contextmanager
def open_files(path: Path) -> Iterator[Hdf5Files]:
    """Open the file of a scan, as ``open_tree`` does."""
    with open_tree(path) as tree, ExitStack() as files:
        yield Hdf5Files(tree, files)


def _meant(tree: Hdf5Tree, part: Part, frame: tuple[int, ...]) -> str:
    """The one array of a file that can be angles, or frames of the projections' size."""
    found = [name for name, shape in tree.datasets(_MOST_NAMED) if _fits(part, shape, frame)]
    called = [name for name in found if _is_called(part, name.rpartition("/")[2])]
    meant = called or found
    if len(meant) != 1:
        what = "angles" if part == "theta" else "frames of the projections' size"
        many = f"several arrays that may be {what}" if meant else f"no array of {what}"
        raise FileFormatError(
            f"{tree.path}: holds {many}; {tree.contents().split(':')[0]}: name one as "
            f"--{part} {tree.path.name}:/NAME"
        )
    return meant[0]


def _fits(part: Part, shape: tuple[int, ...], frame: tuple[int, ...]) -> bool:
    if part == "theta":
        return max(shape, default=0) > 1 and sum(size > 1 for size in shape) == 1
    # Frames of rows and bins, which are all but one of the projections' axes, in any order.
    rest = [sorted(frame[:axis] + frame[axis + 1 :]) for axis in range(len(frame))]
    if len(shape) == len(frame) - 1:
        return sorted(shape) in rest
    return len(shape) == len(frame) and any(
        sorted(shape[:axis] + shape[axis + 1 :]) in rest for axis in range(len(shape))
    )


def _is_called(part: Part, name: str) -> bool:
    return says_angles(name) if part == "theta" else is_said(part, name)
