"""Texts that an HDF5 file keeps in heaps, looked at before the library reads them.

Attributes of variable length hold the place of their text in a *global heap*: ``GCOL``, and then
one object after the other, each with its size. The library goes from object to object by these
sizes, and for ever where one of them is zero (seen with HDF5 2.0; nothing in Python ends that). So
the heaps that an object's attributes, or a dataset of one text, lead to are walked here first.
After the HDF5 file format specification, versions 1.1 to 3.0, sections III.E and IV.A. Attributes
that a file keeps outside the object's header, as it does from nine on in newer files, are not
looked at.
"""

from __future__ import annotations

import os
import struct
from collections.abc import Iterator
from typing import Any, BinaryIO

import h5py

from rift_cl.errors import FileFormatError

_HEAP, _HEADER_2, _MORE_2 = b"GCOL", b"OHDR", b"OCHK"
_ATTRIBUTE, _CONTINUED = 0x0C, 0x10
_LARGEST = 1 << 20
_MOST_BLOCKS = 64
_HEAD = 16


def check_heaps(node: Any) -> None:
    """Make sure that the heaps to which attributes lead have an end.

    Args:
        node: an h5py group or dataset.

    Raises:
        FileFormatError: one has none.
    """
    with open(node.file.filename, "rb") as file:  # noqa: PTH123 - h5py gives text or bytes
        base = _base(node)
        for attribute in _attributes(file, base, h5py.h5o.get_info(node.id).addr):
            _check_places(file, base, attribute)


def check_text_heap(node: Any) -> None:
    """Make sure that the heap to which a dataset of one text of variable length leads has an end.

    Args:
        node: an h5py dataset that is stored in one piece, as h5py stores texts.

    Raises:
        FileFormatError: it has none.
    """
    place = node.id.get_offset()
    with open(node.file.filename, "rb") as file:  # noqa: PTH123 - h5py gives text or bytes
        _check_places(file, _base(node), _bytes(file, place, _HEAD))


def _base(node: Any) -> int:
    base: int = node.file.id.get_create_plist().get_userblock()
    return base


def _check_places(file: BinaryIO, base: int, content: bytes) -> None:
    """Follow whatever may be the place of a heap."""
    for at in range(0, len(content) - 7, 4):
        (address,) = struct.unpack_from("<Q", content, at)
        if _bytes(file, base + address, 4) == _HEAP and not _ends(file, base + address):
            raise FileFormatError(f"{os.fsdecode(file.name)}: the heap of its texts is damaged")


def _ends(file: BinaryIO, place: int) -> bool:
    (size,) = struct.unpack("<Q", _bytes(file, place + 8, 8).ljust(8, b"\0"))
    heap, at = _bytes(file, place, min(size, _LARGEST)), _HEAD
    while at + _HEAD <= len(heap):
        index, taken = struct.unpack_from("<H6xQ", heap, at)
        # The size of the free space, which has the number 0, counts its own head.
        step = taken if index == 0 else _HEAD + (taken + 7) // 8 * 8
        if step == 0:
            return False
        at += step
    return True


def _attributes(file: BinaryIO, base: int, address: int) -> Iterator[bytes]:
    """The messages of an object's header that hold attributes."""
    first = _bytes(file, base + address, 32)
    if first[:4] == _HEADER_2:
        flags = first[5]
        begin = 6 + (16 if flags & 0x20 else 0) + (4 if flags & 0x10 else 0)
        wide = 1 << (flags & 3)
        blocks = [(address + begin + wide, int.from_bytes(first[begin : begin + wide], "little"))]
        head, ordered, second = "<BHB", 2 if flags & 4 else 0, True
    else:
        blocks = [(address + _HEAD, int.from_bytes(first[8:12], "little"))]
        head, ordered, second = "<HHB3x", 0, False
    for number, (place, size) in enumerate(blocks):
        block, at = _bytes(file, base + place, min(size, _LARGEST)), 0
        if second and block[:4] == _MORE_2:
            at = 4
        while at + struct.calcsize(head) + ordered <= len(block):
            kind, length, _ = struct.unpack_from(head, block, at)
            at += struct.calcsize(head) + ordered
            message = block[at : at + length]
            at += length
            if kind == _ATTRIBUTE:
                yield message
            elif kind == _CONTINUED and len(message) >= _HEAD and number < _MOST_BLOCKS:
                blocks.append(struct.unpack_from("<QQ", message))


def _bytes(file: BinaryIO, place: int, count: int) -> bytes:
    """Bytes of a file; fewer, or none, beyond its end."""
    if place >= os.fstat(file.fileno()).st_size:
        return b""
    file.seek(place)
    return file.read(count)
