"""One scene, written in every form: the same cameras, photographs and points come out of each."""

from __future__ import annotations

import json
from collections.abc import Callable
from importlib.util import find_spec
from pathlib import Path

import capture_files as made
import numpy as np
import pytest

from rift_cl.geometry.lens_distortion import Lens
from rift_cl.io import Capture, open_capture

K = np.array([[20, 0, 6.5], [0, 21, 4.25], [0, 0, 1]])


def check_cameras(capture: Capture) -> None:
    """A point ahead of a camera, to its right and below: depth, then pixels, by the axes alone."""
    assert len(capture.views) == len(made.NAMES)
    for index, view in enumerate(capture.views):
        assert view.camera.size == (made.HEIGHT, made.WIDTH)
        assert view.camera.model == "pinhole"
        place, (right, down, forward) = made.stand(index)
        point = place + 3 * forward + 0.5 * right + 0.25 * down
        seen = view.camera.view[:3, :3] @ point + view.camera.view[:3, 3]
        np.testing.assert_allclose(seen, [0.5, 0.25, 3], atol=1e-12)
        np.testing.assert_allclose(view.camera.center, place, atol=1e-12)
        np.testing.assert_allclose(view.camera.K, K, atol=1e-12)


def check_points(capture: Capture, *, colors: bool = True) -> None:
    assert capture.points is not None and capture.points.dtype == np.float32
    np.testing.assert_array_equal(capture.points, made.POINTS.astype(np.float32))
    if not colors:
        assert capture.point_colors is None
        return
    assert capture.point_colors is not None and capture.point_colors.dtype == np.float32
    np.testing.assert_allclose(capture.point_colors, made.COLORS / 255, atol=1e-7)


def test_a_transforms_json_of_nerfstudio(tmp_path: Path) -> None:
    path = made.transforms(tmp_path)
    for given in (path, tmp_path, str(tmp_path)):
        capture = open_capture(given)
        check_cameras(capture)
        assert capture.path == path
        assert capture.points is None and capture.point_colors is None
        count = f"{len(made.NAMES)} photographs of {made.WIDTH} x {made.HEIGHT}"
        assert count in repr(capture) and str(path) in repr(capture)
        assert [view.name for view in capture.views] == [f"images/{name}" for name in made.NAMES]
        assert [view.image for view in capture.views] == [
            tmp_path / "images" / name for name in made.NAMES
        ]
        assert all(view.mask is None and view.lens is None for view in capture.views)


@pytest.mark.parametrize("name", ["transforms_train.json", "mine.JSON"])
def test_a_transforms_json_of_nerf(tmp_path: Path, name: str) -> None:
    """One angle for all, no size, no extensions: 100 of 120 pixels, so that nothing is square."""
    made.photographs(tmp_path / "train")
    angle = 2 * np.arctan(made.WIDTH / 2 / 20)
    frames = [
        {"file_path": f"./train/{image[:-4]}", "rotation": 0.1, "transform_matrix": made.opengl(i)}
        for i, image in enumerate(made.NAMES)
    ]
    (tmp_path / name).write_text(json.dumps({"camera_angle_x": angle, "frames": frames}))
    capture = open_capture(tmp_path if name.startswith("transforms") else tmp_path / name)
    assert [view.name for view in capture.views] == [f"train/{image}" for image in made.NAMES]
    assert capture.views[0].image == tmp_path / "train" / "a.png"
    for view in capture.views:
        np.testing.assert_allclose(view.camera.K, [[20, 0, 6], [0, 20, 4], [0, 0, 1]])


@pytest.mark.each
@pytest.mark.parametrize("folder", ["sparse/0", "sparse", "."])
@pytest.mark.parametrize("write", [made.colmap_binary, made.colmap_text])
def test_a_colmap_model(tmp_path: Path, folder: str, write: type) -> None:
    made.photographs(tmp_path / "images")
    model = write(tmp_path / folder)
    for given in (tmp_path, model):
        capture = open_capture(given)
        check_cameras(capture)
        check_points(capture)
        assert capture.path == model and capture.reprojection_error == 0.5
        assert [view.name for view in capture.views] == made.NAMES
        assert capture.views[2].image == tmp_path / "images" / "sub" / "c.png"


