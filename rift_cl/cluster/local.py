"""Worker processes on this machine: which device each has, and how much of everything."""

from __future__ import annotations

import os
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

from rift_cl.cl.device import Device
from rift_cl.cl.discovery import alike_devices
from rift_cl.cluster.fork_server import begin_server, worker_environment

LOOPBACK = "127.0.0.1"
# What tells PoCL how many threads to take: until version 3, and since version 4.
_DRIVER_THREADS = "POCL_MAX_PTHREAD_COUNT", "POCL_CPU_MAX_CU_COUNT"


def worker_environments(device: Device, selector: str | None, workers: int) -> list[dict[str, str]]:
    """The environment of each worker: its device, its share of the memory, and driver threads.

    Devices like the one that was chosen are dealt out in turn. Those who share one share its
    memory, and the cores of the machine are divided among the threads of all workers' drivers.

    Args:
        device: the one that was chosen, whose budget is divided.
        selector: what it was chosen by; None where nothing was said.
        workers: how many there are.
    """
    devices = alike_devices(device, selector)
    on_host = device.traits.is_cpu or device.traits.unified
    sharing = workers if on_host else -(-workers // len(devices))
    threads = str(max(1, _cores() // workers))
    shared = {"RIFT_MEMORY": str(max(1, device.budget // sharing))}
    # Whoever set them knows the machine.
    shared |= {name: os.environ.get(name, threads) for name in _DRIVER_THREADS}
    return [
        {"RIFT_DEVICE": devices[number % len(devices)].selector, **shared}
        for number in range(workers)
    ]


@contextmanager
def local_cluster(environments: list[dict[str, str]]) -> Iterator[Any]:
    """A scheduler and a worker for each environment, which this machine alone can reach."""
    method = begin_server()
    import dask
    from distributed import Nanny, Scheduler, SpecCluster

    settings = {
        # Dask looks at every thread a hundred times a second: a processor's time, and memory that
        # grows with the run.
        "distributed.worker.profile.enabled": False,
        "distributed.worker.multiprocessing-method": method,
    }
    scheduler = {
        "cls": Scheduler,
        "options": {"host": LOOPBACK, "port": 0, "dashboard_address": f"{LOOPBACK}:0"},
    }
    workers = {
        number: {
            "cls": Nanny,
            "options": {
                "host": LOOPBACK,
                "nthreads": 1,
                # Work is cut to the budget; what Dask counts is the driver's memory as well.
                "memory_limit": 0,
                "dashboard": False,
                "env": worker_environment(environment),
                "preload": ["rift_cl.cluster.on_worker"],
                "silence_logs": "CRITICAL",
            },
        }
        for number, environment in enumerate(environments)
    }
    # Until the end, since a worker that is lost is begun anew.
    with (
        dask.config.set(settings),
        SpecCluster(workers=workers, scheduler=scheduler, silence_logs="CRITICAL") as cluster,
    ):
        yield cluster


def _cores() -> int:
    if hasattr(os, "sched_getaffinity"):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1
