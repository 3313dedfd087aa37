"""Parameters and settings of splats: what passes, and errors that name what does not."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
from projection_scenes import Kind, camera_of, plain, random_splats, shaped, upload

import rift_cl as rift
from rift_cl.errors import DTypeError, InputError, ResourceLimitError, ShapeError
from rift_cl.splat.projection import project
from rift_cl.splat.settings import SplatSettings
from rift_cl.splat.splats import Splats

pytestmark = pytest.mark.dealt


def test_camera_and_settings_must_agree(device):
    splats = upload(device, plain(), Kind())
    with pytest.raises(InputError, match="fisheye"):
        project(device, splats, camera_of("fisheye"), SplatSettings(mode="xray"))
    with pytest.raises(InputError, match=r"near is -1.*positive"):
        project(device, splats, camera_of("pinhole"), SplatSettings(near=-1))
    project(device, splats, camera_of("ortho"), SplatSettings(near=-1e6))


def test_splats_beyond_the_budget_are_refused_before_any_is_sent(device):
    values = random_splats(20_000)
    need = 4 * sum(array.size for array in values.values())
    small = rift.Device(device._handle, device.selector, traits=device.traits, memory=need - 1)
    with pytest.raises(ResourceLimitError, match=r"scene of 20000 splats needs .*budget"):
        Splats.upload(small, **values)
    assert small.taken == 0
    roomy = rift.Device(device._handle, device.selector, traits=device.traits, memory=need)
    assert len(Splats.upload(roomy, **values)) == 20_000


def test_logarithms_of_scales_are_refused(device):
    values = random_splats(5)
    with pytest.raises(InputError, match=r"scales go down to -2\.3.*exp"):
        Splats.upload(device, **values | {"scales": np.full((5, 3), np.log(0.1))})
    one = values["scales"].copy()
    one[:2, 1] = np.nan, -1
    with pytest.raises(InputError, match=r"scales go down to -1"):
        Splats.upload(device, **values | {"scales": one})
    one[1] = 0
    assert len(Splats.upload(device, **values | {"scales": one})) == 5


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"near": 2.0, "far": 1.0}, "near is 2.0"),
        ({"far": np.inf}, "far is inf"),
        ({"near": "close"}, "near is 'close'"),
        ({"far": 1e39}, r"far is 1e\+39"),
        ({"eps2d": 1e39}, r"eps2d is 1e\+39"),
        ({"eps2d": -0.1}, "eps2d is -0.1"),
        ({"radius_clip": np.nan}, "radius_clip is nan"),
        ({"tile": 0}, "tile is 0"),
        ({"tile": 8.5}, "tile is 8.5"),
        ({"alpha_cap": 1.0}, "alpha_cap is 1.0"),
        ({"mode": "dark"}, "mode is 'dark'"),
        ({"mode": "xray", "antialiased": True}, "antialiased"),
    ],
)
def test_settings_out_of_range_are_named(changes, words):
    with pytest.raises(InputError, match=words):
        SplatSettings(**changes)


@pytest.mark.parametrize(
    ("changes", "error", "words"),
    [
        ({"means": np.zeros((4, 2))}, ShapeError, r"means has shape \(4, 2\)"),
        ({"means": 0.0}, ShapeError, "means"),
        ({"quats": np.zeros((5, 4))}, ShapeError, r"quats has shape \(5, 4\)"),
        ({"scales": np.zeros(4)}, ShapeError, "scales"),
        ({"opacities": np.zeros((4, 1))}, ShapeError, r"opacities.*wanted \(4,\)"),
        ({"colors": np.zeros((4, 0))}, ShapeError, "colors"),
        ({"sh": np.zeros((4, 5, 3))}, ShapeError, "sh has shape.*K = 1, 4, 9, 16 or 25"),
        ({"covars": np.zeros((4, 6))}, InputError, "either quats and scales, or covars"),
        ({"scales": None}, InputError, "either quats and scales"),
        ({"means": [["a", "b", "c"]] * 4}, DTypeError, "means"),
    ],
)
def test_splats_that_do_not_fit_are_named(device, changes, error, words):
    with pytest.raises(error, match=words):
        Splats.upload(device, **(random_splats(4) | changes))


def test_lopsided_covariances_are_named(device):
    covars = np.tile(np.eye(3), (4, 1, 1))
    covars[2, 0, 1] = 0.5
    with pytest.raises(InputError, match=r"covars\[2\]"):
        Splats.upload(device, means=np.zeros((4, 3)), opacities=np.ones(4), covars=covars)


def test_upload_takes_any_order_and_type(device):
    values = random_splats(6)
    odd = {name: np.asfortranarray(value.astype(">f8")) for name, value in values.items()}
    splats = Splats.upload(device, **odd)
    assert len(splats) == 6
    for name, value in values.items():
        np.testing.assert_array_equal(device.get(getattr(splats, name)), value)


def test_device_arrays_of_another_type_are_refused(device):
    splats = Splats.upload(device, **random_splats(4))
    with pytest.raises(DTypeError, match="opacities has type int32"):
        dataclasses.replace(splats, opacities=device.array(np.ones(4, np.int32)))


def test_covariances_may_be_whole_matrices(device):
    kind = Kind(covars=True)
    values = shaped(random_splats(20), kind)
    full = np.empty((20, 3, 3), np.float32)
    rows, columns = np.triu_indices(3)
    full[:, rows, columns] = full[:, columns, rows] = values["covars"]
    splats = [Splats.upload(device, **(values | {"covars": c})) for c in (values["covars"], full)]
    screens = [device.get(project(device, s, kind.camera, kind.settings).screen) for s in splats]
    assert screens[0].tobytes() == screens[1].tobytes()


def test_views_into_device_arrays_are_refused(device):
    splats = Splats.upload(device, **random_splats(4))
    view = device.array(random_splats(6)["means"])[2:]
    with pytest.raises(ShapeError, match="means is a view"):
        project(device, dataclasses.replace(splats, means=view), Kind().camera, SplatSettings())