REWRITE = """
import pathlib, pycolmap
model = pycolmap.Reconstruction("{source}")
for form in ("text", "binary"):
    target = pathlib.Path("{target}", form, "sparse")
    target.mkdir(parents=True)
    (model.write_text if form == "text" else model.write_binary)(str(target))
"""


def test_a_colmap_model_as_colmap_writes_it(tmp_path: Path, python: Callable) -> None:
    """In a process of its own: pycolmap and OpenImageIO do not get on in one."""
    if find_spec("pycolmap") is None:
        pytest.skip("COLMAP's Python package is not installed")
    source = made.colmap_text(tmp_path / "sparse" / "0")
    points = (source / "points3D.txt").read_text().splitlines()
    # COLMAP follows the tracks, which lead nowhere here.
    (source / "points3D.txt").write_text("\n".join(" ".join(p.split()[:8]) for p in points))
    done = python(REWRITE.format(source=source.as_posix(), target=tmp_path.as_posix()))
    assert done.returncode == 0, done.stderr
    for form in ("text", "binary"):
        made.photographs(tmp_path / form / "images")
        capture = open_capture(tmp_path / form)
        check_cameras(capture)
        assert capture.points is not None and len(capture.points) == len(made.POINTS)


def test_binary_comes_before_text_and_transforms_before_both(tmp_path: Path) -> None:
    made.colmap_text(tmp_path, ("SIMPLE_PINHOLE", [3.0, 6.0, 4.0]))
    made.colmap_binary(tmp_path)
    made.photographs(tmp_path)
    check_cameras(open_capture(tmp_path))
    made.transforms(tmp_path)
    assert open_capture(tmp_path).path == tmp_path / "transforms.json"


def test_a_model_without_points_or_with_none(tmp_path: Path) -> None:
    made.photographs(tmp_path)
    made.colmap_binary(tmp_path)
    (tmp_path / "points3D.bin").write_bytes(bytes(8))
    assert open_capture(tmp_path).points is None
    (tmp_path / "points3D.bin").unlink()
    assert open_capture(tmp_path).point_colors is None


def test_a_name_with_a_blank_in_a_text_model(tmp_path: Path) -> None:
    made.colmap_text(tmp_path)
    lines = (tmp_path / "images.txt").read_text().replace("a.png", "a b.png")
    (tmp_path / "images.txt").write_text(lines)
    made.photographs(tmp_path, ["a b.png", *made.NAMES[1:]])
    assert open_capture(tmp_path).views[0].name == "a b.png"


