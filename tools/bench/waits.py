"""Where the host waits for the device: each blocking call, who made it, and how long it took.

The driver's blocking calls are wrapped while this lasts. The queue is in order, so that a blocking
copy, however small and in whichever direction, waits for all that was enqueued before.
"""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any
from unittest import mock

import numpy as np
import pyopencl as cl

import rift_cl as rift
from bench.timing import timed

_PACKAGE = Path(rift.__file__).parent
# What every copy goes through says nothing about who wants it.
_BELOW = _PACKAGE / "cl"


@dataclass(frozen=True)
class Wait:
    """One blocking call.

    Args:
        kind: ``to the device``, ``to the host``, ``event`` (of a copy begun before) or ``finish``.
        place: file and line in the package, or of this tool, that asked for it.
        function: the function there.
        bytes: that were copied.
        seconds: until it returned.
    """

    kind: str
    place: str
    function: str
    bytes: int
    seconds: float


@contextmanager
def each_wait() -> Iterator[list[Wait]]:
    """Note every blocking call of this process while this lasts."""
    copy, finish, wait = cl.enqueue_copy, cl.CommandQueue.finish, cl.Event.wait
    log = list[Wait]()

    def note(kind: str, size: int, run: Callable[[], Any]) -> Any:
        place, function = _caller()
        seconds, result = timed(run)
        log.append(Wait(kind, place, function, size, seconds))
        return result

    def copied(queue: Any, to: Any, source: Any, **how: Any) -> Any:
        def run() -> Any:
            return copy(queue, to, source, **how)

        if not how.get("is_blocking", True):
            return run()
        hosts = [array for array in (to, source) if isinstance(array, np.ndarray)]
        kind = "to the host" if isinstance(to, np.ndarray) else "to the device"
        return note(kind, sum(array.nbytes for array in hosts), run)

    def finished(queue: Any) -> None:
        note("finish", 0, lambda: finish(queue))

    def waited(event: Any) -> None:
        note("event", 0, lambda: wait(event))

    with (
        mock.patch.object(cl, "enqueue_copy", copied),
        mock.patch.object(cl.CommandQueue, "finish", finished),
        mock.patch.object(cl.Event, "wait", waited),
    ):
        yield log


def _caller() -> tuple[str, str]:
    """File with line, and function, of the nearest caller above the package's lowest layer."""
    frame: Any = sys._getframe(1)
    while frame is not None:
        path = Path(frame.f_code.co_filename)
        inside = path.is_relative_to(_PACKAGE) and not path.is_relative_to(_BELOW)
        if inside or (path.parent == Path(__file__).parent and path != Path(__file__)):
            root = _PACKAGE.parent if inside else path.parents[2]
            return f"{path.relative_to(root).as_posix()}:{frame.f_lineno}", frame.f_code.co_name
        frame = frame.f_back
    return "elsewhere", ""
