"""Does anything that a page sends, or a stranger asks, end the viewer, hang it, or make it talk?

    python tools/stress_viewer.py --messages 20000 --seed 0

Starts ``rift view`` of a small scene. Strangers ask first: without the token, under other hosts'
names, from other pages. Then pages with the token send messages drawn by chance
(``stress/hostile_messages.py``), 20 on each connection, and floods: many cameras at once, many
pages at once, a frame of 64 MB. After every 200 messages a page that means well must get a picture.
Prints what became of them; ends with status 1 if a stranger was let in, the viewer ended, owed a
picture, or wrote anything on the terminal.
"""

from __future__ import annotations

import contextlib
import http.client
import re
import signal
import subprocess
import sys
import tempfile
import threading
import time
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any
from urllib.parse import urlsplit

import tyro

from stress.hostile_messages import camera, hostile, kinds
from stress.valid_files import OTHERS

# Messages on a connection, and between two pictures.
_TOGETHER, _BETWEEN = 20, 200
_ADDRESS = re.compile(r"http://127\.0\.0\.1:\d+/\w+")


@dataclass(frozen=True)
class Options:
    """Attack the viewer.

    Args:
        messages: how many.
        seed: of the messages; message i depends on the seed and on i alone.
        first: number of the first message, to repeat one that was found.
        seconds: in which a page that means well must get its picture.
    """

    messages: int = 20_000
    seed: int = 0
    first: int = 0
    seconds: float = 60.0


def main(options: Options) -> int:
    """Attack, print what was found, and return the exit status."""
    with tempfile.TemporaryDirectory(prefix="rift-cl-viewer-") as folder:
        scene = Path(folder, "scene.ply")
        scene.write_bytes(OTHERS["splats PLY"].make())
        with Path(folder, "said").open("w+") as said, _viewing(scene, said) as (process, url):
            faults = list(_attack(options, process, url))
            faults += _end(process)
            said.seek(0)
            faults += [f"on the terminal: {line.rstrip()}" for line in said]
    for fault in faults[:80]:
        print(ascii(fault)[:200])
    print(
        f"{options.messages} messages of {len(kinds())} kinds, {len(_STRANGERS)} strangers on two "
        f"ways, 3 floods: {len(faults)} faults"
    )
    return 1 if faults else 0


# What a shell starts in the background ignores Ctrl-C, and so does what that starts.
_VIEW = """
import signal, sys
from rift_cl.commands.cli import main
signal.signal(signal.SIGINT, signal.default_int_handler)
sys.exit(main())
"""


@contextlib.contextmanager
def _viewing(scene: Path, said: Any) -> Iterator[tuple[subprocess.Popen[str], str]]:
    """The viewer in a process of its own, and its address."""
    command = [sys.executable, "-c", _VIEW, "view", str(scene), "--port", "0", "--size", "96"]
    process = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=said, text=True)
    assert process.stdout is not None
    # What is said once the address is.
    keeping = threading.Thread(target=_keep, args=(process.stdout, said))
    try:
        for line in process.stdout:
            if address := _ADDRESS.search(line):
                keeping.start()
                yield process, address[0]
                return
        raise SystemExit(f"the viewer did not start: status {process.wait()}")
    finally:
        process.kill()
        process.wait()
        if keeping.ident is not None:
            keeping.join()
        process.stdout.close()


def _keep(lines: Iterable[str], said: Any) -> None:
    """Write down what the viewer prints."""
    for line in lines:
        said.write(line)
        said.flush()


def _attack(options: Options, process: subprocess.Popen[str], url: str) -> Iterator[str]:
    """Everything, one after the other; what was found."""
    yield from _strangers(url)
    panels = _panels(url, options.seconds)
    known = kinds()
    before = _megabytes(process.pid)
    last = options.first + options.messages
    for number in range(options.first, last, _TOGETHER):
        together = range(number, min(number + _TOGETHER, last))
        _send(url, [hostile(known, panels, options.seed, each) for each in together])
        if (number - options.first) % _BETWEEN == 0 and not _draws(url, options.seconds):
            yield f"no picture after message {together[-1]}"
            return
    for flood in (_many_cameras, _many_pages, _long_frame):
        flood(url)
        if not _draws(url, options.seconds):
            yield f"no picture after {flood.__name__}"
            return
    print(f"the viewer's memory: {before} MB, then {_megabytes(process.pid)} MB")


def _end(process: subprocess.Popen[str]) -> list[str]:
    """End it as Ctrl-C does."""
    if process.poll() is not None:
        return [f"the viewer ended with status {process.returncode}"]
    process.send_signal(signal.SIGINT)
    try:
        process.wait(60)
    except subprocess.TimeoutExpired:
        return ["the viewer does not heed Ctrl-C any more"]
    return []


def _megabytes(process: int) -> int:
    """Memory that a process holds, in MB; 0 where the system does not tell."""
    with contextlib.suppress(OSError):
        status = Path(f"/proc/{process}/status").read_text(encoding="ascii")
        return int(status.partition("VmRSS:")[2].split()[0]) // 1000
    return 0