@pytest.mark.parametrize("left_out", [(0,), (0, 1, 2), (1, 2)])
def test_lines_of_features_may_be_left_out(tmp_path: Path, left_out: tuple[int, ...]) -> None:
    """As many scripts do, of some images or of all; every image is there."""
    made.photographs(tmp_path)
    path = made.colmap_text(tmp_path) / "images.txt"
    head, *lines = path.read_text().split("\n\n", 1)
    lines = lines[0].split("\n")
    kept = [line for k, line in enumerate(lines) if k % 2 == 0 or k // 2 not in left_out]
    path.write_text("\n".join([head, *kept]))
    check_cameras(open_capture(tmp_path))


def test_names_of_several_words_that_end_in_a_number_in_a_text_model(tmp_path: Path) -> None:
    """Such a line has as many words as one of features may have, and ends as that does."""
    path = made.colmap_text(tmp_path) / "images.txt"
    text = path.read_text()
    for name, other in zip(made.NAMES, ("shot a 1", "shot a 2", "a b c d e 3"), strict=True):
        text = text.replace(name, other)
    kept = [line for k, line in enumerate(text.split("\n\n", 1)[1].split("\n")) if k % 2 == 0]
    path.write_text("\n".join(kept))
    views = open_capture(tmp_path, photographs=False).views
    assert [view.name for view in views] == ["a b c d e 3", "shot a 1", "shot a 2"]
    path.write_text(text)
    again = open_capture(tmp_path, photographs=False).views
    assert [view.name for view in again] == [view.name for view in views]


@pytest.mark.parametrize("written", [made.colmap_text, made.colmap_binary])
@pytest.mark.parametrize(
    ("model", "parameters"),
    [("SIMPLE_FISHEYE", [20.0, 6.5, 4.25]), ("FISHEYE", [20.0, 21.0, 6.5, 4.25])],
)
def test_fisheyes_without_coefficients_of_a_colmap_model(
    tmp_path: Path, written: Callable, model: str, parameters: list[float]
) -> None:
    view = open_capture(written(tmp_path, (model, parameters)), photographs=False).views[0]
    np.testing.assert_array_equal(view.camera.K[:2, 2], parameters[-2:])
    assert view.lens == Lens(model, (), view.camera.K)


def test_a_name_that_is_a_number_in_a_text_model(tmp_path: Path) -> None:
    path = made.colmap_text(tmp_path) / "images.txt"
    lines = [line for line in path.read_text().replace("a.png", "0001").split("\n") if line]
    path.write_text("\n".join(lines[1:2] * 2).replace("0001", "0002", 1))
    views = open_capture(tmp_path, photographs=False).views
    assert [view.name for view in views] == ["0001", "0002"]


@pytest.mark.parametrize("text", [True, False])
@pytest.mark.parametrize("colors", [True, False])
def test_points_of_a_transforms_json(tmp_path: Path, text: bool, colors: bool) -> None:
    made.transforms(tmp_path, ply_file_path="points.ply")
    made.point_cloud(tmp_path / "points.ply", text=text, colors=colors)
    check_points(open_capture(tmp_path), colors=colors)


def test_an_empty_face_list_does_not_matter(tmp_path: Path) -> None:
    made.transforms(tmp_path, ply_file_path="points.ply")
    path = made.point_cloud(tmp_path / "points.ply")
    faces = b"element face 0\nproperty list uchar int vertex_indices\nend_header"
    path.write_bytes(path.read_bytes().replace(b"end_header", faces))
    check_points(open_capture(tmp_path))


def test_a_frame_overrides_what_stands_for_all(tmp_path: Path) -> None:
    path = made.transforms(tmp_path)
    made.changed(path, 1, fl_x=33.0, cy=3.5, w=None)
    made.changed(path, 2, camera_angle_x=np.pi / 2, k1=0.125)
    first, second, third = open_capture(path).views
    np.testing.assert_array_equal(first.camera.K, K)
    np.testing.assert_array_equal(second.camera.K, [[33, 0, 6.5], [0, 33, 3.5], [0, 0, 1]])
    np.testing.assert_allclose(third.camera.K[0, 0], made.WIDTH / 2)
    assert first.lens is None and second.lens is None
    assert third.lens == Lens("OPENCV", (0.125, 0, 0, 0), third.camera.K)


@pytest.mark.parametrize(
    ("top", "frame", "wanted"),
    [
        ({"fl_x": 100, "fl_y": 110}, {}, (100, 110)),
        ({"fl_x": 100, "fl_y": 110}, {"fl_x": 170}, (170, 170)),
        ({"fl_x": 100, "fl_y": 110}, {"fl_x": 170, "fl_y": 171}, (170, 171)),
        ({"fl_x": 100, "fl_y": 110}, {"camera_angle_x": np.pi / 2}, (made.WIDTH / 2,) * 2),
        ({"camera_angle_y": np.pi / 2}, {}, (made.HEIGHT / 2,) * 2),
        ({"camera_angle_x": 0.8}, {"x_fov": 90}, (made.WIDTH / 2,) * 2),
        ({"x_fov": 90.0, "y_fov": 90.0}, {}, (made.WIDTH / 2, made.HEIGHT / 2)),
        ({"x_fov": 90, "fl_x": made.WIDTH / 2 + 0.01}, {}, (made.WIDTH / 2,) * 2),
    ],
)
def test_both_focal_lengths_are_those_of_the_frame_or_of_the_file(
    tmp_path: Path,
    top: dict[str, float],
    frame: dict[str, float],
    wanted: tuple[float, float],
) -> None:
    """A frame's own and the file's belong to two cameras; angles in degrees are instant-ngp's."""
    path = made.transforms(tmp_path, **{"fl_x": None, "fl_y": None, **top})
    camera = open_capture(made.changed(path, 0, **frame)).views[0].camera
    np.testing.assert_allclose(np.diag(camera.K)[:2], wanted, rtol=1e-12)


@pytest.mark.parametrize(
    ("fields", "model", "coefficients"),
    [
        ({"k1": 0.1, "p2": 0.2}, "OPENCV", (0.1, 0, 0, 0.2)),
        ({"k1": 0.1, "k3": 0.3, "k4": 0}, "FULL_OPENCV", (0.1, 0, 0, 0, 0.3, 0, 0, 0)),
        ({"camera_model": None, "k2": 0.1}, "OPENCV", (0, 0.1, 0, 0)),
        ({"camera_model": None, "is_fisheye": True, "k4": 0.1}, "OPENCV_FISHEYE", (0, 0, 0, 0.1)),
        ({"camera_model": "OPENCV_FISHEYE"}, "OPENCV_FISHEYE", (0, 0, 0, 0)),
        ({"camera_model": "SIMPLE_RADIAL", "k1": 0.1, "k2": 0.0}, "SIMPLE_RADIAL", (0.1,)),
        ({"camera_model": "PINHOLE", "k1": 0.0}, None, ()),
        ({"k1": 0.0, "k2": 0, "p1": None}, None, ()),
        ({"distortion_params": [0.1, 0.2, 0, 0, 0.3, 0.4]}, "OPENCV", (0.1, 0.2, 0.3, 0.4)),
        ({"distortion_params": [0.1, 0, 0, 0, 0, 0], "k1": 0.1}, "OPENCV", (0.1, 0, 0, 0)),
        (
            {"distortion_params": [0.1, 0.2, 0.3, 0, 0.4, 0.5]},
            "FULL_OPENCV",
            (0.1, 0.2, 0.4, 0.5, 0.3, 0, 0, 0),
        ),
        (
            {"camera_model": "OPENCV_FISHEYE", "distortion_params": [0.1, 0.2, 0.3, 0.4, 0, 0]},
            "OPENCV_FISHEYE",
            (0.1, 0.2, 0.3, 0.4),
        ),
        (
            {"camera_model": "OPENCV_FISHEYE", "distortion_params": [0.1, 0.2, 0.3, 0.4]},
            "OPENCV_FISHEYE",
            (0.1, 0.2, 0.3, 0.4),
        ),
        ({"distortion_params": [0.0] * 6}, None, ()),
        ({"latlong": False, "equirectangular": None, "ftheta_p0": None}, None, ()),
    ],
)
def test_lenses_of_a_transforms_json(
    tmp_path: Path, fields: dict[str, object], model: str | None, coefficients: tuple[float, ...]
) -> None:
    lens = open_capture(made.transforms(tmp_path, **fields)).views[0].lens
    assert lens == (None if model is None else Lens(model, coefficients, K))


def test_a_list_of_coefficients_in_a_frame_overrides_that_of_all(tmp_path: Path) -> None:
    path = made.transforms(tmp_path, k1=0.5, k2=0.25, distortion_params=[0.5, 0.25, 0, 0, 0, 0])
    made.changed(path, 1, distortion_params=[0.125, 0, 0, 0, 0, 0])
    first, second, _ = open_capture(path).views
    assert first.lens == Lens("OPENCV", (0.5, 0.25, 0, 0), K)
    assert second.lens == Lens("OPENCV", (0.125, 0, 0, 0), K)


def test_the_circle_of_a_fisheye_is_known_and_told(tmp_path: Path) -> None:
    path = made.transforms(tmp_path, camera_model="OPENCV_FISHEYE", fisheye_crop_radius=3.5)
    capture = open_capture(made.changed(path, 1, fisheye_crop_radius=3))
    assert [view.crop_radius for view in capture.views] == [3.5, 3, 3.5]
    assert any("'fisheye_crop_radius'" in note and "3.5 pixels" in note for note in capture.notes)


def test_the_circle_of_a_lens_that_is_no_fisheye_is_left_alone(tmp_path: Path) -> None:
    """As nerfstudio does, so that the field may stay once lenses were undone."""
    capture = open_capture(made.transforms(tmp_path, k1=0.1, fisheye_crop_radius=3.5))
    assert all(view.crop_radius is None for view in capture.views)
    assert not any("fisheye" in note for note in capture.notes)


@pytest.mark.parametrize("write", [made.colmap_binary, made.colmap_text])
@pytest.mark.parametrize(
    ("camera", "lens"),
    [
        (
            ("OPENCV", [*made.PINHOLE[1], 0.1, 0.2, 0.3, 0.4]),
            Lens("OPENCV", (0.1, 0.2, 0.3, 0.4), K),
        ),
        (("FOV", [*made.PINHOLE[1], 0.5]), Lens("FOV", (0.5,), K)),
        (("OPENCV", [*made.PINHOLE[1], 0, 0, 0, 0]), None),
        (("SIMPLE_PINHOLE", [20, 6.5, 4.25]), None),
    ],
)
def test_lenses_of_a_colmap_model(
    tmp_path: Path, write: type, camera: tuple[str, list[float]], lens: Lens | None
) -> None:
    made.photographs(tmp_path)
    write(tmp_path, camera)
    view = open_capture(tmp_path).views[0]
    assert view.lens == lens
    assert view.camera.K[0, 0] == 20 and view.camera.K[1, 1] == (20 if len(camera[1]) == 3 else 21)


def test_poses_with_few_digits_become_rotations(tmp_path: Path) -> None:
    path = made.transforms(tmp_path)
    exact = open_capture(path).views
    for index in range(3):
        made.changed(path, index, transform_matrix=np.round(made.opengl(index), 4).tolist())
    for view, true in zip(open_capture(path).views, exact, strict=True):
        rotation = view.camera.view[:3, :3]
        np.testing.assert_allclose(rotation @ rotation.T, np.eye(3), atol=1e-14)
        np.testing.assert_allclose(rotation, true.camera.view[:3, :3], atol=1e-4)
        np.testing.assert_allclose(view.camera.center, true.camera.center, atol=1e-4)


def test_poses_may_leave_out_their_last_row(tmp_path: Path) -> None:
    path = made.transforms(tmp_path)
    for index in range(3):
        made.changed(path, index, transform_matrix=made.opengl(index)[:3])
    check_cameras(open_capture(path))


def test_only_headers_are_read_and_only_where_the_size_is_missing(tmp_path: Path) -> None:
    path = made.transforms(tmp_path)
    image = tmp_path / "images" / "a.png"
    content = image.read_bytes()
    image.write_bytes(b"no picture")
    assert open_capture(path).views[0].camera.size == (made.HEIGHT, made.WIDTH)
    made.transforms(tmp_path, w=None, h=None)
    image.write_bytes(content[: content.index(b"IDAT") + 4])
    assert open_capture(path).views[0].camera.size == (made.HEIGHT, made.WIDTH)
