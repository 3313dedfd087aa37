"""Captures that cannot be used: one sentence that names the file, the frame and what is wrong."""

from __future__ import annotations

import json
import os
import re
from pathlib import Path
from typing import Any

import capture_files as made
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from rift_cl.errors import FileFormatError, InputError, NonFiniteError, RiftError
from rift_cl.io import open_capture

FRAME = r"transforms\.json: frames\[1\] \('images/b\.png'\): "


def matrix(rotation: float = 1, entry: object = None) -> list[list[Any]]:
    rows: list[list[Any]] = [[value * rotation for value in row[:3]] for row in made.opengl(1)[:3]]
    rows = [[*row, 2.0] for row in rows] + [[0, 0, 0, 1]]
    if entry is not None:
        rows[1][2] = entry
    return rows


def mirrored() -> list[list[float]]:
    return [[-row[0], *row[1:]] for row in matrix()[:3]] + [[0, 0, 0, 1]]


def sheared() -> list[list[float]]:
    return [[row[0] + 0.1 * row[1], *row[1:]] for row in matrix()[:3]]


@pytest.mark.parametrize(
    ("changes", "kind", "message"),
    [
        ({"transform_matrix": matrix(entry=float("nan"))}, NonFiniteError, "the pose holds NaN"),
        ({"transform_matrix": matrix(0.5)}, InputError, r"scales the scene by 0\.5"),
        ({"transform_matrix": matrix(1.01)}, InputError, r"scales the scene by 1\.01"),
        ({"transform_matrix": matrix(0)}, InputError, "no rigid motion"),
        ({"transform_matrix": mirrored()}, InputError, "mirrors the scene"),
        ({"transform_matrix": sheared()}, InputError, r"off by 0\.\d"),
        ({"transform_matrix": matrix(1e200)}, InputError, "scales the scene"),
        ({"transform_matrix": matrix()[:2]}, FileFormatError, "4 x 4 numbers"),
        ({"transform_matrix": matrix(entry="1")}, FileFormatError, "4 x 4 numbers"),
        ({"transform_matrix": matrix(entry=True)}, FileFormatError, "4 x 4 numbers"),
        ({"transform_matrix": matrix(entry=10**400)}, FileFormatError, "4 x 4 numbers"),
        ({"transform_matrix": [*matrix()[:3], [0, 0, 0, 2]]}, FileFormatError, "last row"),
        ({"transform_matrix": None}, FileFormatError, "has no 'transform_matrix'"),
        ({"fl_x": 0}, InputError, "fx = 0 .*must be positive"),
        ({"fl_x": 20, "fl_y": -5}, InputError, "fy = -5, .*must be positive"),
        ({"fl_x": float("inf")}, NonFiniteError, "'fl_x' is inf"),
        ({"fl_x": "20"}, FileFormatError, "'fl_x' is '20'"),
        ({"cx": [1]}, FileFormatError, r"'cx' is \[1\]"),
        ({"camera_angle_x": 3.2}, InputError, r"'camera_angle_x' is 3.2"),
        ({"y_fov": 180}, InputError, r"'y_fov' is 180, wanted degrees"),
        ({"x_fov": 30, "camera_angle_x": 0.6}, InputError, "'x_fov' .*'camera_angle_x' .*contra"),
        ({"w": 0}, FileFormatError, "'w' is 0"),
        ({"h": 7.5}, FileFormatError, r"'h' is 7.5"),
        ({"w": 10**9}, InputError, "size is"),
        ({"camera_model": "EQUIRECTANGULAR"}, FileFormatError, "known are .*OPENCV_FISHEYE"),
        ({"camera_model": 4}, FileFormatError, "'camera_model' is 4"),
        ({"camera_model": "PINHOLE", "k1": 0.1}, FileFormatError, "'k1' is 0.1, .*PINHOLE"),
        ({"k4": 0.1}, FileFormatError, r"'k4' is 0.1"),
        ({"k1": float("nan")}, NonFiniteError, "'k1' is nan"),
        ({"camera_model": None, "is_fisheye": 1}, FileFormatError, "wanted true or false"),
        ({"distortion_params": [0.1, 0, 0, 0]}, FileFormatError, "holds 4 numbers"),
        ({"distortion_params": [0.1] * 12}, FileFormatError, "holds 12 numbers"),
        ({"distortion_params": 0.1}, FileFormatError, "'distortion_params' is 0.1"),
        ({"distortion_params": ["0"] * 6}, FileFormatError, "wanted a list of numbers"),
        ({"distortion_params": [float("nan")] * 6}, NonFiniteError, "wanted finite numbers"),
        ({"distortion_params": [0, 0, 0, 0.1, 0, 0]}, FileFormatError, "'k4' is 0.1"),
        ({"distortion_params": [0] * 6, "k1": 0.1}, FileFormatError, "'k1' is 0.1 and 0 in"),
        ({"latlong": True}, FileFormatError, "'latlong' says"),
        ({"equirectangular": True}, FileFormatError, "'equirectangular' says"),
        ({"orthographic": True}, FileFormatError, "'orthographic' says"),
        ({"ftheta_p0": 0.0, "ftheta_p1": 0.1}, FileFormatError, "'ftheta_p0'"),
        ({"camera_model": "OPENCV", "is_fisheye": True}, FileFormatError, "'is_fisheye' true"),
        ({"camera_model": "OPENCV_FISHEYE", "is_fisheye": False}, FileFormatError, "contradict"),
        ({"is_fisheye": True, "fisheye_crop_radius": 0}, InputError, "'fisheye_crop_radius' is 0"),
        ({"mask_path": "masks/b.png"}, InputError, r"leads to 'masks/b.png'"),
        ({"mask_path": 3}, FileFormatError, "'mask_path' is 3"),
    ],
)
def test_a_frame_that_cannot_be_used(
    tmp_path: Path, changes: dict[str, object], kind: type[Exception], message: str
) -> None:
    path = made.changed(made.transforms(tmp_path, camera_model=None), 1, **changes)
    with pytest.raises(kind, match=FRAME + ".*" + message) as caught:
        open_capture(path)
    assert "\n" not in str(caught.value) and str(caught.value).count("transforms.json") == 1


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"frames": []}, "holds no views"),
        ({"frames": None}, "has no 'frames'"),
        ({"frames": {}}, r"'frames' is \{\}"),
        ({"frames": [3]}, r"frames\[0\] is 3"),
        ({"frames": [{}]}, r"frames\[0\]: has no 'file_path'"),
        ({"frames": [{"file_path": ["a"]}]}, r"frames\[0\]: 'file_path' is \['a'\]"),
        ({"fl_x": None, "fl_y": None}, "neither 'fl_x' nor 'camera_angle_x' nor 'x_fov'"),
        ({"ply_file_path": "gone.ply"}, r"'ply_file_path': leads to 'gone.ply'"),
        ({"ply_file_path": {}}, "wanted a text"),
    ],
)
def test_a_file_without_usable_frames(
    tmp_path: Path, changes: dict[str, object], message: str
) -> None:
    with pytest.raises(InputError, match=r"transforms\.json.*" + message):
        open_capture(made.transforms(tmp_path, **changes))


