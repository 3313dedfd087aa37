"""A child process for what may die or hang: compilers of kernels, decoders of files.

Requests and answers are JSON objects behind their length (four bytes, big-endian); bytes follow a
message that announces their ``size``. A child lives as long as whoever asks, is started again when
it dies, and ends when its input does: whoever started it may have been killed. What a library
prints in it goes nowhere.
"""

from __future__ import annotations

import atexit
import contextlib
import json
import os
import signal
import struct
import subprocess
import sys
import threading
from collections.abc import Callable
from pathlib import Path
from typing import IO, Any

from rift_cl.json_parsing import parse_json

Buffer = bytes | bytearray | memoryview
Message = tuple[dict[str, Any], bytearray]

_LENGTH = struct.Struct(">I")
# The most bytes that a message has, and may announce unless more are expected: a kernel's source
# is some 100 KB, a compiler's log may be longer.
LONGEST = 1 << 26
# Seconds that a child whose pipe broke is given to be gone.
_DYING = 20.0
HUNG = "hung"


def write_message(stream: IO[bytes], message: dict[str, Any], data: Buffer = b"") -> None:
    """Write a JSON object behind its length, and the bytes that it announces."""
    text = json.dumps({**message, "size": len(data)}).encode()
    stream.write(_LENGTH.pack(len(text)) + text)
    stream.write(data)
    stream.flush()


def read_message(stream: IO[bytes], longest: int = LONGEST) -> Message | None:
    """Read what ``write_message`` wrote, or None where the other side has ended.

    Args:
        stream: where from.
        longest: the most bytes that it may announce.
    """
    head = stream.read(_LENGTH.size)
    if len(head) < _LENGTH.size or _LENGTH.unpack(head)[0] > LONGEST:
        return None
    try:
        message = parse_json(stream.read(_LENGTH.unpack(head)[0]))
        size = int(message["size"])
    except (ValueError, TypeError, LookupError):
        return None
    if not 0 <= size <= longest:
        return None
    data = bytearray(size)
    # Type checkers know of readinto on raw streams alone.
    return (message, data) if stream.readinto(data) == size else None  # type: ignore[attr-defined]


def answer_requests(answer: Callable[[dict[str, Any]], tuple[dict[str, Any], Buffer]]) -> None:
    """Answer the requests on the standard input until it ends: what a child does.

    Args:
        answer: an answer, and the bytes that come with it.
    """
    # Ctrl-C, and what batch systems send to all processes, is for the process that asks; it ends
    # this one by closing the input.
    for each in ("SIGINT", "SIGTERM", "SIGHUP"):
        if hasattr(signal, each):
            signal.signal(getattr(signal, each), signal.SIG_IGN)
    answers = os.fdopen(os.dup(1), "wb")
    os.dup2(2, 1)
    while (request := read_message(sys.stdin.buffer)) is not None:
        write_message(answers, *answer(request[0]))


class ChildProcess:
    """A child process that answers requests, one after the other.

    Args:
        module: the module of the package that it runs.
        who: what dies or hangs there, as its errors are to name it.
        limit: seconds after which it counts as hanging.
        command: what to start in place of the module.
    """

    def __init__(
        self, module: str, *, who: str, limit: float, command: list[str] | None = None
    ) -> None:
        self._command = command or [sys.executable, "-m", module]
        self._who = who
        self.limit = limit
        self._process: subprocess.Popen[bytes] | None = None
        self._asking = threading.Lock()
        self._owner = os.getpid()

    def ask(
        self, request: dict[str, Any], limit: float | None = None, *, longest: int = LONGEST
    ) -> tuple[str, dict[str, Any] | None, bytearray]:
        """Have a request answered.

        A child that dies after other work may die of that, such as of a kernel that wrote where it
        must not: a fresh one is asked again.

        Args:
            request: what JSON can hold.
            limit: seconds in place of the child's own.
            longest: the most bytes that may come with the answer.

        Returns:
            What went wrong with the child, empty if nothing; its answer, or None; and the bytes
            that came with it.

        Raises:
            OSError: no child can be started.
        """
        limit = self.limit if limit is None else limit
        self._leave_to_owner()
        with self._asking:
            fresh = self._process is None
            found = self._ask(request, limit, longest)
            if not found[0] or fresh or HUNG in found[0]:
                return found
            return self._ask(request, limit, longest)

    def close(self) -> None:
        """End the child."""
        self._leave_to_owner()
        if self._process is not None:
            self._end(self._process, 0)

    def environment(self) -> dict[str, str]:
        """The variables of the environment that are the child's own."""
        return {}

    def ended(self) -> None:
        """What is to be done after a child has ended, or could not be started."""

    def _leave_to_owner(self) -> None:
        """Forget a child that is another process's, where this one was forked from that."""
        if self._owner != os.getpid():
            self._process, self._asking, self._owner = None, threading.Lock(), os.getpid()

    def _ask(
        self, request: dict[str, Any], limit: float, longest: int
    ) -> tuple[str, dict[str, Any] | None, bytearray]:
        process = self._started()
        found: list[Message] = []
        talk = threading.Thread(target=_talk, args=(process, request, longest, found), daemon=True)
        talk.start()
        try:
            talk.join(limit)
        except BaseException:
            self._end(process, 0)
            raise
        if found:
            return "", *found[0]
        if talk.is_alive():
            self._end(process, 0)
            return f"{self._who} {HUNG} for {limit:.3g} s", None, bytearray()
        return death_of(self._who, self._end(process, _DYING)), None, bytearray()

    def _started(self) -> subprocess.Popen[bytes]:
        if self._process is None:
            root = str(Path(__file__).parents[1])
            path = os.pathsep.join(filter(None, (root, os.environ.get("PYTHONPATH"))))
            try:
                self._process = subprocess.Popen(
                    self._command,
                    stdin=subprocess.PIPE,
                    stdout=subprocess.PIPE,
                    stderr=subprocess.DEVNULL,
                    env={**os.environ, "PYTHONPATH": path, **self.environment()},
                )
            except OSError:
                self.ended()
                raise
            atexit.register(self.close)
        return self._process

    def _end(self, process: subprocess.Popen[bytes], patience: float) -> int:
        """Kill the child where it has not ended by itself, and return its exit status."""
        self._process = None
        atexit.unregister(self.close)
        try:
            status = process.wait(patience)
        except subprocess.TimeoutExpired:
            process.kill()
            status = process.wait()
        for pipe in (process.stdin, process.stdout):
            if pipe is not None:
                # What was not sent to a dead child is of no use.
                with contextlib.suppress(OSError):
                    pipe.close()
        self.ended()
        return status


def _talk(
    process: subprocess.Popen[bytes], request: dict[str, Any], longest: int, found: list[Message]
) -> None:
    assert process.stdin is not None
    assert process.stdout is not None
    try:
        write_message(process.stdin, request)
        answer = read_message(process.stdout, longest)
    except (OSError, ValueError):
        # The child died, or was ended, while it was spoken to.
        return
    if answer is not None:
        found.append(answer)


def death_of(who: str, status: int) -> str:
    """How a process ended that should not have, from its exit status."""
    if status < 0:
        return f"{who} died ({signal.Signals(-status).name})"
    return f"{who} ended the process (status {status})"
