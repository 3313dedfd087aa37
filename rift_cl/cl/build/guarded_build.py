"""Compiling where a compiler may die: in a child process, with workarounds for what it cannot do.

One child per device lives as long as this process and is started again when it dies. Its driver
has a cache of its own: what PoCL leaves in one as it dies, it would load without any kernel in it.
What it leaves there otherwise is put into ours, where this process finds it compiled. A compiler
that crashes, hangs or refuses a kernel is asked again in other ways, the gentlest first. Each time
it may take half of what is left of twice ``LIMIT``: a kernel is waited for no longer than that,
however often it is asked for, and again where nothing came of repeated launches. What a child says
that somebody ended, or that had no memory, is no verdict on its compiler, and is told as passing.
"""

from __future__ import annotations

import shutil
import tempfile
import time
from collections.abc import Sequence
from pathlib import Path
from typing import Any, NamedTuple

from rift_cl.child_process import HUNG, Buffer, ChildProcess
from rift_cl.cl.build.cache_check import program_files
from rift_cl.cl.build.first_launch import FirstLaunch, without_numbers
from rift_cl.cl.build.intel_runtime import renew_intel_runtime
from rift_cl.cl.build.kernel_cache import LEAST_ROOM, cache_folder, room
from rift_cl.cl.build.program_store import write_whole
from rift_cl.cl.build.worker import SCRATCH
from rift_cl.errors import DeviceError

# Seconds after which a compiler that is asked for the first time counts as hanging; and the least.
LIMIT, _LEAST = 300.0, 1.0
# Others end a child in these ways, as the system does where memory runs out; no compiler by itself.
_ENDED = ("SIGKILL", "SIGTERM", "SIGINT", "SIGHUP")
# Seconds that repeated launches may take: all that they wait for is the compiler.
_LONGEST_LAUNCHES = 120.0
_FULL = "is full"
UNOPTIMIZED = "-cl-opt-disable"
# How a kernel is built: what stands before its source, and further options.
WAYS = {
    "": ("", ()),
    "noinline": ("#define static static __attribute__((noinline))\n", ()),
    "without optimization": ("", (UNOPTIMIZED,)),
}


class Built(NamedTuple):
    """What came of building a kernel.

    Args:
        binary: what the driver gave, empty where it gives none; None where it did not compile.
        way: the workaround that was taken, empty for none.
        fault: what the first attempt met, empty for nothing.
        log: the compiler's words, where it refused the kernel.
        passing: whether a cause outside of the compiler had a hand in it, so that another time may
            bring something else.
    """

    binary: bytes | None
    way: str
    fault: str
    log: str
    passing: bool = False


class Request(NamedTuple):
    """A kernel to build.

    Args:
        selector: of the device, as platform and index.
        device: its name.
        kernel: its entry point.
        source: its source, with the includes in line.
        options: what the compiler is given.
        launches: first launches that the child tries as well.
        binary: whether the binary is wanted; if not, our cache is given what the driver keeps.
    """

    selector: str
    device: str
    kernel: str
    source: str
    options: list[str]
    launches: Sequence[FirstLaunch] = ()
    binary: bool = True


def way_to_build(way: str, source: str, options: list[str]) -> tuple[str, list[str]]:
    """The source and the options that a workaround stands for; others than ``WAYS`` change none."""
    before, further = WAYS.get(way, WAYS[""])
    return before + source, [*options, *further]


def guarded_build(request: Request, worker: Worker | None = None) -> Built:
    """Build a kernel in a child process, in the first way that the compiler can do.

    Args:
        request: the kernel.
        worker: the child; the one of this device if not given.
    """
    worker = worker or _worker_of(request.selector)
    until = time.monotonic() + 2 * worker.limit
    first = log = ""
    passing = False
    for way in WAYS:
        source, options = way_to_build(way, request.source, request.options)
        asked = request._replace(source=source, options=options)
        fault, answer, binary = _answer(asked, worker, until)
        if answer is not None and "error" not in answer:
            return Built(bytes(binary), way, first, log, passing)
        said = "" if answer is None else answer["error"]
        short = answer is not None and answer.get("short of memory", False)
        passing |= short or _is_passing(fault)
        fault = fault or ("its compiler had no memory" if short else "its compiler refused it")
        first, log = first or fault, log or said
    if request.launches and (passing or len(request.launches) == 1):
        # One process may have been ended for another reason, and a launch on zeros die of those;
        # a child that somebody ends tells nothing.
        return guarded_build(request._replace(launches=()), worker)
    return Built(None, "", first, log, passing)


