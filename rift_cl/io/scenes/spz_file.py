"""Splats of an SPZ file, the compressed format of Niantic and Scaniverse: versions 2 and 3.

``rift_cl.io.scenes.formats.spz`` writes it and says what it holds; the layout is that of
github.com/nianticlabs/spz, ``load-spz.cc``. Version 2 differs in rotations: three bytes hold x, y
and z, and w is what is left. Places keep the file's axes, right, up, back.
"""

from __future__ import annotations

import struct
import zlib
from dataclasses import dataclass
from io import BufferedReader
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from rift_cl.errors import FileFormatError
from rift_cl.io.boundary import check_claim
from rift_cl.io.scenes.scene_drawing import SceneDrawing
from rift_cl.io.scenes.splat_activations import logits_of

Arrays = dict[str, NDArray[np.float32]]
Bytes = NDArray[np.uint8]

_MAGIC = 0x5053474E
_HEADER = struct.Struct("<IIIBBBB")
# Bytes of a splat's rotation by version.
_TURNS = {2: 3, 3: 4}
_DEGREE, _ANTIALIASED = 3, 1
# No byte of a deflate stream becomes more than so many.
_TIGHTEST = 1032
_CHUNK = 1 << 16
# Bytes of memory that a number takes while it is converted.
_EACH = 24


@dataclass(frozen=True)
class _Header:
    """What the first bytes say."""

    version: int
    count: int
    degree: int
    digits: int
    flags: int

    @property
    def widths(self) -> tuple[int, ...]:
        """Bytes of a splat: places, opacities, colours, scales, rotations, harmonics."""
        return 9, 1, 3, 3, _TURNS[self.version], 3 * ((self.degree + 1) ** 2 - 1)

    @property
    def size(self) -> int:
        """Bytes of the whole, header and all."""
        return _HEADER.size + self.count * sum(self.widths)


def read_spz(
    path: Path, file: BufferedReader, *, budget: int | None
) -> tuple[SceneDrawing, Arrays]:
    """Read the drawing and arrays of a scene from a file that is open at its beginning.

    Raises:
        FileFormatError: the file is damaged, is no SPZ, or of a version that is not read.
        ResourceLimitError: its splats are larger than the budget; nothing was allocated.
    """
    packed = file.seek(0, 2)
    header = _header(path, _unpacked(file, _HEADER.size)[0])
    if header.size > _TIGHTEST * packed:
        raise FileFormatError(
            f"{path}: claims {header.count} splats, more than {packed} bytes can hold; it was cut "
            "off or damaged"
        )
    check_claim(path, "the scene", _EACH * header.size, budget)
    content, ended = _unpacked(file, header.size + 1)
    # What further flags announce lies behind the splats, and is not read.
    more = len(content) > header.size
    fewer = len(content) < header.size or not (more or ended)
    if fewer or (more and header.flags <= _ANTIALIASED):
        raise FileFormatError(
            f"{path}: claims {header.count} splats in {header.size} bytes and holds "
            f"{'fewer' if fewer else 'more'}; it was cut off or damaged"
        )
    drawing = SceneDrawing(antialiased=bool(header.flags & _ANTIALIASED))
    return drawing, _arrays(header, np.frombuffer(content, np.uint8, header.size))


def _header(path: Path, content: bytes) -> _Header:
    if len(content) < _HEADER.size:
        raise FileFormatError(f"{path}: has no SPZ header; the file is damaged or something else")
    magic, version, count, degree, digits, flags, _ = _HEADER.unpack(content)
    if magic != _MAGIC:
        raise FileFormatError(f"{path}: is no SPZ file, whatever its name says")
    if version not in _TURNS:
        raise FileFormatError(
            f"{path}: is SPZ of version {version}, and 2 and 3 are read: convert it by "
            "'npx @playcanvas/splat-transform IN.spz OUT.ply'"
        )
    if degree > _DEGREE or digits > 24:
        raise FileFormatError(
            f"{path}: claims harmonics of degree {degree} and {digits} bits after the point, "
            f"wanted up to {_DEGREE} and 24; the file is damaged"
        )
    return _Header(version, count, degree, digits, flags)


def _unpacked(file: BufferedReader, most: int) -> tuple[bytes, bool]:
    """The first bytes of a gzip stream, so many at most, and whether its end was met.

    Its check sum is compared there.
    """
    file.seek(0)
    unpacker, found = zlib.decompressobj(zlib.MAX_WBITS | 16), bytearray()
    while len(found) < most and not unpacker.eof:
        packed = unpacker.unconsumed_tail or file.read(_CHUNK)
        if not packed:
            break
        found += unpacker.decompress(packed, most - len(found))
    return bytes(found), unpacker.eof


def _arrays(header: _Header, content: Bytes) -> Arrays:
    tables, start = [], _HEADER.size
    for width in header.widths:
        end = start + header.count * width
        tables.append(content[start:end].reshape(header.count, width))
        start = end
    places, opacities, colors, scales, turns, rest = tables
    coefficients = (header.degree + 1) ** 2
    sh = np.empty((header.count, coefficients, 3), np.float32)
    sh[:, 0] = (colors / 255 - 0.5) / 0.15
    sh[:, 1:] = (rest.reshape(header.count, coefficients - 1, 3) - 128.0) / 128
    return {
        "means": _places(places, header.digits),
        "log_scales": (scales / 16 - 10).astype(np.float32),
        "quats": _packed_quats(turns) if header.version == 2 else _smallest_three(turns),
        "logit_opacities": logits_of(opacities[:, 0] / 255),
        "sh": sh,
    }


def _places(table: Bytes, digits: int) -> NDArray[np.float32]:
    """(N, 3) signed numbers of 24 bits, the lowest byte first."""
    words = np.zeros((*table.shape[:1], 3, 4), np.uint8)
    # In the upper three bytes, so that the sign is the word's own.
    words[..., 1:] = table.reshape(-1, 3, 3)
    numbers = words.view("<i4")[..., 0] >> 8
    return (numbers * 0.5**digits).astype(np.float32)


def _packed_quats(table: Bytes) -> NDArray[np.float32]:
    vector = table / 127.5 - 1
    scalar = np.sqrt(np.maximum(1 - np.square(vector).sum(axis=1), 0))
    return np.column_stack([scalar, vector]).astype(np.float32)


def _smallest_three(table: Bytes) -> NDArray[np.float32]:
    """(N, 4) quaternions (w, x, y, z) from the number of the largest of (x, y, z, w) and others."""
    word = np.ascontiguousarray(table).view("<u4")[:, 0]
    largest, quats = word >> 30, np.zeros((len(word), 4))
    for axis in (3, 2, 1, 0):
        own = largest == axis
        size = (word & 511) / 511 * np.sqrt(0.5)
        quats[:, axis] = np.where(own, 0, np.where(word >> 9 & 1, -size, size))
        word = np.where(own, word, word >> 10)
    rest = np.sqrt(np.maximum(1 - np.square(quats).sum(axis=1), 0))
    quats[np.arange(len(quats)), largest] = rest
    return np.roll(quats, 1, axis=1).astype(np.float32)
