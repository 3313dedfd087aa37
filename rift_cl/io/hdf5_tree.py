"""An HDF5 file whose links and storage are checked before they are followed.

HDF5 can lead a reader anywhere: soft links to other places of the file, external links, virtual
datasets and raw files to any path on the machine, and round in circles, which ends the process.
So the links are walked here, one by one, and nothing outside the file's own folder is opened.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import ExitStack, contextmanager, suppress
from pathlib import Path
from typing import Any

import h5py

from rift_cl.errors import FileFormatError, PathEscapeError, RiftError
from rift_cl.io.boundary import HOW_TO_NAME, reading
from rift_cl.io.hdf5_heaps import check_heaps

_MOST_LINKS = 200
# Groups and datasets of a file that are looked at for what they lead to.
_MOST_NODES = 10_000
_DEEPEST_VIRTUAL = 16
_LISTED = 8

_Key = tuple[str, int]


@contextmanager
def open_tree(path: Path) -> Iterator[Hdf5Tree]:
    """Open an HDF5 file for reading, with every exception inside turned into one of ours.

    Raises:
        InputError: there is no such file.
        FileFormatError: the file is damaged.
    """
    with reading(path, "the HDF5 file"), ExitStack() as files:
        yield Hdf5Tree(path, files)


def files_behind(path: Path) -> tuple[Path, ...]:
    """A file, and those that its links and the storage of its datasets lead to, if it is HDF5.

    What leads nowhere is left out, and so is what no reader would follow, outside the folder.

    Raises:
        InputError: the file may not be opened.
    """
    with reading(path, "the file"):
        if not h5py.is_hdf5(path):
            return (path,)
    try:
        with open_tree(path) as tree:
            tree.follow_all()
            return (path, *tree.others)
    except FileFormatError:
        # A damaged one is told where it is read.
        return (path,)


class Hdf5Tree:
    """The groups and datasets that may be reached from one HDF5 file.

    Args:
        path: the file; links may lead to other files in its folder and below.
        files: closes whatever is opened.
    """

    def __init__(self, path: Path, files: ExitStack) -> None:
        self.path = path
        self._folder = path.resolve().parent
        self._files = files
        self._opened: dict[Path, Any] = {}
        self._links = 0
        self._checked: set[_Key] = set()
        self._raw: set[Path] = set()
        self.root: Any = self._open(path.resolve())

    @property
    def others(self) -> tuple[Path, ...]:
        """Files besides this one in which what was found so far is stored, or that led to it."""
        found = {*self._opened, *filter(Path.is_file, self._raw)}
        return tuple(sorted(found - {self.path.resolve()}))

    def follow_all(self) -> None:
        """Find all that may be reached, so that ``others`` names every file that matters."""
        todo, seen = [self.root["/"]], set[_Key]()
        while todo and len(seen) < _MOST_NODES:
            node = todo.pop()
            if not isinstance(node, (h5py.Dataset, h5py.Group)):
                continue
            key = _key(node)
            if key in seen:
                continue
            seen.add(key)
            # What cannot be followed leads to no file; the reader that needs it says so.
            if isinstance(node, h5py.Dataset):
                with suppress(RiftError, OSError):
                    self._check_storage(node, ())
                continue
            for name in node:
                self._links = 0
                with suppress(RiftError, OSError, KeyError):
                    todo.append(self._step(node, name))

    def find(self, name: str) -> Any:
        """The group or dataset of that name, or None.

        Raises:
            PathEscapeError: a link on the way leads outside the file's folder.
            FileFormatError: links go round in circles, or to a file that is missing; or texts of
                its attributes are kept in a damaged heap.
        """
        self._links = 0
        node = self._follow(self.root, name)
        if node is not None:
            check_heaps(node)
        return node

    def dataset(self, name: str, *, remedy: str = HOW_TO_NAME) -> Any:
        """The dataset of that name, whose storage was found to lie in the file's folder.

        Args:
            name: its path in the file.
            remedy: what to do where there is none.

        Raises:
            FileFormatError: there is none; the error lists those that there are.
            PathEscapeError: the dataset, or part of it, lies outside the file's folder.
        """
        node = self.find(name)
        if not isinstance(node, h5py.Dataset):
            raise FileFormatError(f"{self.path}: has no dataset {name!r}; {self.contents(remedy)}")
        self._check_storage(node, ())
        return node

    def contents(self, remedy: str = HOW_TO_NAME) -> str:
        """A phrase that lists the first datasets of the file, and says what to do."""
        found = [f"{name!r} {shape}" for name, shape in self.datasets(_LISTED + 1)]
        if not found:
            return "it holds no dataset at all"
        more = ", ..." if len(found) > _LISTED else ""
        return f"it holds {', '.join(found[:_LISTED])}{more}: {remedy}"

    def datasets(self, most: int) -> list[tuple[str, tuple[int, ...]]]:
        """Names and shapes of the first datasets that no link leads to."""
        found: list[tuple[str, tuple[int, ...]]] = []

        def note(name: str, node: Any) -> bool | None:
            if isinstance(node, h5py.Dataset):
                found.append((f"/{name}", node.shape))
            return True if len(found) >= most else None

        self.root.visititems(note)
        return found

    def _follow(self, here: Any, name: str) -> Any:
        if name.startswith("/"):
            here = here.file["/"]
        for part in name.split("/"):
            if part not in ("", "."):
                here = self._step(here, part)
        return here

    def _step(self, here: Any, part: str) -> Any:
        if not isinstance(here, h5py.Group):
            return None
        link = here.get(part, getlink=True)
        if link is None:
            return None
        if isinstance(link, h5py.HardLink):
            return here[part]
        self._links += 1
        if self._links > _MOST_LINKS:
            raise FileFormatError(f"{self.path}: the links at {part!r} go round in circles")
        if isinstance(link, h5py.SoftLink):
            return self._follow(here, link.path)
        target = self._open(self._inside(here, link.filename))
        return self._follow(target, "/" + link.path)

    def _check_storage(self, dataset: Any, above: tuple[_Key, ...]) -> None:
        for name, _, _ in dataset.external or ():
            # The HDF5 library looks for raw files from the working directory, not from the file.
            raw = Path(name).resolve()
            self._demand_inside(raw, name)
            self._raw.add(raw)
        if not dataset.is_virtual:
            return
        key = _key(dataset)
        if key in above or len(above) > _DEEPEST_VIRTUAL:
            raise FileFormatError(f"{self.path}: {dataset.name!r} is a virtual dataset of itself")
        if key in self._checked:
            return
        for source in dataset.virtual_sources():
            self._check_storage(self._source(dataset, source), (*above, key))
        self._checked.add(key)

    def _source(self, dataset: Any, source: Any) -> Any:
        if "%" in source.file_name + source.dset_name:
            raise FileFormatError(
                f"{self.path}: {dataset.name!r} numbers its sources by a pattern, which is not "
                "read; copy it into an ordinary dataset"
            )
        here = dataset.file["/"]
        if source.file_name != ".":
            here = self._open(self._inside(dataset, source.file_name))
        self._links = 0
        node = self._follow(here, "/" + source.dset_name)
        if not isinstance(node, h5py.Dataset):
            raise FileFormatError(
                f"{self.path}: {dataset.name!r} is made of {source.dset_name!r} in "
                f"{source.file_name!r}, which is not there"
            )
        return node

    def _inside(self, here: Any, name: str) -> Path:
        target = (Path(here.file.filename).parent / name).resolve()
        self._demand_inside(target, name)
        # A name that is missing here would be looked for in the working directory.
        if not target.is_file():
            raise FileFormatError(f"{self.path}: leads to {name!r}, which is not there")
        return target

    def _demand_inside(self, target: Path, name: str) -> None:
        if not target.is_relative_to(self._folder):
            raise PathEscapeError(
                f"{self.path}: leads to {name!r}, which is outside the folder {self._folder}; "
                "put that file there and mend the link, or copy the data into one file"
            )

    def _open(self, path: Path) -> Any:
        if path not in self._opened:
            self._opened[path] = self._files.enter_context(h5py.File(path, "r"))
        return self._opened[path]


def _key(node: Any) -> _Key:
    """What tells a group or dataset from others, whatever led to it."""
    return node.file.filename, int(h5py.h5o.get_info(node.id).addr)
