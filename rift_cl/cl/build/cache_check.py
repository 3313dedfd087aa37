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
import zlib
from collections.abc import Iterator
from pathlib import Path

_RECORD = "checksums.json"
# A driver touches this file to say when it used a program; it holds nothing.
_TOUCHED = "last_accessed"
# Folders down to a program's own: PoCL names it by a hash that is cut in two.
_PROGRAM_DEPTH = 2
_UNKNOWN, _UNREADABLE = -1, -2


def remove_damaged(folder: Path) -> int:
    """Remove every program that is not as it was recorded; hold the build lock meanwhile.

    A program without a record stays: another process may be building it without our lock, and
    a driver puts its files in place whole. Without any record nothing can be trusted.

    Returns:
        The number of programs that were removed.
    """
    known = _read(folder)
    damaged = {
        _program(name)
        for name, path in _files(folder)
        if known is None or known.get(name, _UNKNOWN) not in (_UNKNOWN, _checksum(path))
    }
    for program in damaged:
        shutil.rmtree(folder / program, ignore_errors=True)
    kept = {name: value for name, value in (known or {}).items() if _program(name) not in damaged}
    _write(folder, kept)
    return len(damaged)


def record(folder: Path) -> None:
    """Write down the checksums of files that are new; hold the build lock meanwhile."""
    known = _read(folder) or {}
    new = {name: _checksum(path) for name, path in _files(folder) if name not in known}
    if new:
        _write(folder, {**known, **new})


def files_kept(folder: Path) -> int:
    """How many files drivers have put into the cache."""
    return sum(1 for _ in _files(folder))


def _files(folder: Path) -> Iterator[tuple[str, str]]:
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
        return zlib.crc32(Path(path).read_bytes())
    except OSError:
        return _UNREADABLE


def _read(folder: Path) -> dict[str, int] | None:
    try:
        known = json.loads((folder / _RECORD).read_text(encoding="utf-8"))
    except (OSError, ValueError):
        return None
    return known if isinstance(known, dict) else None


def _write(folder: Path, known: dict[str, int]) -> None:
    part = folder / f"{_RECORD}.part"
    part.write_text(json.dumps(known), encoding="utf-8")
    part.replace(folder / _RECORD)
