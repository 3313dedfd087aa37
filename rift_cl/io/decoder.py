"""Pictures and videos are decoded in a child process, so that a decoder may die there.

Decoders are large libraries in C and C++ that meet whatever a file holds. What kills or hangs one
ends the child, and is an error that names the file here. The child's side is
``decoder_worker``; what that costs, ``tools/decoder_price.py`` prints.
"""

from __future__ import annotations

import os
from pathlib import Path
from typing import Any

from rift_cl import errors
from rift_cl.child_process import ChildProcess
from rift_cl.errors import FileFormatError, ResourceLimitError, RiftError

# Seconds after which a decoder counts as hanging: a picture of 200 megapixels takes a few.
_LIMIT = 600.0
# How the system ends a process for which there is no memory.
_NO_MEMORY = "SIGKILL"


class Decoder(ChildProcess):
    """A child process that decodes files.

    Args:
        command: what to start; our own worker if not given.
        limit: seconds after which it counts as hanging.
    """

    def __init__(self, command: list[str] | None = None, limit: float = _LIMIT) -> None:
        super().__init__(
            "rift_cl.io.decoder_worker", who="the decoder", limit=limit, command=command
        )

    def decode(
        self, path: Path, task: str, longest: int = 0, **more: Any
    ) -> tuple[dict[str, Any], bytearray]:
        """Have a part of a file decoded.

        Args:
            path: the file.
            task: what is wanted, by its name in the worker.
            longest: the most bytes that may come with the answer.
            more: what the task wants to know besides.

        Raises:
            RiftError: what the worker raised.
            FileFormatError: the decoder died or hung.
            ResourceLimitError: there was no memory, or no process can be started.
        """
        request = {"task": task, "path": str(path), "cwd": _working_folder(), **more}
        try:
            fault, answer, data = self.ask(request, longest=longest)
        except OSError as error:
            raise ResourceLimitError(
                f"{path}: the process that decodes it cannot be started ({error}): it is Python "
                "itself, and wants memory and the right to start processes"
            ) from error
        if answer is None:
            raise _end_of_decoder(path, fault)
        if "error" in answer:
            raise _known_error(answer)
        return answer, data


def _working_folder() -> str:
    """The folder that relative paths start from, which may have changed since the child began."""
    try:
        return str(Path.cwd())
    except OSError:
        # It is gone, and relative paths with it.
        return os.sep


def _end_of_decoder(path: Path, fault: str) -> RiftError:
    if _NO_MEMORY in fault:
        return ResourceLimitError(
            f"{path}: {fault}, as happens where memory runs out: make room, or use smaller pictures"
        )
    return FileFormatError(
        f"{path}: {fault} of this file, which is damaged or more than it can read: write the file "
        "anew with another program, or leave it out"
    )


def _known_error(answer: dict[str, Any]) -> RiftError:
    kind = getattr(errors, str(answer["error"]), FileFormatError)
    error = kind(str(answer["said"]))
    assert isinstance(error, RiftError)
    return error
