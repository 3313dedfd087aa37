"""Splats that are not drawn, and why: one code for each reason, whatever the numbers hold."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp
from projection_scenes import KINDS, Kind, arrays_of, camera_of, changed, plain, projected_on, sent

from rift_cl.splat.projection import project
from rift_cl.splat.settings import SplatSettings
from rift_cl.splat.splats import Splats

pytestmark = pytest.mark.dealt

CULLS = {
    "visible": (plain(), 0),
    "nearly transparent": (plain(opacities=[1.001 / 255]), 0),
    "too transparent": (plain(opacities=[0.999 / 255]), 3),
    "opacity zero": (plain(opacities=[0]), 3),
    "opacity below zero": (plain(opacities=[-1]), 3),
    "opacity above one": (plain(opacities=[7]), 0),
    "opacity not a number": (plain(opacities=[np.nan]), 2),
    "opacity infinite": (plain(opacities=[np.inf]), 2),
    "mean not a number": (plain(means=[[0, np.nan, 0]]), 2),
    "mean infinite": (plain(means=[[0, 0, -np.inf]]), 2),
    "mean enormous": (plain(means=[[3e38, 3e38, 3e38]]), 2),
    "quaternion zero": (plain(quats=[[0, 0, 0, 0]]), 2),
    "quaternion tiny": (plain(quats=[[1e-25, 0, 0, 2e-25]]), 0),
    "quaternion huge": (plain(quats=[[2e38, 0, -2e38, 0]]), 0),
    "quaternion not a number": (plain(quats=[[1, 0, 0, np.nan]]), 2),
    "scale zero": (plain(scales=[[0.1, 0, 0.1]]), 2),
    "scale negative": (plain(scales=[[0.1, 0.1, -0.1]]), 2),
    "scale infinite": (plain(scales=[[np.inf, 0.1, 0.1]]), 2),
    "scale tiny": (plain(scales=[[1e-30, 1e-30, 1e-30]]), 0),
    "scale too large to tell": (plain(scales=[[1e30, 1e30, 1e30]]), 2),
    "scale larger than any screen": (plain(scales=[[1e7, 1e6, 1e6]]), 0),
}


@pytest.mark.parametrize("case", CULLS)
def test_cull_codes(device, case):
    values, code = CULLS[case]
    assert projected_on(device, values, Kind())["culled"].tolist() == [code]


def test_line_integral_that_overflows_is_culled(device):
    values = plain(opacities=[3e38], scales=[[9, 9, 9]])
    assert projected_on(device, values, changed(mode="xray"))["culled"].tolist() == [2]


def test_cull_codes_that_hang_on_the_camera(device):
    camera = camera_of("pinhole")
    # Points of the camera's frame: behind, before the near plane, beyond the far one, beside.
    points = np.array([[0, 0, -1], [0, 0, 0.0099], [0, 0, 51], [30, 0, 5], [0, 0, 2]])
    means = np.linalg.solve(camera.view[:3, :3], (points - camera.view[:3, 3]).T).T
    values = {name: np.repeat(value, len(points), 0) for name, value in plain().items()}
    found = projected_on(device, values | {"means": means.astype(np.float32)}, changed(far=50.0))
    assert found["culled"].tolist() == [1, 1, 1, 4, 0]


def test_radius_clip_leaves_out_what_is_not_larger(device):
    values = plain()
    radii = projected_on(device, values, Kind())["radii"][0]
    assert radii.min() > 1
    largest = float(radii.max())
    assert projected_on(device, values, changed(radius_clip=largest))["culled"].tolist() == [5]
    assert projected_on(device, values, changed(radius_clip=largest - 0.5))["culled"].tolist() == [
        0
    ]


def test_enormous_splat_covers_the_screen_and_no_more(device):
    found = projected_on(device, plain(scales=[[1e7, 1e6, 1e6]]), Kind())
    assert found["boxes"].tolist() == [[0, 0, 9, 7]]
    assert 1e6 < found["radii"].min() <= found["radii"].max() <= 1 << 30


NUMBERS = [0.0, -0.0, 1.0, -1.0, 0.3, 1e-45, -1e-40, 1e-30, 1e-12, 1e6, -1e12, 1e19, -3e38, 3.4e38]
ODD = st.sampled_from([*NUMBERS, np.inf, -np.inf, np.nan])


@pytest.mark.parametrize("name", KINDS)
@settings(
    max_examples=25, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture]
)
@given(odd=hnp.arrays(np.float32, (32, 11), elements=ODD | st.floats(-4, 4, width=32)))
def test_hostile_numbers_are_culled_or_drawn_whole(device, name, odd):
    kind = KINDS[name]
    values = {
        "means": odd[:, :3], "quats": odd[:, 3:7], "scales": odd[:, 7:10], "opacities": odd[:, 10]
    }  # fmt: skip
    if kind.covars:
        values = {"means": odd[:, :3], "covars": odd[:, 3:9], "opacities": odd[:, 10]}
    splats = sent(device, values)
    projected = project(device, splats, kind.camera, kind.settings)
    found = {name: device.get(array) for name, array in arrays_of(projected).items()}
    codes = found["culled"]
    given_all = np.concatenate([value.reshape(32, -1) for value in values.values()], axis=1)
    assert (codes[~np.isfinite(given_all).all(axis=1)] == 2).all()
    assert set(codes) <= set(range(6))
    assert np.isfinite(found["screen"]).all()
    drawn = codes == 0
    assert not found["screen"][~drawn].any() and not found["boxes"][~drawn].any()
    boxes = found["boxes"][drawn]
    assert (boxes[:, :2] >= 0).all() and (boxes[:, 2:] <= (9, 7)).all()
    assert (boxes[:, :2] < boxes[:, 2:]).all()
    assert (found["screen"][drawn, 6:] > 0).any(axis=1).all()
    a, _, c = found["screen"][drawn, 2:5].T
    assert (a > 0).all() and (c > 0).all() and (found["screen"][drawn, 5] > 0).all()


@pytest.mark.parametrize(
    ("six", "code"),
    [
        ([1, 0, 0, 1, 0, 1], 0),
        ([1, 0, 0, 1, 0, 0], 0),
        ([0, 0, 0, 1, 0, 1], 0),
        ([1, 1, 0, 1, 0, 1], 0),
        ([1, 0, 0, 1, 0, -1], 2),
        ([0, 1, 0, 1, 0, 1], 2),
        ([1, 2, 0, 1, 0, 1], 2),
        ([0, 0, 0, 0, 0, 0], 2),
        ([-1, 0, 0, -1, 0, -1], 2),
    ],
    ids=str,
)
def test_covariances_that_are_none_are_culled(device, six, code):
    values = {"means": [[0, 0, 0]], "opacities": [1], "covars": 0.01 * np.array([six])}
    splats = Splats.upload(device, **values)
    projected = project(device, splats, Kind().camera, SplatSettings())
    assert device.get(projected.culled).tolist() == [code]
