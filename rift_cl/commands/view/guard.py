"""Who may look at a page of ours: a browser that was told its address, and nobody else.

Any page on the internet may open a WebSocket to 127.0.0.1 in the browser of who looks at it, and
any name may be made to lead there (DNS rebinding). So the address holds a token that is drawn anew
for each server, requests must name this computer as their host, and a WebSocket must come from a
page of this very server. viser asks for none of that; its requests are looked at before it is.
"""

from __future__ import annotations

import contextlib
import dataclasses
import hmac
import importlib
import logging
import secrets
import threading
from collections.abc import Iterator, Mapping
from typing import Any

# What this computer is called by pages that were opened on it.
_NAMES = ("127.0.0.1", "localhost")
# Servers are started one after the other, since what starts them is shared.
_STARTING = threading.Lock()


class Guard:
    """A token, and what is asked of each request.

    ``asked`` says whether a server asks it.
    """

    def __init__(self) -> None:
        self.token = secrets.token_hex(16)
        self.asked = False

    def refusal(self, path: str, headers: Mapping[str, str]) -> str | None:
        """Why a request is turned down, in words; None where it is not.

        Args:
            path: what is asked for, with its leading slash.
            headers: of the request.
        """
        host, origin = headers.get("Host", ""), headers.get("Origin")
        if host.partition(":")[0] not in _NAMES:
            return "the request names another host"
        # Browsers always say where a WebSocket comes from.
        if (origin is not None or "Upgrade" in headers) and origin != f"http://{host}":
            return "the request comes from another page"
        given = _parts(path)[0].encode("utf-8", "surrogateescape")
        if not hmac.compare_digest(given, self.token.encode()):
            return "the address lacks its token: open the one that rift printed"
        return None

    @staticmethod
    def inside(path: str) -> str:
        """A path without its token."""
        return "/" + _parts(path)[1]

    @contextlib.contextmanager
    def before_viser(self) -> Iterator[None]:
        """A server that viser starts meanwhile asks the guard first, for as long as it runs."""
        module: Any = importlib.import_module("websockets.asyncio.server")
        with _STARTING:
            serve = module.serve

            def guarded(*arguments: Any, process_request: Any, **more: Any) -> Any:
                self.asked = True
                checked = self._checked(process_request)
                more = {**more, "process_request": checked, "logger": _silent()}
                return serve(*arguments, **more)

            module.serve = guarded
            try:
                yield
            finally:
                module.serve = serve

    def _checked(self, process_request: Any) -> Any:
        """Viser's answers to requests, after ours."""

        def answer(connection: Any, request: Any) -> Any:
            refused = self.refusal(request.path, request.headers)
            if refused is not None:
                return connection.respond(403, f"{refused}\n")
            inner = dataclasses.replace(request, path=self.inside(request.path))
            response = process_request(connection, inner)
            if response is not None:
                # The address is a secret: it is told to nobody whom the page might lead to.
                response.headers["Referrer-Policy"] = "no-referrer"
            return response

        return answer


def _parts(path: str) -> tuple[str, str]:
    """The first part of a path, and what follows it, with its query."""
    plain, mark, query = path.removeprefix("/").partition("?")
    first, _, rest = plain.partition("/")
    return first, rest + mark + query


def _silent() -> logging.Logger:
    """Keeps to itself what strangers send: it belongs neither on a terminal nor in a log."""
    logger = logging.Logger("rift view")
    logger.addHandler(logging.NullHandler())
    return logger
