"""Cameras that can be bought, from a file: what is read, and what a file may not say."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest

from rift_cl.errors import RiftError
from rift_cl.io.captures.camera_file import read_cameras
from rift_cl.sample.stock_lenses import stock_lens

CAMERA = {"name": "a", "focal_length": 50, "f_number": 8, "pixel_um": 5, "size": [60, 40]}
BEHIND = {"name": "b", "lens": "triplet.json", "pixel_um": 5, "size": [60, 40]}


def save(folder: Path, content: Any) -> Path:
    (folder / "triplet.json").write_bytes(stock_lens("cooke_triplet").read_bytes())
    path = folder / "cameras.json"
    path.write_text(json.dumps(content))
    return path


def test_units_are_those_of_data_sheets(tmp_path: Path) -> None:
    given = {**CAMERA, "wavelength_nm": 600, "cost": 2, "ranges": {"f_number": [4, 22]}}
    plain, lens = read_cameras(save(tmp_path, {"cameras": [given, BEHIND]}))
    assert plain.kind.pixel == pytest.approx(5e-3) and plain.kind.size == (40, 60)
    assert plain.kind.wavelength == pytest.approx(600e-6)
    assert (plain.cost, plain.ranges) == (2.0, {"f_number": (4.0, 22.0)})
    assert lens.kind.focal_length == pytest.approx(49.999783) and lens.kind.name == "b"


def test_a_lens_lies_beside_the_file_whatever_path_leads_there(tmp_path: Path) -> None:
    (tmp_path / "deep" / "er").mkdir(parents=True)
    path = save(tmp_path / "deep", BEHIND)
    (tmp_path / "link").symlink_to(tmp_path / "deep" / "er")
    around = tmp_path / "link" / ".." / path.name
    assert read_cameras(around) == read_cameras(path)


def test_whole_numbers_of_more_than_64_bits_are_numbers(tmp_path: Path) -> None:
    (read,) = read_cameras(save(tmp_path, {**CAMERA, "exposure": 10**30}))
    assert read.kind.exposure == 1e30


@pytest.mark.parametrize(
    ("change", "word"),
    [
        ({"pixel_um": None}, "no 'pixel_um'"),
        ({"focal_length": None}, "no 'focal_length'"),
        ({"size": [10**400, 4]}, "size"),
        ({"size": "60x40"}, "'size' is '60x40'"),
        ({"cost": -1}, "'cost' is -1"),
        ({"focal_length": -(2**64)}, "focal"),
        ({"ranges": {"f_number": "ab"}}, "wanted two numbers"),
        ({"lens": "triplet.json"}, "comes with a 'lens'"),
        ({**dict.fromkeys(CAMERA), **BEHIND, "lens": "none.json"}, r"'none.json'"),
        ({**dict.fromkeys(CAMERA), **BEHIND, "lens": "../x.json"}, "outside the folder"),
    ],
)
def test_what_a_camera_may_not_be_is_said_with_its_place_once(
    tmp_path: Path, change: dict[str, Any], word: str
) -> None:
    path = save(tmp_path, {"cameras": [CAMERA, {**CAMERA, **change}]})
    with pytest.raises(RiftError, match=word) as caught:
        read_cameras(path)
    assert str(caught.value).startswith(f"{path}: cameras[1]")
    assert str(caught.value).count("cameras[1]") == 1


def test_fields_beside_the_list_are_not_passed_over(tmp_path: Path) -> None:
    path = save(tmp_path, {"cameras": [CAMERA], "ranges": {"f_number": [4, 22]}})
    with pytest.raises(RiftError, match=r"'ranges'.*'cameras'"):
        read_cameras(path)
