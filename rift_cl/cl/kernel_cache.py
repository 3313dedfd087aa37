"""The folder in which a driver keeps compiled kernels, and the lock round a first build.

PoCL loads its cached kernels as shared libraries, so whoever can write there runs code as the
user: the folder is ours alone (mode 0700, owner checked). When that folder cannot be used PoCL's
device vanishes without an error, so a private temporary folder takes its place with a warning.
PoCL also loses a build when several processes make the same one at once; a file lock round the
build and the first launch prevents that.
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

from rift_cl import __version__

try:
    import fcntl
except ImportError:  # Windows: no PoCL wheel there, so no cache to guard
    fcntl = None  # type: ignore[assignment]


@cache
def cache_folder() -> Path:
    """Choose the cache folder and point the drivers at it; call before a driver loads.

    ``RIFT_CACHE_DIR`` names another folder. A ``POCL_CACHE_DIR`` that the user set is kept as
    long as it can be used.
    """
    folder = _private(_wanted())
    if folder is None:
        folder = Path(tempfile.mkdtemp(prefix="rift-cl-"))
        warnings.warn(
            f"kernel cache {_wanted()} cannot be used; compiled kernels go to {folder} and are "
            "lost afterwards: set RIFT_CACHE_DIR to a folder that you own",
            stacklevel=2,
        )
    foreign = os.environ.get("POCL_CACHE_DIR")
    if foreign is None or _private(Path(foreign)) is None:
        os.environ["POCL_CACHE_DIR"] = str(folder)
    # pyopencl's own cache is a pickle; the drivers that need one keep a better one themselves.
    os.environ.setdefault("PYOPENCL_NO_CACHE", "1")
    return folder


def _wanted() -> Path:
    named = os.environ.get("RIFT_CACHE_DIR")
    if named:
        return Path(named)
    root = os.environ.get("XDG_CACHE_HOME") or Path("~/.cache").expanduser()
    return Path(root) / "rift_cl" / __version__


def _private(folder: Path) -> Path | None:
    """The folder, made and closed to others, or None when it is not ours or not writable."""
    try:
        folder.mkdir(parents=True, exist_ok=True)
        if hasattr(os, "getuid") and folder.stat().st_uid != os.getuid():
            return None
        folder.chmod(0o700)
        with tempfile.TemporaryFile(dir=folder):
            return folder
    except OSError:
        return None


@contextlib.contextmanager
def build_lock() -> Iterator[None]:
    """Hold the cache against every other process of this user."""
    if fcntl is None:
        yield
        return
    with (cache_folder() / "build.lock").open("w") as handle:
        fcntl.flock(handle, fcntl.LOCK_EX)
        yield


def cache_size() -> int:
    """Bytes in the cache folder."""
    files = (path for path in cache_folder().rglob("*") if path.is_file())
    return sum(path.stat().st_size for path in files)


def clear_cache() -> int:
    """Remove every compiled kernel and return how many bytes that freed."""
    freed = cache_size()
    with build_lock():
        for entry in cache_folder().iterdir():
            if entry.is_dir():
                shutil.rmtree(entry, ignore_errors=True)
            elif entry.name != "build.lock":
                entry.unlink(missing_ok=True)
    return freed
