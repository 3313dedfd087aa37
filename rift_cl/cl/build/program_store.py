"""Our own store of programs: what came of compiling each, and its binary.

The binary of a driver that keeps what it compiles is left to it. A file holds one program: a line
that names the format, the SHA-256 of all that follows, a line of JSON that says what it is, and the
driver's binary. Its name is a hash of all that the binary depends on, so that a new source, option,
driver or release never meets an old file. A file that is not as it was written is removed, and the
program built again.
"""

from __future__ import annotations

import contextlib
import hashlib
import json
import os
import tempfile
import time
import warnings
from collections.abc import Iterator
from pathlib import Path
from typing import Any, NamedTuple

from rift_cl import __version__
from rift_cl.cl.build.cache_check import own_file
from rift_cl.cl.build.first_launch import FirstLaunch
from rift_cl.cl.build.kernel_cache import cache_folder
from rift_cl.json_parsing import parse_json

_FORMAT = b"RIFT-CL program 1\n"
_HASH = 64
_FOLDER, _SUFFIX, _BEGUN = "programs", ".program", ".begun"
# How many processes must have met a compiler's fault before none asks it again; and for how many
# seconds they do not where it hung, as a compiler may on a machine that has too much to do.
_MET, _A_DAY = 2, 86_400


class Stored(NamedTuple):
    """A program as the store keeps it.

    Args:
        about: what it is, for a person; ``fault`` says why there is no binary where there is none,
            ``met`` how many processes met it, one after the other, and ``when`` the last did;
            ``launched`` the ways in which a child has launched it.
        binary: what the driver gave, and takes again; empty where it keeps it, or gives none.
    """

    about: dict[str, Any]
    binary: bytes


def program_name(driver: dict[str, str], source: str, options: list[str]) -> str:
    """The name of a program in the store: a hash of everything that its binary depends on.

    Args:
        driver: what tells the device and its driver from any other.
        source: the complete source, with the includes in line.
        options: what the compiler is given, macros among them.
    """
    parts = [_FORMAT.decode(), __version__, json.dumps(driver, sort_keys=True), source, *options]
    return hashlib.sha256(json.dumps(parts).encode()).hexdigest()


def load(name: str) -> Stored | None:
    """What is stored under a name, or None; a damaged file is removed."""
    path = own_file(_path(name))
    try:
        data = path.read_bytes()
    except OSError:
        return None
    stored = _parsed(name, data)
    if stored is None:
        remove(name)
    return stored


def is_settled(about: dict[str, Any]) -> bool:
    """Whether what is said of a program holds: a compiler's fault does when it came again."""
    if about["built"]:
        return True
    fresh = "hung" not in about["fault"] or time.time() - about.get("when", 0) < _A_DAY
    return bool(about.get("met", 0) >= _MET and fresh)


def save(name: str, stored: Stored) -> None:
    """Store a program, which nobody then dies of any more.

    Where there is no room for it, it is kept for this run only, and said so.
    """
    body = json.dumps(stored.about, sort_keys=True).encode() + b"\n" + stored.binary
    path = _path(name)
    try:
        write_whole(path, _FORMAT + _checksum(name, body) + b"\n" + body)
    except OSError as error:
        warnings.warn(
            f"kernel cache {path.parent} cannot be written ({error.strerror or error}): compiled "
            "kernels are kept for this run only; make room, or set RIFT_CACHE_DIR to another "
            "folder that you own",
            stacklevel=2,
        )
    else:
        forget_begun(name)


def remove(name: str) -> None:
    """Forget a program."""
    with contextlib.suppress(OSError):
        _path(name).unlink(missing_ok=True)


@contextlib.contextmanager
def begun(name: str, launch: FirstLaunch | None = None) -> Iterator[None]:
    """Mark a program while this process compiles or first launches it; hold the build lock then.

    A mark that is found (``unfinished``) is of a process that died of it, or was ended meanwhile.

    Args:
        name: of the program.
        launch: the launch, which some drivers compile for; None while it is built.
    """
    path = _path(name).with_suffix(_BEGUN)
    # Where no mark can be made the program is compiled without one.
    with contextlib.suppress(OSError):
        path.parent.mkdir(mode=0o700, parents=True, exist_ok=True)
        own_file(path).write_text(json.dumps(launch), encoding="utf-8")
    try:
        yield
    finally:
        forget_begun(name)


def unfinished(name: str) -> list[FirstLaunch] | None:
    """What a process began with a program without coming to an end: a launch, or none but to build.

    None where nobody did. Hold the build lock, or the mark may be of one who is still at it.
    """
    path = own_file(_path(name).with_suffix(_BEGUN))
    try:
        launch = parse_json(path.read_text(encoding="utf-8"))
    except FileNotFoundError:
        return None
    except (OSError, ValueError):
        return []
    return [launch] if isinstance(launch, dict) else []


def forget_begun(name: str) -> None:
    """Forget that anybody began with a program."""
    with contextlib.suppress(OSError):
        _path(name).with_suffix(_BEGUN).unlink(missing_ok=True)


def write_whole(path: Path, data: bytes) -> None:
    """Write a file of the cache so that it is there whole or not at all, for this user alone.

    Raises:
        OSError: it cannot be written.
    """
    path.parent.mkdir(mode=0o700, parents=True, exist_ok=True)
    handle, part = tempfile.mkstemp(dir=path.parent, prefix=".part-")
    try:
        with os.fdopen(handle, "wb") as file:
            file.write(data)
        Path(part).replace(path)
    except BaseException:
        with contextlib.suppress(OSError):
            Path(part).unlink(missing_ok=True)
        raise


def stored_programs(driver: dict[str, str] | None = None) -> list[dict[str, Any]]:
    """What is said of every program in the store, or of one driver's; damaged files are removed."""
    names = (path.stem for path in sorted((cache_folder() / _FOLDER).glob(f"*{_SUFFIX}")))
    found = [stored.about for stored in map(load, names) if stored is not None]
    return [about for about in found if driver is None or about.get("driver") == driver]


def forget(driver: dict[str, str]) -> None:
    """Remove every program of one driver."""
    for path in (cache_folder() / _FOLDER).glob(f"*{_SUFFIX}"):
        stored = load(path.stem)
        if stored is not None and stored.about.get("driver") == driver:
            remove(path.stem)
            forget_begun(path.stem)


def _path(name: str) -> Path:
    return cache_folder() / _FOLDER / f"{name}{_SUFFIX}"


def _checksum(name: str, body: bytes) -> bytes:
    return hashlib.sha256(name.encode() + body).hexdigest().encode()


def _parsed(name: str, data: bytes) -> Stored | None:
    head = len(_FORMAT) + _HASH
    body = data[head + 1 :]
    if not data.startswith(_FORMAT) or data[len(_FORMAT) : head] != _checksum(name, body):
        return None
    text, _, binary = body.partition(b"\n")
    try:
        about = parse_json(text)
    except ValueError:
        return None
    return Stored(about, binary) if isinstance(about, dict) else None
