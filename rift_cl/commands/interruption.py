"""Ctrl-C that is heard between two steps, so that a long run can keep what it has done."""

from __future__ import annotations

import signal
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from types import FrameType

from rift_cl.commands.progress_bar import print_line


@contextmanager
def gentle_interrupt(stop: Callable[[], None]) -> Iterator[None]:
    """Call ``stop`` at the first Ctrl-C; the second breaks off at once, as usual."""
    if threading.current_thread() is not threading.main_thread():
        yield  # Signals are the main thread's.
        return
    usual = signal.getsignal(signal.SIGINT)

    def heard(number: int, frame: FrameType | None) -> None:
        signal.signal(signal.SIGINT, usual)
        stop()
        print_line("rift: stopping after this step; Ctrl-C again stops at once")

    signal.signal(signal.SIGINT, heard)
    try:
        yield
    finally:
        signal.signal(signal.SIGINT, usual)
