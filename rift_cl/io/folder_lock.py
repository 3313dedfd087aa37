"""Keeps a folder for one process at a time: two runs that write into one folder would mix.

What keeps it is a lock on an open file, not that the file is there: the operating system lets go of
it when the process ends, however that ends. Where there are no such locks (some network file
systems) nothing is kept. A process does not keep a folder from itself.
"""

from __future__ import annotations

import atexit
import os
import socket
from contextlib import suppress
from pathlib import Path
from typing import IO

from rift_cl.errors import OutputError
from rift_cl.io.output import writing

try:
    import fcntl
except ImportError:
    fcntl = None  # type: ignore[assignment]
try:
    import msvcrt
except ImportError:
    msvcrt = None  # type: ignore[assignment]

# There while a run is; a run that was killed leaves it, and nobody holds it then.
LOCK_NAME = ".running"
_LONGEST_NOTE = 200
# Windows lets nobody else read a byte that is locked: one far behind the note is.
_LOCKED_BYTE = 1 << 20
_held: dict[Path, IO[str]] = {}


def keep(folder: Path) -> None:
    """Keep a folder until ``let_go``, or until this process ends.

    Raises:
        OutputError: another process keeps it, or nothing can be written there.
    """
    path = _lock_of(folder)
    if path in _held:
        return
    with writing(folder):
        while path not in _held:
            handle = path.open("a+", encoding="utf-8")
            if not _locked(handle):
                handle.seek(0)
                who = handle.read(_LONGEST_NOTE).strip() or "another process"
                handle.close()
                raise OutputError(
                    f"{folder}: {who} is writing here: wait for its end, or name another folder "
                    "(--out)"
                )
            if _is_there(handle, path):
                _held[path] = handle
            else:
                handle.close()
    with suppress(OSError):
        handle.truncate(0)
        handle.write(f"process {os.getpid()} on {socket.gethostname()}")
        handle.flush()


def let_go(folder: Path) -> None:
    """Let others have a folder; nothing where it is not kept."""
    _release(_lock_of(folder))


def _lock_of(folder: Path) -> Path:
    # Unlike Path.resolve, this takes links in a circle, which are told where they are followed.
    return Path(os.path.realpath(folder), LOCK_NAME)


def _release(path: Path) -> None:
    handle = _held.pop(path, None)
    if handle is None:
        return
    # Removed while it is locked, so that nobody's lock is on a file without a name. Windows removes
    # no file that anybody has open, so that there it is closed before.
    steps = [handle.close, path.unlink] if _on_windows() else [path.unlink, handle.close]
    for step in steps:
        with suppress(OSError):
            step()


def _on_windows() -> bool:
    return fcntl is None


def _locked(handle: IO[str]) -> bool:
    """Lock a file, without waiting; whether nobody else has."""
    try:
        if _on_windows():
            os.lseek(handle.fileno(), _LOCKED_BYTE, os.SEEK_SET)
            msvcrt.locking(handle.fileno(), msvcrt.LK_NBLCK, 1)  # type: ignore[attr-defined]
        else:
            fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except (BlockingIOError, PermissionError):
        return False
    except OSError:
        # A file system without locks.
        pass
    return True


def _is_there(handle: IO[str], path: Path) -> bool:
    """Whether a file still has its name: whoever had it before may have removed it."""
    if _on_windows():
        # Nobody can, while it is open.
        return True
    try:
        return os.path.samestat(os.fstat(handle.fileno()), path.stat())
    except OSError:
        return False


@atexit.register
def _release_all() -> None:
    for path in [*_held]:
        _release(path)
