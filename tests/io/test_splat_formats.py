"""Splats in .ply and .splat files: what is kept, and what every other program finds there."""

from __future__ import annotations

import os
import struct
from pathlib import Path

import numpy as np
import pytest
import splat_files as made
from plyfile import PlyData
from splat_files import sigmoid

import rift_cl as rift
from rift_cl.errors import FileFormatError

DEGREES = pytest.mark.parametrize("degree", range(5))
C0 = 0.28209479177387814


@DEGREES
def test_a_ply_keeps_every_bit(tmp_path: Path, degree: int) -> None:
    scene = made.scene(5000, degree)
    scene.means[:4, 0] = -0.0, 1e-45, 3.4028235e38, 1 / 3
    scene.quats[0] = 0
    scene.save(tmp_path / "a.ply")
    found = rift.SplatScene.load(tmp_path / "a.ply")
    made.assert_same(found, scene)
    assert (len(found), found.degree) == (5000, degree)


@DEGREES
def test_a_ply_is_what_another_library_writes_of_the_same_records(
    tmp_path: Path, degree: int
) -> None:
    scene = made.scene(degree=degree)
    made.write(tmp_path / "theirs.ply", ("vertex", made.records(scene)))
    scene.save(tmp_path / "ours.ply")
    assert (tmp_path / "ours.ply").read_bytes() == (tmp_path / "theirs.ply").read_bytes()
    read = PlyData.read(str(tmp_path / "ours.ply"))
    assert [element.name for element in read] == ["vertex"]
    assert [entry.name for entry in read["vertex"].properties] == made.names(degree)
    assert {entry.val_dtype for entry in read["vertex"].properties} == {"f4"}


def test_a_ply_written_by_hand_has_its_harmonics_channel_by_channel(tmp_path: Path) -> None:
    names = made.names(1)
    header = "ply\nformat binary_little_endian 1.0\nelement vertex 2\n"
    header += "".join(f"property float {name}\n" for name in names) + "end_header\n"
    # Halves, since a splat whose scale is exp(45) is too large to be drawn.
    body = struct.pack(f"<{2 * len(names)}f", *(n / 2 for n in range(2 * len(names))))
    (tmp_path / "a.ply").write_bytes(header.encode() + body)
    scene = rift.SplatScene.load(tmp_path / "a.ply")
    np.testing.assert_array_equal(2 * scene.means[0], [0, 1, 2])
    # Numbers 9 to 17 are the rest: three of red, then of green, then of blue.
    numbers = [[6, 7, 8], [9, 12, 15], [10, 13, 16], [11, 14, 17]]
    np.testing.assert_array_equal(2 * scene.sh[0], numbers)
    assert 2 * scene.logit_opacities[0] == 18
    np.testing.assert_array_equal(2 * scene.log_scales[0], [19, 20, 21])
    np.testing.assert_array_equal(2 * scene.quats[0], [22, 23, 24, 25])
    np.testing.assert_array_equal(2 * (scene.sh[1] - scene.sh[0]), len(names))


def shuffled(values: np.ndarray) -> list[tuple[str, str]]:
    order = np.random.default_rng(3).permutation(len(values.dtype.names))
    return [(values.dtype.names[i], "f4") for i in order]


LAYOUTS = {
    "as it is": lambda values: values.dtype.descr,
    "shuffled": shuffled,
    "without normals": lambda values: [(n, "f4") for n in values.dtype.names if n[0] != "n"],
    "with more": lambda values: [("id", "u4"), *values.dtype.descr, ("red", "u1"), ("s", "i2")],
    "double": lambda values: [(name, "f8") for name in values.dtype.names],
}
KINDS = {"text": (True, "="), "little-endian": (False, "<"), "big-endian": (False, ">")}


@pytest.mark.each
@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("layout", LAYOUTS)
def test_every_layout_of_the_same_numbers_is_the_same_scene(
    tmp_path: Path, layout: str, kind: str
) -> None:
    scene = made.scene(degree=2)
    values = made.records(scene)
    values = made.retyped(values, LAYOUTS[layout](values))
    text, order = KINDS[kind]
    path = made.write(tmp_path / "a.bin", ("vertex", values), text=text, order=order)
    made.assert_same(rift.SplatScene.load(path), scene)


@pytest.mark.parametrize("newline", [b"\r\n", b"\r"])
def test_lines_may_end_as_on_other_systems(tmp_path: Path, newline: bytes) -> None:
    scene = made.scene(5000, degree=0)
    path = made.write(tmp_path / "a.ply", ("vertex", made.records(scene)), text=True)
    content = path.read_bytes().replace(
        b"element", b"comment Z\xfcrich\n\nobj_info end_header\nelement"
    )
    path.write_bytes(content.replace(b"\n", newline))
    made.assert_same(rift.SplatScene.load(path), scene)


def test_an_empty_scene_is_a_ply_like_any_other(tmp_path: Path) -> None:
    scene = made.scene(0)
    scene.save(tmp_path / "a.ply")
    made.assert_same(rift.SplatScene.load(tmp_path / "a.ply"), scene)


