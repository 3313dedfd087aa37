"""The workers that a command's work is spread over, and what is done when one of them is lost.

Tasks repeat without harm: each names a part of a run, whose result goes to a file of its own that
appears whole or not at all. So the part of a worker that was killed goes to another, and so does
that of a worker whose device failed or hangs, whose process is begun anew. Few tasks are handed out
at a time, so that the scheduler knows of no more than these, however many there are.
"""

from __future__ import annotations

import asyncio
import queue
import time
import warnings
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import ExitStack, contextmanager, suppress
from dataclasses import dataclass
from importlib.util import find_spec
from pathlib import Path
from typing import Any, NamedTuple

from rift_cl import __version__
from rift_cl.cl.device import Device
from rift_cl.cluster.address import ClusterAddress
from rift_cl.cluster.local import local_cluster, worker_environments
from rift_cl.cluster.on_worker import do, look
from rift_cl.errors import ClusterError, DeviceError, InputError

# Seconds in which a scheduler must answer, and in which a worker must come where there is none.
_ANSWER, _WORKER = 10.0, 60.0
# Tasks that are handed out, for each worker.
_AHEAD = 2
# How often a task is given out that a device failed in.
_TRIES = 3
# Seconds between two looks at what has come, and at who is there.
_LOOK, _WHO = 0.5, 2.0
# A worker hangs when it ends nothing for so many times as long as a task of the size of its own
# took at most so far, and for so many seconds.
_HANGS, _HANGS_FROM = 20.0, 300.0


class Task(NamedTuple):
    """A part of a run.

    Args:
        name: what an error calls it, such as ``slices 16 to 32``.
        arguments: of the function that does it.
        size: how many equal parts it has, such as slices; 0 where nobody knows how long it takes,
            so that no worker counts as hanging over it.
    """

    name: str
    arguments: tuple[Any, ...]
    size: int = 0


@contextmanager
def cluster_workers(
    address: str, device: Device, selector: str | None, limit: float | None = None
) -> Iterator[Workers]:
    """The workers that ``--cluster`` names; those of this machine are started, and ended at last.

    Some may still be to come (``Workers.wait``).

    Args:
        address: ``local:N``, or that of a scheduler.
        device: the one that was chosen here, whose memory local workers divide.
        selector: what it was chosen by; None where nothing was said.
        limit: seconds that a worker may take for a task; told from what others took if None.

    Raises:
        InputError: the address is none, or Dask is not installed.
        ClusterError: no scheduler answers.
    """
    where = ClusterAddress.of(address)
    try:
        from distributed import Client
    except ImportError as error:
        raise InputError(f"--cluster needs Dask ({error}): pip install dask distributed") from error
    with ExitStack() as stack:
        target: Any = address
        if where.workers:
            environments = worker_environments(device, selector, where.workers)
            target = _started(environments, stack)
        try:
            client = stack.enter_context(Client(target, timeout=_ANSWER, set_as_default=False))
        # The timeout of asyncio is an OSError from Python 3.11 on.
        except (OSError, ValueError, asyncio.TimeoutError) as error:
            raise ClusterError(
                f"--cluster {address}: no Dask scheduler answers there: start one with 'dask "
                "scheduler', or mend the address"
            ) from error
        except (TypeError, RuntimeError) as error:
            # What Dask raises where certificates are missing, or its packages for them.
            if not address.startswith("tls://"):
                raise
            raise ClusterError(
                f"--cluster {address}: no connection by TLS ({error}); name the certificates in "
                "Dask's configuration, distributed.comm.tls.ca-file and client.cert and client.key"
            ) from error
        yield Workers(client, where, None if where.workers else selector, limit)


@contextmanager
def quiet_dask() -> Iterator[None]:
    """Without the warnings of Dask: of versions we speak ourselves.

    For the main thread, whose other filters it leaves as they are: they are the whole process's.
    """
    with warnings.catch_warnings():
        warnings.filterwarnings("ignore", module="distributed|tornado|asyncio")
        yield


def _started(environments: list[dict[str, str]], stack: ExitStack) -> Any:
    """Workers of this machine, which end with the stack.

    Raises:
        ClusterError: they do not start.
    """
    try:
        return stack.enter_context(local_cluster(environments))
    except (OSError, RuntimeError) as error:
        raise ClusterError(
            f"the worker processes do not start ({error}); a script wants "
            "'if __name__ == \"__main__\":' before its first call, since each worker imports it"
        ) from error


