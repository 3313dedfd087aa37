"""napari is given volumes with their places, and splats as points; its manifest is right."""

from __future__ import annotations

import sys
from pathlib import Path

import h5py
import numpy as np
import pytest
import yaml

import rift_cl.io
from rift_cl.errors import RiftError
from rift_cl.io import SplatScene
from rift_cl.io.napari_reader import reader_of
from rift_cl.io.scenes.splat_scene import XrayScene
from rift_cl.io.volumes import open_volume

MANIFEST = Path(rift_cl.io.__file__).parent / "napari.yaml"


def layer(path):
    read = reader_of(str(path))
    (only,) = read(str(path))
    return only


@pytest.mark.parametrize(("format", "name"), [("zarr", "head.zarr"), ("h5", "head.h5")])
def test_a_volume_is_an_image_in_its_place(tmp_path, format, name):
    volume = np.random.default_rng(0).random((3, 5, 7), np.float32)
    options = {"spacing": (0.5, 0.2, 0.1), "origin": (1, 2, 3), "unit": "mm"}
    with open_volume(tmp_path / name, volume.shape, format=format, **options) as out:
        out.write(0, volume)
    values, about, kind = layer(tmp_path / name)
    assert kind == "image"
    assert np.array_equal(values, volume)
    assert about["scale"] == (0.5, 0.2, 0.1)
    assert about["translate"] == (1, 2, 3)
    assert about["contrast_limits"][0] <= volume.min() < volume.max() <= about["contrast_limits"][1]


def test_a_volume_without_a_place_has_spacing_1(tmp_path):
    with open_volume(tmp_path / "a.mrc", (2, 3, 4), format="mrc", spacing=0.5) as out:
        out.write(0, np.ones((2, 3, 4)))
    assert layer(tmp_path / "a.mrc")[1]["scale"] == (1, 1, 1)


def scene(kind=SplatScene, count=4):
    random = np.random.default_rng(1)
    return kind(
        means=random.random((count, 3)),
        log_scales=np.log(np.full((count, 3), 0.25)),
        quats=random.standard_normal((count, 4)),
        logit_opacities=np.arange(count),
        sh=np.zeros((count, 1, 3)),
    )


@pytest.mark.parametrize("kind", [SplatScene, XrayScene])
def test_splats_are_points_in_their_colours(tmp_path, kind):
    scene(kind).save(tmp_path / "scene.ply")
    points, about, layer_kind = layer(tmp_path / "scene.ply")
    assert layer_kind == "points"
    assert np.array_equal(points, scene().means[:, ::-1])
    assert np.allclose(about["size"], 0.5)
    assert np.allclose(about["face_color"][:, :3], 0.5)
    opaque = np.ones(4) if kind is XrayScene else 1 / (1 + np.exp(-np.arange(4.0)))
    assert np.allclose(about["face_color"][:, 3], opaque)


def test_of_many_splats_those_seen_most_are_shown(tmp_path, monkeypatch):
    monkeypatch.setattr("rift_cl.io.napari_reader._MOST_POINTS", 2)
    scene().save(tmp_path / "scene.ply")
    points, about, _ = layer(tmp_path / "scene.ply")
    assert np.array_equal(points, scene().means[2:, ::-1])
    assert about["name"] == "scene, 2 splats"


def test_other_files_are_left_to_others(tmp_path):
    assert reader_of("photo.jpg") is None
    assert reader_of(["a.h5", "b.h5"]) is None


def test_a_file_that_is_not_there_is_named(tmp_path):
    with pytest.raises(RiftError, match=r"none\.zarr"):
        layer(tmp_path / "none.zarr")


def test_a_scan_is_no_volume_and_what_is_advised_can_be_done(tmp_path):
    with h5py.File(tmp_path / "scan.h5", "w") as file:
        file["exchange/data"] = np.zeros((4, 1, 8), np.float32)
    with pytest.raises(RiftError, match=r"scan\.h5: has no dataset '/volume'.*reconstruct") as told:
        layer(tmp_path / "scan.h5")
    # Whoever opens a file in napari has no options.
    assert "dataset=" not in str(told.value)


def test_the_manifest_names_what_there_is():
    manifest = yaml.safe_load(MANIFEST.read_text())
    (command,) = manifest["contributions"]["commands"]
    module, _, name = command["python_name"].partition(":")
    assert getattr(sys.modules[module], name) is reader_of
    (reader,) = manifest["contributions"]["readers"]
    assert all(reader_of(f"a{pattern[1:]}") for pattern in reader["filename_patterns"])
    assert reader["command"] == command["id"]


@pytest.mark.filterwarnings("ignore")
def test_npe2_takes_the_manifest():
    npe2 = pytest.importorskip("npe2", reason="npe2 is not installed")
    manifest = npe2.PluginManifest.from_file(MANIFEST)
    manifest.validate_imports()
    assert manifest.contributions.readers[0].command == "rift-cl.read"
