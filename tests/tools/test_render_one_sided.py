"""Captures from one side: the subject is in every picture, and no camera stands behind it."""

from __future__ import annotations

import itertools
import json

import numpy as np
import pytest

from rift_cl.errors import InputError
from rift_cl.io import open_capture, read_image


@pytest.fixture
def script(tool):
    return tool("render_one_sided")


def projected(camera, points):
    """Where points (P, 3) of the world land in pixels (P, 2), and their depths (P,)."""
    local = points @ camera.view[:3, :3].T + camera.view[:3, 3]
    fx, fy, cx, cy = camera.intrinsics
    return local[:, :2] / local[:, 2:] * [fx, fy] + [cx, cy], local[:, 2]


@pytest.mark.parametrize("scene", ["wall", "shelf"])
@pytest.mark.parametrize("seed", [0, 7])
def test_every_camera_has_the_subject_in_its_picture_and_stands_before_it(script, scene, seed):
    shots = script.shots_of(script.Settings(scene=scene, seed=seed))
    corners = np.array(list(itertools.product((-1, 1), repeat=3))) * script.SUBJECT[scene]
    assert len(shots) == 40
    for shot in shots:
        camera = shot.camera
        assert camera.center[1] < -1.5
        # Upright, to the few degrees that a hand is off.
        assert camera.view[0, 2] == pytest.approx(0, abs=0.08) and camera.view[1, 2] < -0.8
        places, depths = projected(camera, corners)
        assert (depths > 0).all()
        assert (places > 0).all() and (places < camera.size[::-1]).all()


def test_a_walk_goes_to_and_fro_and_is_one_of_its_seed(tool):
    walk = tool("one_sided.cameras").walk
    sideways = np.array([pose[0, 3] for pose in walk(30, 0, 4.0)])
    assert (np.diff(sideways[:10]) > 0).all() and (np.diff(sideways[10:20]) < 0).all()
    assert np.array_equal(walk(30, 0, 4.0), walk(30, 0, 4.0))
    assert not np.array_equal(walk(30, 0, 4.0), walk(30, 1, 4.0))


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"views": 2}, "--views is 2"),
        ({"points": 5}, "--points is 5"),
        ({"samples": 0}, "--samples is 0"),
        ({"seed": -1}, "--seed is -1"),
        ({"size": (0, 4)}, "--size is"),
        ({"distance": 1.0}, "--distance is 1"),
        ({"field": float("nan")}, "--field is nan"),
    ],
)
def test_settings_that_make_no_sense_are_named(script, changes, words):
    with pytest.raises(InputError, match=words):
        script.shots_of(script.Settings(**changes))


@pytest.mark.parametrize("format", ["png", "jpg"])
def test_the_package_reads_the_cameras_and_points_back(script, tmp_path, format):
    settings = script.Settings(views=4, size=(32, 24), points=8, format=format)
    shots = script.shots_of(settings)
    record = script.record_of(settings, shots, "a painter")
    draw = lambda number: np.full((24, 32, 3), number / 4)  # noqa: E731
    list(script.render_capture(tmp_path, record, draw))
    script.write_points(tmp_path, record, 2, lambda number: np.full((24, 32, 3), float(number)))
    capture = open_capture(tmp_path)
    assert [view.camera for view in capture.views] == [shot.camera for shot in shots]
    assert {view.image.suffix for view in capture.views} == {f".{format}"}
    np.testing.assert_array_equal(capture.points[:, 0], [0, 0, 1, 1, 2, 2, 3, 3])
    np.testing.assert_allclose(capture.point_colors[:, 1], capture.points[:, 0] / 4, atol=0.01)
    assert json.loads((tmp_path / "transforms.json").read_text())["scene"] == "wall"
    assert read_image(tmp_path / "images" / f"0003.{format}").shape == (24, 32, 3)


@pytest.mark.parametrize("scene", ["wall", "shelf"])
def test_what_a_pixel_shows_lies_on_its_ray_and_the_wall_fills_the_picture(script, tool, scene):
    pytest.importorskip("mitsuba")
    tracer = tool("ornament.tracer").Tracer(
        "scalar_rgb", seed=0, samples=3, scenes=script.SCENES[scene]
    )
    shots = script.shots_of(script.Settings(scene=scene, size=(32, 24)))
    y, x = np.indices((24, 32)) + 0.5
    for shot in (shots[0], shots[20]):
        np.testing.assert_allclose(tracer.light(shot, 0)[..., 3], 1, atol=1e-6)
        places = tracer.places(shot, 0).reshape(-1, 3)
        landed, depths = projected(shot.camera, places)
        assert np.abs(landed - np.column_stack([x.ravel(), y.ravel()])).max() < 0.51
        assert depths.min() > 0.5
        behind = tool("one_sided.scene").BEHIND[scene]
        assert places[:, 1].max() <= behind + 1e-3
        # Something stands before the wall, in the middle of the picture.
        assert places.reshape(24, 32, 3)[8:16, 10:22, 1].min() < behind - 0.3