@pytest.mark.parametrize(
    ("field", "edge", "value"),
    [("cx", "w", made.WIDTH), ("cx", "w", 13.0), ("cy", "h", made.HEIGHT), ("cy", "h", -1.0)],
)
def test_intrinsics_of_pictures_of_another_size(
    tmp_path: Path, field: str, edge: str, value: float
) -> None:
    """The middle of pictures twice as large is the corner of these."""
    path = made.transforms(tmp_path, **{field: value})
    assert getattr(open_capture(path).views[0].camera, "width" if edge == "w" else "height")
    path = made.transforms(tmp_path, **{field: value, edge: None})
    with pytest.raises(InputError, match=rf"a\.png.*'{field}' is .*another size"):
        open_capture(path)


def test_images_that_are_listed_twice(tmp_path: Path) -> None:
    path = made.transforms(tmp_path)
    for name in ("images/a.png", "./images/../images//a.png", "images\\a.png", "images/a"):
        made.changed(path, 2, file_path=name)
        with pytest.raises(FileFormatError, match=r"frames 0 and 2 .*'images/a\.png'"):
            open_capture(path)


def test_an_image_that_is_missing(tmp_path: Path) -> None:
    path = made.transforms(tmp_path)
    (tmp_path / "images" / "b.png").unlink()
    with pytest.raises(InputError, match=FRAME + r"the image 'images/b\.png' is not in"):
        open_capture(path)


