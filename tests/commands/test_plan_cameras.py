"""Cameras for ``rift plan``: files that are read, and cameras that are none."""

from __future__ import annotations

import json

import pytest

from rift_cl.commands.cli import main
from rift_cl.commands.plan.input import plan_input
from rift_cl.commands.plan.settings import PlanSettings
from rift_cl.io.captures.camera_file import read_cameras

CAMERA = {
    "name": "mine",
    "focal_length": 16,
    "f_number": 8,
    "pixel_um": 5,
    "size": [1200, 800],
}


def plan(out, *more):
    return main(["plan", "--out", str(out), "--quiet", *map(str, more)])


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"focal_length": 0}, "focal_length is 0"),
        ({"focal_length": -50}, "focal_length is -50"),
        ({"f_number": 0}, "f_number is 0"),
        ({"f_number": -8}, "f_number is -8"),
        ({"pixel_um": 0}, "pixel is 0"),
        ({"size": [0, 100]}, "100"),
        ({"size": [100.5, 100]}, "'size'"),
        ({"size": 7}, "'size'"),
        ({"focal_length": None}, "no 'focal_length'"),
        ({"focal_length": "long"}, "'focal_length' is 'long'"),
        ({"aperture": 3}, "'aperture' is no field"),
        ({"cost": -1}, "'cost' is -1"),
        ({"ranges": {"zoom": [1, 2]}}, "'ranges'"),
        ({"ranges": {"f_number": [4]}}, "'f_number'"),
        ({"ranges": {"f_number": [16, 4]}}, "f_number"),
        ({"lens": "x.json"}, "'focal_length' comes with a 'lens'"),
    ],
)
def test_a_camera_that_is_none_is_named(tmp_path, capsys, change, words):
    path = tmp_path / "bad.json"
    path.write_text(json.dumps({**CAMERA, **change}))
    assert plan(tmp_path / "out", "--views", 2, "--camera", path) == 3
    error = capsys.readouterr().err
    assert words in error and "Traceback" not in error
    assert not (tmp_path / "out").exists()


def test_a_lens_stands_for_focal_length_and_opening(tmp_path):
    lens = {
        "name": "singlet",
        "unit": "mm",
        "entrance_pupil_diameter": 5,
        "surfaces": [
            {"radius": 50, "thickness": 3, "glass": {"index": 1.5}, "stop": True},
            {"radius": -50, "thickness": 48},
        ],
    }
    (tmp_path / "singlet.json").write_text(json.dumps(lens))
    body = {key: CAMERA[key] for key in ("name", "pixel_um", "size")}
    (tmp_path / "body.json").write_text(json.dumps({**body, "lens": "singlet.json"}))
    [choice] = read_cameras(tmp_path / "body.json")
    # 1 / f = (n - 1) (1 / R1 - 1 / R2 + (n - 1) d / (n R1 R2)).
    focal = 1 / (0.5 * (1 / 50 + 1 / 50 - 0.5 * 3 / (1.5 * 50 * 50)))
    assert choice.kind.focal_length == pytest.approx(focal)
    assert choice.kind.f_number == pytest.approx(focal / 5)
    given = plan_input(PlanSettings(lens=tmp_path / "singlet.json"))
    assert given.types[0].focal_length == pytest.approx(focal)
    assert given.types[0].wavelength == 550e-6
