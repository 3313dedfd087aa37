"""Gradients of projection and shading: against float64 autograd, differences, and laws."""

from __future__ import annotations

import numpy as np
import pytest
from projection_scenes import KINDS, Kind, all_round, random_splats, twin_of, upload

from rift_cl.cl.arithmetic import sum_columns
from rift_cl.errors import DTypeError, ShapeError
from rift_cl.geometry import Aperture
from rift_cl.splat.features import shade, shade_grad
from rift_cl.splat.projection import project, project_grad
from rift_cl.splat.settings import SplatSettings

pytest.importorskip("torch", reason="the oracle of gradients is torch's autograd")
made = pytest.importorskip("projection_gradients")

pytestmark = pytest.mark.dealt
run, oracle, error, errors_by_splat = made.run, made.oracle, made.error, made.errors_by_splat


@pytest.mark.parametrize("name", KINDS)
def test_gradients_are_autograds(device, name):
    kind, values = KINDS[name], random_splats()
    found, sums, drawn = run(device, values, kind)
    right = oracle(values, kind, sums, drawn)
    shape = {"covars"} if kind.covars else {"quats", "scales"}
    lens = set() if kind.aperture is None else {"aperture"}
    assert set(right) == {"means", "opacities", "sh", "camera"} | shape | lens
    assert ("aperture" in found) == bool(lens)
    np.testing.assert_allclose(found["features"], sums[:, 6:], rtol=1e-5, atol=1e-5)
    for what, wanted in right.items():
        assert np.linalg.norm(wanted) > 0, what
        assert error(found[what], wanted) < 3e-5, what
        if what not in ("camera", "aperture"):
            assert errors_by_splat(found[what][drawn], wanted[drawn]).max() < 2e-4, what
            assert not found[what][~drawn].any(), what
    for what in {"camera"} | lens:
        # Large parts of both signs may leave a small number.
        rounding = 1e-6 * np.linalg.norm(right[what])
        np.testing.assert_allclose(found[what], right[what], rtol=2e-4, atol=rounding)


@pytest.mark.parametrize("coefficients", [1, 4, 9, 25])
def test_gradients_through_harmonics_of_every_degree(device, coefficients):
    values = random_splats(100, coefficients=coefficients)
    found, sums, drawn = run(device, values, Kind())
    right = oracle(values, Kind(), sums, drawn)
    for what in ("sh", "means", "camera"):
        assert error(found[what], right[what]) < 3e-5, what


@pytest.mark.parametrize("mode", ["light", "xray"])
def test_gradients_where_the_affine_map_is_held_near_the_image(device, mode):
    """Large splats far outside, of which the margin's clamp decides the shape."""
    kind, values = Kind(settings=SplatSettings(mode=mode)), random_splats(300, wide=4.0)
    values["scales"] *= 4
    found, sums, drawn = run(device, values, kind, shaded=False)
    pixels = twin_of(values, kind).means
    outside = drawn & ((pixels < -0.16 * 143) | (pixels > 1.16 * 143)).any(axis=1)
    assert outside.sum() > 10
    right = oracle(values, kind, sums, drawn, shaded=False)
    for what in ("means", "quats", "scales"):
        assert error(found[what][outside], right[what][outside]) < 1e-4, what
    np.testing.assert_allclose(found["camera"], right["camera"], rtol=1e-3)


@pytest.mark.parametrize("name", ["fisheye", "fisheye antialiased covariances"])
def test_gradients_at_and_near_the_axis_of_a_fisheye(device, name):
    """There the closed forms are 0 / 0."""
    kind, values = KINDS[name], random_splats(64)
    camera = kind.camera
    radius = np.geomspace(1e-6, 3, 64)
    points = np.stack([radius * np.cos(3 * radius), radius * np.sin(3 * radius), 0 * radius + 3], 1)
    away = np.linalg.solve(camera.view[:3, :3], (points - camera.view[:3, 3]).T).T
    values["means"] = away.astype(np.float32)
    found, sums, drawn = run(device, values, kind, shaded=False)
    assert drawn.sum() > 30
    right = oracle(values, kind, sums, drawn, shaded=False)
    assert errors_by_splat(found["means"][drawn], right["means"][drawn]).max() < 2e-4


