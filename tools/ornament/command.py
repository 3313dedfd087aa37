"""How a script that renders ends: errors as one sentence, and a status that says of what kind."""

from __future__ import annotations

from collections.abc import Callable

from rift_cl import RiftError
from rift_cl.commands.progress_bar import print_line

_INTERRUPTED = 130


def run(name: str, work: Callable[[], None]) -> int:
    """Do the work of the script of that name; the exit status."""
    try:
        work()
    except RiftError as error:
        print_line(f"{name}: {error}")
        return error.exit_status
    except KeyboardInterrupt:
        print_line(f"{name}: interrupted; the same command goes on")
        return _INTERRUPTED
    return 0
