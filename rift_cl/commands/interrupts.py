"""Ctrl-C, SIGTERM, a lost terminal: what has a state to keep is asked to stop first.

Handlers belong to the main thread. What runs in another hears nothing, and is broken off as usual.
"""

from __future__ import annotations

import signal
import threading
from collections.abc import Callable, Iterable, Iterator
from contextlib import ExitStack, contextmanager
from types import FrameType

from rift_cl.commands.progress_bar import print_line


def ending() -> tuple[signal.Signals, ...]:
    """What ends a command from outside; the end of its terminal unless nohup has it ignored."""
    return (signal.SIGINT, *sent())


def sent() -> tuple[signal.Signals, ...]:
    """The same but for Ctrl-C, for which Python has a handler."""
    hung_up = getattr(signal, "SIGHUP", None)  # not on Windows
    if hung_up is None or signal.getsignal(hung_up) is signal.SIG_IGN:
        return (signal.SIGTERM,)
    return (signal.SIGTERM, hung_up)


@contextmanager
def gentle_interrupt(
    stop: Callable[[], None], signals: Iterable[signal.Signals] | None = None
) -> Iterator[None]:
    """Call ``stop`` at the first of the signals; the second breaks off at once, as usual.

    Args:
        stop: asks for the end.
        signals: those that are heeded; all that end a command if None.
    """
    with ExitStack() as usual:

        def heard(number: int, frame: FrameType | None) -> None:
            usual.close()
            stop()
            print_line("rift: stopping after this step; a second Ctrl-C or SIGTERM stops at once")

        usual.enter_context(heeded(ending() if signals is None else signals, heard))
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
