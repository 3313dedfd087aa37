"""An NPZ file as a table of array headers: nothing is loaded that was not counted first.

NPZ is a zip archive of NumPy's NPY files. The headers are read without the arrays, and what they
claim is compared with what the archive stores and with the budget, because an archive of a
kilobyte may ask for terabytes. Nothing is ever unpickled.
"""

from __future__ import annotations

import zipfile
from pathlib import Path

import numpy as np
from numpy.lib import format as npy
from numpy.typing import NDArray

from rift_cl.errors import FileFormatError
from rift_cl.io.boundary import HOW_TO_NAME, check_claim
from rift_cl.io.npy_file import ArrayHeader, read_header

_METHODS = (zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED)
# Deflate packs at most this many bytes into one; a few more cover the blocks' own headers.
_DEFLATE_LIMIT = 1032
_DEFLATE_SLACK = 4096
_LISTED = 8
# Bytes of a text that is a name or a unit, at most.
_LONGEST_WORD = 1024


class NpzArchive:
    """The arrays of an open NPZ archive.

    Args:
        path: its file, for errors.
        archive: the archive, open for reading.
    """

    def __init__(self, path: Path, archive: zipfile.ZipFile) -> None:
        self.path = path
        self._archive = archive
        self._members = {member.filename: member for member in archive.infolist()}

    def __contains__(self, name: str) -> bool:
        return f"{name}.npy" in self._members

    def header(self, name: str) -> ArrayHeader:
        """What an array claims to be.

        Raises:
            FileFormatError: there is no such array, or its header is damaged.
            DTypeError: it does not hold real numbers.
            ShapeError: it is empty.
        """
        if name not in self:
            raise FileFormatError(f"{self.path}: has no array {name!r}; {self.contents()}")
        with self._archive.open(self._members[f"{name}.npy"]) as file:
            header = read_header(file)
        header.check(self.path, name)
        return header

    def load(self, name: str, *, budget: int | None) -> NDArray[np.generic]:
        """Load an array whole.

        Raises:
            ResourceLimitError: it claims more than the budget; nothing was allocated.
            FileFormatError: it claims more, or less, than the archive stores.
        """
        header = self.header(name)
        check_claim(self.path, f"{name!r}", header.size, budget)
        member = self._members[f"{name}.npy"]
        stored = member.compress_size
        most = stored * _DEFLATE_LIMIT + _DEFLATE_SLACK if member.compress_type else stored
        if (
            member.compress_type not in _METHODS
            or member.file_size != header.offset + header.size
            or member.file_size > most
            or stored > self.path.stat().st_size
        ):
            raise FileFormatError(
                f"{self.path}: {name!r} claims {header.size} bytes, which is not what the "
                "archive stores; the file is damaged"
            )
        with self._archive.open(member) as file:
            values: NDArray[np.generic] = npy.read_array(file, allow_pickle=False)
        return values

    def text(self, name: str) -> str:
        """A word that an array holds; nothing where it holds numbers, or there is none."""
        if name not in self:
            return ""
        member = self._members[f"{name}.npy"]
        with self._archive.open(member) as file:
            header = read_header(file)
            if header.dtype.kind not in "US" or header.shape not in ((), (1,)):
                return ""
            if not header.size <= _LONGEST_WORD or member.file_size != header.offset + header.size:
                raise FileFormatError(
                    f"{self.path}: {name!r} is no word but {header.size} bytes of text, or damaged"
                )
        with self._archive.open(member) as file:
            value = npy.read_array(file, allow_pickle=False).item()
        return value.decode(errors="replace") if isinstance(value, bytes) else str(value)

    def names(self) -> list[str]:
        """Names of all arrays."""
        return [name[: -len(".npy")] for name in self._members if name.endswith(".npy")]

    def contents(self) -> str:
        """A phrase that lists the first arrays, and how to name one."""
        names = self.names()
        if not names:
            return "it holds no array at all"
        listed = ", ".join(f"{name!r} {self._shape(name)}" for name in names[:_LISTED])
        more = ", ..." if len(names) > _LISTED else ""
        return f"it holds {listed}{more}: {HOW_TO_NAME}"

    def _shape(self, name: str) -> tuple[int, ...] | str:
        with self._archive.open(self._members[f"{name}.npy"]) as file:
            return read_header(file).shape
