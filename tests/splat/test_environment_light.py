"""Light that splats share: the device against the twin, the twin against differences, and laws."""

from __future__ import annotations

import numpy as np
import pytest
from projection_scenes import camera_of

from rift_cl.basis.angular import SphericalGaussians
from rift_cl.basis.angular.environment import (
    environment_axes,
    lattice_sharpness,
    light_from,
    reflected_light,
)
from rift_cl.cl.arithmetic import sum_columns
from rift_cl.errors import InputError, ShapeError
from rift_cl.geometry import Camera
from rift_cl.reference.environment import shade_light, shade_light_grad
from rift_cl.splat.environment import CHUNK, shade_environment, shade_environment_grad
from rift_cl.splat.projection import SplatGradients
from rift_cl.splat.renderer import Renderer
from rift_cl.splat.settings import SplatSettings
from rift_cl.splat.splats import Splats

CAMERA = camera_of("pinhole")
NAMES = ("normals", "reflectance", "environment", "means")


def lit(count=200, lobes=20, seed=0):
    """Host arrays of reflecting splats about the origin, of all normals and roughnesses."""
    random = np.random.default_rng(seed)
    reflectance = random.normal(size=(count, 7))
    reflectance[:, 6] = random.uniform(0, 5, count)
    arrays = {
        "means": random.uniform(-1.6, 1.6, (count, 3)),
        "normals": random.normal(size=(count, 3)),
        "reflectance": reflectance,
        "environment": random.normal(size=(lobes, 3)),
    }
    return {name: array.astype(np.float32) for name, array in arrays.items()}


def exact(values):
    return {name: array.astype(float) for name, array in values.items()}


def upload(device, values, **more):
    count = len(values["means"])
    plain = {
        "quats": np.tile([1.0, 0, 0, 0], (count, 1)),
        "scales": np.full((count, 3), 0.1),
        "opacities": np.full(count, 0.8),
        "sh": np.zeros((count, 1, 3)),
    }
    return Splats.upload(device, **(plain | values | more))


def seen(device, values, culled=None, camera=CAMERA):
    """Reflected light, on the device."""
    splats = upload(device, values)
    codes = np.zeros(len(splats), np.uint8) if culled is None else culled
    features = device.array(np.full((len(splats), 4), 7.0))
    shade_environment(device, splats, camera, device.array(codes), into=features)
    return features


def seen_grad(device, values, incoming, features=None, camera=CAMERA):
    """Host gradients by name; those of means and view are beside what was there, 0."""
    features = seen(device, values, camera=camera) if features is None else features
    count = len(values["means"])
    means, parts = device.zeros((count, 3)), device.zeros((max(count, 1), 16))
    coming = np.concatenate([incoming, np.full((count, 1), 9, np.float32)], 1)
    into = SplatGradients(means, None, None, None, None, device.array(coming), None, None, parts)
    given = (device, upload(device, values), camera)
    found = shade_environment_grad(*given, features=features, gradients=into)._asdict()
    view = device.get(sum_columns(device, parts))[:12].reshape(3, 4)
    host = {name: device.get(array) for name, array in found.items()}
    return host | {"means": device.get(means), "view": view}


def incoming_for(count, seed=2):
    return np.random.default_rng(seed).standard_normal((count, 3)).astype(np.float32)


def error(found, right):
    return np.linalg.norm(found - right) / np.linalg.norm(right)


@pytest.mark.full
@pytest.mark.each
@pytest.mark.parametrize("model", ["pinhole", "ortho"])
def test_light_and_its_gradients_are_the_twins(device, model):
    """More splats than a chunk, lobes that are no whole number of lanes."""
    values, camera = lit(CHUNK + 9), camera_of(model)
    incoming = incoming_for(CHUNK + 9)
    found = device.get(seen(device, values, camera=camera))
    right = shade_light(**exact(values), camera=camera)
    assert error(found[:, :3], right) < 5e-6 and (found[:, 3] == 7).all()
    gradients = seen_grad(device, values, incoming, camera=camera)
    twin = shade_light_grad(**exact(values), camera=camera, incoming=incoming.astype(float))
    # Parallel rays go along the axis, wherever a splat is.
    assert gradients["means"].any() == twin.means.any() == (model == "pinhole")
    for name in (*NAMES, "view"):
        if getattr(twin, name).any():
            assert error(gradients[name], getattr(twin, name)) < 5e-5, name