class Workers:
    """The workers of a scheduler.

    Args:
        client: a ``distributed.Client``.
        address: what ``--cluster`` says.
        selector: of the device on each worker; its own choice if None.
        limit: seconds that a worker may take for a task; told from what others took if None.
    """

    def __init__(
        self,
        client: Any,
        address: ClusterAddress,
        selector: str | None,
        limit: float | None = None,
    ) -> None:
        self._client, self._address, self._selector = client, address, selector
        self._limit = limit
        self.lost = 0
        """How many workers were lost so far."""
        self._there: set[str] = set()
        self._asked = self._seen = time.monotonic()
        self._look_for_workers()

    def __len__(self) -> int:
        """How many there are."""
        return len(self._there)

    @property
    def sentence(self) -> str:
        """How many there are, and where to watch them."""
        address = self._client.scheduler.address
        page = self._client.dashboard_link if find_spec("bokeh") else "none (pip install bokeh)"
        plural = "" if len(self) == 1 else "s"
        return f"{len(self)} worker{plural} of {address}; dashboard: {page}"

    def wait(self) -> None:
        """Wait for the first worker, and where they are our own for all.

        Raises:
            ClusterError: none has come in a minute.
        """
        while len(self) < max(1, self._address.workers):
            time.sleep(_LOOK / 5)
            self._look_for_workers()

    def check(self, paths: Sequence[Path]) -> set[str]:
        """Make sure that every worker has what it takes.

        Args:
            paths: files and folders that each must see.

        Returns:
            The names of their devices.

        Raises:
            ClusterError: one has another version or no device, or does not see a file.
        """
        told = self._ask(self._client.run, look, self._selector, list(paths), on_error="return")
        return {self._device_of(worker, seen) for worker, seen in told.items()}

    def _device_of(self, worker: str, seen: Any) -> str:
        version = seen.get("version") if isinstance(seen, dict) else f"none that answers ({seen})"
        if version != __version__:
            raise ClusterError(
                f"worker {worker}: has the version {version} of rift_cl, wanted {__version__} as "
                "here: install the same on all machines"
            )
        where = f"worker {worker} on {seen['host']}"
        if "refusal" in seen:
            raise ClusterError(f"{where}: {seen['refusal']}")
        if "unseen" in seen:
            raise ClusterError(
                f"{where}: does not see {seen['unseen']}; what is read and --out must be on a disk "
                "that all workers share, under the same path"
            )
        return str(seen["device"])

    def each(
        self, function: Callable[..., Any], tasks: Iterable[Task]
    ) -> Iterator[tuple[Task, Any] | None]:
        """Have tasks done; results in the order in which they come.

        Args:
            function: of an importable module; does one task, and may do it twice.
            tasks: taken a few at a time.

        Yields:
            A task and its result, or None where a while has gone by without one.

        Raises:
            RiftError: what a task raised.
            ClusterError: tasks ended every worker that they were given to, which is told once
                no others are left; or there are no workers any more, or no scheduler.
        """
        waiting, running = iter(tasks), _Running(self._client, function, self._limit)
        killers: list[str] = []
        try:
            while True:
                running.fill(waiting, _AHEAD * max(1, len(self)))
                if not len(running):
                    break
                self._look_around(running)
                come = running.next(_LOOK)
                done = None if come is None else self._result(come, running, killers)
                yield done
        finally:
            running.cancel()
        if killers:
            raise ClusterError(
                f"not done: {', '.join(killers)}; every worker that these were given to ended, "
                "by one of them or by itself; --resume tries them again"
            )

    def _result(
        self, come: _Begun, running: _Running, killers: list[str]
    ) -> tuple[Task, Any] | None:
        """A task with what it gave; None where it is to be done again, or cannot be."""
        from distributed import KilledWorker

        if come.future.status == "finished":
            seconds, result = self._ask(come.future.result)
            running.took(come.task, seconds)
            return come.task, result
        if come.future.status != "error":
            raise self._gone()
        error = come.future.exception()
        if isinstance(error, KilledWorker):
            killers.append(come.task.name)
            return None
        if isinstance(error, DeviceError) and come.tries < _TRIES:
            # What the process had on the device is lost.
            self._begin_anew(getattr(error, "worker", None))
            running.begin(come.task, come.tries + 1)
            return None
        raise error

    def _begin_anew(self, worker: str | None) -> None:
        """Begin a worker's process anew; one that no nanny watches stays as it is."""
        if worker is not None:
            with suppress(Exception):
                self._client.restart_workers([worker])

    def _look_around(self, running: _Running) -> None:
        """Now and then see who is there, and who hangs.

        Raises:
            ClusterError: nobody has been there for a minute, or the scheduler is gone, or a worker
                hangs that cannot be begun anew.
        """
        if time.monotonic() - self._asked < _WHO:
            return
        self._look_for_workers()
        doing = self._ask(self._client.processing)
        for worker in running.hanging(doing, time.monotonic()):
            try:
                self._client.restart_workers([worker])
            except ValueError as error:
                raise ClusterError(
                    f"worker {worker}: hangs, and no Dask nanny watches it: end it by hand; "
                    "--resume goes on"
                ) from error
            except (OSError, TimeoutError):
                # Then the scheduler has let it go.
                continue

    def _look_for_workers(self) -> None:
        threads: dict[str, int] = self._ask(self._client.nthreads)
        for worker, count in threads.items():
            if count > 1:
                raise ClusterError(
                    f"worker {worker}: has {count} threads, wanted one, since tasks share what a "
                    "process has on its device: start it with 'dask worker ADDRESS --nthreads 1'"
                )
        now = set(threads)
        self.lost += len(self._there - now)
        self._there, self._asked = now, time.monotonic()
        if now:
            self._seen = self._asked
        elif self._asked - self._seen > _WORKER:
            raise ClusterError(
                f"--cluster {self._address.text}: no worker has been there for {_WORKER:.0f} s: "
                "start one, such as with 'dask worker ADDRESS --nthreads 1'"
            )

    def _ask(self, question: Callable[..., Any], *arguments: Any, **options: Any) -> Any:
        """Ask the scheduler something.

        Raises:
            ClusterError: it does not answer any more.
        """
        from distributed import CancelledError

        try:
            return question(*arguments, **options)
        except (OSError, TimeoutError, CancelledError) as error:
            raise self._gone() from error

    def _gone(self) -> ClusterError:
        return ClusterError(
            f"--cluster {self._address.text}: the scheduler does not answer any more: start it "
            "and its workers again; --resume goes on"
        )


