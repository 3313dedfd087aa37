"""A scene of splats in memory and on a device: what it demands, and what comes back."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
import splat_files as made
from plyfile import PlyData
from splat_files import sigmoid

import rift_cl as rift
from rift_cl.errors import DTypeError, InputError, NonFiniteError, ShapeError
from rift_cl.io.scenes.splat_scene import XrayScene
from rift_cl.splat.splats import Splats


def test_upload_applies_the_activations(device) -> None:
    scene = made.scene(50, 2)
    splats = scene.upload(device)
    np.testing.assert_allclose(device.get(splats.scales), np.exp(scene.log_scales), rtol=1e-6)
    np.testing.assert_allclose(
        device.get(splats.opacities), sigmoid(scene.logit_opacities), rtol=1e-6
    )
    for name in ("means", "quats", "sh"):
        np.testing.assert_array_equal(device.get(getattr(splats, name)), getattr(scene, name))


def test_a_scene_comes_back_from_a_device(device) -> None:
    scene = made.scene(50, 1)
    found = rift.SplatScene.of(scene.upload(device), device)
    for name in ("means", "quats", "sh"):
        np.testing.assert_array_equal(getattr(found, name), getattr(scene, name))
    np.testing.assert_allclose(found.log_scales, scene.log_scales, rtol=0, atol=1e-6)
    # Near an opacity of 1 a step of float32 is a large step of the logit.
    room = 1e-6 + 6e-8 / (1 - sigmoid(scene.logit_opacities))
    assert (np.abs(found.logit_opacities - scene.logit_opacities) <= room).all()


def parts(**changes: object) -> dict[str, object]:
    count = 2
    return {
        "means": np.zeros((count, 3)),
        "quats": np.ones((count, 4)),
        "scales": np.ones((count, 3)),
        "opacities": np.full(count, 0.5),
        "sh": np.zeros((count, 1, 3)),
    } | changes


def test_zeros_and_ones_come_back_finite(device) -> None:
    uploaded = Splats.upload(device, **parts(opacities=[0, 1], scales=[[0, 1, np.inf]] * 2))
    scene = rift.SplatScene.of(uploaded, device)
    again = scene.upload(device)
    np.testing.assert_allclose(device.get(again.opacities), [0, 1], rtol=0, atol=6e-8)
    np.testing.assert_allclose(device.get(again.scales)[0], [1.2e-38, 1, 3.4e38], rtol=0.03)


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"opacities": [0.5, 1.5]}, "opacities hold 1 values outside 0 to 1"),
        ({"sh": None, "colors": np.ones((2, 3))}, "wants splats with"),
        ({"colors": np.ones((2, 5))}, "no colors"),
        ({"quats": None, "scales": None, "covars": np.ones((2, 6))}, "with quats"),
        ({"opacities": [0.5, np.nan]}, "logit_opacities holds NaN"),
        ({"means": np.full((2, 3), np.inf)}, "means holds NaN or infinity in 6"),
    ],
)
def test_what_no_file_can_hold_does_not_come_back(device, changes, words) -> None:
    splats = Splats.upload(device, **parts(**changes))
    with pytest.raises(InputError, match=words):
        rift.SplatScene.of(splats, device)


def test_scales_below_zero_do_not_come_back(device) -> None:
    below = device.array(-np.ones((2, 3), np.float32))
    splats = dataclasses.replace(Splats.upload(device, **parts()), scales=below)
    with pytest.raises(InputError, match="scales hold 6 values"):
        rift.SplatScene.of(splats, device)


@pytest.mark.parametrize(
    ("changes", "kind", "words"),
    [
        ({"means": np.zeros((7, 2))}, ShapeError, r"means has shape \(7, 2\)"),
        ({"means": 1.0}, ShapeError, r"means has shape \(\)"),
        ({"quats": np.zeros((6, 4))}, ShapeError, r"quats has shape"),
        ({"log_scales": np.zeros(7)}, ShapeError, "log_scales has shape"),
        ({"logit_opacities": np.zeros((7, 1))}, ShapeError, "logit_opacities has shape"),
        ({"sh": np.zeros((7, 5, 3))}, ShapeError, "K = 1, 4, 9, 16 or 25"),
        ({"sh": np.zeros((7, 3))}, ShapeError, "sh has shape"),
        ({"sh": np.zeros((7, 4, 3), complex)}, DTypeError, "sh has type complex"),
        ({"quats": np.full((7, 4), np.nan)}, NonFiniteError, "quats holds NaN .* 28 places"),
        ({"means": np.full((7, 3), 1e39)}, NonFiniteError, "means holds"),
    ],
)
def test_arrays_that_make_no_scene(changes, kind, words) -> None:
    with pytest.raises(kind, match=words):
        rift.SplatScene(**(vars(made.scene()) | changes))


def test_arrays_are_brought_into_one_form_and_not_copied_without_need() -> None:
    scene = made.scene()
    again = rift.SplatScene(**vars(scene))
    assert again.sh is scene.sh
    turned = {name: np.asfortranarray(getattr(scene, name), ">f8") for name in made.ARRAYS}
    made.assert_same(rift.SplatScene(**turned), scene)
    with pytest.raises(AttributeError):
        scene.means = again.means  # type: ignore[misc]


def test_a_scene_of_x_rays_keeps_its_densities_and_its_kind(tmp_path, device) -> None:
    plain = made.scene(20, 0)
    scene = XrayScene(**vars(plain))
    scene.save(tmp_path / "scene.ply")
    found = rift.SplatScene.load(tmp_path / "scene.ply")
    assert found.mode == "xray" and plain.mode == "light"
    made.assert_same(found, scene)
    splats = found.upload(device)
    np.testing.assert_allclose(
        device.get(splats.opacities), np.exp(scene.logit_opacities), rtol=1e-5
    )
    again = XrayScene.of(splats, device)
    np.testing.assert_allclose(again.logit_opacities, scene.logit_opacities, atol=1e-5)


def test_no_viewer_takes_densities_for_opacities(tmp_path) -> None:
    scene = XrayScene(**vars(made.scene(3, 0)))
    scene.save(tmp_path / "scene.ply")
    names = [p.name for p in PlyData.read(str(tmp_path / "scene.ply"))["vertex"].properties]
    assert "log_density" in names and "opacity" not in names
    assert b"comment X-ray splats" in (tmp_path / "scene.ply").read_bytes()
    with pytest.raises(InputError, match=r"save a \.ply"):
        scene.save(tmp_path / "scene.splat")