@pytest.mark.parametrize("covars", [False, True])
def test_gradients_near_and_beyond_a_quarter_turn_from_the_axis_of_a_fisheye(device, covars):
    """Those of depth as well, which is the distance there."""
    kind = Kind("fisheye", covars, focal=22.0)
    values = all_round(kind.camera)
    found, sums, drawn = run(device, values, kind, channels=4, depth_channel=True)
    assert drawn.sum() > 150 and drawn[-30:].any()
    right = oracle(values, kind, sums, drawn, depth_channel=True)
    for what in {"means", "quats", "scales", "covars", "camera"} & set(right):
        assert error(found[what], right[what]) < 1e-4, what


def test_gradients_of_needles(device):
    """Each splat for itself: a sum over all would hide the few that rounding spoils."""
    values = random_splats(200, seed=6, wide=0.5)
    values["scales"] = np.tile(np.float32([1.0, 2e-3, 2e-3]), (200, 1))
    kind = Kind(settings=SplatSettings(eps2d=0.05))
    # One tile each: in a sum over tiles the records' own rounding would be all that is seen.
    found, sums, drawn = run(device, values, kind, shaded=False, one_tile=True)
    right = oracle(values, kind, sums, drawn, shaded=False)
    for what in ("scales", "means", "quats"):
        errors = errors_by_splat(found[what][drawn], right[what][drawn])
        # Written in the conic's numbers the same gradients have medians of 7e-5 and more.
        assert np.median(errors) < 4e-5, what
        assert errors.max() < 1e-2, what


@pytest.mark.parametrize("aperture", [None, Aperture(0.02, 3.75)], ids=str)
@pytest.mark.parametrize("covars", [False, True])
def test_compensation_that_is_held_passes_nothing_on(device, covars, aperture):
    kind = Kind(covars=covars, settings=SplatSettings(antialiased=True), aperture=aperture)
    values = random_splats(120, wide=0.8)
    values["scales"] = np.minimum(values["scales"], 1e-3)
    values["opacities"][:] = 0.95
    found, sums, drawn = run(device, values, kind, shaded=False)
    sharp = twin_of(values, Kind(covars=covars, settings=kind.settings))
    assert (sharp.factors[drawn] == 0.005).mean() > 0.5
    right = oracle(values, kind, sums, drawn, shaded=False)
    for what in {"means", "scales", "covars"} & set(right):
        assert error(found[what], right[what]) < 1e-4, what


def test_every_channel_and_the_depth_find_their_place(device):
    values, kind = random_splats(150), Kind(settings=SplatSettings(absgrad=True))
    found, sums, drawn = run(device, values, kind, channels=5, depth_channel=True)
    assert found["features"].shape == (150, 5)
    np.testing.assert_allclose(found["features"], sums[:, 6:11], rtol=1e-5, atol=1e-5)
    np.testing.assert_allclose(found["means2d_abs"], sums[:, 11:], rtol=1e-5)
    right = oracle(values, kind, sums[:, :11], drawn, depth_channel=True)
    for what in ("means", "sh", "camera"):
        assert error(found[what], right[what]) < 3e-5, what


@pytest.mark.parametrize(
    "name", ["pinhole", "ortho xray", "fisheye antialiased covariances", "lens antialiased"]
)
def test_gradients_are_differences_of_the_numpy_twin(device, name):
    """A second oracle, which shares nothing with the first."""
    kind, values = KINDS[name], random_splats(100, seed=2)
    found, sums, drawn = run(device, values, kind, shaded=False)
    random, step = np.random.default_rng(3), 1e-6
    before = twin_of(values, kind)
    way = random.standard_normal((100, 3))

    def loss(sign):
        moved = values | {"means": values["means"].astype(float) + sign * step * way}
        now = twin_of(moved, kind)
        a, b, c = before.conics.T
        s0, sx, sy, sxx, sxy, syy = sums.T[:6]
        terms = (a * sx + b * sy) * now.means[:, 0] + (b * sx + c * sy) * now.means[:, 1]
        terms += (np.array([sxx / 2, sxy, syy / 2]).T * now.conics).sum(1)
        return (terms - s0 * np.log(now.weights))[drawn]

    slopes = (loss(1) - loss(-1)) / (2 * step)
    assert error((found["means"] * way).sum(1)[drawn], slopes) < 1e-4