# What strangers ask for: the address without what follows the port, their Host and their Origin.
_STRANGERS: tuple[tuple[str, str | None, str | None], ...] = (
    ("", None, None),
    ("/", None, None),
    ("/{other}", None, None),
    ("/?{token}", None, None),
    ("//{token}", None, None),
    ("/%2e%2e/{token}", None, None),
    ("/{short}", None, None),
    ("/{token}0", None, None),
    ("/{token}", "evil.example:{port}", None),
    ("/{token}", "127.0.0.1.evil.example:{port}", None),
    ("/{token}", "[::1]:{port}", None),
    ("/{token}", "0.0.0.0:{port}", None),
    ("/{token}", "", None),
    ("/{token}", None, "http://evil.example"),
    ("/{token}", None, "http://127.0.0.1:{other_port}"),
    ("/{token}", None, "https://127.0.0.1:{port}"),
    ("/{token}", None, "null"),
    ("/{token}", "evil.example", "http://evil.example"),
)


def _strangers(url: str) -> Iterator[str]:
    """Ask as strangers do, for the page and for a socket; those who were let in."""
    parts = urlsplit(url)
    token, port = parts.path[1:], parts.port or 0
    names = {"token": token, "short": token[:-1], "other": "0" * len(token)}
    names |= {"port": str(port), "other_port": str(port + 1)}
    for stranger in _STRANGERS:
        path, host, origin = (None if text is None else text.format(**names) for text in stranger)
        headers = {"Host": parts.netloc if host is None else host}
        if origin is not None:
            headers["Origin"] = origin
        socket = {"Origin": f"http://{headers['Host']}"} | headers
        socket |= {"Upgrade": "websocket", "Connection": "Upgrade", "Sec-WebSocket-Version": "13"}
        socket["Sec-WebSocket-Key"] = "dGhlIHNhbXBsZSBub25jZQ=="
        for asked in (headers, socket):
            status = _status(port, path or "/", asked)
            if status in (101, 200):
                yield f"a stranger was let in ({status}): {stranger}"


def _status(port: int, path: str, headers: dict[str, str]) -> int:
    """What a request is answered with; 0 where the connection is closed."""
    connection = http.client.HTTPConnection("127.0.0.1", port, timeout=20)
    try:
        connection.putrequest("GET", path, skip_host=True, skip_accept_encoding=True)
        for name, value in headers.items():
            connection.putheader(name, value)
        connection.endheaders()
        return connection.getresponse().status
    except (http.client.HTTPException, OSError):
        return 0
    finally:
        connection.close()


def _dialled(url: str) -> Any:
    """A socket as viser's page opens it."""
    import viser
    from websockets.sync.client import connect

    return connect(
        url.replace("http:", "ws:"),
        origin=f"http://{urlsplit(url).netloc}",
        subprotocols=[f"viser-v{viser.__version__}"],
        max_size=None,
        open_timeout=60,
        close_timeout=1,
        ping_interval=None,
    )


def _messages(socket: Any, seconds: float) -> Iterator[dict[str, Any]]:
    """What a page is told, until there is nothing for so long."""
    import msgspec
    import zstandard

    while True:
        try:
            frame = socket.recv(timeout=seconds)
        except TimeoutError:
            return
        length = int.from_bytes(frame[8:16], "little")
        inner = zstandard.ZstdDecompressor().decompress(frame[16 : 16 + length])
        yield from msgspec.msgpack.decode(inner)["messages"]


def _panels(url: str, seconds: float) -> list[str]:
    """The names of what the page has to press, pull and fill in."""
    found = list[str]()
    with _dialled(url) as socket:
        socket.send(camera())
        for told in _messages(socket, seconds):
            if told["type"].startswith("Gui") and "props" in told:
                found.append(told["uuid"])
            if told["type"] == "BackgroundImageMessage":
                return found
    return found


def _draws(url: str, seconds: float) -> bool:
    """Whether a page that means well gets a picture."""
    from websockets.exceptions import WebSocketException

    end = time.monotonic() + seconds
    with contextlib.suppress(OSError, WebSocketException), _dialled(url) as socket:
        socket.send(camera(position=[0.0, 0.1, -4]))
        for told in _messages(socket, seconds):
            if told["type"] == "BackgroundImageMessage":
                return True
            if time.monotonic() > end:
                return False
    return False


def _send(url: str, messages: list[bytes | str]) -> None:
    """Send messages as one page; what the server closes is begun anew by the next."""
    from websockets.exceptions import WebSocketException

    with contextlib.suppress(OSError, WebSocketException), _dialled(url) as socket:
        socket.send(camera())
        for message in messages:
            socket.send(message)


def _many_cameras(url: str) -> None:
    _send(url, [camera(position=[0.0, 0.001 * n, -4]) for n in range(5000)])


def _many_pages(url: str) -> None:
    from websockets.exceptions import WebSocketException

    with contextlib.ExitStack() as pages:
        for _ in range(60):
            with contextlib.suppress(OSError, WebSocketException):
                pages.enter_context(_dialled(url)).send(camera())


def _long_frame(url: str) -> None:
    _send(url, [b"\x00" * (64 << 20)])


if __name__ == "__main__":
    sys.exit(main(tyro.cli(Options)))
