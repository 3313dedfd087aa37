"""SOG, the splats of PlayCanvas for the web: lossless WebP pictures and a meta.json in a ZIP file.

Pixel n of each picture is splat n. Places: sign(x) ln(1 + |x|) in 16 bits of its range, in two
pictures. Rotations: three smallest components in 8 bits, and which was largest. Logarithms of
scales, and first harmonics, are numbers of a palette of 256; opacities have 8 bits. Higher
harmonics of a splat are together one of up to 65,536 vectors, whose numbers are of a palette of
256 as well. (PlayCanvas, "The SOG format", version 2; read by splat-transform 2.7.)

What it rounds: a place's logarithm by 1/131,070 of its range, a rotation's components by 2.8e-3,
opacities by 1/510; palettes by as much as the splats need, higher harmonics most.
"""

from __future__ import annotations

import io
import json
import zipfile
from typing import Any

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from rift_cl.io.scenes.formats.palettes import number_palette, vector_palette
from rift_cl.io.scenes.formats.plain import along_curve, check_plain, smallest_three, unit_quats
from rift_cl.io.scenes.splat_activations import opacities_of
from rift_cl.io.scenes.splat_scene import SplatScene

_PALETTE = 256
# Vectors of harmonics: a power of two times 1,024, as many as a quarter to all of the splats.
_VECTORS, _MOST = 1024, 1 << 16
# Vectors in a row of their picture, and what edges of pictures are whole multiples of.
_ROW, _EDGE = 64, 4
_LARGEST_IS_W = 252
# A ZIP file cannot leave out a date: the first that it knows.
_DATE = (1980, 1, 1, 0, 0, 0)

Bytes = NDArray[np.uint8]


def encode_sog(scene: SplatScene) -> bytes:
    """The bytes of a file.

    Raises:
        InputError: the scene is none that the format holds.
    """
    check_plain(scene, 3)
    scene = along_curve(scene)
    width = _whole(int(np.ceil(np.sqrt(len(scene)))))
    size = (_whole(-(-len(scene) // width)), width)
    pictures: dict[str, bytes] = {}

    def add(name: str, *channels: Bytes, size: tuple[int, int] = size) -> None:
        pixels = np.zeros((size[0] * size[1], 4), np.uint8)
        pixels[:, 3] = 255
        table = np.column_stack(channels)
        pixels[: len(table), : table.shape[1]] = table
        pictures[f"{name}.webp"] = _webp(pixels.reshape(*size, 4))

    meta: dict[str, Any] = {"version": 2, "asset": {"generator": "RiFT-CL"}, "count": len(scene)}
    low, high, words = _places(scene)
    add("means_l", (words & 255).astype(np.uint8))
    add("means_u", (words >> 8).astype(np.uint8))
    files = ["means_l.webp", "means_u.webp"]
    meta["means"] = {"mins": low.tolist(), "maxs": high.tolist(), "files": files}
    palette, labels = number_palette(scene.log_scales, _PALETTE)
    add("scales", labels)
    meta["scales"] = {"codebook": palette.tolist(), "files": ["scales.webp"]}
    add("quats", _rotations(scene))
    meta["quats"] = {"files": ["quats.webp"]}
    palette, labels = number_palette(scene.sh[:, 0], _PALETTE)
    opacities = np.rint(255 * np.clip(opacities_of(scene.logit_opacities), 0, 1))
    add("sh0", labels, opacities.astype(np.uint8))
    meta["sh0"] = {"codebook": palette.tolist(), "files": ["sh0.webp"]}
    if scene.degree:
        rest = scene.sh.shape[1] - 1
        vectors, numbers = vector_palette(
            scene.sh[:, 1:].reshape(len(scene), 3 * rest), _vectors(len(scene))
        )
        palette, labels = number_palette(vectors, _PALETTE)
        rows = -(-len(vectors) // _ROW)
        add("shN_centroids", labels.reshape(-1, 3), size=(rows, _ROW * rest))
        add("shN_labels", (numbers & 255).astype(np.uint8), (numbers >> 8).astype(np.uint8))
        meta["shN"] = {
            "count": len(vectors),
            "bands": scene.degree,
            "codebook": palette.tolist(),
            "files": ["shN_centroids.webp", "shN_labels.webp"],
        }
    return _zipped(pictures | {"meta.json": json.dumps(meta, separators=(",", ":")).encode()})


def _places(scene: SplatScene) -> tuple[NDArray[Any], NDArray[Any], NDArray[Any]]:
    """Least and greatest logarithms (3,), and 16 bits (N, 3) for each place between them."""
    means = scene.means.astype(np.float64)
    curved = np.sign(means) * np.log1p(np.abs(means))
    low, high = curved.min(axis=0), curved.max(axis=0)
    # Readers take a range of nothing for 1.
    span = np.where(high > low, high - low, 1)
    return low, high, np.rint(65535 * (curved - low) / span).astype(np.uint16)


def _rotations(scene: SplatScene) -> Bytes:
    """(N, 4) the three smaller of (w, x, y, z), and 252 and the number of the largest."""
    largest, others = smallest_three(unit_quats(scene))
    levels = np.rint(255 * np.clip(others / np.sqrt(2) + 0.5, 0, 1))
    return np.column_stack([levels, _LARGEST_IS_W + largest]).astype(np.uint8)


def _vectors(count: int) -> int:
    return min(_MOST, _VECTORS << max(0, (count // _VECTORS).bit_length() - 1))


def _whole(edge: int) -> int:
    return -(-edge // _EDGE) * _EDGE


def _webp(pixels: Bytes) -> bytes:
    """A picture whose every bit is kept, those of transparent pixels as well."""
    file = io.BytesIO()
    Image.fromarray(pixels).save(file, "WEBP", lossless=True, exact=True, quality=100, method=4)
    return file.getvalue()


def _zipped(contents: dict[str, bytes]) -> bytes:
    """A ZIP file without dates; pictures are packed as they are."""
    file = io.BytesIO()
    with zipfile.ZipFile(file, "w", zipfile.ZIP_STORED) as archive:
        for name, content in contents.items():
            archive.writestr(zipfile.ZipInfo(name, _DATE), content)
    return file.getvalue()
