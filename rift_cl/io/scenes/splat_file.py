"""Splats in the 32 bytes of a .splat file, the format of the viewer antimatter15/splat.

Position and scales are float32; colour with opacity and the rotation are four bytes each. There
is no header and no direction in the colour: what is read has degree 0.
"""

from __future__ import annotations

from collections.abc import Iterator
from io import BufferedReader
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from rift_cl.errors import FileFormatError, InputError
from rift_cl.io.boundary import check_claim
from rift_cl.io.scenes.splat_activations import (
    HARMONIC_0,
    log_scales_of,
    logits_of,
    opacities_of,
    scales_of,
)

if TYPE_CHECKING:
    from rift_cl.io.scenes.splat_scene import SplatScene

_RECORD = np.dtype([("mean", "<f4", 3), ("scale", "<f4", 3), ("color", "u1", 4), ("quat", "u1", 4)])
# Bytes of a splat in the file and in memory, with what the arithmetic takes in between.
_EACH = 32 + 56 + 48


def read_splat(
    path: Path, file: BufferedReader, *, budget: int | None
) -> dict[str, NDArray[np.float32]]:
    """Read the arrays of a scene from a file that is open at its beginning.

    Raises:
        FileFormatError: the file cannot hold splats.
        ResourceLimitError: they are larger than the budget; nothing was allocated.
    """
    size = file.seek(0, 2)
    count, over = divmod(size, _RECORD.itemsize)
    if over or not count:
        raise FileFormatError(f"{path}: has {size} bytes, a splat has 32; it was cut off")
    check_claim(path, "the scene", _EACH * count, budget)
    file.seek(0)
    content = file.read(size)
    if len(content) < size:
        raise FileFormatError(f"{path}: was cut off while it was read")
    records = np.frombuffer(content, _RECORD)
    scales = records["scale"].astype(np.float32)
    negative = np.count_nonzero((scales < 0).any(axis=1))
    if negative:
        raise FileFormatError(
            f"{path}: {negative} of {count} splats have a negative scale; it is no .splat file, or "
            "is damaged"
        )
    color = records["color"] / 255
    return {
        "means": records["mean"].astype(np.float32),
        "log_scales": log_scales_of(scales),
        "quats": ((records["quat"] - 128.0) / 128).astype(np.float32),
        "logit_opacities": logits_of(color[:, 3]),
        "sh": ((color[:, None, :3] - 0.5) / HARMONIC_0).astype(np.float32),
    }


def encode_splat(scene: SplatScene) -> tuple[int, Iterator[bytes]]:
    """A scene as the bytes of a file: how many they are, and the blocks that they come in.

    Raises:
        InputError: the scene is empty: nothing would tell its file from a lost one.
    """
    if not len(scene):
        raise InputError("a .splat file holds one splat at least, the scene is empty: save a .ply")
    return len(scene) * _RECORD.itemsize, iter([_records(scene).tobytes()])


def _records(scene: SplatScene) -> NDArray[np.void]:
    records = np.empty(len(scene), _RECORD)
    records["mean"] = scene.means
    records["scale"] = scales_of(scene.log_scales)
    opacities = opacities_of(scene.logit_opacities)
    records["color"][:, :3] = _bytes(255 * (0.5 + HARMONIC_0 * scene.sh[:, 0].astype(np.float64)))
    records["color"][:, 3] = _bytes(255 * opacities.astype(np.float64))
    quats = scene.quats.astype(np.float64)
    lengths = np.linalg.norm(quats, axis=1, keepdims=True)
    # A quaternion of length zero is no rotation, and stays one that is not drawn.
    records["quat"] = _bytes(128 + 128 * quats / np.where(lengths > 0, lengths, 1))
    return records[_by_weight(scene)]


def _by_weight(scene: SplatScene) -> NDArray[np.intp]:
    """Large and opaque splats first, so that a viewer shows the most while it still loads."""
    logits = scene.logit_opacities.astype(np.float64)
    # Logarithms of volume times opacity: the product itself would leave the range of numbers.
    weights = scene.log_scales.sum(axis=1, dtype=np.float64) - np.logaddexp(0, -logits)
    return np.argsort(-weights, kind="stable")


def _bytes(values: NDArray[np.float64]) -> NDArray[np.uint8]:
    """Rounded and clamped, as the viewer's own converter does it."""
    return np.rint(np.clip(values, 0, 255)).astype(np.uint8)
