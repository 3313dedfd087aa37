"""Small captures that the tests write: one scene, in every form that a capture comes in.

Nothing here is shared with the readers; poses are written down from the camera's three axes.
"""

from __future__ import annotations

import json
import struct
import tempfile
from collections.abc import Sequence
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
from plyfile import PlyData, PlyElement
from scipy.spatial.transform import Rotation

from rift_cl.io import write_png

WIDTH, HEIGHT = 12, 8
FOCAL = 20.0
NAMES = ["a.png", "b.png", "sub/c.png"]
POINTS = np.array([[0.5, 0.25, -0.5], [1.0, -1.0, 2.0], [0.0, 0.5, 0.0], [3.0, 2.0, 1.0]])
COLORS = np.array([[255, 0, 0], [0, 128, 0], [1, 2, 3], [255, 255, 255]], np.uint8)
MODEL_NUMBERS = {
    "SIMPLE_PINHOLE": 0,
    "PINHOLE": 1,
    "OPENCV": 4,
    "FOV": 7,
    "DIVISION": 13,
    "SIMPLE_FISHEYE": 14,
    "FISHEYE": 15,
}

PINHOLE = ("PINHOLE", [FOCAL, FOCAL + 1, 6.5, 4.25])


def stand(index: int) -> tuple[np.ndarray, np.ndarray]:
    """Where camera ``index`` stands, and its axes right, down, forward as rows."""
    angle = 0.7 * index
    place = np.array([4 * np.cos(angle), 4 * np.sin(angle), 1.0 + index])
    forward = -place / np.linalg.norm(place)
    right = np.cross(forward, [0, 0, 1])
    right /= np.linalg.norm(right)
    return place, np.array([right, np.cross(forward, right), forward])


def opengl(index: int) -> list[list[float]]:
    """Camera-to-world: the columns are right, up, backward, place."""
    place, (right, down, forward) = stand(index)
    rows = np.stack([right, -down, -forward, place], axis=1)
    return [*rows.tolist(), [0.0, 0.0, 0.0, 1.0]]


def colmap_pose(index: int) -> tuple[list[float], list[float]]:
    """World-to-camera: quaternion w, x, y, z and shift."""
    place, axes = stand(index)
    x, y, z, w = Rotation.from_matrix(axes).as_quat()
    return [w, x, y, z], (-axes @ place).tolist()


def image(seed: int = 0, channels: int = 3) -> np.ndarray:
    codes = np.random.default_rng(seed).integers(0, 256, (HEIGHT, WIDTH, channels))
    return codes.astype(np.uint8)


@cache
def png(seed: int) -> bytes:
    """The bytes of a photograph; made once, because every PNG is forced to the disk."""
    with tempfile.TemporaryDirectory() as folder:
        write_png(Path(folder) / "a.png", image(seed))
        return (Path(folder) / "a.png").read_bytes()


def photographs(folder: Path, names: Sequence[str] = NAMES) -> None:
    for index, name in enumerate(names):
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
        (folder / name).write_bytes(png(index))


def transforms(folder: Path, **changes: Any) -> Path:
    """A nerfstudio capture; a field that is changed to None is left out."""
    photographs(folder / "images")
    frames = [
        {"file_path": f"images/{name}", "transform_matrix": opengl(index)}
        for index, name in enumerate(NAMES)
    ]
    fields: dict[str, Any] = {
        "camera_model": "OPENCV",
        "w": WIDTH,
        "h": float(HEIGHT),
        "fl_x": FOCAL,
        "fl_y": FOCAL + 1,
        "cx": 6.5,
        "cy": 4.25,
        "frames": frames,
        **changes,
    }
    kept = {name: value for name, value in fields.items() if value is not None}
    path = folder / "transforms.json"
    path.write_text(json.dumps(kept))
    return path


def changed(path: Path, index: int, **changes: Any) -> Path:
    """Change fields of one frame of a transforms.json."""
    value = json.loads(path.read_text())
    value["frames"][index].update(changes)
    path.write_text(json.dumps(value))
    return path


def point_cloud(path: Path, *, text: bool = False, colors: bool = True) -> Path:
    fields = [(axis, "f4") for axis in "xyz"]
    fields += [(name, "u1") for name in ("red", "green", "blue") if colors]
    table = np.empty(len(POINTS), fields)
    for axis, values in zip("xyz", POINTS.T, strict=True):
        table[axis] = values
    for name, codes in zip(("red", "green", "blue"), COLORS.T, strict=True):
        if colors:
            table[name] = codes
    PlyData([PlyElement.describe(table, "vertex")], text=text).write(str(path))
    return path


def colmap_binary(folder: Path, camera: tuple[str, list[float]] = PINHOLE) -> Path:
    """A binary COLMAP model; images have features and points have tracks to be passed over."""
    folder.mkdir(parents=True, exist_ok=True)
    model, parameters = camera
    head = struct.pack("<QIiQQ", 1, 7, MODEL_NUMBERS[model], WIDTH, HEIGHT)
    (folder / "cameras.bin").write_bytes(head + struct.pack(f"<{len(parameters)}d", *parameters))
    content = struct.pack("<Q", len(NAMES))
    for index in reversed(range(len(NAMES))):
        quaternion, shift = colmap_pose(index)
        content += struct.pack("<I7dI", index + 1, *quaternion, *shift, 7)
        content += NAMES[index].encode() + b"\0" + struct.pack("<Q", index) + bytes(24 * index)
    (folder / "images.bin").write_bytes(content)
    content = struct.pack("<Q", len(POINTS))
    for index, (point, color) in enumerate(zip(POINTS, COLORS, strict=True)):
        content += struct.pack("<Q3d3Bd", index, *point, *color, 0.5)
        content += struct.pack("<Q", index) + bytes(8 * index)
    (folder / "points3D.bin").write_bytes(content)
    return folder


def colmap_text(folder: Path, camera: tuple[str, list[float]] = PINHOLE) -> Path:
    folder.mkdir(parents=True, exist_ok=True)
    model, parameters = camera
    line = [7, model, WIDTH, HEIGHT, *parameters]
    (folder / "cameras.txt").write_text("# cameras\n" + joined(line))
    lines = "# images\n\n"
    for index, name in enumerate(NAMES):
        quaternion, shift = colmap_pose(index)
        lines += joined([index + 1, *quaternion, *shift, 7, name]) + joined([1.5, 2.5, -1] * index)
    (folder / "images.txt").write_text(lines)
    lines = ""
    for index, (point, color) in enumerate(zip(POINTS, COLORS, strict=True)):
        lines += joined([index, *point, *color, 0.5, *range(2 * index)])
    (folder / "points3D.txt").write_text(lines)
    return folder


def joined(values: Sequence[object]) -> str:
    return " ".join(str(value) for value in values) + "\n"
