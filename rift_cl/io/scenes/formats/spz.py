"""SPZ, the compressed splats of Niantic and Scaniverse: version 3, a gzip stream.

A header of 16 bytes, then for all splats after each other: places as signed numbers of 24 bits with
so many after the point, opacities, colours, scales, rotations, and harmonics to degree 3 by
coefficient and channel. Axes are right, up, back (y up), as in glTF. (github.com/nianticlabs/spz,
``load-spz.cc``; PyPI's ``spz`` is something else.)

What it rounds: places by half a unit of the last of 24 bits, which is chosen as fine as the
farthest splat allows; logarithms of scales, kept from -10 to 5.9, by 1/32; a rotation's components
by 7e-4; opacities by 1/510; the first harmonic, kept within 3.33, by 0.013; higher ones, kept
within 1, by 1/64. (The format has levels 1/128 apart; Niantic's own program takes every eighth of
degree 1 and every sixteenth above, we take every fourth: docs/how-to/export.md says what for.)
"""

from __future__ import annotations

import struct
import zlib

import numpy as np
from numpy.typing import NDArray

from rift_cl.errors import InputError
from rift_cl.io.scenes.formats.plain import (
    Floats,
    along_curve,
    check_plain,
    smallest_three,
    unit_quats,
)
from rift_cl.io.scenes.splat_activations import opacities_of
from rift_cl.io.scenes.splat_scene import SplatScene

_MAGIC, _VERSION = 0x5053474E, 3
# What the flags say: splats are to be dimmed as they are widened (Mip-Splatting).
_ANTIALIASED = 1
# A gzip member without a name, a date or a system.
_GZIP = b"\x1f\x8b\x08\x00\x00\x00\x00\x00\x02\xff"
# Bits after the point of a place at most, and the largest number that 24 bits hold.
_FINEST, _LARGEST = 20, 2**23 - 1
_COLOR = 0.15
# Every so many-th level of harmonics is used, so that they pack well.
_STEP = 4


def encode_spz(scene: SplatScene) -> bytes:
    """The bytes of a file.

    Raises:
        InputError: the scene is none that the format holds, or too large for its numbers.
    """
    check_plain(scene, 3)
    scene = along_curve(scene)
    digits = fraction_bits(scene)
    flags = _ANTIALIASED if scene.antialiased else 0
    header = (_MAGIC, _VERSION, len(scene), scene.degree, digits, flags, 0)
    parts = [
        struct.pack("<IIIBBBB", *header),
        _places(scene, digits),
        _bytes(255 * opacities_of(scene.logit_opacities).astype(np.float64)),
        _bytes(255 * (_COLOR * scene.sh[:, 0].astype(np.float64) + 0.5)),
        _bytes(16 * (scene.log_scales.astype(np.float64) + 10)),
        _rotations(scene),
        _harmonics(scene.sh[:, 1:].astype(np.float64)),
    ]
    return _gzipped(b"".join(parts))


def fraction_bits(scene: SplatScene) -> int:
    """Bits after the point with which the farthest splat still fits.

    Raises:
        InputError: none does.
    """
    farthest = float(np.abs(scene.means).max())
    for digits in range(_FINEST, -1, -1):
        if round(farthest * 2**digits) <= _LARGEST:
            return digits
    raise InputError(
        f"SPZ holds places up to {_LARGEST}, and a splat lies at {farthest:.3g}: scale the scene, "
        "or take another format"
    )


def _places(scene: SplatScene, digits: int) -> bytes:
    fixed = np.rint(scene.means.astype(np.float64) * 2.0**digits).astype("<i4")
    return np.ascontiguousarray(fixed.view(np.uint8).reshape(-1, 4)[:, :3]).tobytes()


def _rotations(scene: SplatScene) -> bytes:
    """The number of the largest component of (x, y, z, w), and sign and 9 bits of the others."""
    largest, others = smallest_three(np.roll(unit_quats(scene), -1, axis=1))
    word = largest.astype("<u4")
    for part in others.T:
        level = np.minimum(np.floor(np.abs(part) * np.sqrt(2) * 511 + 0.5), 511).astype("<u4")
        word = (word << np.uint32(10)) | ((part < 0).astype("<u4") << np.uint32(9)) | level
    return word.astype("<u4").tobytes()


def _harmonics(rest: Floats) -> bytes:
    return _bytes(np.rint((128 * rest + 128) / _STEP) * _STEP)


def _bytes(values: Floats) -> bytes:
    rounded: NDArray[np.uint8] = np.clip(np.rint(values), 0, 255).astype(np.uint8)
    return rounded.tobytes()


def _gzipped(content: bytes) -> bytes:
    packer = zlib.compressobj(9, zlib.DEFLATED, -zlib.MAX_WBITS)
    body = packer.compress(content) + packer.flush()
    return _GZIP + body + struct.pack("<II", zlib.crc32(content), len(content) & 0xFFFFFFFF)
