"""The child process in which kernels are compiled, so that a compiler may die or hang there.

    python -m rift_cl.cl.build.worker

It answers requests (``rift_cl.child_process``), with a binary where one is wanted. As it ends, it
takes the folder with it that it was given for its driver's cache: whoever started it may have been
killed.
"""

from __future__ import annotations

import os
import shutil
from functools import cache
from typing import Any

from rift_cl.child_process import answer_requests
from rift_cl.cl.build.first_launch import repeat_launch
from rift_cl.cl.failures import is_out_of_memory

# The variable that names the folder.
SCRATCH = "RIFT_COMPILER_SCRATCH"


def main() -> None:
    """Answer requests until the input ends."""
    answer_requests(_answer)
    if folder := os.environ.get(SCRATCH):
        shutil.rmtree(folder, ignore_errors=True)


def _answer(request: dict[str, Any]) -> tuple[dict[str, Any], bytes]:
    import warnings

    import pyopencl as cl

    warnings.simplefilter("ignore")
    try:
        context = _context(request["selector"], request["device"])
        program = cl.Program(context, request["source"]).build(request["options"])
        binary = program.get_info(cl.program_info.BINARIES)[0] if request["binary"] else b""
        if binary:
            # Whoever asked will load it in a process that must not die of it.
            program = cl.Program(context, context.devices, [binary]).build()
        kernel = cl.Kernel(program, request["kernel"])
        for launch in request["launches"]:
            repeat_launch(kernel, context, launch)
    except (cl.Error, MemoryError, LookupError, TypeError, ValueError) as error:
        return {"error": str(error), "short of memory": is_out_of_memory(error)}, b""
    return {}, binary


@cache
def _context(selector: str, name: str) -> Any:
    """The context of the device that the asking process means.

    Raises:
        LookupError: this process does not see it.
    """
    import pyopencl as cl

    platform, index = map(int, selector.split(":"))
    device = cl.get_platforms()[platform].get_devices()[index]
    if device.name.strip() != name:
        raise LookupError(f"device {selector} is {device.name.strip()}, not {name}")
    return cl.Context([device])


if __name__ == "__main__":
    main()
