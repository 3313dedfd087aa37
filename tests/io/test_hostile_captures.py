"""Captures that claim terabytes or are damaged at random: one named error each, never a crash."""

from __future__ import annotations

import json
import struct
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import capture_files as made
import numpy as np
import pytest
from test_hostile_scans import grown

from rift_cl.errors import FileFormatError, ResourceLimitError, RiftError
from rift_cl.io import json_fields, open_capture, read_view

CLAIMS = [10, 10**9, 10**12, 2**63, 2**64 - 1]


def colmap(folder: Path) -> Path:
    made.photographs(folder)
    return made.colmap_binary(folder)


def overwritten(path: Path, offset: int, value: int) -> None:
    content = bytearray(path.read_bytes())
    content[offset : offset + 8] = struct.pack("<Q", value)
    path.write_bytes(content)


@pytest.mark.parametrize("claim", CLAIMS)
@pytest.mark.parametrize(
    ("file", "offset", "what"),
    [
        ("cameras.bin", 0, "cameras"),
        ("images.bin", 0, "images"),
        # Behind the first image, which is the last of the names.
        ("images.bin", 8 + 64 + len("sub/c.png") + 1, "features"),
        ("points3D.bin", 0, "points"),
    ],
)
def test_a_colmap_count_is_compared_with_the_file(
    tmp_path: Path, file: str, offset: int, what: str, claim: int
) -> None:
    overwritten(colmap(tmp_path) / file, offset, claim)
    before, start = grown(), time.perf_counter()
    with pytest.raises(FileFormatError, match=rf"{file}:.*{claim} {what}"):
        open_capture(tmp_path)
    assert time.perf_counter() - start < 1
    assert grown() - before < 50 << 20


def test_a_track_is_compared_with_the_file(tmp_path: Path) -> None:
    overwritten(colmap(tmp_path) / "points3D.bin", 8 + 43, 2**62)
    with pytest.raises(FileFormatError, match=r"points3D\.bin: .*ends"):
        open_capture(tmp_path)


@pytest.mark.parametrize("name", ["cameras.bin", "images.bin", "points3D.bin"])
def test_binary_models_cut_short_or_too_long(tmp_path: Path, name: str) -> None:
    path = colmap(tmp_path) / name
    content = path.read_bytes()
    for cut in range(len(content)):
        path.write_bytes(content[:cut])
        with pytest.raises(FileFormatError, match=rf"{name}: "):
            open_capture(tmp_path)
    path.write_bytes(content + b"\0")
    with pytest.raises(FileFormatError, match="last record"):
        open_capture(tmp_path)


def test_the_name_of_an_image_has_an_end(tmp_path: Path) -> None:
    path = colmap(tmp_path) / "images.bin"
    content = path.read_bytes()
    path.write_bytes(content.replace(b"sub/c.png", b"x" * 5000))
    with pytest.raises(FileFormatError, match="name of an image"):
        open_capture(tmp_path)
    path.write_bytes(content.replace(b"sub/c.png", b"sub/\xff\xfe"))
    with pytest.raises(FileFormatError, match="cannot be read"):
        open_capture(tmp_path)


@pytest.mark.parametrize("model", [-1, 18, 2**31 - 1])
def test_a_camera_model_of_no_known_number(tmp_path: Path, model: int) -> None:
    path = colmap(tmp_path) / "cameras.bin"
    content = path.read_bytes()
    path.write_bytes(content[:12] + struct.pack("<i", model) + content[16:])
    with pytest.raises(FileFormatError, match=f"'number {model}'.*SIMPLE_"):
        open_capture(tmp_path)


@pytest.mark.parametrize("form", ["ascii", "binary_little_endian", "binary_big_endian"])
@pytest.mark.parametrize("newline", ["\n", "\r\n", "\r"])
@pytest.mark.parametrize("claim", [-1, 1000, 10**12, 2**70])
def test_a_ply_count_is_compared_with_the_file(
    tmp_path: Path, form: str, newline: str, claim: int
) -> None:
    made.transforms(tmp_path, ply_file_path="points.ply")
    # A comment that looks like the end where lines end in another way.
    trap = {"\n": "\r", "\r\n": "\n", "\r": "\n"}[newline]
    lines = ["ply", f"format {form} 1.0", f"comment {trap}end_header{trap}"]
    lines += [f"element vertex {claim}", "property float x", "end_header", ""]
    (tmp_path / "points.ply").write_bytes(newline.join(lines).encode())
    before = grown()
    with pytest.raises(FileFormatError, match=rf"points\.ply:.*'?{claim}'?"):
        open_capture(tmp_path)
    assert grown() - before < 50 << 20


def test_lists_in_a_ply_are_not_followed(tmp_path: Path) -> None:
    made.transforms(tmp_path, ply_file_path="points.ply")
    path = made.point_cloud(tmp_path / "points.ply")
    faces = b"element face 1\nproperty list uint double v\nend_header"
    path.write_bytes(path.read_bytes().replace(b"end_header", faces) + b"\xff" * 8)
    points = open_capture(tmp_path).points
    assert points is not None and len(points) > 0


