"""The child process in which kernels are compiled, so that a compiler may die or hang there.

    python -m rift_cl.cl.build.worker

It reads requests from its input and writes answers to its output, each a JSON object behind its
length (four bytes, big-endian); a binary follows the answer that announces its ``size``. It ends
when its input does, and takes the folder with it that it was given for its driver's cache: whoever
started it may have been killed. What a driver prints goes nowhere.
"""

from __future__ import annotations

import json
import os
import shutil
import signal
import struct
import sys
from functools import cache
from typing import IO, Any

from rift_cl.cl.build.first_launch import repeat_launch
from rift_cl.cl.failures import is_out_of_memory
from rift_cl.json_parsing import parse_json

# The variable that names the folder.
SCRATCH = "RIFT_COMPILER_SCRATCH"
LENGTH = struct.Struct(">I")
# The most bytes that are read at once: a source is some 100 KB, a compiler's log may be longer.
_LONGEST = 1 << 26


def write_message(stream: IO[bytes], message: dict[str, Any], data: bytes = b"") -> None:
    """Write a JSON object behind its length, and the bytes that it announces."""
    text = json.dumps({**message, "size": len(data)}).encode()
    stream.write(LENGTH.pack(len(text)) + text + data)
    stream.flush()


def read_message(stream: IO[bytes]) -> tuple[dict[str, Any], bytes] | None:
    """Read what ``write_message`` wrote, or None where the other side has ended."""
    head = stream.read(LENGTH.size)
    if len(head) < LENGTH.size or LENGTH.unpack(head)[0] > _LONGEST:
        return None
    try:
        message = parse_json(stream.read(LENGTH.unpack(head)[0]))
        size = int(message["size"])
    except (ValueError, TypeError, LookupError):
        return None
    if not 0 <= size <= _LONGEST:
        return None
    data = stream.read(size)
    return (message, data) if len(data) == size else None


def main() -> None:
    """Answer requests until the input ends."""
    # Ctrl-C is for the process that asks; it ends this one by closing the input.
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    answers = os.fdopen(os.dup(1), "wb")
    os.dup2(2, 1)
    while (request := read_message(sys.stdin.buffer)) is not None:
        write_message(answers, *_answer(request[0]))
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
