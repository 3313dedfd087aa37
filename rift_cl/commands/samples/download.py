"""A file over https that is kept only if it is the one that was meant."""

from __future__ import annotations

import hashlib
import urllib.request
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from http.client import HTTPException
from pathlib import Path
from typing import IO, Any

from rift_cl.errors import InputError, OutputError, RiftError
from rift_cl.io.output import sync, writing

# Seconds in which a server must answer, and bytes that are read at a time.
_PATIENCE = 30
_BLOCK = 1 << 20
_PART_IS_THERE = 206
_AGAIN = "it is another file, or a part of it is missing or damaged: fetch it again"
Opener = Callable[[urllib.request.Request], Any]


class _HttpsAlone(urllib.request.HTTPRedirectHandler):
    """Follow redirections to https and to nothing else."""

    def redirect_request(
        self, req: Any, fp: IO[bytes], code: int, msg: str, headers: Any, newurl: str
    ) -> Any:
        """The request that follows, refused where it is not encrypted."""
        _demand_https(newurl)
        return super().redirect_request(req, fp, code, msg, headers, newurl)


def download(
    url: str, path: Path, size: int, sha256: str, *, open_url: Opener | None = None
) -> None:
    """Fetch a file; ``path`` appears once all of it is there and is the file that was meant.

    What came before the connection broke stays in ``path`` with ``.part`` appended, and the next
    call goes on from there if the server can.

    Args:
        url: an https address.
        path: file to write.
        size: bytes that the file must have; no more are read.
        sha256: its checksum, in hexadecimal digits.
        open_url: what opens a request; urllib with https alone if not given.

    Raises:
        InputError: the address is not https, or what came is not the file that was meant.
        OutputError: the server cannot be reached, broke off, or the file cannot be written.
    """
    _demand_https(url)
    part = path.with_name(path.name + ".part")
    have = part.stat().st_size if part.exists() else 0
    if have < size:
        _fetch(open_url or _open_url, url, part, have, size)
    try:
        checked(part, size, sha256, source=url)
    except InputError:
        part.unlink(missing_ok=True)
        raise
    with writing(path):
        sync(part)
        part.replace(path)


def checked(path: Path, size: int, sha256: str, *, source: str = "") -> None:
    """Refuse a file that is not the one that was meant.

    Raises:
        InputError: it is absent, or has another size or checksum.
    """
    named = source or str(path)
    try:
        found = path.stat().st_size
        if found != size:
            raise InputError(f"{named}: has {found} bytes, wanted {size}: {_AGAIN}")
        with path.open("rb") as file:
            digest = hashlib.sha256()
            while block := file.read(_BLOCK):
                digest.update(block)
    except OSError as failure:
        raise InputError(f"{named}: cannot be read ({failure.strerror})") from failure
    if digest.hexdigest() != sha256:
        raise InputError(f"{named}: its SHA-256 is {digest.hexdigest()}, wanted {sha256}: {_AGAIN}")


def _open_url(request: urllib.request.Request) -> Any:
    return urllib.request.build_opener(_HttpsAlone).open(request, timeout=_PATIENCE)


def _demand_https(url: str) -> None:
    if not url.startswith("https://"):
        raise InputError(f"{url}: is not an https address, and nothing else is fetched")


@contextmanager
def _fetching(url: str) -> Iterator[None]:
    """Turn what a broken connection raises into an ``OutputError`` that names the address."""
    try:
        yield
    except RiftError:
        raise
    except (OSError, HTTPException) as failure:
        raise OutputError(f"{url}: cannot be fetched ({failure}); run it again") from failure


def _block(url: str, answer: Any, most: int) -> bytes:
    """Some of what a server sends: told apart from a disk that does not take it."""
    with _fetching(url):
        return bytes(answer.read(most))


def _fetch(open_url: Opener, url: str, part: Path, have: int, size: int) -> None:
    """Append what is missing to the part, or begin anew where the server does not skip."""
    asked = {"Range": f"bytes={have}-"} if have else {}
    with _fetching(url), open_url(urllib.request.Request(url, headers=asked)) as answer:
        go_on = have > 0 and answer.status == _PART_IS_THERE
        left = size - have if go_on else size
        with writing(part), part.open("ab" if go_on else "wb") as file:
            while block := _block(url, answer, min(_BLOCK, left + 1)):
                left -= len(block)
                file.write(block)
                if left < 0:
                    return
    if left > 0:
        raise OutputError(f"{url}: the connection ended {left} bytes early; run it again")