@pytest.mark.parametrize("content", [b"", b"no picture", b"\x89PNG\r\n\x1a\n"])
def test_an_image_whose_size_is_asked_for_and_cannot_be_read(
    tmp_path: Path, content: bytes
) -> None:
    path = made.transforms(tmp_path, w=None)
    (tmp_path / "images" / "b.png").write_bytes(content)
    with pytest.raises(FileFormatError, match=FRAME + r".*b\.png: "):
        open_capture(path)


@pytest.mark.parametrize(
    "content",
    [b"", b"{", b"[]", b"3", b"\xff\xfe", b'{"frames": [1,}', b"[" * 100_000, b"9" * 10_000],
)
def test_what_is_no_json_object(tmp_path: Path, content: bytes) -> None:
    (tmp_path / "transforms.json").write_bytes(content)
    with pytest.raises(FileFormatError, match=r"transforms\.json"):
        open_capture(tmp_path)


@pytest.mark.parametrize(("digits", "told"), [(6, False), (4, False), (3, True)])
def test_poses_of_few_digits_are_read_and_told(tmp_path: Path, digits: int, told: bool) -> None:
    path = made.transforms(tmp_path)
    for index in range(3):
        turned = Rotation.from_euler("xyz", [0.7, 0.3 + index, 0.9]).as_matrix()
        pose = np.round(np.column_stack([turned, [1, 2, 3]]), digits)
        made.changed(path, index, transform_matrix=[*pose.tolist(), [0, 0, 0, 1]])
    capture = open_capture(path)
    assert bool(capture.notes) == told
    assert not told or "of 3 photographs have few digits" in capture.notes[0]
    for view in capture.views:
        rotation = view.camera.view[:3, :3]
        np.testing.assert_allclose(rotation @ rotation.T, np.eye(3), atol=1e-9)


def test_a_pose_of_two_digits_is_not_called_scaled(tmp_path: Path) -> None:
    pose = np.round(made.opengl(1), 2).tolist()
    path = made.changed(made.transforms(tmp_path), 1, transform_matrix=pose)
    with pytest.raises(InputError, match="too few digits"):
        open_capture(path)


def test_a_camera_model_that_is_not_read_is_named(tmp_path: Path) -> None:
    for written in (made.colmap_text, made.colmap_binary):
        written(tmp_path / written.__name__, ("DIVISION", [20.0, 21.0, 6.5, 4.25, 0.1]))
        words = r"camera 7: .*'DIVISION' is not known.*image_undistorter"
        if written is made.colmap_text:
            words = words.removeprefix("camera 7: .*")
        with pytest.raises(FileFormatError, match=words):
            open_capture(tmp_path / written.__name__)


@pytest.mark.parametrize(
    ("name", "program"), [("poses.csv", "RealityCapture"), ("cameras.XML", "Metashape")]
)
def test_cameras_of_other_programs_have_a_way_out(tmp_path: Path, name: str, program: str) -> None:
    (tmp_path / name).write_text("<document/>")
    with pytest.raises(InputError, match=f"{program}, export them as a COLMAP model"):
        open_capture(tmp_path / name)


def test_what_is_no_capture(tmp_path: Path) -> None:
    for given, message in [
        (tmp_path / "gone", "no such file or folder"),
        (tmp_path / "gone.json", "no such file or folder"),
        (tmp_path, r"holds no capture; looked for transforms\.json.*sparse/0"),
        ("a\0b", "a.b"),
        ("x" * 5000, "x"),
    ]:
        with pytest.raises(InputError, match=message):
            open_capture(given)
    (tmp_path / "a.txt").write_text("")
    with pytest.raises(InputError, match=r"\.json file"):
        open_capture(tmp_path / "a.txt")
    os.mkfifo(tmp_path / "pipe.json")
    with pytest.raises(InputError, match="is not a file"):
        open_capture(tmp_path / "pipe.json")
    (tmp_path / "cameras.bin").write_bytes(bytes(8))
    with pytest.raises(InputError, match="holds no capture"):
        open_capture(tmp_path)


def edited(path: Path, old: str, new: str) -> None:
    text, count = re.subn(old, new, path.read_text(), count=1, flags=re.M)
    assert count == 1
    path.write_text(text)


