"""A viewer's page without a browser: what it sends over its WebSocket, and what it is sent."""

from __future__ import annotations

import time
from urllib.parse import urlsplit

import numpy as np

CAMERA = {
    "wxyz": (1.0, 0, 0, 0),
    "position": (0.0, 0, -4),
    "fov": 0.8,
    "near": 0.1,
    "far": 100.0,
    "image_height": 90,
    "image_width": 120,
    "look_at": (0.0, 0, 0),
    "up_direction": (0, 1, 0),
}


def dialled(url, **more):
    """A WebSocket as viser's page opens it."""
    import viser
    from websockets.sync.client import connect

    parts = urlsplit(url)
    given = {"origin": f"http://{parts.netloc}", "open_timeout": 20, **more}
    version = f"viser-v{viser.__version__}"
    return connect(url.replace("http:", "ws:"), subprotocols=[version], max_size=None, **given)


def packed(kind, **fields):
    """A message that a page sends."""
    import msgspec

    return msgspec.msgpack.encode({"type": kind, **fields})


def told(**changed):
    """What a page sends of its camera."""
    return packed("ViewerCameraMessage", **CAMERA | changed)


def until(true):
    end = time.monotonic() + 60
    while not true():
        assert time.monotonic() < end
        time.sleep(0.01)


class Wire:
    """A page that stands somewhere, presses buttons, and keeps all that it is told."""

    def __init__(self, socket):
        self.socket, self.got = socket, []
        self.socket.send(told())

    def press(self, label, value=True):
        """Change what has a label, once it is there."""
        [made] = self.wait(lambda m: m.get("props", {}).get("label") == label)[:1]
        self.socket.send(packed("GuiUpdateMessage", uuid=made["uuid"], updates={"value": value}))

    def wait(self, wanted):
        """The messages so far that are wanted, once there is one."""
        import msgspec
        import zstandard

        while not (found := [message for message in self.got if wanted(message)]):
            frame = self.socket.recv(timeout=60)
            length = int.from_bytes(frame[8:16], "little")
            inner = zstandard.ZstdDecompressor().decompress(frame[16 : 16 + length])
            self.got += msgspec.msgpack.decode(inner)["messages"]
        return found

    def stands(self):
        """Where the page was told to stand last, and what to look at."""
        told = {"SetCameraPositionMessage": "position", "SetCameraLookAtMessage": "look_at"}
        places = {}
        for message in self.got:
            kind = told.get(message["type"])
            if kind is not None and not message["initial"]:
                places[kind] = np.array(message[kind])
        return places
