"""The compressed PLY of PlayCanvas and SuperSplat: 16 bytes a splat, and one a harmonic above 0.

Chunks of 256 splats span a box of places, logarithms of scales and colours, 18 floats each; within
it a place and the scales have 11, 10 and 11 bits, a rotation the number of its largest component
and 10 bits for each other, colours and opacity 8 bits each. Higher harmonics, to degree 3, have 256
levels from -4 to 4. (PlayCanvas, "The compressed PLY format"; read by splat-transform 2.7.)

What it rounds: a place by 1/4094 of its chunk's box (1/2046 along y), logarithms of scales, kept
from -20 to 20, likewise; a rotation's components by 7e-4; opacities and, within a chunk, colours by
1/510; harmonics by 1/64.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from rift_cl.io.scenes.formats.plain import (
    Floats,
    along_curve,
    check_plain,
    smallest_three,
    unit_quats,
)
from rift_cl.io.scenes.splat_activations import HARMONIC_0, opacities_of
from rift_cl.io.scenes.splat_scene import SplatScene

_CHUNK = 256
_BOX = ("x", "y", "z"), ("scale_x", "scale_y", "scale_z"), ("r", "g", "b")
_PACKED = ("packed_position", "packed_rotation", "packed_scale", "packed_color")
# Logarithms of scales that are kept.
_FINEST, _WIDEST = -20.0, 20.0
_HARMONICS = 8.0

Words = NDArray[np.uint32]


def encode_compressed_ply(scene: SplatScene) -> bytes:
    """The bytes of a file.

    Raises:
        InputError: the scene is none that the format holds.
    """
    check_plain(scene, 3)
    scene = along_curve(scene)
    starts = np.arange(0, len(scene), _CHUNK)
    colors = HARMONIC_0 * scene.sh[:, 0].astype(np.float64) + 0.5
    scales = np.clip(scene.log_scales.astype(np.float64), _FINEST, _WIDEST)
    boxes, shares = [], []
    for values in (scene.means.astype(np.float64), scales, colors):
        box, share = _shares(values, starts)
        boxes += box
        shares.append(share)
    places, scales, colors = shares
    opacities = opacities_of(scene.logit_opacities).astype(np.float64)
    words = (
        _packed(places, (11, 10, 11)),
        _rotations(scene),
        _packed(scales, (11, 10, 11)),
        _packed(np.column_stack([colors, opacities]), (8, 8, 8, 8)),
    )
    body = [np.column_stack(boxes).astype("<f4"), np.column_stack(words).astype("<u4")]
    rest = 3 * (scene.sh.shape[1] - 1)
    if rest:
        # Channel by channel, as f_rest of the plain PLY is.
        table = scene.sh[:, 1:].transpose(0, 2, 1).reshape(len(scene), rest).astype(np.float64)
        levels = np.floor((table / _HARMONICS + 0.5) * 256)
        body.append(np.clip(levels, 0, 255).astype(np.uint8))
    return _header(len(starts), len(scene), rest) + b"".join(part.tobytes() for part in body)


def _header(chunks: int, count: int, rest: int) -> bytes:
    lines = ["ply", "format binary_little_endian 1.0", f"element chunk {chunks}"]
    for names in _BOX:
        lines += [f"property float {end}_{name}" for end in ("min", "max") for name in names]
    lines += [f"element vertex {count}", *(f"property uint {name}" for name in _PACKED)]
    if rest:
        lines += [f"element sh {count}", *(f"property uchar f_rest_{k}" for k in range(rest))]
    return "\n".join([*lines, "end_header", ""]).encode()


def _shares(values: Floats, starts: NDArray[np.intp]) -> tuple[list[Floats], Floats]:
    """The boxes of chunks as float32 says them, low and high, and places in them from 0 to 1."""
    low = np.minimum.reduceat(values, starts).astype(np.float32).astype(np.float64)
    high = np.maximum.reduceat(values, starts).astype(np.float32).astype(np.float64)
    chunk = np.arange(len(values)) // _CHUNK
    span = np.where(high > low, high - low, 1)
    return [low, high], np.clip((values - low[chunk]) / span[chunk], 0, 1)


def _packed(shares: Floats, bits: tuple[int, ...]) -> Words:
    """Numbers from 0 to 1 in so many bits each, the first on top."""
    word = np.zeros(len(shares), np.uint32)
    for share, width in zip(shares.T, bits, strict=True):
        most = 2**width - 1
        levels = np.floor(share * most + 0.5).astype(np.uint32)
        word = (word << np.uint32(width)) | levels
    return word


def _rotations(scene: SplatScene) -> Words:
    largest, others = smallest_three(unit_quats(scene))
    shares = np.clip(others / np.sqrt(2) + 0.5, 0, 1)
    return (largest.astype(np.uint32) << np.uint32(30)) | _packed(shares, (10, 10, 10))