@pytest.mark.parametrize(
    ("file", "old", "new", "message"),
    [
        ("cameras", "PINHOLE", "WIDE", r"line 2: .*'WIDE' is not known"),
        ("cameras", "PINHOLE", "OPENCV", "line 2: OPENCV has 4 parameters"),
        ("cameras", " 12 ", " twelve ", "line 2: .*twelve.* no numbers"),
        ("cameras", " 12 ", " 0 ", r"image 'a\.png': .*size"),
        ("cameras", " 20.0 ", " -20 ", r"image 'a\.png': .*must be positive"),
        ("cameras", " 20.0 ", " nan ", r"image 'a\.png': .*nan"),
        ("cameras", "7 PINHOLE.*", r"\g<0>\n\g<0>", "two cameras have the same number"),
        ("cameras", "7 PINHOLE.*", "7 PINHOLE", "line 2: has 2 entries"),
        ("images", r"7 a\.png", "8 a.png", r"image 'a\.png': was taken by camera 8"),
        ("images", r"a\.png", "gone.png", r"image 'gone\.png': leads to 'gone\.png'"),
        ("images", r"a\.png", "b.png", r"have the same image, 'b\.png'"),
        ("images", r"^1 [^ ]*", "1 nan", r"image 'a\.png': the pose holds NaN"),
        ("images", r"^1( [^ ]*){4}", "1 0 0 0 0", r"image 'a\.png': the quaternion .* zero"),
        ("images", r"7 a\.png", "", "line 3: has 8 entries"),
        ("images", r"^1 [^ ]*", "1 north", "line 3: .* no numbers"),
        ("images", r"^1\.5 2\.5 -1$", "1.5 2.5", "line 6: has 2 entries"),
        ("images", r"^1\.5 2\.5 -1$", "1.5 2.5 -1 9.5", "line 6: has 4 entries"),
        ("points3D", "^0 0.5", "0 inf", "point 0 is not finite"),
        ("points3D", " 255 0 0 ", " 256 0 0 ", "colour is .256, 0, 0"),
        ("points3D", " 255 0 0 .*", "", "line 1: has 4 entries"),
    ],
)
def test_a_text_model_that_cannot_be_used(
    tmp_path: Path, file: str, old: str, new: str, message: str
) -> None:
    made.photographs(tmp_path)
    made.colmap_text(tmp_path)
    edited(tmp_path / f"{file}.txt", old, new)
    with pytest.raises(RiftError, match=rf"{'images|cameras' if file != 'points3D' else file}"):
        open_capture(tmp_path)
    with pytest.raises(InputError, match=message):
        open_capture(tmp_path)


def test_a_model_without_images(tmp_path: Path) -> None:
    made.colmap_text(tmp_path)
    (tmp_path / "images.txt").write_text("# none\n")
    with pytest.raises(FileFormatError, match=r"images\.txt: .*no views"):
        open_capture(tmp_path)


@pytest.mark.parametrize(
    ("content", "message"),
    [
        (b"", "has no PLY header"),
        (b"ply\nformat ascii 1.0\n", "has no PLY header"),
        (b"ply\nformat ascii 1.0\nelement face 0\nend_header\n", "element 'face'"),
        (b"ply\nformat ascii 1.0\nelement vertex 1\nproperty float x\nend_header\n1\n", "x, y and"),
    ],
)
def test_point_clouds_that_are_none(tmp_path: Path, content: bytes, message: str) -> None:
    made.transforms(tmp_path, ply_file_path="points.ply")
    (tmp_path / "points.ply").write_bytes(content)
    with pytest.raises(FileFormatError, match=r"points\.ply: .*" + message):
        open_capture(tmp_path)


def test_a_point_that_is_not_finite(tmp_path: Path) -> None:
    made.transforms(tmp_path, ply_file_path="points.ply")
    path = made.point_cloud(tmp_path / "points.ply", text=True)
    path.write_text(path.read_text().replace("\n3 2 1 ", "\n3 nan 1 "))
    with pytest.raises(NonFiniteError, match=r"points\.ply: point 3"):
        open_capture(tmp_path)


def test_json_of_any_depth_and_numbers_of_any_size_stay_short_in_errors(tmp_path: Path) -> None:
    path = made.transforms(tmp_path)
    made.changed(path, 1, fl_x=json.loads("[" * 200 + "]" * 200))
    with pytest.raises(FileFormatError) as caught:
        open_capture(path)
    assert len(str(caught.value)) < 400 + len(str(path))
    made.changed(path, 1, fl_x=np.arange(10_000).tolist())
    with pytest.raises(FileFormatError) as caught:
        open_capture(path)
    assert len(str(caught.value)) < 400 + len(str(path))
