"""Damaged kernels are found before a driver loads them.

PoCL dies by a signal when a kernel in its cache was cut short or altered, by a full disk or a
power cut, and no exception can tell of it. So checksums are written down while the build lock is
held, and compared when the next process starts: a program whose files are not as they were
written down, or that a killed process left behind, is removed and built again. What is damaged
while a process runs is found by the next one only.
"""

from __future__ import annotations

import json
import os
import shutil
import zlib
from collections.abc import Iterator
from pathlib import Path

LOCK = "build.lock"
_RECORD = "checksums.json"
# A driver touches this file to say when it used a program; it holds nothing.
_TOUCHED = "last_accessed"


def remove_damaged(folder: Path) -> int:
    """Remove every program that is not as it was recorded; hold the build lock meanwhile.

    Returns:
        The number of programs and stray files that were removed.
    """
    known = _read(folder)
    damaged = set()
    for name, path in _files(folder):
        if known.get(name) != _checksum(path):
            damaged.add(_program(name))
    for program in damaged:
        _remove(folder / program)
    _write(folder, {name: value for name, value in known.items() if _program(name) not in damaged})
    return len(damaged)


def record(folder: Path) -> None:
    """Write down the checksums of files that are new; hold the build lock meanwhile."""
    known, new = _read(folder), {}
    for name, path in _files(folder):
        # A file at the top is the driver's scratch; it belongs to no program.
        if name not in known and "/" in name:
            new[name] = _checksum(path)
    if new:
        _write(folder, {**known, **new})


def _files(folder: Path) -> Iterator[tuple[str, Path]]:
    for path in folder.rglob("*"):
        if path.is_file() and path.name not in (LOCK, _RECORD, _TOUCHED):
            yield path.relative_to(folder).as_posix(), path


def _program(name: str) -> str:
    """The folder of one program: PoCL names it by a hash that is cut in two."""
    return "/".join(name.split("/")[:2])


def _checksum(path: Path) -> int:
    try:
        return zlib.crc32(path.read_bytes())
    except OSError:
        return -1


def _remove(path: Path) -> None:
    if path.is_dir():
        shutil.rmtree(path, ignore_errors=True)
    else:
        path.unlink(missing_ok=True)


def _read(folder: Path) -> dict[str, int]:
    try:
        known = json.loads((folder / _RECORD).read_text(encoding="utf-8"))
    except (OSError, ValueError):
        return {}
    return known if isinstance(known, dict) else {}


def _write(folder: Path, known: dict[str, int]) -> None:
    part = folder / f"{_RECORD}.part"
    part.write_text(json.dumps(known), encoding="utf-8")
    os.replace(part, folder / _RECORD)