def test_opacity_gradient_is_the_records(device):
    values = random_splats(50)
    found, sums, drawn = run(device, values, Kind(), shaded=False)
    wanted = -sums[:, 0] / values["opacities"]
    np.testing.assert_allclose(found["opacities"][drawn], wanted[drawn], rtol=1e-4)


def test_without_the_camera_the_rest_is_the_same(device):
    values, camera = random_splats(80), Kind().camera
    splats = upload(device, values, Kind())
    projected = project(device, splats, camera, SplatSettings())
    twin_covars = twin_of(values, Kind()).covars
    slots, records = made.random_records(made.tiles_of(device.get(projected.boxes)), twin_covars, 3)
    sums = made.sums_of(device, slots, records)
    with_it, without = (project_grad(projected, sums, with_camera=flag) for flag in (True, False))
    assert without.camera is None
    features = shade(device, splats.means, splats.sh, camera, projected.culled)
    for gradients in (with_it, without):
        shade_grad(device, splats.means, splats.sh, camera, features=features, gradients=gradients)
    for name in ("means", "quats", "scales", "opacities", "features", "means2d"):
        pair = [device.get(getattr(gradients, name)) for gradients in (with_it, without)]
        np.testing.assert_allclose(*pair, rtol=1e-5, atol=1e-6, err_msg=name)


def test_two_runs_give_the_same_bits(device):
    first, second = (run(device, random_splats(), Kind())[0] for _ in range(2))
    for name, array in first.items():
        assert array.tobytes() == second[name].tobytes(), name


def test_hostile_splats_leave_zeros(device):
    values = random_splats(60, wide=0.5)
    values["means"][3] = np.nan
    values["quats"][5] = 0
    values["scales"][7] = [np.inf, -1, 0]
    values["opacities"][9] = np.nan
    values["means"][11] = 3e38
    found, _, drawn = run(device, values, Kind())
    culled = [3, 5, 7, 9, 11]
    assert not drawn[culled].any()
    for name, array in found.items():
        assert np.isfinite(array).all(), name
        assert name == "camera" or not array[culled].any(), name


def test_splats_without_slots_and_no_splats_at_all(device):
    camera = Kind().camera
    for count in (4, 0):
        values = {name: value[:count] for name, value in random_splats(4, wide=0.2).items()}
        splats = upload(device, values, Kind())
        projected = project(device, splats, camera, SplatSettings())
        nothing = np.zeros(count + 1, np.int32), np.zeros((0, 9), np.float32)
        gradients = project_grad(projected, made.sums_of(device, *nothing))
        assert not device.get(gradients.means).any()
        assert not device.get(sum_columns(device, gradients.camera)).any()


@pytest.mark.parametrize(
    "shape", [(0, 3), (1, 16), (7, 16), (64, 1), (65, 5), (4097, 3), (9000, 16)]
)
def test_columns_are_summed(device, shape):
    table = np.random.default_rng(0).standard_normal(shape).astype(np.float32) + 1
    total = device.get(sum_columns(device, device.array(table)))
    np.testing.assert_allclose(total, table.sum(axis=0, dtype=float), rtol=1e-6)


def test_position_gradients_may_come_in_place_of_first_moments(device):
    values, kind = random_splats(120), Kind()
    found, sums, drawn = run(device, values, kind, shaded=False)
    splats = upload(device, values, kind)
    projected = project(device, splats, kind.camera, kind.settings)
    sums[:, 1:3] = found["means2d"]
    direct = project_grad(projected, device.array(sums), first_moments=False)
    assert drawn.sum() > 60
    np.testing.assert_allclose(device.get(direct.means), found["means"], rtol=1e-4, atol=1e-3)


def test_sums_must_fit(device):
    splats = upload(device, random_splats(4), Kind())
    projected = project(device, splats, Kind().camera, SplatSettings())

    def attempt(sums):
        project_grad(projected, sums)

    attempt(device.zeros((4, 9)))
    for bad in (device.zeros((4, 6)), device.zeros((3, 9)), device.zeros((4,))):
        with pytest.raises(ShapeError, match="sums has shape"):
            attempt(bad)
    with pytest.raises(DTypeError, match="sums"):
        attempt(device.zeros((4, 9), np.int32))