def guarded_launch(request: Request) -> str:
    """Have a child launch a kernel as this process is about to, and keep what is compiled for that.

    Args:
        request: the kernel, and the launch.

    Returns:
        What its compiler died of, empty for nothing; a child that somebody ended tells nothing,
        nor does one that hangs, since the kernel itself may on zeros.
    """
    worker = _worker_of(request.selector)
    fault, _, _ = _answer(request, worker, time.monotonic() + _LONGEST_LAUNCHES)
    return "" if _is_passing(fault) or HUNG in fault else fault


def _is_passing(fault: str) -> bool:
    """Whether a child came to its end by what was no doing of its compiler."""
    return any(words in fault for words in (*_ENDED, _FULL))


def _answer(
    request: Request, worker: Worker, until: float
) -> tuple[str, dict[str, Any] | None, Buffer]:
    """What a child makes of a request, which half of the time ``until`` is left for; see ``ask``.

    A compiler dies of a launch whatever its numbers are. The kernel itself may die of numbers that
    are all zero, or of what does not fit together, as numbers and the zeros of its buffers do; so
    that a launch which passes in one of these ways has been compiled. Zeros come first: by them
    most kernels have nothing to do, while one that looks for the end of a list in zeros may go
    through them for as long as its numbers allow.
    """
    found: tuple[str, dict[str, Any] | None, Buffer] = ("", None, b"")
    tries = [list(map(without_numbers, request.launches)), request.launches]
    for launches in tries if request.launches else [()]:
        asked = request._replace(launches=launches)._asdict()
        found = worker.answer(asked, _half_of_what_is_left(until))
        if not found[0]:
            break
    answer = found[1]
    if answer is not None and "error" not in answer and not request.binary:
        worker.hand_over()
    return found


def _half_of_what_is_left(until: float) -> float:
    return max((until - time.monotonic()) / 2, _LEAST)


class Worker(ChildProcess):
    """A child process that compiles, with a cache of its driver's own.

    Args:
        command: what to start; our own worker if not given.
        limit: seconds after which it counts as hanging.
    """

    def __init__(self, command: list[str] | None = None, limit: float = LIMIT) -> None:
        super().__init__(
            "rift_cl.cl.build.worker", who="its compiler", limit=limit, command=command
        )
        self._scratch: str | None = None

    def answer(
        self, request: dict[str, Any], limit: float | None = None
    ) -> tuple[str, dict[str, Any] | None, Buffer]:
        """Have a request answered; see ``ask``.

        Raises:
            DeviceError: no child can be started.
        """
        renew_intel_runtime()
        try:
            fault, answer, data = self.ask(request, limit)
        except OSError as error:
            raise DeviceError(
                f"the process that compiles kernels cannot be started ({error}): it is Python "
                "itself, and wants memory and the right to start processes"
            ) from error
        place = tempfile.gettempdir()
        if fault and HUNG not in fault and room(Path(place)) < LEAST_ROOM:
            fault += f": {place} {_FULL}"
        return fault, answer, data

    def hand_over(self) -> None:
        """Put what the child's driver has compiled into our cache; hold the kernel's lock.

        Raises:
            DeviceError: it cannot be written there.
        """
        if self._scratch is None:
            return
        folder = cache_folder()
        try:
            for name, path in program_files(Path(self._scratch)):
                if not (folder / name).exists():
                    write_whole(folder / name, Path(path).read_bytes())
        except OSError as error:
            raise DeviceError(
                f"kernel cache {folder} cannot be written ({error.strerror or error}): make room, "
                "or set RIFT_CACHE_DIR to another folder that you own"
            ) from error

    def environment(self) -> dict[str, str]:
        """Where the child's driver keeps what it compiles."""
        place = self._scratch = tempfile.mkdtemp(prefix="rift-cl-compiler-")
        return {"POCL_CACHE_DIR": place, SCRATCH: place}

    def ended(self) -> None:
        """Remove what the child's driver kept."""
        if self._scratch is not None:
            shutil.rmtree(self._scratch, ignore_errors=True)
            self._scratch = None


_workers: dict[str, Worker] = {}


def _worker_of(selector: str) -> Worker:
    if selector not in _workers:
        _workers[selector] = Worker()
    return _workers[selector]