@dataclass
class _Begun:
    """A task that was handed out.

    Args:
        task: the task.
        future: its result to be.
        tries: how often it was handed out.
    """

    task: Task
    future: Any
    tries: int


class _Running:
    """The tasks that are handed out.

    Args:
        client: of the scheduler.
        function: does a task.
        limit: seconds that a worker may take for a task; told from what others took if None.
    """

    def __init__(
        self, client: Any, function: Callable[..., Any], limit: float | None = None
    ) -> None:
        self._client, self._function, self._limit = client, function, limit
        self._ended: queue.Queue[Any] = queue.Queue()
        self._begun: dict[str, _Begun] = {}
        # Seconds of the slowest so far, for each of its parts.
        self._slowest = 0.0
        # What each worker has, and since when it has ended none of it.
        self._has: dict[str, tuple[frozenset[str], float]] = {}

    def __len__(self) -> int:
        return len(self._begun)

    def fill(self, waiting: Iterator[Task], most: int) -> None:
        """Hand tasks out until there are so many."""
        while len(self) < most and (task := next(waiting, None)) is not None:
            self.begin(task)

    def begin(self, task: Task, tries: int = 1) -> None:
        """Hand a task out."""
        given = __version__, self._function, *task.arguments
        future = self._client.submit(do, *given, pure=False)
        self._begun[future.key] = _Begun(task, future, tries)
        future.add_done_callback(self._ended.put)

    def next(self, seconds: float) -> _Begun | None:
        """The next one that ended, if one does so soon."""
        try:
            return self._begun.pop(self._ended.get(timeout=seconds).key)
        except queue.Empty:
            return None

    def took(self, task: Task, seconds: float) -> None:
        """Learn from a task that was done."""
        if task.size:
            self._slowest = max(self._slowest, seconds / task.size)

    def hanging(self, doing: Mapping[str, Iterable[str]], now: float) -> list[str]:
        """Workers that have ended nothing for too long; each is told once, then begins again.

        A worker does one task at a time: what it does began when it ended the last one, or came.

        Args:
            doing: keys of the tasks that each worker has.
            now: seconds of a clock.
        """
        found: dict[str, tuple[frozenset[str], float]] = {}
        for worker, keys in doing.items():
            has = frozenset(keys) & self._begun.keys()
            before, since = self._has.get(worker, (frozenset(), now))
            found[worker] = has, since if before and before <= has else now
        hang = [w for w, (has, since) in found.items() if now - since > self._longest(has)]
        self._has = {worker: had for worker, had in found.items() if worker not in hang}
        return hang

    def _longest(self, keys: Iterable[str]) -> float:
        """Seconds that a worker with these tasks may take for one of them."""
        sizes = [self._begun[key].task.size for key in keys]
        if self._limit is not None:
            return self._limit if sizes else float("inf")
        if not (self._slowest and sizes and all(sizes)):
            return float("inf")
        return max(_HANGS * self._slowest * max(sizes), _HANGS_FROM)

    def cancel(self) -> None:
        """Take back what is not done."""
        with suppress(Exception):
            self._client.cancel([begun.future for begun in self._begun.values()], force=True)
