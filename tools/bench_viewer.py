"""How many pictures a second ``rift view`` sends to a page whose camera moves, and how large.

It opens the command's page over its WebSocket as a browser does, moves the camera round a small
loop, and counts what comes back. Beside the pictures of a second of the clock it prints those of a
second of the server's processor time, which others on the machine do not slow down.

    python tools/bench_viewer.py FIT --seconds 10
    python tools/bench_viewer.py FIT --arguments="--moving rift --capture CAPTURE"
"""

from __future__ import annotations

import io
import os
import shlex
import signal
import subprocess
import sys
import threading
import time
from collections import Counter
from collections.abc import Iterator
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any
from urllib.parse import urlsplit

import msgspec
import numpy as np
import tyro
import viser
import viser.transforms
import zstandard
from PIL import Image
from tyro.conf import Positional
from websockets.exceptions import ConnectionClosed
from websockets.sync.client import ClientConnection, connect

# Seconds between two messages of a browser whose camera moves, and of the warm-up.
_FRAME, _WARM = 1 / 60, 3.0
# Radians and scene units that the camera swings, and seconds of a swing.
_SWING, _PERIOD = 0.1, 4.0


@dataclass(frozen=True)
class Settings:
    """Count the pictures of a moving camera."""

    scene: Annotated[Path, Positional]
    """What rift view shows."""
    arguments: str = "--moving rift"
    """More for rift view."""
    seconds: float = 10.0
    """How long to count."""
    width: int = 960
    """Of the window, in pixels."""
    height: int = 600
    """Of the window, in pixels."""


def main(settings: Settings) -> None:
    """Start the viewer, move the camera, print what came."""
    command = [
        sys.executable,
        "-m",
        "rift_cl.commands.cli",
        "view",
        str(settings.scene),
        "--port",
        "0",
    ]
    command += [
        "--size",
        str(max(settings.width, settings.height)),
        *shlex.split(settings.arguments),
    ]
    environment = {**os.environ, "PYTHONPATH": str(Path(__file__).parents[1])}
    server = subprocess.Popen(command, stdout=subprocess.PIPE, text=True, env=environment)
    try:
        assert server.stdout is not None
        url = server.stdout.readline().split()[0]
        parts = urlsplit(url)
        version = f"viser-v{viser.__version__}"
        with connect(
            url.replace("http:", "ws:"),
            origin=f"http://{parts.netloc}",  # type: ignore[arg-type]
            subprotocols=[version],  # type: ignore[list-item]
            max_size=None,
        ) as socket:
            _measure(settings, socket, server.pid)
    finally:
        server.send_signal(signal.SIGINT)
        server.wait(20)


def _measure(settings: Settings, socket: ClientConnection, pid: int) -> None:
    """Move, count, and print."""
    first: dict[str, Any] = {}
    messages = _messages(socket)
    while "look_at" not in first or "position" not in first:
        _remember(next(messages), first)
    mover = threading.Thread(target=_move, args=(settings, socket, first), daemon=True)
    mover.start()
    sizes: Counter[tuple[int, int]] = Counter()
    begin, busy = time.monotonic() + _WARM, None
    for message in messages:
        now = time.monotonic()
        if now < begin:
            continue
        if busy is None:
            busy = _processor_seconds(pid)
        if message["type"] == "BackgroundImageMessage" and message["rgb_data"] is not None:
            sizes[Image.open(io.BytesIO(message["rgb_data"])).size] += 1
        if now >= begin + settings.seconds:
            break
    spent = _processor_seconds(pid) - (busy or 0.0)
    count = sum(sizes.values())
    every = sorted(size for size, number in sizes.items() for _ in range(number))
    if every:
        least, middle, most = every[0], every[len(every) // 2], every[-1]
        print(f"sizes: {_words(least)} to {_words(most)}, median {_words(middle)}")
    print(f"{count / settings.seconds:.1f} pictures a second")
    print(f"{count / max(spent, 1e-9):.1f} pictures a second of one core's processor time")


def _words(size: tuple[int, int]) -> str:
    return f"{size[0]} x {size[1]}"


def _messages(socket: ClientConnection) -> Iterator[dict[str, Any]]:
    """What the server sends, as viser's page decodes it: packed, with arrays behind."""
    unpacked = zstandard.ZstdDecompressor()
    for frame in socket:
        assert isinstance(frame, bytes)
        packed = int.from_bytes(frame[8:16], "little")
        whole = msgspec.msgpack.decode(unpacked.decompress(frame[16 : 16 + packed]))
        place, arrays = 16 + packed, []
        for length in whole["binaryBufferLengths"]:
            place += -place % 8
            arrays.append(frame[place : place + length])
            place += length
        for message in whole["messages"]:
            for key, value in message.items():
                if isinstance(value, dict) and "__binary_index" in value:
                    message[key] = arrays[value["__binary_index"]]
            yield message


def _remember(message: dict[str, Any], first: dict[str, Any]) -> None:
    """Where the page's camera is told to stand."""
    kinds = {"SetCameraPositionMessage": "position", "SetCameraLookAtMessage": "look_at"}
    kind = kinds.get(message["type"])
    if kind is not None:
        first[kind] = np.array(message[kind], float)


def _move(settings: Settings, socket: ClientConnection, first: dict[str, Any]) -> None:
    """Send poses, as a browser does at each of its frames."""
    way = first["look_at"] - first["position"]
    away = float(np.linalg.norm(way))
    while True:
        angle = 2 * np.pi * time.monotonic() / _PERIOD
        shift = _SWING * away * np.array([np.cos(angle), np.sin(angle), 0])
        position = first["position"] + shift
        forward = (first["look_at"] - position) / np.linalg.norm(first["look_at"] - position)
        right = np.cross(forward, [0.0, 0, 1])
        right /= np.linalg.norm(right)
        turn = np.stack([right, np.cross(forward, right), forward], axis=1)
        message = {
            "type": "ViewerCameraMessage",
            "wxyz": viser.transforms.SO3.from_matrix(turn).wxyz.tolist(),
            "position": position.tolist(),
            "fov": float(np.radians(45)),
            "near": 0.01,
            "far": 1000.0,
            "image_height": settings.height,
            "image_width": settings.width,
            "look_at": first["look_at"].tolist(),
            "up_direction": [0.0, 0.0, 1.0],
        }
        with suppress(ConnectionClosed):
            socket.send(msgspec.msgpack.encode(message))
        time.sleep(_FRAME)


def _processor_seconds(pid: int) -> float:
    """What a process has used of all cores."""
    fields = Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()
    return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")


if __name__ == "__main__":
    main(tyro.cli(Settings))
