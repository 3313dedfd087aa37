"""The formats by the names that commands know them by."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from rift_cl.io.scenes.formats.compressed_ply import encode_compressed_ply
from rift_cl.io.scenes.formats.gltf import encode_glb
from rift_cl.io.scenes.formats.plain import check_plain
from rift_cl.io.scenes.formats.sog import encode_sog
from rift_cl.io.scenes.formats.spz import encode_spz, scene_notes
from rift_cl.io.scenes.splat_ply import encode_ply
from rift_cl.io.scenes.splat_scene import SplatScene

# Harmonics that every format holds and viewers know.
DEGREE = 3


@dataclass(frozen=True)
class SplatFormat:
    """A format.

    Args:
        suffix: of its files' names.
        encode: from a scene of plain splats to the bytes of a file.
        upright: whether its files have y up; the others keep the axes of the scene.
        rounds: what of a splat is not kept to the bit.
        antialiased: whether its files can say that splats are antialiased.
        notes: what is to be said of a scene of plain splats that is to be written, a sentence each.
    """

    suffix: str
    encode: Callable[[SplatScene], bytes]
    upright: bool
    rounds: str
    antialiased: bool = False
    notes: Callable[[SplatScene], list[str]] = lambda scene: []


def _plain_ply(scene: SplatScene) -> bytes:
    check_plain(scene, DEGREE)
    return b"".join(encode_ply(scene)[1])


FORMATS = {
    "ply": SplatFormat(".ply", _plain_ply, False, "nothing"),
    "compressed-ply": SplatFormat(
        ".compressed.ply", encode_compressed_ply, False, "everything, within chunks of 256 splats"
    ),
    "spz": SplatFormat(
        ".spz",
        encode_spz,
        True,
        "everything, harmonics most",
        antialiased=True,
        notes=scene_notes,
    ),
    "sog": SplatFormat(".sog", encode_sog, False, "everything, to palettes made for the scene"),
    "glb": SplatFormat(".glb", encode_glb, True, "nothing"),
}
