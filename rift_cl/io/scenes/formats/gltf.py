"""glTF: splats by KHR_gaussian_splatting, in a binary file (GLB) of float32, y up.

One mesh of points with the attributes POSITION, KHR_gaussian_splatting:ROTATION (x, y, z, w),
:SCALE (standard deviations, not logarithms), :OPACITY (0 to 1) and :SH_DEGREE_l_COEF_m to degree
3; COLOR_0 shows points where a viewer does not know splats. (Khronos, ratified 2026.) Nothing is
rounded but COLOR_0. The container serves meshes as well.
"""

from __future__ import annotations

import json
import struct
from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rift_cl.io.scenes.formats.plain import check_plain, unit_quats
from rift_cl.io.scenes.splat_activations import HARMONIC_0, opacities_of, scales_of
from rift_cl.io.scenes.splat_scene import SplatScene

_EXTENSION = "KHR_gaussian_splatting"
_POINTS = 0
_TYPES = {1: "SCALAR", 3: "VEC3", 4: "VEC4"}
_COMPONENTS = {"f4": 5126, "u1": 5121, "u4": 5125}
_JSON, _BINARY = b"JSON", b"BIN\x00"
# What a buffer is for: vertices, or the corners of triangles.
_VERTICES, _CORNERS = 34962, 34963


def encode_glb(scene: SplatScene) -> bytes:
    """The bytes of a file.

    Raises:
        InputError: the scene is none that the format holds.
    """
    check_plain(scene, 3)
    opacities = np.clip(opacities_of(scene.logit_opacities), 0, 1)
    shown = np.clip(HARMONIC_0 * scene.sh[:, 0].astype(np.float64) + 0.5, 0, 1)
    colors = np.rint(255 * np.column_stack([shown, opacities]))
    attributes = {
        "POSITION": scene.means,
        "COLOR_0": colors.astype(np.uint8),
        f"{_EXTENSION}:ROTATION": np.roll(unit_quats(scene), -1, axis=1).astype(np.float32),
        f"{_EXTENSION}:SCALE": scales_of(scene.log_scales),
        f"{_EXTENSION}:OPACITY": opacities,
    }
    number = 0
    for degree in range(scene.degree + 1):
        for order in range(2 * degree + 1):
            name = f"{_EXTENSION}:SH_DEGREE_{degree}_COEF_{order}"
            attributes[name] = np.ascontiguousarray(scene.sh[:, number])
            number += 1
    extension = {
        "kernel": "ellipse",
        "colorSpace": "srgb_rec709_display",
        "projection": "perspective",
        "sortingMethod": "cameraDistance",
    }
    return glb(attributes, None, _POINTS, {_EXTENSION: extension})


def glb(
    attributes: Mapping[str, NDArray[Any]],
    triangles: NDArray[np.uint32] | None,
    mode: int,
    extensions: Mapping[str, Any],
) -> bytes:
    """A file of one mesh.

    Args:
        attributes: arrays of float32, or of normalised uint8, a row a vertex, by their names.
        triangles: (T, 3) numbers of vertices, or None.
        mode: of glTF: 0 for points, 4 for triangles.
        extensions: of the mesh's one primitive.
    """
    views: list[dict[str, int]] = []
    accessors: list[dict[str, Any]] = []
    body = bytearray()

    def added(values: NDArray[Any], target: int) -> int:
        views.append({"buffer": 0, "byteOffset": len(body), "byteLength": values.nbytes})
        views[-1]["target"] = target
        body.extend(np.ascontiguousarray(values).tobytes())
        body.extend(bytes(-len(body) % 4))
        width = values.shape[1] if values.ndim > 1 else 1
        kind = values.dtype.str[1:]
        accessor = {"bufferView": len(views) - 1, "componentType": _COMPONENTS[kind]}
        accessors.append(accessor | {"count": len(values), "type": _TYPES[width]})
        return len(accessors) - 1

    primitive: dict[str, Any] = {"attributes": {}, "mode": mode}
    for name, values in attributes.items():
        number = primitive["attributes"][name] = added(values, _VERTICES)
        if values.dtype == np.uint8:
            accessors[number]["normalized"] = True
        if name == "POSITION":
            accessors[number] |= {"min": values.min(0).tolist(), "max": values.max(0).tolist()}
    if triangles is not None:
        primitive["indices"] = added(triangles.reshape(-1), _CORNERS)
    if extensions:
        primitive["extensions"] = dict(extensions)
    document: dict[str, Any] = {"asset": {"version": "2.0", "generator": "RiFT-CL"}}
    if extensions:
        document["extensionsUsed"] = list(extensions)
    document |= {
        "scene": 0,
        "scenes": [{"nodes": [0]}],
        "nodes": [{"mesh": 0}],
        "meshes": [{"primitives": [primitive]}],
        "accessors": accessors,
        "bufferViews": views,
        "buffers": [{"byteLength": len(body)}],
    }
    text = json.dumps(document, separators=(",", ":")).encode()
    text += b" " * (-len(text) % 4)
    chunks = b"".join(
        struct.pack("<I", len(part)) + kind + part
        for kind, part in ((_JSON, text), (_BINARY, bytes(body)))
    )
    return b"glTF" + struct.pack("<II", 2, 12 + len(chunks)) + chunks
