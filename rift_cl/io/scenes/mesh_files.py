"""Triangles in the files that printers and modellers read: PLY, STL, OBJ, and glTF (GLB).

PLY and STL are binary. STL has no shared vertices and no unit; glTF has y up, which is for the
caller to see to. The same triangles are the same bytes.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from rift_cl.io.scenes.formats.gltf import glb

Vertices = NDArray[np.float32]
Triangles = NDArray[np.uint32]

_TRIANGLES = 4


def mesh_ply(vertices: Vertices, triangles: Triangles) -> bytes:
    """A PLY file of (V, 3) places and (T, 3) numbers of them, counter-clockwise from outside."""
    lines = ["ply", "format binary_little_endian 1.0", f"element vertex {len(vertices)}"]
    lines += [f"property float {axis}" for axis in "xyz"]
    lines += [f"element face {len(triangles)}", "property list uchar int vertex_indices"]
    faces = np.empty(len(triangles), [("count", "u1"), ("corners", "<i4", 3)])
    faces["count"], faces["corners"] = 3, triangles
    header = "\n".join([*lines, "end_header", ""]).encode()
    return header + vertices.astype("<f4").tobytes() + faces.tobytes()


def mesh_stl(vertices: Vertices, triangles: Triangles) -> bytes:
    """A binary STL file."""
    corners = vertices[triangles]
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    lengths = np.linalg.norm(normals, axis=1, keepdims=True)
    records = np.zeros(
        len(triangles), [("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("end", "<u2")]
    )
    records["normal"] = normals / np.where(lengths > 0, lengths, 1)
    records["corners"] = corners
    header = b"RiFT-CL".ljust(80, b"\0") + np.uint32(len(triangles)).tobytes()
    return header + records.tobytes()


def mesh_obj(vertices: Vertices, triangles: Triangles) -> bytes:
    """A Wavefront OBJ file; vertices count from 1."""
    lines = [f"v {x:.9g} {y:.9g} {z:.9g}" for x, y, z in vertices.tolist()]
    lines += [f"f {a} {b} {c}" for a, b, c in (triangles.astype(np.int64) + 1).tolist()]
    return ("\n".join(lines) + "\n").encode()


def mesh_glb(vertices: Vertices, triangles: Triangles) -> bytes:
    """A binary glTF file."""
    return glb({"POSITION": vertices}, triangles, _TRIANGLES, {})


MESH_FORMATS: dict[str, Callable[[Vertices, Triangles], bytes]] = {
    "ply": mesh_ply,
    "stl": mesh_stl,
    "obj": mesh_obj,
    "glb": mesh_glb,
}
