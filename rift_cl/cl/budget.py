"""How much memory a device may use, and how work is cut to fit it.

PoCL accepts any allocation and dies when memory really ends, so nothing may be allocated that was
not counted first.
"""

from __future__ import annotations

import os
import re
import time
from bisect import bisect_left
from collections.abc import Callable
from functools import lru_cache
from pathlib import Path

from rift_cl.cl.traits import Traits
from rift_cl.errors import InputError, ResourceLimitError

_HOST_SHARE = 0.6
# Seconds for which what was read of free memory holds.
_FRESH = 0.1
_MOST = 1 << 63
_UNITS = {"": 1, "K": 1 << 10, "M": 1 << 20, "G": 1 << 30, "T": 1 << 40}


def parse_bytes(text: str) -> int:
    """Read an amount of memory such as ``512M``, ``1.5 GB`` or ``1073741824`` (powers of 1024).

    Raises:
        InputError: the text is no positive amount.
    """
    match = re.fullmatch(r"\s*([0-9.]+)\s*([KMGT]?)(?:i?B)?\s*", text, re.IGNORECASE)
    try:
        amount = float(match[1]) * _UNITS[match[2].upper()] if match else 0.0
    except ValueError:
        amount = 0.0
    if not 1 <= amount < _MOST:
        raise InputError(f"memory is {text!r}, wanted a positive amount such as 512M or 2G")
    return int(amount)


def free_host_memory() -> int | None:
    """Bytes of host memory that are free to take, or None where the system does not say.

    The answer may be a tenth of a second old: a step of training asks several times.
    """
    return _free_host_memory(int(time.monotonic() / _FRESH))


@lru_cache(maxsize=1)
def _free_host_memory(moment: int) -> int | None:
    try:
        text = Path("/proc/meminfo").read_text(encoding="ascii")
        return int(text.split("MemAvailable:")[1].split()[0]) * 1024
    except (OSError, IndexError, ValueError):
        pass
    try:
        return os.sysconf("SC_AVPHYS_PAGES") * os.sysconf("SC_PAGE_SIZE")
    except (AttributeError, OSError, ValueError):
        return None


def host_budget() -> int:
    """Bytes of host memory that may be taken: 60 % of what is free, all where that is not told."""
    free = free_host_memory()
    return _MOST if free is None else int(_HOST_SHARE * free)


def memory_budget(traits: Traits, limit: int | None = None) -> int:
    """Bytes that a device may use.

    The smallest of what the device reports (85 % of that on a GPU with memory of its own), 60 % of
    free host memory where the device lives in it, and ``limit`` or else the environment's
    ``RIFT_MEMORY``.
    """
    amounts = [traits.usable_memory]
    if traits.is_cpu or traits.unified:
        amounts.append(host_budget())
    if limit is None and os.environ.get("RIFT_MEMORY"):
        limit = parse_bytes(os.environ["RIFT_MEMORY"])
    if limit is not None:
        amounts.append(limit)
    return min(amounts)


def plan_chunks(
    count: int,
    each: int,
    fixed: int,
    budget: int,
    *,
    what: str,
    array: int = 0,
    largest: int = _MOST,
    instead: str = "",
) -> list[slice]:
    """Cut equal items of work into chunks that fit the memory (images: ``rift_cl.splat.bands``).

    Args:
        count: how many equal items of work there are, such as slices or rows.
        each: bytes that one item needs.
        fixed: bytes needed whatever the number of items.
        budget: bytes there are.
        what: the name of one item, for the error.
        array: bytes of one item in the largest of its arrays, which grows with the items.
        largest: bytes of the largest array that the device takes (``traits.allocation``).
        instead: what does it where not even one item fits, for the error.

    Returns:
        Slices over the items, as even as can be, one for each chunk.

    Raises:
        ResourceLimitError: not even one item fits.
    """
    most = (budget - fixed) // max(each, 1)
    if most < 1:
        raise ResourceLimitError(
            f"one {what} needs {format_bytes(fixed + each)}, the memory budget is "
            f"{format_bytes(budget)}: raise the budget (RIFT_MEMORY or --memory), use a device "
            f"with more memory, or make the problem smaller{_or(instead)}"
        )
    check_array(array, largest, what=f"an array of one {what}", instead=instead)
    return cut_evenly(count, min(most, largest // max(array, 1)))


def cut_evenly(count: int, most: int) -> list[slice]:
    """Cut ``count`` items into as few runs of at most ``most`` as can be, as even as can be."""
    runs = -(-count // most)
    return [slice(count * k // runs, count * (k + 1) // runs) for k in range(runs)]


def largest_pair(fits: Callable[[int, int], bool], first: int, second: int) -> tuple[int, int]:
    """The largest numbers that fit, the second halved only where no first one does; else ones."""
    while True:
        most = bisect_left(range(1, first + 1), True, key=lambda n: not fits(n, second))
        if most or second == 1:
            return max(most, 1), second
        second = -(-second // 2)


def check_array(size: int, largest: int, *, what: str, instead: str = "") -> None:
    """Refuse an array that the device does not take in one piece.

    Args:
        size: bytes of the array.
        largest: bytes of the largest array that the device takes.
        what: the array, for the error.
        instead: what does it without that array, for the error.

    Raises:
        ResourceLimitError: it is larger.
    """
    if size > largest:
        raise ResourceLimitError(
            f"{what} takes {format_bytes(size)}, the largest single array that the device takes is "
            f"{format_bytes(largest)}, however much memory it has: work on parts of it, make the "
            "problem smaller, or use a device that takes larger arrays (rift devices)"
            f"{_or(instead)}"
        )


def check_host(size: int, *, what: str) -> None:
    """Refuse arrays that the host has no memory for, before any of them is made.

    Args:
        size: bytes of the arrays.
        what: what needs them, for the error.

    Raises:
        ResourceLimitError: they are larger than what may be taken.
    """
    if size > (most := host_budget()):
        raise ResourceLimitError(
            f"{what} takes {format_bytes(size)} of the host's memory, of which "
            f"{format_bytes(most)} may be taken: make the problem smaller"
        )


def _or(instead: str) -> str:
    return f"; {instead}" if instead else ""


def format_bytes(amount: float) -> str:
    """An amount of memory as a person reads it."""
    for unit in ("B", "KiB", "MiB", "GiB"):
        if amount < 1024:
            return f"{amount:.3g} {unit}"
        amount /= 1024
    return f"{amount:.3g} TiB"