def test_gradients_of_the_twin_are_its_differences():
    values, random = exact(lit(12, 9)), np.random.default_rng(5)
    incoming = incoming_for(12).astype(float)
    found = shade_light_grad(**values, camera=CAMERA, incoming=incoming)
    numbers = {
        "kappa": np.eye(7)[6],
        "tint": np.eye(7)[:3].sum(0),
        "grazing": np.eye(7)[3:6].sum(0),
    }
    ways = {name: (name, random.normal(size=values[name].shape)) for name in NAMES}
    for name, row in numbers.items():
        ways[name] = ("reflectance", row * random.normal(size=(12, 7)))
    for name, (array, way) in ways.items():
        ends = [
            (shade_light(**values | {array: values[array] + step * way}, camera=CAMERA) * incoming)
            for step in (1e-6, -1e-6)
        ]
        slope = (ends[0].sum() - ends[1].sum()) / 2e-6
        gradient = (getattr(found, array) * way).sum()
        assert slope != 0 and gradient == pytest.approx(slope, rel=2e-6, abs=1e-7), name


def test_turning_splats_light_and_camera_together_changes_nothing():
    """The light's lattice turns with everything else where a turn takes it onto itself."""
    values = exact(lit(30, 2))
    axes = environment_axes(2)
    # Half a turn about the line between two lobes exchanges them.
    middle = axes.sum(0) / np.linalg.norm(axes.sum(0))
    turn = 2 * np.outer(middle, middle) - np.eye(3)
    np.testing.assert_allclose(axes @ turn.T, axes[::-1], atol=1e-15)
    turned = values | {
        "means": values["means"] @ turn.T,
        "normals": values["normals"] @ turn.T,
        "environment": values["environment"][::-1],
    }
    view = CAMERA.view.copy()
    view[:3, :3] = view[:3, :3] @ turn.T
    camera = Camera(CAMERA.size, CAMERA.K, view)
    before, after = shade_light(**values, camera=CAMERA), shade_light(**turned, camera=camera)
    np.testing.assert_allclose(after, before, atol=1e-13)


def test_normals_have_no_sides_and_no_length(device):
    values = lit(40)
    other = values | {"normals": -3 * values["normals"]}
    one, two = (device.get(seen(device, given)) for given in (values, other))
    np.testing.assert_allclose(one, two, rtol=1e-5, atol=1e-7)


def test_one_lobe_is_a_spherical_gaussian_about_the_mirrored_axis():
    """A splat that reflects a single lobe shows an ``sg`` lobe about I - 2 n n^T times its axis."""
    values = exact(lit(1, 1))
    values["reflectance"][0, 3:6] = -100
    n = values["normals"][0] / np.linalg.norm(values["normals"])
    kappa, lattice = np.exp(values["reflectance"][0, 6]), lattice_sharpness(1)
    s = lattice * kappa / (lattice + kappa)
    axis = environment_axes(1)[0] @ (np.eye(3) - 2 * np.outer(n, n))
    directions = np.random.default_rng(1).normal(size=(50, 3))
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    lobe = SphericalGaussians(1).functions(np.array([*axis, np.log(s)]), directions)[:, 1]
    tint = 1 / (1 + np.exp(-values["reflectance"][0, :3]))
    color = s / lattice * tint * np.exp(values["environment"][0])
    light = [values[name] for name in ("normals", "reflectance", "environment")]
    np.testing.assert_allclose(reflected_light(*light, directions)[0], lobe[:, None] * color)


def test_a_mirror_shows_the_light_itself_and_a_rough_splat_its_mean():
    values = exact(lit(2, 64))
    values["reflectance"][:] = [50.0] * 3 + [-50.0] * 3 + [9.2]
    values["reflectance"][1, 6] = -9.2
    directions = np.eye(3)
    light = [values[name] for name in ("normals", "reflectance", "environment")]
    mirror, rough = reflected_light(*light, directions)
    n = values["normals"][0] / np.linalg.norm(values["normals"][0])
    mirrored = directions - 2 * np.outer(directions @ n, n)
    np.testing.assert_allclose(mirror, light_from(values["environment"], mirrored), rtol=0.02)
    # A lobe of kappa near 0 gives all directions the same.
    np.testing.assert_allclose(rough, np.broadcast_to(rough[:1], rough.shape), rtol=1e-3)


@pytest.mark.parametrize("kappa", [1.0, 2.0, 30.0])
def test_a_sphere_leaves_of_a_dull_lobe_what_its_closed_form_says(kappa):
    """Over a plane, exp(s (t - 1)) has the integral 2 pi / s; a sphere has 1 - exp(-2 s) of it."""
    lobes, axes = 64, environment_axes(4000)
    lattice = lattice_sharpness(lobes)
    reflectance = np.array([[50.0] * 3 + [-50.0] * 3 + [np.log(kappa)]])
    light = np.zeros((lobes, 3))
    found = reflected_light(np.array([[0, 0, 1.0]]), reflectance, light, axes).mean()
    left = 1 - np.exp(-2 * lattice * kappa / (lattice + kappa))
    assert found == pytest.approx(left * light_from(light, axes).mean(), rel=2e-3)


