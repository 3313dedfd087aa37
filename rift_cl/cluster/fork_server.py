"""A process that has loaded what workers need, of which each worker of this machine is a fork.

Python takes longer to load these packages than to make a few slices, and every worker that is
spawned loads them again. The server loads them once, while the command that wants the workers opens
its scan. It speaks to no device and has one thread, so that it can be forked.
"""

from __future__ import annotations

import multiprocessing
import os
import sys
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from multiprocessing import forkserver

# How worker processes are begun, as Dask calls it: macOS's libraries do not endure a fork, and
# Windows has none.
METHOD = "forkserver" if sys.platform == "linux" else "spawn"
# What Dask gives a worker's process before it begins: libraries read it as they are loaded.
_ENVIRONMENT = {
    "MALLOC_TRIM_THRESHOLD_": "65536",
    "OMP_NUM_THREADS": "1",
    "MKL_NUM_THREADS": "1",
    "OPENBLAS_NUM_THREADS": "1",
}
_ALWAYS = "distributed", "rift_cl.cluster.on_worker"


def begin_server(modules: Iterable[str] = ()) -> None:
    """Have a server load modules, where there is none yet; returns at once.

    Args:
        modules: names of what the work needs; one that is not there is passed over.
    """
    if METHOD != "forkserver":
        return
    multiprocessing.set_forkserver_preload([*_ALWAYS, *modules])
    with _environment():
        forkserver.ensure_running()


@contextmanager
def _environment() -> Iterator[None]:
    """What the server is to have around it; what somebody has set stays."""
    ours = [name for name in _ENVIRONMENT if name not in os.environ]
    os.environ.update({name: _ENVIRONMENT[name] for name in ours})
    try:
        yield
    finally:
        for name in ours:
            del os.environ[name]
