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
What lies beyond these ends is clipped, and told of or refused (``spz_range``).

A few far splats do not make the places of all others coarse: where the farthest allows no rounding
as fine as 1e-4 of the scene's size (the median distance from its middle), up to one splat in 100 is
drawn in towards the middle, and made smaller alike, so that from there it looks as it did.
"""

from __future__ import annotations

import dataclasses
import struct
import zlib
from typing import Any

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
from rift_cl.io.scenes.formats.spz_range import check_scales, range_notes
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
# The rounding of places that no far splat shall make coarser, as a share of the scene's size: seen
# from so far away, a tenth of a pixel of a camera whose focal length is 1000 pixels. (Niantic's own
# program has 12 bits after the point in any scene, which is the same where the size is 1.2, and
# clips each coordinate.) One splat in so many may be drawn in for it.
_FINE, _FAR = 1e-4, 100
# Every so many-th level of harmonics is used, so that they pack well.
_STEP = 4


def encode_spz(scene: SplatScene) -> bytes:
    """The bytes of a file.

    Raises:
        InputError: the scene is none that the format holds, or too large or small for its numbers.
    """
    check_plain(scene, 3)
    scene = along_curve(scene)
    digits = fraction_bits(scene.means)
    scene = drawn_in(scene, digits)
    check_scales(scene)
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


def fraction_bits(means: NDArray[np.float32]) -> int:
    """Bits after the point of places (N, 3): as many as the farthest splat allows, or as are fine.

    Where the farthest allows too few, all but one splat in 100 decide.

    Raises:
        InputError: no number of bits holds the scene.
    """
    middle, distances = _distances(means)
    near = _reach(middle, np.sort(distances)[-1 - len(means) // _FAR])
    farthest = float(np.abs(means).max())
    digits = max(_holding(farthest), min(_fine_bits(distances), _holding(near)))
    if digits < 0:
        raise InputError(
            f"SPZ holds places up to {_LARGEST}, and a splat lies at {farthest:.3g}: scale the "
            "scene, or take another format"
        )
    return digits


def drawn_in(scene: SplatScene, digits: int) -> SplatScene:
    """The scene with every splat where so many bits after the point hold its place.

    Distances from the middle become shorter without end but never equal, so that of two splats in
    one direction the nearer stays in front: d becomes r - r^2 / (4 d) beyond r / 2, with r the
    radius of the ball that fits. Scales go with them.
    """
    far = _far(scene.means, digits)
    if not far.size:
        return scene
    means, (middle, distances) = scene.means.astype(np.float64), _distances(scene.means)
    radius = _LARGEST * 0.5**digits - np.abs(middle).max()
    shares = (radius * (1 - radius / (4 * distances[far])) / distances[far])[:, None]
    means[far] = middle + shares * (means[far] - middle)
    log_scales = scene.log_scales.astype(np.float64)
    log_scales[far] += np.log(shares)
    return dataclasses.replace(
        scene, means=means.astype(np.float32), log_scales=log_scales.astype(np.float32)
    )


def scene_notes(scene: SplatScene) -> list[str]:
    """What is to be said of a plain scene that will be written: of its places, and what is clipped.

    Raises:
        InputError: as ``encode_spz`` does.
    """
    written = drawn_in(scene, fraction_bits(scene.means))
    check_scales(written)
    return [*place_notes(scene.means), *range_notes(written)]


def place_notes(means: NDArray[np.float32]) -> list[str]:
    """What is to be said of the places (N, 3): nothing where they are fine, or a sentence."""
    digits, distances = fraction_bits(means), _distances(means)[1]
    rounding, far = 0.5 ** (digits + 1), _far(means, digits)
    if far.size:
        return [
            f"{far.size} of {len(means)} splats, {distances[far].min():.3g} units and more from "
            "the middle, are drawn in towards it, and made smaller alike, so that they look from "
            "there as they did: SPZ has 24 bits, and places of the others would be coarse "
            f"otherwise (they are rounded by up to {rounding:.2g} units)"
        ]
    if digits < _fine_bits(distances):
        share, farthest = rounding / float(np.median(distances)), float(np.abs(means).max())
        return [
            f"places are rounded by up to {rounding:.2g} units, {share:.2g} of the scene's size, "
            f"since SPZ has 24 bits and splats lie as far as {farthest:.4g} units from the origin "
            "(move or crop the scene, or take another format)"
        ]
    return []


def _distances(means: NDArray[np.float32]) -> tuple[Floats, Floats]:
    """The middle (3,) of places, their median, and how far each lies from it (N,)."""
    places = means.astype(np.float64)
    middle = np.median(places, axis=0)
    return middle, np.linalg.norm(places - middle, axis=1)


def _reach(middle: Floats, distances: Any) -> Any:
    """What bits must hold so that splats at such distances are not drawn in."""
    return np.abs(middle).max() + 2 * distances


def _far(means: NDArray[np.float32], digits: int) -> NDArray[np.intp]:
    """The splats that are drawn in: none where the places of all fit."""
    limit = _LARGEST * 0.5**digits
    if np.abs(means).max() <= limit:
        return np.empty(0, np.intp)
    return np.flatnonzero(_reach(*_distances(means)) > limit)


def _holding(farthest: float) -> int:
    """The most bits after the point with which a place fits; -1 where it fits with none."""
    fits = (d for d in range(_FINEST, -1, -1) if round(farthest * 2**d) <= _LARGEST)
    return next(fits, -1)


def _fine_bits(distances: Floats) -> int:
    """The fewest bits after the point that round places finely, by distances from the middle."""
    fine = _FINE * float(np.median(distances))
    return next((d for d in range(_FINEST) if 0.5 ** (d + 1) <= fine), _FINEST)


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
