"""Guard against OpenCL in a forked process.

A driver's threads do not survive ``fork``: with PoCL every later call in the child hangs for
ever. The first use of OpenCL is therefore recorded with its process, and every entry point asks
here before it calls the driver, so that a child gets an error at once.
"""

from __future__ import annotations

import os

from rift_cl.errors import ForkedContextError

_owner: int | None = None


def claim_process() -> None:
    """Record that this process uses OpenCL, or raise if one of its ancestors already did.

    Raises:
        ForkedContextError: OpenCL was used before this process was forked.
    """
    global _owner  # noqa: PLW0603 - one fact about the process, so one variable of the module
    if _owner is None:
        _owner = os.getpid()
    elif _owner != os.getpid():
        raise ForkedContextError(
            f"OpenCL was used in process {_owner} before it forked this one ({os.getpid()}), and "
            "a driver does not survive that: start workers with the 'spawn' method, or fork "
            "before the first use of rift_cl"
        )
