"""Results are written whole or not at all.

Everything is written under a temporary name beside the final one, forced to the disk, and renamed
as the last step: whoever finds the final name finds a complete result, and an earlier result stays
as it was until then.
"""

from __future__ import annotations

import json
import math
import os
import shutil
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any

import numpy as np

from rift_cl.cl.budget import format_bytes
from rift_cl.errors import InputError, OutputError, RiftError

# What is being written has its name with this at the end.
PART = ".part"
_OLD = ".old"


@contextmanager
def atomic_path(path: str | os.PathLike[str]) -> Iterator[Path]:
    """Give a temporary name to write to; a clean exit turns it into ``path``.

    The temporary name is ``path`` with ``.part`` appended. After an exception it is removed and
    ``path`` stays as it was.

    Raises:
        OutputError: an ``OSError`` came up, inside the block or in the steps round it, or the
            block wrote no file.
    """
    path = Path(path)
    with writing(path), staged_file(path) as part:
        yield part


def write_text(path: str | os.PathLike[str], text: str) -> None:
    r"""Write a text file in UTF-8.

    A byte of a file's name that is not UTF-8 is written as ``\udc`` and its two hexadecimal
    digits, which JSON reads as the same name.

    Raises:
        OutputError: it cannot be written.
    """
    with atomic_path(path) as part:
        part.write_text(text, encoding="utf-8", errors="backslashreplace")


def write_json(path: str | os.PathLike[str], value: Any) -> None:
    """Write a JSON file of what ``json_text`` gives.

    Raises:
        InputError: the value holds something that JSON cannot say.
        OutputError: the file cannot be written.
    """
    try:
        text = json_text(value)
    except (TypeError, ValueError, RecursionError) as error:
        raise InputError(f"{path}: the value cannot be written as JSON ({error})") from error
    write_text(path, text)


def json_text(value: Any) -> str:
    """A value as JSON; NumPy numbers and arrays count as numbers and lists, paths as text.

    NaN and infinity have no place in JSON and become null.

    Raises:
        TypeError, ValueError, RecursionError: the value holds something that JSON cannot say.
    """
    return json.dumps(_plain(value), indent=2, allow_nan=False, ensure_ascii=False) + "\n"


def make_folder(path: str | os.PathLike[str]) -> Path:
    """Make a folder and those above it; one that exists is kept.

    Raises:
        OutputError: it cannot be made.
    """
    path = Path(path)
    with writing(path):
        path.mkdir(parents=True, exist_ok=True)
    return path


@contextmanager
def writing(path: Path) -> Iterator[None]:
    """Turn what the operating system raises into an ``OutputError`` that names ``path``."""
    try:
        yield
    except RiftError:
        raise
    except OSError as error:
        raise OutputError(
            f"{path}: cannot be written ({error.strerror or error}); see to the disk and its "
            "permissions or name another place"
        ) from error


@contextmanager
def staged_file(path: Path) -> Iterator[Path]:
    """As ``atomic_path``, with the exceptions of the block left as they are."""
    part = path.with_name(path.name + PART)
    with writing(path):
        if path.is_dir():
            raise OutputError(f"{path}: is a folder, a file is to be written; name another place")
        part.unlink(missing_ok=True)
    try:
        yield part
        with writing(path):
            sync(part)
            part.replace(path)
            sync(path.parent)
    except BaseException:
        with suppress(OSError):
            part.unlink(missing_ok=True)
        raise


@contextmanager
def staged_folder(path: Path, strange: Callable[[list[str]], str | None]) -> Iterator[Path]:
    """Make a temporary folder; a clean exit turns it into ``path``.

    Args:
        path: the final name.
        strange: of the names in an existing folder, one that no earlier result can have left
            there, or None. A folder with such an entry is refused, never replaced.

    Raises:
        OutputError: the folder cannot be made, or ``path`` is something else already.
    """
    part = path.with_name(path.name + PART)
    old = path.with_name(path.name + _OLD)
    with writing(path):
        for folder in (path, part, old):
            _demand_ours(folder, strange)
        _remove(part)
        part.mkdir()
    try:
        yield part
        with writing(path):
            _sync_all(part)
            _swap(part, path, old)
    except BaseException:
        shutil.rmtree(part, ignore_errors=True)
        raise


def leftovers(name: str) -> tuple[str, str]:
    """What writing a file or folder of this name leaves beside it where the process is killed."""
    return name + PART, name + _OLD


def check_space(path: Path, need: int) -> None:
    """Refuse to begin what the disk cannot hold.

    Raises:
        OutputError: less than ``need`` bytes are free where ``path`` is to be, or there is no
            folder for it.
    """
    with writing(path):
        free = shutil.disk_usage(path.parent).free
    if free < need:
        raise OutputError(
            f"{path}: needs {format_bytes(need)}, the disk has {format_bytes(free)} free; free "
            "some space or name another place"
        )


def sync(path: Path) -> None:
    """Force a file, or the entries of a folder, to the disk."""
    folder = path.is_dir()
    if folder and os.name == "nt":
        return  # Windows keeps folders in order by itself and refuses to open them.
    handle = os.open(path, os.O_RDONLY if folder else os.O_RDWR)
    try:
        os.fsync(handle)
    finally:
        os.close(handle)


def _sync_all(folder: Path) -> None:
    for place, _, names in os.walk(folder):
        for name in names:
            sync(Path(place, name))
        sync(Path(place))


def _swap(part: Path, path: Path, old: Path) -> None:
    _remove(old)
    if path.exists():
        path.rename(old)
    try:
        part.rename(path)
    except OSError:
        if old.exists():
            old.rename(path)
        raise
    sync(path.parent)
    shutil.rmtree(old, ignore_errors=True)


def _demand_ours(folder: Path, strange: Callable[[list[str]], str | None]) -> None:
    if not folder.exists():
        return
    if not folder.is_dir():
        raise OutputError(f"{folder}: is a file, a folder is to be written; name another place")
    name = strange(sorted(entry.name for entry in folder.iterdir()))
    if name is not None:
        raise OutputError(
            f"{folder}: holds {name!r}, which no earlier result has; it is not replaced: name "
            "another place"
        )


def _remove(folder: Path) -> None:
    if folder.exists():
        shutil.rmtree(folder)


def _plain(value: Any) -> Any:
    if isinstance(value, dict):
        return {str(key): _plain(entry) for key, entry in value.items()}
    if isinstance(value, (list, tuple)):
        return [_plain(entry) for entry in value]
    if isinstance(value, (np.ndarray, np.generic)):
        return _plain(value.tolist())
    if isinstance(value, Path):
        return str(value)
    if isinstance(value, float) and not math.isfinite(value):
        return None
    return value
