"""What runs in a worker's process: it says what it has, and does tasks."""

from __future__ import annotations

import secrets
import socket
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any

from rift_cl import __version__
from rift_cl.errors import ClusterError, DeviceError
from rift_cl.io.output import make_folder, writing
from rift_cl.own_parts import load_parts


def dask_setup(worker: Any) -> None:
    """Get ready, while the process that hands tasks out does so too (``preload`` of Dask).

    A person's own parts are loaded before objects of their classes arrive. The device is opened;
    ``look`` says why, where there is none.
    """
    from rift_cl.cl.discovery import open_device

    load_parts()
    with suppress(DeviceError):
        open_device()


def look(device: str | None, paths: Sequence[Path]) -> dict[str, str]:
    """Say which version and which device this process has, and which of some files it lacks.

    Args:
        device: selects the device; the process's own choice if None.
        paths: files and folders, from the root.

    Returns:
        ``version``; ``host``, the name of the machine; ``device``, with its driver, or
        ``refusal``, why there is none; ``unseen``, the first of the files that is not there.
    """
    from rift_cl.cl.discovery import open_device

    seen = {"version": __version__, "host": socket.gethostname()}
    try:
        opened = open_device(device)
        seen["device"] = f"{opened.name} ({opened.platform} {opened.driver})"
    except DeviceError as error:
        seen["refusal"] = str(error)
    unseen = next((str(path) for path in paths if not path.exists()), None)
    return seen if unseen is None else {**seen, "unseen": unseen}


def do(version: str, function: Callable[..., Any], *arguments: Any) -> tuple[float, Any]:
    """Do a task; the error of a device says on which worker it came up.

    Args:
        version: of the process that hands it out; a worker may have come after ``look``.
        function: does it.
        *arguments: of the function.

    Returns:
        The seconds that it took, and what the function gave.

    Raises:
        ClusterError: this process has another version.
    """
    from distributed import get_worker

    if version != __version__:
        raise ClusterError(
            f"worker {get_worker().address}: has the version {__version__} of rift_cl, wanted "
            f"{version}: install the same on all machines; --resume goes on"
        )
    load_parts()
    begin = time.perf_counter()
    try:
        result = function(*arguments)
        return time.perf_counter() - begin, result
    except DeviceError as error:
        error.worker = get_worker().address  # type: ignore[attr-defined]
        raise


@contextmanager
def token(folder: Path) -> Iterator[Path]:
    """A file in a folder for workers to look for: another machine may have a folder of that name.

    Raises:
        OutputError: the folder cannot be written to.
    """
    make_folder(folder)
    path = folder / f".seen-{secrets.token_hex(8)}"
    with writing(path):
        path.write_bytes(b"")
    try:
        yield path
    finally:
        path.unlink(missing_ok=True)
