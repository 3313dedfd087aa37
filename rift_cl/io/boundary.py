"""The boundary that every file crosses on its way in.

The libraries below raise some fifteen kinds of exception on a damaged file, and believe whatever
size a header claims. Here every exception becomes an error that names the file, and every claim
is compared with the memory there is before anything is allocated.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import numpy as np

from rift_cl.cl.budget import format_bytes, free_host_memory
from rift_cl.errors import DTypeError, FileFormatError, InputError, ResourceLimitError, RiftError

HOW_TO_NAME = "name those that are meant with dataset= and theta= (--dataset, --theta)"

HOST_SHARE = 0.6
_REASON_LENGTH = 200


@contextmanager
def reading(path: Path, what: str) -> Iterator[None]:
    """Turn whatever a library raises about a file into an error that names it.

    Args:
        path: the file.
        what: the part that is being read, as it is to be named.

    Raises:
        InputError: the file is not there or may not be opened.
        FileFormatError: anything else went wrong.
        ResourceLimitError: memory ran out.
    """
    try:
        yield
    except RiftError:
        raise
    except FileNotFoundError as error:
        raise InputError(f"{path}: there is no such file") from error
    except (IsADirectoryError, NotADirectoryError, PermissionError) as error:
        raise InputError(f"{path}: cannot be opened ({error.strerror or error})") from error
    except MemoryError as error:
        raise ResourceLimitError(
            f"{path}: {what} does not fit into memory; read fewer rows at a time"
        ) from error
    except Exception as error:
        raise FileFormatError(
            f"{path}: {what} cannot be read ({_reason(error)}); the file is damaged or is not "
            "what its name says"
        ) from error


def check_claim(path: Path, what: str, need: int, budget: int | None) -> None:
    """Refuse to read more than the budget allows.

    Args:
        path: the file.
        what: the part that is to be read.
        need: bytes that reading it takes.
        budget: bytes there are; 60 % of the free host memory when None.

    Raises:
        ResourceLimitError: the part is too large.
    """
    limit = _available() if budget is None else budget
    if limit is not None and need > limit:
        raise ResourceLimitError(
            f"{path}: {what} claims {format_bytes(need)}, the memory budget is "
            f"{format_bytes(limit)}; read fewer rows at a time or raise the budget"
        )


def check_numeric(path: Path, name: str, dtype: np.dtype[np.generic]) -> None:
    """Refuse an array that does not hold real numbers.

    Raises:
        DTypeError: it holds truth values, complex numbers, text, records or objects.
    """
    if dtype.kind not in "iuf":
        raise DTypeError(f"{path}: {name!r} holds {dtype}, wanted integers or real numbers")


def _available() -> int | None:
    free = free_host_memory()
    return None if free is None else int(HOST_SHARE * free)


def _reason(error: Exception) -> str:
    lines = str(error).splitlines()
    return (lines[0] if lines else type(error).__name__)[:_REASON_LENGTH]
