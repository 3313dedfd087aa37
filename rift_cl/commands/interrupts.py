"""Ctrl-C and a batch system's SIGTERM: what has a state to keep is asked to stop first.

Handlers belong to the main thread. What runs in another hears nothing, and is broken off as usual.
"""

from __future__ import annotations

import signal
import threading
from collections.abc import Callable, Iterable, Iterator
from contextlib import ExitStack, contextmanager
from types import FrameType

from rift_cl.commands.progress_bar import print_line

# What ends a command from outside.
ENDING = (signal.SIGINT, signal.SIGTERM)


@contextmanager
def gentle_interrupt(
    stop: Callable[[], None], signals: Iterable[signal.Signals] = ENDING
) -> Iterator[None]:
    """Call ``stop`` at the first of the signals; the second breaks off at once, as usual."""
    with ExitStack() as usual:

        def heard(number: int, frame: FrameType | None) -> None:
            usual.close()
            stop()
            print_line("rift: stopping after this step; a second Ctrl-C or SIGTERM stops at once")

        usual.enter_context(heeded(signals, heard))
        yield


def plain_interrupt() -> tuple[signal.Signals, ...]:
    """Ctrl-C, unless the program that calls us has a handler of its own for it."""
    plain = signal.getsignal(signal.SIGINT) is signal.default_int_handler
    return (signal.SIGINT,) if plain else ()


@contextmanager
def heeded(
    signals: Iterable[signal.Signals], heard: Callable[[int, FrameType | None], None]
) -> Iterator[None]:
    """Have signals call a function, in the main thread, whose they are; elsewhere do nothing."""
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    usual = {number: signal.signal(number, heard) for number in signals}
    try:
        yield
    finally:
        for number, handler in usual.items():
            signal.signal(number, signal.SIG_DFL if handler is None else handler)
