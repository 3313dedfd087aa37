"""Ends a process whose device hangs: a call of its driver that does not come back.

Such a call cannot be broken off, neither from this thread nor from another. What is left is to say
what happened and to end the process; checkpoints and slabs that were kept are whole, and
``--resume`` goes on. A library has no right to do that, so that only commands are watched.

Seen are calls that wait with Python's lock let go: copies, and waits for what was enqueued. A
driver that hangs while it enqueues holds that lock, so that nothing in this process can tell.
"""

from __future__ import annotations

import os
import threading
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from typing import TYPE_CHECKING, NamedTuple

from rift_cl.errors import InputError

if TYPE_CHECKING:
    from rift_cl.cl.device import Device

# Seconds that a GPU may take for what was enqueued; 0 for any time. CPUs do not hang, and may
# rightly take hours.
VARIABLE = "RIFT_DEVICE_TIMEOUT"
_GPU = 1800.0
_LOOKS, _LONGEST_TICK = 4, 1.0


class Call(NamedTuple):
    """A call of a driver that has begun.

    Args:
        doing: what it does, as a sentence names it.
        device: the device's name.
    """

    doing: str
    device: str


# By thread. Every call is an object of its own, so that two calls for the same are told apart.
_calls: dict[int, Call] = {}


@contextmanager
def in_driver(doing: str, device: str) -> Iterator[None]:
    """Note that the calling thread is in a call of a driver."""
    thread = threading.get_ident()
    before = _calls.get(thread)
    _calls[thread] = Call(doing, device)
    try:
        yield
    finally:
        if before is None:
            del _calls[thread]
        else:
            _calls[thread] = before


class Patience:
    """Counts looks at the calls of all threads.

    Looks are counted and not seconds: a process that was stopped for an hour, as batch systems do,
    was not waiting for its device.

    Args:
        looks: at how many of them in a row a call may be found.
    """

    def __init__(self, looks: int) -> None:
        self._looks = looks
        self._seen: dict[int, tuple[Call, int]] = {}

    def look(self, calls: Mapping[int, Call]) -> Call | None:
        """Look once; the call that was found too often, if there is one."""
        seen = {}
        for thread, call in list(calls.items()):
            known, count = self._seen.get(thread, (None, 0))
            seen[thread] = call, count + 1 if known is call else 0
            if seen[thread][1] > self._looks:
                return call
        self._seen = seen
        return None


@contextmanager
def watched(seconds: float, hung: Callable[[str], None]) -> Iterator[None]:
    """Call a function with a sentence, in another thread, when a driver's call takes too long.

    Args:
        seconds: that it may take; 0 for any time.
        hung: what to do then.
    """
    if seconds == 0:
        yield
        return
    over = threading.Event()
    tick = min(seconds / _LOOKS, _LONGEST_TICK)

    def watch() -> None:
        patience = Patience(round(seconds / tick))
        while not over.wait(tick):
            call = patience.look(_calls)
            if call is not None:
                hung(
                    f"{call.device} has not answered for {seconds:g} s while {call.doing}: its "
                    f"driver hangs, or needs a larger {VARIABLE} (seconds; 0 for any time)"
                )
                return

    thread = threading.Thread(target=watch, name="watchdog", daemon=True)
    thread.start()
    try:
        yield
    finally:
        over.set()


def patience_with(device: Device) -> float:
    """Seconds that a call of a device's driver may take; 0 for any time.

    Raises:
        InputError: the environment's ``RIFT_DEVICE_TIMEOUT`` is no such number.
    """
    given = os.environ.get(VARIABLE, "").strip()
    if not given:
        return 0.0 if device.kind == "CPU" else _GPU
    try:
        seconds = float(given)
    except ValueError:
        seconds = -1.0
    if not 0 <= seconds < float("inf"):
        raise InputError(f"{VARIABLE} is {given!r}, wanted seconds, 0 or more")
    return seconds