def test_splats_without_a_meaning_reflect_nothing_and_spoil_nothing(device):
    values, bad = lit(40), lit(40)
    bad["normals"][3], bad["normals"][4, 1], bad["reflectance"][5, 2] = 0, np.nan, np.inf
    spoilt, rest = [3, 4, 5], np.setdiff1d(np.arange(40), [3, 4, 5])
    colors = device.get(seen(device, bad))
    assert not colors[spoilt, :3].any()
    assert colors[rest].tobytes() == device.get(seen(device, values))[rest].tobytes()
    found, well = (seen_grad(device, given, incoming_for(40)) for given in (bad, values))
    for name in ("normals", "reflectance", "means"):
        assert not found[name][spoilt].any()
        assert found[name][rest].tobytes() == well[name][rest].tobytes()
    assert np.isfinite(found["environment"]).all() and np.isfinite(found["view"]).all()


def test_splats_that_are_not_drawn_reflect_nothing(device):
    values, culled = lit(40), (np.arange(40) % 2).astype(np.uint8)
    features = seen(device, values, culled)
    colors = device.get(features)[:, :3]
    assert not colors[1::2].any() and colors[::2].all()
    found = seen_grad(device, values, incoming_for(40), features)
    for name in ("normals", "reflectance", "means"):
        assert not found[name][1::2].any() and found[name][::2].any()


def test_same_call_gives_the_same_bits_in_any_company(device):
    values, incoming = lit(65), incoming_for(65)
    colors, whole = device.get(seen(device, values)), seen_grad(device, values, incoming)
    for count in (1, 9, 65):
        few = {n: a if n == "environment" else a[:count] for n, a in values.items()}
        assert device.get(seen(device, few)).tobytes() == colors[:count].tobytes()
        found = seen_grad(device, few, incoming[:count])
        for name in ("normals", "reflectance", "means"):
            assert np.array_equal(found[name], whole[name][:count]), (name, count)
    assert found["environment"].tobytes() == whole["environment"].tobytes()


def test_no_splats_reflect_nothing(device):
    values = lit(0)
    assert seen(device, values).shape == (0, 4)
    assert not seen_grad(device, values, np.zeros((0, 3), np.float32))["environment"].any()


@pytest.mark.full
@pytest.mark.parametrize("angular", ["sh", "sg"])
def test_an_image_is_own_colour_plus_light_and_its_gradients_are_differences(device, angular):
    """What is negative on its own is not, once light is added; the sum is what is held above 0."""
    random, values = np.random.default_rng(6), lit(12, 8)
    linear = 3 if angular == "sg" else 4
    own = {"sh": 0.4 * random.normal(size=(12, linear, 3)), "scales": np.full((12, 3), 0.4)}
    own["sh"][:, 0] -= 1.8
    if angular == "sg":
        own["lobes"] = random.normal(size=(12, 8))
    renderer = Renderer(SplatSettings(angular=angular, smooth_cutoff=True), device=device)
    coming = random.normal(size=(*CAMERA.size, 3)).astype(np.float32)

    def drawn(**changed):
        return renderer.forward(upload(device, values | own | changed), CAMERA)

    frame = drawn()
    dark = values["environment"] - 60
    assert device.get(frame.image).sum() > device.get(drawn(environment=dark).image).sum() + 1
    found = renderer.backward(frame, device.array(coming))
    for name in ("normals", "reflectance", "environment", "sh"):
        base = (values | own)[name].astype(float)
        way, step = random.normal(size=base.shape), 3e-3
        high, low = (
            device.get(drawn(**{name: base + sign * step * way}).image).astype(float)
            for sign in (1, -1)
        )
        right = ((high - low) * coming).sum() / (2 * step)
        gradient = device.get(getattr(found, name)).astype(float)
        scale = np.linalg.norm(gradient) * np.linalg.norm(way)
        assert scale > 0 and abs((gradient * way).sum() - right) < 4e-3 * scale, name


def test_light_that_does_not_fit_is_refused(device):
    values = lit(5)
    with pytest.raises(InputError, match="normals and reflectance alone reflect no light"):
        upload(device, values, environment=None)
    with pytest.raises(ShapeError, match="reflectance"):
        upload(device, values, reflectance=np.zeros((5, 6)))
    with pytest.raises(ShapeError, match="environment"):
        upload(device, values, environment=np.zeros((0, 3)))
    with pytest.raises(InputError, match="sh"):
        upload(device, values, sh=None, colors=np.zeros((5, 3)))