def test_the_bytes_of_a_splat_file(tmp_path: Path) -> None:
    scene = rift.SplatScene(
        means=[[1.5, -2, 0.25], [7, 8, 9]],
        log_scales=np.log([[0.5, 0.25, 2], [1, 2, 3]]),
        quats=[[0, 3, -4, 0], [0, 0, 0, 0]],
        logit_opacities=[np.log(0.2 / 0.8), 40],
        sh=[[[0, -9, 9]], [[1, -1, 0.5]]],
    )
    scene.save(tmp_path / "a.splat")
    wanted = struct.pack("<6f8B", 7, 8, 9, 1, 2, 3, 199, 56, 163, 255, 128, 128, 128, 128)
    wanted += struct.pack("<6f8B", 1.5, -2, 0.25, 0.5, 0.25, 2, 128, 0, 255, 51, 128, 205, 26, 128)
    found = np.frombuffer((tmp_path / "a.splat").read_bytes(), "<f4,<f4,<f4,<f4,<f4,<f4,8u1")
    expected = np.frombuffer(wanted, found.dtype)
    for name in found.dtype.names:
        np.testing.assert_allclose(found[name], expected[name], rtol=2e-7, atol=0)


@DEGREES
def test_a_splat_file_keeps_a_scene_to_half_a_step(tmp_path: Path, degree: int) -> None:
    scene = made.scene(2000, degree)
    scene.save(tmp_path / "a.splat")
    assert (tmp_path / "a.splat").stat().st_size == 32 * 2000
    found = rift.SplatScene.load(tmp_path / "a.splat")
    assert found.degree == 0
    # Positions are kept to the bit, and tell which splat is which.
    order = np.lexsort(scene.means.T)[np.argsort(np.lexsort(found.means.T))]
    np.testing.assert_array_equal(found.means, scene.means[order])
    np.testing.assert_allclose(found.log_scales, scene.log_scales[order], rtol=0, atol=1e-6)
    opacities = sigmoid(scene.logit_opacities[order])
    assert np.abs(sigmoid(found.logit_opacities) - opacities).max() <= 0.5 / 255 + 1e-6
    colors = np.clip(0.5 + C0 * scene.sh[order, 0], 0, 1)
    assert np.abs(0.5 + C0 * found.sh[:, 0] - colors).max() <= 0.5 / 255 + 1e-6
    quats = scene.quats[order] / np.linalg.norm(scene.quats[order], axis=1, keepdims=True)
    # A component of 1 would be byte 256, and becomes 255.
    steps = np.where(quats > 1 - 0.5 / 128, 1, 0.5)
    assert (np.abs(found.quats - quats) * 128 <= steps + 1e-4).all()
    weights = np.exp(scene.log_scales[order].sum(1, dtype=float)) * opacities
    assert (np.diff(weights) <= 0).all()


def test_extremes_survive_a_splat_file(tmp_path: Path) -> None:
    """Opaque, transparent, vanishing and enormous splats: their logarithms stay finite."""
    scene = made.scene(4, 0)
    scene.logit_opacities[:2] = 500, -500
    scene.log_scales[2:] = [[-500] * 3, [44] * 3]
    scene.save(tmp_path / "a.splat")
    found = rift.SplatScene.load(tmp_path / "a.splat")
    opacities = sigmoid(found.logit_opacities)
    assert opacities.min() < 1e-30 and opacities.max() > 1 - 1e-7
    assert np.exp(found.log_scales.min()) < 1e-37 and np.exp(found.log_scales.max()) > 1e19
    found.save(tmp_path / "b.splat")
    assert sorted(sigmoid(rift.SplatScene.load(tmp_path / "b.splat").logit_opacities)) == sorted(
        opacities
    )


def beside(count: int, *kinds: str) -> np.ndarray:
    """Records of an element of another program."""
    return np.ones(count, [(f"p{k}", kind) for k, kind in enumerate(kinds)])


@pytest.mark.parametrize("text", [False, True])
def test_elements_behind_the_splats_are_left_out(tmp_path: Path, text: bool) -> None:
    """As SHARP of Apple writes them: a camera, the size of its image and what else it knows."""
    wanted = made.scene(7, 1)
    elements = (
        ("vertex", made.records(wanted)),
        ("extrinsic", beside(16, "f4")),
        ("image_size", beside(2, "u4")),
        ("version", beside(3, "u1")),
    )
    path = made.write(tmp_path / "a.ply", *elements, text=text)
    made.assert_same(rift.SplatScene.load(path), wanted)
    if not text:
        os.truncate(path, path.stat().st_size - 1)
        with pytest.raises(FileFormatError, match="cut off"):
            rift.SplatScene.load(path)


@pytest.mark.parametrize("order", ["<", ">"])
def test_elements_of_plain_numbers_before_the_splats_are_skipped(tmp_path: Path, order) -> None:
    wanted = made.scene(7, 1)
    elements = (("camera", beside(3, "f8", "u1")), ("vertex", made.records(wanted)))
    path = made.write(tmp_path / "a.ply", *elements, order=order)
    made.assert_same(rift.SplatScene.load(path), wanted)
    made.write(path, *elements, text=True)
    with pytest.raises(FileFormatError, match="'camera' before 'vertex'"):
        rift.SplatScene.load(path)


def test_lists_behind_the_splats_are_not_followed(tmp_path: Path) -> None:
    wanted = made.scene(7, 1)
    wanted.save(tmp_path / "a.ply")
    content = (tmp_path / "a.ply").read_bytes()
    faces = b"element face 5\nproperty list uint double v\nend_header"
    (tmp_path / "a.ply").write_bytes(content.replace(b"end_header", faces) + b"\xff" * 3)
    made.assert_same(rift.SplatScene.load(tmp_path / "a.ply"), wanted)
