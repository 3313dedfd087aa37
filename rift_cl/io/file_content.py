"""What files hold, told by their sizes and a digest of them, so that one is known from another.

By content, a file that was touched, copied, moved or renamed is the same, and another that took
its name is not, whatever its size and its time of change.
"""

from __future__ import annotations

import hashlib
import os
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any, BinaryIO

from rift_cl.io.boundary import reading

# Bytes up to which all are read: a fraction of a second.
_WHOLE = 1 << 27
# Of more: bytes of a block, blocks of all files together, and the most files that give one.
_BLOCK, _BLOCKS, _MOST_FILES = 1 << 14, 256, 4096
_CHUNK = 1 << 20
_DIGITS = 16


@dataclass(frozen=True)
class Content:
    """What some files hold that belong together, and where they are.

    Args:
        words: how many, their sizes together, and the digest: of all bytes up to 128 MiB; of more,
            of 256 blocks of 16 KiB spread over them and of the size of each, with one block at
            least of each of 4096 files. Names count within a folder.
        place: where they are, which decides nothing.
        times: a digest of their times of change; empty where all bytes were read. A change that no
            block shows is known by them, but not of a copy, whose times are its own.
    """

    words: str
    place: str
    times: str = ""

    @classmethod
    def of(cls, files: Sequence[Path], place: Path) -> Content:
        """The content of files.

        Args:
            files: in their order.
            place: the file or folder that they are, or that leads to them.

        Raises:
            InputError: one is not there, or may not be read.
        """
        digest = hashlib.sha256()
        states = []
        for path in files:
            with reading(path, "its contents"):
                states.append(path.stat())
        sizes = [state.st_size for state in states]
        sampled = sum(sizes) > _WHOLE
        for path, size in zip(files, sizes, strict=True):
            digest.update(f"{_name(path, place)}\0{size}\n".encode("utf-8", "surrogateescape"))
        for path in _some(files) if sampled else files:
            with reading(path, "its contents"), path.open("rb") as file:
                for block in _blocks(file, _BLOCKS // len(files)) if sampled else _all(file):
                    digest.update(block)
        times = "\n".join(str(state.st_mtime_ns) for state in states).encode()
        count = "1 file" if len(files) == 1 else f"{len(files)} files"
        return cls(
            f"{count} of {sum(sizes)} bytes with the hash {digest.hexdigest()[:_DIGITS]}",
            os.path.realpath(place),
            hashlib.sha256(times).hexdigest()[:_DIGITS] if sampled else "",
        )

    @classmethod
    def read(cls, record: Any) -> Content | None:
        """What ``record`` gave; None if it is something else."""
        names = {"words", "place", "times"}
        if isinstance(record, Mapping) and record.keys() == names:
            return cls(**{name: str(record[name]) for name in names})
        return None

    def record(self) -> dict[str, str]:
        """It as JSON holds it."""
        return asdict(self)

    def is_same(self, other: Content) -> bool:
        """Whether it is that of the same files, or of copies of them."""
        moved = self.place != other.place
        return self.words == other.words and (moved or self.times == other.times)


def file_states(files: Sequence[Path]) -> tuple[tuple[int, ...], ...]:
    """What the system says of files, which differs once one is written to or replaced.

    The last change of a file's record (ctime) is none that a program can set.
    """
    found: list[tuple[int, ...]] = []
    for path in files:
        try:
            state = path.stat()
        except OSError:
            found.append(())
        else:
            found.append((state.st_ino, state.st_size, state.st_mtime_ns, state.st_ctime_ns))
    return tuple(found)


def _name(path: Path, place: Path) -> str:
    """The name by which a file counts: where chunks and frames lie in their folder."""
    if path == place or not path.is_relative_to(place):
        return ""
    return path.relative_to(place).as_posix()


def _some(files: Sequence[Path]) -> list[Path]:
    """Files spread over all, not too many."""
    count = min(len(files), _MOST_FILES)
    return [files[at * len(files) // count] for at in range(count)]


def _all(file: BinaryIO) -> Iterator[bytes]:
    while chunk := file.read(_CHUNK):
        yield chunk


def _blocks(file: BinaryIO, count: int) -> Iterator[bytes]:
    """Blocks spread over a file: the middle of each of as many parts, one at least."""
    count = max(count, 1)
    size = file.seek(0, os.SEEK_END)
    begins = [max(size - _BLOCK, 0) * (2 * part + 1) // (2 * count) for part in range(count)]
    for begin in dict.fromkeys(begins):
        file.seek(begin)
        yield file.read(_BLOCK)
