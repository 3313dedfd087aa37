"""Damaged kernels are found before a driver loads them.

PoCL dies by a signal when a kernel in its cache was cut short or altered, by a full disk or a
power cut, and no exception can tell of it. So checksums are written down while the build lock is
held, and compared when the next process starts: a program that is not as it was written down is
removed and built again. What is damaged while a process runs is found by the next one only.
"""

from __future__ import annotations

import contextlib
import json
import os
import shutil
import stat
import zlib
from collections.abc import Iterator
from pathlib import Path

from rift_cl.json_parsing import parse_json

_RECORD = "checksums.json"
# A driver touches this file to say when it used a program; it holds nothing.
_TOUCHED = "last_accessed"
# Folders down to a program's own: PoCL names it by a hash that is cut in two.
_PROGRAM_DEPTH = 2
_UNKNOWN, _UNREADABLE = -1, -2
# A hundred bytes for each of some hundred thousand files.
_MOST_BYTES = 1 << 24


def remove_damaged(folder: Path) -> int:
    """Remove every program that is not as it was recorded; hold the build lock meanwhile.

    A program without a record stays: another process may be building it without our lock, and
    a driver puts its files in place whole. Without any record nothing can be trusted.

    Returns:
        The number of programs that were removed.
    """
    known = _read(folder)
    found = dict(program_files(folder))
    damaged = {
        _program(name) for name, path in found.items() if not _is_as_recorded(known, name, path)
    }
    # Where a folder stands in a file's place the driver could not put the file that it builds anew.
    damaged |= {_program(name) for name in known or {} if _is_folder(folder, name)}
    for program in damaged:
        shutil.rmtree(folder / program, ignore_errors=True)
    kept = {name: value for name, value in (known or {}).items() if _program(name) not in damaged}
    _write(folder, kept)
    return len(damaged)


def _is_as_recorded(known: dict[str, int] | None, name: str, path: str) -> bool:
    if known is None:
        return False
    checksum = _checksum(path)
    return checksum != _UNREADABLE and known.get(name, _UNKNOWN) in (_UNKNOWN, checksum)


def _is_folder(folder: Path, name: str) -> bool:
    parts = name.split("/")
    # A record is read before it is known to be ours: nothing outside of the cache is removed.
    inside = len(parts) > _PROGRAM_DEPTH and not {"", ".", ".."} & set(parts)
    return inside and (folder / name).is_dir()


def record(folder: Path) -> None:
    """Write down the checksums of files that are new; hold the build lock meanwhile."""
    known = _read(folder) or {}
    new = {name: _checksum(path) for name, path in program_files(folder) if name not in known}
    if new:
        _write(folder, {**known, **new})


def own_file(path: Path) -> Path:
    """A path of the cache at which there is a file or nothing: what else is there is removed.

    Whoever opens a pipe waits for ever, and a folder cannot be replaced by a file.
    """
    with contextlib.suppress(OSError):
        mode = path.lstat().st_mode
        if stat.S_ISDIR(mode):
            shutil.rmtree(path, ignore_errors=True)
        elif not stat.S_ISREG(mode):
            path.unlink()
    return path


def files_kept(folder: Path) -> int:
    """How many files drivers have put into the cache."""
    return sum(1 for _ in program_files(folder))


def program_files(folder: Path) -> Iterator[tuple[str, str]]:
    """Every file of every program: its name inside the cache, and its path.

    The cache is walked at every build, and os.walk would take twice as long over it. What lies
    outside of a program (two folders deep) is not its file.
    """
    pending = [(os.fspath(folder), "", 0)]
    while pending:
        place, inside, depth = pending.pop()
        # A folder that another process removed meanwhile has no files.
        with contextlib.suppress(OSError), os.scandir(place) as entries:
            for entry in entries:
                if entry.is_dir(follow_symlinks=False):
                    pending.append((entry.path, f"{inside}{entry.name}/", depth + 1))
                elif depth >= _PROGRAM_DEPTH and entry.name != _TOUCHED:
                    yield f"{inside}{entry.name}", entry.path


def _program(name: str) -> str:
    """The folder of the program that a file belongs to."""
    return "/".join(name.split("/")[:_PROGRAM_DEPTH])


def _checksum(path: str) -> int:
    try:
        # Whoever reads a pipe waits for ever.
        if not stat.S_ISREG(os.lstat(path).st_mode):
            return _UNREADABLE
        return zlib.crc32(Path(path).read_bytes())
    except OSError:
        return _UNREADABLE


def _read(folder: Path) -> dict[str, int] | None:
    try:
        path = own_file(folder / _RECORD)
        if path.stat().st_size > _MOST_BYTES:
            return None
        known = parse_json(path.read_text(encoding="utf-8"))
    except (OSError, ValueError):
        return None
    return known if isinstance(known, dict) else None


def _write(folder: Path, known: dict[str, int]) -> None:
    part = own_file(folder / f"{_RECORD}.part")
    part.write_text(json.dumps(known), encoding="utf-8")
    part.replace(folder / _RECORD)
