"""Cameras that are written are read back, and views may come without their photographs."""

from __future__ import annotations

import json
import shutil

import capture_files as made
import numpy as np
import pytest
from test_start import ring

from rift_cl.errors import FileFormatError, InputError, PathEscapeError
from rift_cl.geometry import Camera
from rift_cl.geometry.aperture import Aperture
from rift_cl.geometry.lens_distortion import Lens
from rift_cl.io import open_capture, write_json
from rift_cl.io.captures.transforms_record import lens_fields, transforms_of

NAMES = ["0.png", "deep/1.png", "2"]


def written(folder, cameras, fields=()):
    record = transforms_of(cameras, NAMES[: len(cameras)], fields)
    write_json(folder / "transforms.json", record)
    return json.loads((folder / "transforms.json").read_text())


def test_cameras_that_are_written_are_read_back(tmp_path):
    cameras = [
        Camera((6 + k, 8), camera.K + np.diag([k, 2 * k, 0]), camera.view)
        for k, camera in enumerate(ring(3))
    ]
    record = written(tmp_path, cameras)
    assert record["camera_model"] == "PINHOLE" and "NaN" not in json.dumps(record)
    views = open_capture(tmp_path, photographs=False).views
    assert [view.name for view in views] == NAMES
    for view, camera in zip(views, cameras, strict=True):
        assert view.camera.size == camera.size and view.lens is None
        np.testing.assert_allclose(view.camera.K, camera.K)
        np.testing.assert_allclose(view.camera.view, camera.view, atol=1e-12)


def test_what_is_known_of_the_lens_is_in_the_file(tmp_path):
    camera = ring(1)[0]
    lens = Aperture(0.1, 4.5, 5e-4)
    with_lens = Camera(camera.size, camera.K, camera.view, aperture=lens)
    far = Camera(camera.size, camera.K, camera.view, aperture=Aperture(0.1, np.inf))
    record = written(tmp_path, [with_lens, far, camera], [{"exposure": 2.0}, {}, {}])
    sharp, far_off, pinhole = record["frames"]
    assert (sharp["aperture_radius"], sharp["focus_distance"]) == (0.1, 4.5)
    assert (sharp["wavelength"], sharp["exposure"]) == (5e-4, 2.0)
    assert far_off["aperture_radius"] == 0.1 and "focus_distance" not in far_off
    assert not {"aperture_radius", "focus_distance", "wavelength"} & set(pinhole)
    views = open_capture(tmp_path, photographs=False).views
    assert [v.camera.aperture for v in views] == [lens, Aperture(0.1, np.inf), None]


FISHEYE = Lens("OPENCV_FISHEYE", (0.1, 0, 0, 0), np.eye(3))
RADIAL = Lens("RADIAL", (0.1, 0.02), np.eye(3))


@pytest.mark.parametrize(
    ("lenses", "top"),
    [
        ([FISHEYE, FISHEYE], "OPENCV_FISHEYE"),
        ([RADIAL, None], "OPENCV"),
        ([None, FISHEYE], None),
    ],
)
def test_the_top_of_the_file_names_the_model_of_all_frames(tmp_path, lenses, top):
    record = written(tmp_path, ring(2), [lens_fields(lens) for lens in lenses])
    assert record.get("camera_model") == top
    found = [view.lens for view in open_capture(tmp_path, photographs=False).views]
    assert [lens and lens.model for lens in found] == [lens and lens.model for lens in lenses]


def test_photographs_have_to_be_there_unless_the_caller_can_do_without(tmp_path):
    written(tmp_path, ring(2))
    with pytest.raises(InputError, match=r"0\.png"):
        open_capture(tmp_path)
    assert [view.image for view in open_capture(tmp_path, photographs=False).views] == [
        tmp_path / name for name in NAMES[:2]
    ]
    made.transforms(tmp_path)
    whole = open_capture(tmp_path, photographs=False)
    assert all(view.image.is_file() for view in whole.views)


def test_a_colmap_model_can_do_without_photographs_too(tmp_path):
    made.photographs(tmp_path / "images")
    made.colmap_text(tmp_path)
    expected = open_capture(tmp_path)
    shutil.rmtree(tmp_path / "images")
    with pytest.raises(InputError):
        open_capture(tmp_path)
    found = open_capture(tmp_path, photographs=False)
    assert [v.name for v in found.views] == [v.name for v in expected.views]
    assert [v.camera for v in found.views] == [v.camera for v in expected.views]


def test_a_view_whose_size_nobody_knows_is_refused(tmp_path):
    record = written(tmp_path, ring(1))
    del record["frames"][0]["w"]
    write_json(tmp_path / "transforms.json", record)
    with pytest.raises(InputError, match=r"'w'.*0\.png"):
        open_capture(tmp_path, photographs=False)


@pytest.mark.parametrize("name", ["../outside.png", "/etc/outside.png", "C:\\outside.png", ""])
def test_no_name_leads_out_of_the_folder_though_nothing_is_there(tmp_path, name):
    record = written(tmp_path, ring(1))
    record["frames"][0]["file_path"] = name
    write_json(tmp_path / "transforms.json", record)
    with pytest.raises(PathEscapeError):
        open_capture(tmp_path, photographs=False)


def test_two_views_still_need_two_names(tmp_path):
    record = written(tmp_path, ring(2))
    record["frames"][1]["file_path"] = "0.png"
    write_json(tmp_path / "transforms.json", record)
    with pytest.raises(FileFormatError, match="same image"):
        open_capture(tmp_path, photographs=False)


@pytest.mark.parametrize("model", ["ortho", "fisheye"])
def test_a_camera_that_the_file_has_no_words_for_is_not_written_as_a_pinhole(model):
    camera = ring(1)[0]
    other = Camera(camera.size, camera.K, camera.view, model)
    with pytest.raises(InputError, match=rf"'0\.png'.*'{model}'"):
        transforms_of([other], NAMES[:1])
