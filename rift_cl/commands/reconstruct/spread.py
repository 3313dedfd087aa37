"""A reconstruction on the workers of a cluster, who each do runs of slices of one begun run.

A worker opens the scan by itself, takes the axis from the record of the run, reads the rows that
its slices need, cuts these into slabs that fit its own memory, and keeps them beside the others.
What it does is what this process would do without a cluster, so that a run may be gone on with
either way, to the same bits.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Iterator
from contextlib import contextmanager
from functools import lru_cache
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple, TypeAlias

from rift_cl.cluster.address import ClusterAddress
from rift_cl.cluster.beside import Beside
from rift_cl.cluster.on_worker import token
from rift_cl.commands.options import absolute_files
from rift_cl.commands.reconstruct.assembly import Assembly
from rift_cl.commands.reconstruct.overlap import Behind
from rift_cl.commands.reconstruct.settings import ReconstructSettings
from rift_cl.commands.reconstruct.slice_window import cut_evenly
from rift_cl.io.volumes.layout import PART
from rift_cl.progress import Report

if TYPE_CHECKING:
    from rift_cl.cluster.workers import Task, Workers
    from rift_cl.commands.reconstruct.cone_job import ConeReconstruction
    from rift_cl.commands.reconstruct.job import Reconstruction

    Run: TypeAlias = Reconstruction | ConeReconstruction

# Tasks that a worker gets at least, and slices of one at most: a lost worker loses no more.
_SHARES, _MOST = 4, 64


class Receipt(NamedTuple):
    """What a worker tells of slices that it has kept.

    Args:
        figures: numbers that are added up over a run, by name.
        zingers: values that were replaced.
        residuals: root mean square of the residual after each step, by detector row.
        weights: of the total variation, by detector row.
        device: what it was done on.
    """

    figures: dict[str, int]
    zingers: int
    residuals: dict[int, list[float]]
    weights: dict[int, float]
    device: str


@contextmanager
def begun_workers(job: Run) -> Iterator[Beside[Workers] | None]:
    """The workers that a run asks for, which begin while it is got ready; None where it asks none.

    They end while whoever has done with them goes on.
    """
    settings = job.settings
    if settings.cluster is None or settings.preview:
        yield None
        return
    # Imported when used: most runs do without.
    from rift_cl.cluster.workers import cluster_workers, quiet_dask

    given = settings.cluster, job.device, settings.device, settings.part_timeout
    with quiet_dask(), Beside(cluster_workers(*given)) as begun:
        yield begun


def spread(job: Run, begun: Beside[Workers], assembly: Assembly) -> Iterator[Report]:
    """Have the missing slices of a run that has begun made by workers; a report now and then.

    What they have kept goes into the volume while they go on.

    Raises:
        RiftError: a worker cannot do it; what is done is kept.
    """
    kept, workers = job.kept, begun.get()
    workers.wait()
    job.announce(workers.sentence)
    theirs = _of_workers(job.settings)
    run = kept.mark()
    with token(kept.path) as seen:
        workers.check([theirs.out, *_files(theirs), seen])
    runs = _runs(kept.missing(), len(workers), job.block)
    tasks = (_task(wanted, theirs, run) for wanted in runs)
    used: set[str] = set()
    done, lost = -1, 0
    with Behind() as behind:
        for come in workers.each(make_slices, tasks):
            if come is not None:
                used.add(come[1].device)
                job.take(come[1])
            if workers.lost > lost:
                lost = workers.lost
                job.announce("a worker was lost: its slices go to another")
            behind.offer(assembly.catch_up)
            if kept.done > done:
                done = kept.done
                yield job.report(done, {"workers": len(workers)})
        begun.leave()
    job.metrics["workers"] = len(workers)
    if len(used) > 1:
        job.source.notes.append(
            f"Slices were made on {len(used)} kinds of devices, which may round differently: "
            f"{'; '.join(sorted(used))}."
        )


def _runs(missing: list[slice], workers: int, block: int) -> Iterator[slice]:
    """Runs of slices, as many as keep all workers busy to the end.

    Args:
        missing: slices that are not there yet; they begin between blocks.
        workers: how many there are.
        block: slices that are not cut between.
    """
    count = sum(wanted.stop - wanted.start for wanted in missing)
    each = max(1, min(_MOST, -(-count // (_SHARES * workers))))
    if each > PART:
        block = math.lcm(block, PART)
    each = -(-each // block) * block
    for wanted in missing:
        yield from cut_evenly(wanted, each)


def _task(wanted: slice, settings: ReconstructSettings, run: str) -> Task:
    from rift_cl.cluster.workers import Task

    given = settings, run, wanted.start, wanted.stop
    return Task(f"slices {wanted.start} to {wanted.stop}", given, wanted.stop - wanted.start)


def _of_workers(settings: ReconstructSettings) -> ReconstructSettings:
    """The settings as workers take them."""
    # Each worker of this machine has its share of memory, and its device, by its environment.
    own: dict[str, Any] = {}
    if ClusterAddress.of(settings.cluster or "").workers:
        own = {"device": None, "memory": None}
    begun: dict[str, Any] = {"resume": True, "overwrite": False, "cluster": None, "config": None}
    begun["part_timeout"] = None
    return dataclasses.replace(absolute_files(settings), **begun, **own)


def _files(settings: ReconstructSettings) -> list[Path]:
    """The files and folders that are read."""
    named = [settings.scan, settings.geometry, settings.centers]
    return [path for path in named if path is not None]


def make_slices(settings: ReconstructSettings, run: str, first: int, stop: int) -> Receipt:
    """Make and keep some slices of a run that has begun; called on a worker.

    Args:
        settings: the run's.
        run: the token of the run, without which nothing is kept.
        first: the first slice, counted from the first row that was asked for.
        stop: the one after the last.

    Raises:
        RiftError: the worker cannot do it.
    """
    job = _joined(settings, run)
    job.metrics, job.source.clean.zingers = {}, 0
    job.inversion.residuals.clear()
    job.inversion.weights.clear()
    for _ in job.work_on([slice(first, stop)], job.kept.save):
        pass
    device = f"{job.device.name} ({job.device.platform} {job.device.driver})"
    residuals, weights = dict(job.inversion.residuals), dict(job.inversion.weights)
    return Receipt(dict(job.metrics), job.source.clean.zingers, residuals, weights, device)


@lru_cache(maxsize=1)
def _joined(settings: ReconstructSettings, run: str) -> Run:
    """The run, which this worker has joined; it stays open for its next slices.

    A later run of the same settings has another token: files of the same names may hold else by
    then, such as angles that were mended.
    """
    from rift_cl.commands.devices.driver_test import meet_driver
    from rift_cl.commands.reconstruct.choice import reconstruction_of

    job = reconstruction_of(settings, joins=True)
    for _ in meet_driver(job.device):
        pass
    job.join()
    job.kept.token = run
    return job
