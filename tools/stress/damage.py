"""Damage that is done to files by chance, and drawn from a generator so that it can be repeated."""

from __future__ import annotations

import struct
from collections.abc import Callable

import numpy as np

_Random = np.random.Generator
_HEADERS = 2048


def damaged(random: _Random, content: bytes, other: bytes) -> bytes:
    """A damaged copy of a file.

    Args:
        random: draws the kind of damage and its places.
        content: the file.
        other: a file that blocks may come from.
    """
    return _DAMAGES[int(random.integers(len(_DAMAGES)))](random, content, other)


def _flipped(random: _Random, content: bytes, _: bytes) -> bytes:
    data = np.frombuffer(content, np.uint8).copy()
    where = random.integers(0, _reach(random, len(data)), random.integers(1, 17))
    data[where] ^= (1 << random.integers(0, 8, where.size)).astype(np.uint8)
    return data.tobytes()


def _cut(random: _Random, content: bytes, _: bytes) -> bytes:
    return content[: random.integers(0, len(content))]


def _forged(random: _Random, content: bytes, _: bytes) -> bytes:
    data = bytearray(content)
    for _ in range(random.integers(1, 5)):
        wide = "IQH"[random.integers(3)]
        size = struct.calcsize("=" + wide)
        bits = 8 * size
        values = (0, 1, 2**bits - 1, 2 ** (bits - 1), 2 ** (bits - 1) - 1, 2 ** (bits // 2 + 8))
        value = values[random.integers(len(values))] % 2**bits
        at = int(random.integers(0, _reach(random, len(data)))) // 2 * 2
        part = struct.pack("<>"[random.integers(2)] + wide, value)
        data[at : at + size] = part[: len(data) - at]
    return bytes(data)


def _spliced(random: _Random, content: bytes, other: bytes) -> bytes:
    source = content if random.random() < 0.5 else other
    size = int(random.integers(1, 1 << random.integers(2, 11)))
    start = int(random.integers(0, len(source))) // 4 * 4
    at = int(random.integers(0, _reach(random, len(content)))) // 4 * 4
    block = source[start : start + size]
    # Half of the blocks push the rest away, the others replace what was there.
    return content[:at] + block + content[at + int(random.integers(2)) * len(block) :]


_DAMAGES: tuple[Callable[[_Random, bytes, bytes], bytes], ...] = (_flipped, _cut, _forged, _spliced)


def _reach(random: _Random, size: int) -> int:
    # Headers come first in most files, and are where damage is dangerous.
    return size if random.random() < 0.5 else min(_HEADERS, size)
