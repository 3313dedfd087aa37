"""The chain of directories in a TIFF file: how many pages there are, and what each says of itself.

OpenImageIO takes a chain that breaks for one that ends, so that a file cut short would pass for a
shorter scan. Source of the layout: TIFF 6.0 (Adobe, 1992) and the BigTIFF design of libtiff.
"""

from __future__ import annotations

import struct
from typing import IO

# Whole numbers of two, four and eight bytes.
_TYPES = {3: "H", 4: "I", 16: "Q"}
_MOST_TAGS = 4096
_MOST_PAGES = 1 << 20

Tags = dict[int, tuple[int, ...]]


class TiffChain:
    """The directories of an open TIFF file, one for each page.

    Args:
        file: the file, which was found to begin as TIFF does.

    Raises:
        ValueError: here and in every method, as ``struct.error`` and ``OSError``: it is damaged.
    """

    def __init__(self, file: IO[bytes]) -> None:
        self._file = file
        start = file.read(16)
        self.order = "<" if start[:2] == b"II" else ">"
        (version,) = struct.unpack(self.order + "H", start[2:4])
        self._big = version == 43
        self._word, self._count, self._entry = ("Q", "Q", 20) if self._big else ("I", "H", 12)
        place = start[8:16] if self._big else start[4:8]
        (self.first,) = struct.unpack(self.order + self._word, place)

    def pages(self) -> list[int]:
        """Where the directory of every page is."""
        places: dict[int, None] = {}
        at = self.first
        while at:
            if at in places or len(places) >= _MOST_PAGES:
                raise ValueError(f"its pages go on without end after {len(places)}")
            places[at] = None
            at = self._directory(at)[1]
        return list(places)

    def tags(self, at: int) -> Tags:
        """The tags of a directory that hold whole numbers."""
        tags: Tags = {}
        for entry in self._directory(at)[0]:
            tag, kind = struct.unpack(self.order + "HH", entry[:4])
            (count,) = struct.unpack_from(self.order + self._word, entry, 4)
            if kind not in _TYPES:
                continue
            value = entry[12:] if self._big else entry[8:]
            size = count * struct.calcsize(_TYPES[kind])
            if size > len(value):
                (place,) = struct.unpack(self.order + self._word, value)
                value = self.bytes_at(place, size)
            tags[tag] = struct.unpack(f"{self.order}{count}{_TYPES[kind]}", value[:size])
        return tags

    def _directory(self, at: int) -> tuple[list[bytes], int]:
        head = struct.calcsize("=" + self._count)
        (count,) = struct.unpack(self.order + self._count, self.bytes_at(at, head))
        if count > _MOST_TAGS:
            raise ValueError(f"a directory claims {count} tags")
        tail = struct.calcsize("=" + self._word)
        body = self.bytes_at(at + head, count * self._entry + tail)
        entries = [body[i * self._entry : (i + 1) * self._entry] for i in range(count)]
        return entries, struct.unpack(self.order + self._word, body[-tail:])[0]

    def bytes_at(self, place: int, size: int) -> bytes:
        """Bytes of the file, all of them."""
        self._file.seek(0, 2)
        if place + size > self._file.tell():
            raise ValueError(f"{size} bytes at {place} lie beyond the end")
        self._file.seek(place)
        return self._file.read(size)
