"""A process that has loaded what workers need, of which each worker of this machine is a fork.

Python takes longer to load these packages than to make a few slices, and every worker that is
spawned loads them again. The server loads them once, while the command that wants the workers opens
its scan. It speaks to no device and has one thread, so that it can be forked.
"""

from __future__ import annotations

import multiprocessing
import os
import sys
from collections.abc import Iterable, Iterator, Mapping
from contextlib import contextmanager
from multiprocessing import forkserver
from typing import Literal

# macOS's libraries do not endure a fork, and Windows has none. Without the flag, which Python knows
# since version 3.11, what the server loads would be looked for in the current folder first.
_SERVES = (
    sys.platform == "linux"
    and sys.version_info >= (3, 11)
    and (not sys.flags.ignore_environment or sys.flags.safe_path)
)
# What Dask gives a worker's process before it begins: libraries read it as they are loaded.
_ENVIRONMENT = {
    "MALLOC_TRIM_THRESHOLD_": "65536",
    "OMP_NUM_THREADS": "1",
    "MKL_NUM_THREADS": "1",
    "OPENBLAS_NUM_THREADS": "1",
}
# What the server alone is to have: it loads from where this process does.
_PATHS = "PYTHONSAFEPATH", "PYTHONPATH"
_ALWAYS = "distributed", "rift_cl.cluster.on_worker"
# The variables that this process had when the server began, which all forks have.
_had: set[str] = set()


def begin_server(modules: Iterable[str] = ()) -> Literal["forkserver", "spawn"]:
    """Have a server load modules, where there is none yet; returns at once.

    Args:
        modules: names of what the work needs; one that is not there is passed over.

    Returns:
        How workers are to be begun, as Dask calls it: ``spawn`` where no server can be, or where
        this process lacks a variable by now that a fork would have.
    """
    if not _SERVES or not _had <= os.environ.keys():
        return "spawn"
    had = set(os.environ)
    multiprocessing.set_forkserver_preload([*_ALWAYS, *modules])
    try:
        with _environment():
            forkserver.ensure_running()
    except OSError:
        # Its socket is a file, whose path may be too long where the temporary folder's is long.
        return "spawn"
    if not _had:
        _had.update(had)
    return "forkserver"


def worker_environment(own: Mapping[str, str]) -> dict[str, str]:
    """All that a worker is to have around it: what this process has now, and what is its own.

    A fork by itself has what this process had when the server began.
    """
    # Empty, these two are as good as absent.
    return {**dict.fromkeys(_PATHS, ""), **os.environ, **own}


@contextmanager
def _environment() -> Iterator[None]:
    """What the server is to have around it; settings of libraries that somebody has made stay."""
    paths = [path for path in sys.path if path and os.pathsep not in path]
    ours = {name: value for name, value in _ENVIRONMENT.items() if name not in os.environ}
    ours |= dict(zip(_PATHS, ("1", os.pathsep.join(paths)), strict=True))
    before = {name: os.environ[name] for name in ours if name in os.environ}
    os.environ.update(ours)
    try:
        yield
    finally:
        for name in ours:
            del os.environ[name]
        os.environ.update(before)
