"""The folder in which a driver keeps compiled kernels, and the lock round a first build.

PoCL loads its cached kernels as shared libraries, so whoever can write there runs code as the
user: the folder is ours alone (mode 0700, owner checked). When that folder cannot be used PoCL's
device vanishes without an error, so a private temporary folder takes its place with a warning.
PoCL also loses a build when several processes make the same one at once; a file lock round the
build and the first launch prevents that, one for each kernel: other kernels are built meanwhile.
"""

from __future__ import annotations

import contextlib
import os
import shutil
import tempfile
import warnings
from collections.abc import Iterator
from functools import cache
from pathlib import Path
from typing import IO

from rift_cl import __version__
from rift_cl.cl.budget import format_bytes
from rift_cl.cl.build.cache_check import own_file, record, remove_damaged
from rift_cl.errors import DeviceError

try:
    import fcntl
except ImportError:  # Windows: no PoCL wheel there, so no cache to guard
    fcntl = None  # type: ignore[assignment]
try:
    import resource
except ImportError:
    resource = None  # type: ignore[assignment]

_LOCK, _TURN = "build.lock", "turn.lock"
_LOCK_SUFFIX = ".lock"
# Bytes that a build is given: PoCL ends the process where its compiler cannot write.
LEAST_ROOM = 16 << 20


def prepare_cache() -> None:
    """Make the cache safe to load from; call before a driver loads."""
    with build_lock(), contextlib.suppress(OSError):
        remove_damaged(cache_folder())


@cache
def cache_folder() -> Path:
    """Choose the cache folder and point the drivers at it; call before a driver loads.

    It is ``rift_cl/<version>`` inside ``RIFT_CACHE_DIR``, or else inside the user's cache folder.
    A ``POCL_CACHE_DIR`` is overruled, because locks and checks hold in our own folder alone.

    Raises:
        DeviceError: neither that folder nor a temporary one can be used.
    """
    folder = _private(_root())
    if folder is None:
        folder = _temporary()
        warnings.warn(
            f"kernel cache in {_root()} cannot be used, or its disk is full; compiled kernels go "
            f"to {folder}, where the next run will not find them: set RIFT_CACHE_DIR to a folder "
            "that you own",
            stacklevel=2,
        )
        # Child processes go to the same place, so that its lock holds for them too.
        os.environ["RIFT_CACHE_DIR"] = str(folder.parents[1])
    os.environ["POCL_CACHE_DIR"] = str(folder)
    # pyopencl's own cache is a pickle; the drivers that need one keep a better one themselves.
    os.environ.setdefault("PYOPENCL_NO_CACHE", "1")
    return folder


def _root() -> Path:
    named = os.environ.get("RIFT_CACHE_DIR") or os.environ.get("XDG_CACHE_HOME")
    return Path(named or os.path.expanduser("~/.cache")).absolute()  # noqa: PTH111 - never raises


def _private(root: Path) -> Path | None:
    """Our folder under a root, made and closed to others, or None when that cannot be."""
    folder = root / "rift_cl" / __version__
    try:
        folder.mkdir(mode=0o700, parents=True, exist_ok=True)
        # Whoever owns a folder above ours can put another in its place.
        owners = {path.stat().st_uid for path in (folder, folder.parent, root)}
        if hasattr(os, "getuid") and owners != {os.getuid()}:
            return None
        folder.chmod(0o700)
        with tempfile.TemporaryFile(dir=folder):
            return folder if room(folder) >= LEAST_ROOM else None
    except OSError:
        return None


def room(folder: Path) -> float:
    """Bytes that a file in a folder may take: what the disk has left, or ``ulimit -f`` allows."""
    left = float(shutil.disk_usage(folder).free)
    if resource is not None:
        limit, _ = resource.getrlimit(resource.RLIMIT_FSIZE)
        left = left if limit == resource.RLIM_INFINITY else min(left, limit)
    return left


def _temporary() -> Path:
    with contextlib.suppress(OSError):
        folder = _private(Path(tempfile.mkdtemp(prefix="rift-cl-")))
        if folder is not None:
            return folder
    raise DeviceError(
        f"compiled kernels can be kept neither in {_root()} nor in a temporary folder: set "
        "RIFT_CACHE_DIR to a folder that you own and can write to, on a disk with "
        f"{format_bytes(LEAST_ROOM)} left"
    )


@contextlib.contextmanager
def build_lock(kernel: str = "", *, write_down: bool = True) -> Iterator[None]:
    """Hold one kernel in the cache, or the whole cache, against every other process of this user.

    Args:
        kernel: the name of a kernel, all of whose variants are held; empty for the whole cache.
        write_down: whether files that are new are recorded afterwards, which walks the cache; not
            where the next to hold it does.

    Raises:
        DeviceError: the cache folder cannot be used any more, or has no room for a kernel.
    """
    folder = cache_folder()
    with contextlib.ExitStack() as held:
        try:
            folder.mkdir(mode=0o700, parents=True, exist_ok=True)
            whole = held.enter_context(own_file(folder / _LOCK).open("w"))
            # Whoever wants the whole cache keeps this one while he waits, lest others keep him out.
            with own_file(folder / _TURN).open("w") as turn:
                _lock(turn)
                _lock(whole, shared=bool(kernel))
            if kernel:
                own = own_file(folder / f"{kernel}{_LOCK_SUFFIX}")
                _lock(held.enter_context(own.open("w")))
            left = room(folder)
        except OSError as error:
            raise DeviceError(
                f"kernel cache {folder} cannot be used any more ({error.strerror}): make it "
                "writable, or set RIFT_CACHE_DIR to a folder that you own"
            ) from error
        if kernel and left < LEAST_ROOM:
            raise DeviceError(
                f"kernel cache {folder}: {format_bytes(int(left))} are left for compiled kernels, "
                f"wanted {format_bytes(LEAST_ROOM)}: free some space on that disk, or set "
                "RIFT_CACHE_DIR to a folder on another"
            )
        yield
        if not write_down:
            return
        # What cannot be recorded is trusted, as any driver trusts its cache. What others build
        # meanwhile is not whole yet: the last of them records it all.
        with contextlib.suppress(OSError):
            if not kernel or _lock(whole, wait=False):
                record(folder)


def _lock(handle: IO[str], *, shared: bool = False, wait: bool = True) -> bool:
    """Lock a file; whether that could be done without waiting, where that was asked for.

    Some network file systems have no locks; a lost race is then repeated (``builder``).
    """
    if fcntl is not None:
        kind = fcntl.LOCK_SH if shared else fcntl.LOCK_EX
        try:
            fcntl.flock(handle, kind if wait else kind | fcntl.LOCK_NB)
        except BlockingIOError:
            return False
        except OSError:
            pass
    return True


def cache_size() -> int:
    """Bytes in the cache folder."""
    files = (path for path in cache_folder().rglob("*") if path.is_file())
    return sum(path.stat().st_size for path in files)


def clear_cache() -> int:
    """Remove every compiled kernel and return how many bytes that freed."""
    with build_lock():
        before = cache_size()
        for entry in cache_folder().iterdir():
            if entry.is_dir():
                shutil.rmtree(entry, ignore_errors=True)
            elif entry.suffix != _LOCK_SUFFIX:
                entry.unlink(missing_ok=True)
        return before - cache_size()