def test_a_point_cloud_may_name_faces_that_it_has_not(tmp_path: Path) -> None:
    made.transforms(tmp_path, ply_file_path="points.ply")
    path = made.point_cloud(tmp_path / "points.ply")
    faces = b"element face 0\nproperty list uchar int vertex_indices\nend_header"
    path.write_bytes(path.read_bytes().replace(b"end_header", faces))
    points = open_capture(tmp_path).points
    assert points is not None and len(points) > 0


def test_a_json_file_has_a_largest_size(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = made.transforms(tmp_path)
    size = path.stat().st_size
    monkeypatch.setattr(json_fields, "_LARGEST_FILE", size)
    open_capture(path)
    monkeypatch.setattr(json_fields, "_LARGEST_FILE", size - 1)
    with pytest.raises(ResourceLimitError, match=r"transforms\.json: .*larger"):
        open_capture(path)


def outcome(folder: Path) -> bool:
    """Whether a capture opens; anything but that or our own error, in time, fails the test."""
    start = time.perf_counter()
    try:
        capture = open_capture(folder)
        image = read_view(capture.views[0], budget=1 << 24)
    except RiftError as error:
        assert str(folder) in str(error) and len(str(error)) < 2000
        capture = None
    assert time.perf_counter() - start < 5
    if capture is None:
        return False
    assert image.shape[:2] == capture.views[0].camera.size and np.isfinite(image).all()
    assert all(np.isfinite(view.camera.view).all() for view in capture.views)
    if capture.points is not None:
        assert np.isfinite(capture.points).all() and capture.points.shape[1] == 3
    return True


def damaged(content: bytes, random: np.random.Generator) -> bytes:
    """Some bytes replaced, removed, doubled, or the end cut off."""
    values = bytearray(content)
    for _ in range(random.integers(1, 4)):
        place = int(random.integers(0, len(values)))
        span = int(random.integers(1, 9))
        match random.integers(0, 4):
            case 0:
                values[place] = random.integers(0, 256)
            case 1:
                values[place : place + span] = b""
            case 2:
                values[place:place] = values[place : place + span]
            case _:
                values[place : place + span] = b"\xff" * span
    return bytes(values) or b"\0"


@pytest.mark.parametrize("write", [colmap, made.colmap_text], ids=["binary", "text"])
def test_colmap_models_that_are_damaged_at_random(
    tmp_path: Path, write: Callable[[Path], Path]
) -> None:
    made.photographs(tmp_path)
    write(tmp_path)
    random = np.random.default_rng(11)
    files = [p for p in sorted(tmp_path.iterdir()) if p.suffix in (".bin", ".txt")]
    opened = []
    for path in files:
        content = path.read_bytes()
        for _ in range(120):
            path.write_bytes(damaged(content, random))
            opened.append(outcome(tmp_path))
        path.write_bytes(content)
    assert 10 < sum(opened) < len(opened) - 10


@pytest.mark.full
def test_point_clouds_that_are_damaged_at_random(tmp_path: Path) -> None:
    made.transforms(tmp_path, ply_file_path="points.ply")
    random = np.random.default_rng(12)
    opened = []
    for text in (True, False):
        path = made.point_cloud(tmp_path / "points.ply", text=text)
        content = path.read_bytes()
        for _ in range(120):
            path.write_bytes(damaged(content, random))
            opened.append(outcome(tmp_path))
    # Nearly every byte of so small a file matters.
    assert 3 < sum(opened) < len(opened) - 10


STRANGE: list[Any] = [
    *(None, True, False, 0, -1, 0.5, 1e-320, 1e308, -1e308, 10**30, 10**400),
    *(float("nan"), float("inf"), "", "x", "images/a.png", "../a.png", "\0", "\ud800", "1"),
    *([], {}, [[]], [1, 2, 3], {"a": 1}, "OPENCV", "OPENCV_FISHEYE", "FULL_OPENCV"),
]


def mutated(value: Any, random: np.random.Generator) -> Any:
    """One field or entry, anywhere in the tree, replaced, removed or put in another's place."""
    keys = list(value) if isinstance(value, dict) else list(range(len(value)))
    if not keys:
        return STRANGE[random.integers(len(STRANGE))]
    key = keys[random.integers(len(keys))]
    inner = value[key]
    if isinstance(inner, list | dict) and random.random() < 0.8:
        value[key] = mutated(inner, random)
    elif random.random() < 0.2:
        del value[key]
    else:
        value[key] = STRANGE[random.integers(len(STRANGE))]
    return value


@pytest.mark.full
def test_json_captures_that_are_changed_at_random(tmp_path: Path) -> None:
    """Half of them by meaning, half of them by bytes."""
    extra = {"k1": 0.01, "k2": 0.0, "p1": 0.001, "camera_angle_x": 0.6, "aabb_scale": 4}
    path = made.transforms(tmp_path, **extra)
    made.changed(path, 0, mask_path="images/b.png", fl_x=22.0)
    content = path.read_bytes()
    random = np.random.default_rng(13)
    opened = []
    for index in range(600):
        if index % 2:
            path.write_bytes(damaged(content, random))
        else:
            value = json.loads(content)
            for _ in range(random.integers(1, 3)):
                value = mutated(value, random)
            path.write_text(json.dumps(value))
        opened.append(outcome(tmp_path))
    assert 50 < sum(opened) < len(opened) - 50
