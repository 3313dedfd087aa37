"""A thin lens: against the pinholes its aperture is made of, the laws of optics, and misuse."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from projection_scenes import (
    LENS,
    Kind,
    camera_of,
    changed,
    plain,
    projected_on,
    random_splats,
    twin_of,
    upload,
)
from scipy.special import j1

from rift_cl.errors import InputError
from rift_cl.geometry import Aperture, Camera
from rift_cl.splat import Renderer, SplatSettings

pytestmark = pytest.mark.dealt

FOCAL, SIZE = 150.0, (96, 96)


def before(depth, aperture=None, *, wide=0.02, opacity=0.9):
    """A small round splat on the axis of a camera, and the camera."""
    K = [[FOCAL, 0, 48.0], [0, FOCAL, 48.0], [0, 0, 1]]
    values = plain(means=[[0, 0, depth]], scales=[[wide] * 3], opacities=[opacity])
    return values, Camera(SIZE, K, np.eye(4), aperture=aperture)


def seen(device, values, camera):
    """Where one splat is on the screen, its variances along x and y, and its light."""
    u, v, a, b, c, weight = projected_on(device, values, Kind(), camera)["screen"][0, :6].astype(
        float
    )
    det = a * c - b * b
    return np.array([u, v]), np.array([c, a]) / det, weight / np.sqrt(det)


@pytest.mark.parametrize(("depth", "focus"), [(2.0, 4.0), (9.0, 4.0), (4.0, np.inf)])
def test_a_lens_is_the_mean_of_the_pinholes_in_its_aperture(device, depth, focus):
    """Each pinhole is shifted within the pupil, and its picture so that the focus stays in place.

    Spread and light are compared; the shape is a disc's there and a Gaussian's here.
    """
    radius, steps = 0.2, np.linspace(-1, 1, 41)
    values, camera = before(depth, Aperture(radius, focus))
    across = np.stack(np.meshgrid(steps, steps), -1).reshape(-1, 2)
    pupil = radius * across[(across**2).sum(1) <= 1][::7]
    pictures = []
    for x, y in pupil:
        view, K = np.eye(4), camera.K.copy()
        view[:2, 3] = -x, -y
        K[:2, 2] += FOCAL * np.array([x, y]) / focus
        pictures.append(seen(device, values, Camera(SIZE, K, view)))
    places, variances, lights = (np.array(part) for part in zip(*pictures, strict=True))
    wanted = variances.mean(0) + places.var(0)
    assert places.var(0).min() > 2 * variances.min(), "the blur is larger than the splat"
    _, found, light = seen(device, values, camera)
    np.testing.assert_allclose(found, wanted, rtol=0.01)
    assert light == pytest.approx(lights.mean(), rel=0.01)


def test_blur_is_the_discs_variance_at_every_depth(device):
    depths = np.linspace(1, 9, 33)
    aperture, kind = Aperture(0.1, 4.0), changed()
    for depth in depths:
        values, camera = before(depth, aperture, opacity=1)
        sharp = projected_on(device, values, kind, before(depth, opacity=1)[1])["screen"][0]
        blurred = projected_on(device, values, kind, camera)["screen"][0]
        diameter = FOCAL * aperture.blur(depth) / depth
        assert 1 / blurred[2] - 1 / sharp[2] == pytest.approx(diameter**2 / 16, rel=1e-4, abs=1e-6)
        # A round splat's height times its area stays.
        assert blurred[5] / blurred[2] == pytest.approx(sharp[5] / sharp[2], rel=1e-5)


@pytest.mark.parametrize("radius", [0.2, 0.5, 0.8, 1.4])
def test_what_is_drawn_lacks_the_light_below_the_threshold(device, radius):
    """All of it but (1/255) / weight: alphas below 1/255 do not count."""
    lights = []
    for aperture in (None, Aperture(radius, 4.0)):
        values, camera = before(8.0, aperture)
        weight = projected_on(device, values, Kind(), camera)["screen"][0, 5]
        splats = upload(device, values | {"colors": np.ones((1, 1), np.float32)}, Kind())
        image = device.get(Renderer(device=device).forward(splats, camera).image)
        lights.append((image.sum(), 1 - 1 / 255 / weight if weight else 0.0))
    (sharp, all_but), (blurred, left) = lights
    assert blurred / sharp == pytest.approx(left / all_but, abs=0.02)


def test_what_is_in_focus_is_what_a_pinhole_draws(device):
    values, camera = before(4.0, Aperture(0.3, 4.0))
    lens = projected_on(device, values, Kind(), camera)
    pinhole = projected_on(device, values, Kind(), before(4.0)[1])
    for name, array in pinhole.items():
        np.testing.assert_allclose(lens[name], array, rtol=1e-6, err_msg=name)


def test_a_lens_too_small_to_matter_is_a_pinhole(device):
    values = random_splats(100)
    lens = projected_on(device, values, Kind(aperture=Aperture(1e-30, 3.0)))
    for name, array in projected_on(device, values, Kind()).items():
        np.testing.assert_allclose(lens[name], array, rtol=1e-5, atol=1e-6, err_msg=name)


def test_focus_at_infinity_is_the_limit_of_a_far_one(device):
    values = random_splats(100)
    far, infinite = (
        projected_on(device, values, Kind(aperture=Aperture(0.1, focus)))["screen"]
        for focus in (1e9, np.inf)
    )
    np.testing.assert_allclose(far, infinite, rtol=1e-5)


def test_diffraction_has_the_light_and_the_peak_of_the_airy_pattern(device):
    aperture = Aperture(0.05, 4.0, wavelength=0.004)
    values, camera = before(4.0, aperture)
    found, sharp = (
        projected_on(device, values, Kind(), view)["screen"][0, 2].astype(float)
        for view in (camera, before(4.0)[1])
    )
    variance = 1 / found - 1 / sharp
    # 2 J1(v) / v squared, v = 2 pi R r / (wavelength f), by its light to 400 rings.
    v = np.linspace(1e-6, 1256, 400_000)
    light = np.trapezoid(2 * np.pi * v * (2 * j1(v) / v) ** 2, v)
    per_pixel = 2 * np.pi * aperture.radius / (aperture.wavelength * FOCAL)
    assert 2 * np.pi * variance == pytest.approx(light / per_pixel**2, rel=2e-3)


def test_gradients_by_radius_and_focus_are_differences_of_the_twin():
    """In float64 on both sides: autograd of one definition, differences of another."""
    pytest.importorskip("torch", reason="one of the definitions is torch's")
    from projection_gradients import oracle

    values = {n: v.astype(float) for n, v in random_splats(60, seed=4).items()}
    kind = Kind(aperture=LENS)
    first = twin_of(values, kind)
    drawn, random = first.culled == 0, np.random.default_rng(0)
    sums = random.standard_normal((60, 9))
    right = oracle(values, kind, sums, drawn, shaded=False)["aperture"]
    for place, step in ((0, (1e-6, 0)), (1, (0, 1e-5))):
        losses = []
        for sign in (1, -1):
            moved = Aperture(LENS.radius + sign * step[0], LENS.focus + sign * step[1], 0.002)
            now = twin_of(values, Kind(aperture=moved))
            terms = (np.array([sums[:, 3] / 2, sums[:, 4], sums[:, 5] / 2]).T * now.conics).sum(1)
            losses.append((terms - sums[:, 0] * np.log(now.weights))[drawn].sum())
        assert (losses[0] - losses[1]) / (2 * sum(step)) == pytest.approx(right[place], rel=1e-5)


def drawn(device, aperture, count=40):
    kind = Kind(aperture=aperture)
    renderer = Renderer(device=device)
    frame = renderer.forward(upload(device, random_splats(count), kind), kind.camera)
    return renderer, frame


@pytest.mark.parametrize("aperture", [Aperture(0.1, np.inf), Aperture(1e-20, 3.0)], ids=str)
def test_gradients_at_the_limits_are_finite(device, aperture):
    renderer, frame = drawn(device, aperture)
    found = renderer.backward(frame, device.array(np.ones(frame.image.shape)), with_camera=True)
    by_radius, by_focus = device.get(found.aperture)
    assert np.isfinite([by_radius, by_focus]).all()
    assert by_focus == 0 or aperture.focus != np.inf
    assert np.isfinite(device.get(found.splats.means)).all()


@pytest.mark.full
def test_the_apertures_gradient_is_there_where_it_is_asked_for(device):
    for aperture, asked in ((LENS, True), (LENS, False), (None, True)):
        renderer, frame = drawn(device, aperture)
        one = device.array(np.ones(frame.image.shape))
        found = renderer.backward(frame, one, with_camera=asked)
        assert (found.aperture is not None) == (asked and aperture is not None)
        assert found.camera is None or found.camera.shape == (16,)


LENGTHS = st.sampled_from([1e-30, 1e-12, 1e-3, 0.1, 1.0, 4.0, 1e6, 1e18, 1e30])


@settings(
    max_examples=30, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture]
)
@given(radius=LENGTHS, focus=LENGTHS | st.just(np.inf), wavelength=LENGTHS | st.just(0.0))
def test_hostile_lenses_leave_finite_numbers(device, radius, focus, wavelength):
    kind = Kind(aperture=Aperture(radius, focus, wavelength))
    values = random_splats(30)
    try:
        found = projected_on(device, values, kind)
    except InputError as error:
        assert "float32" in str(error)
        return
    assert np.isfinite(found["screen"]).all()
    assert set(found["culled"]) <= set(range(6))


def test_what_lies_before_the_near_plane_is_culled(device):
    values, camera = before(0.005, LENS)
    assert projected_on(device, values, Kind(), camera)["culled"].tolist() == [1]


def test_xray_mode_refuses_a_lens(device):
    with pytest.raises(InputError, match=r"xray.*aperture"):
        projected_on(device, plain(), changed(mode="xray"), camera_of("pinhole", aperture=LENS))


@pytest.mark.parametrize(
    "aperture", [Aperture(1e39, 1.0), Aperture(1.0, 1e-39), Aperture(1e-30, 1.0, 1e20)], ids=str
)
def test_lenses_beyond_float32_are_refused_by_name(device, aperture):
    with pytest.raises(InputError, match=r"^Aperture\(.*float32"):
        projected_on(device, plain(), Kind(aperture=aperture))


@pytest.mark.full
def test_a_wrong_radius_and_focus_are_found_by_their_gradient(device):
    """From a picture through the true lens, with splats that are known: Adam on logarithms."""
    kind, values = Kind(aperture=Aperture(0.2, 3.4)), random_splats(150, seed=9)
    renderer = Renderer(SplatSettings(smooth_cutoff=True), device=device)
    splats = upload(device, values, kind)
    truth = device.get(renderer.forward(splats, kind.camera).image)
    found = np.log([0.1, 4.4])
    first, second = np.zeros(2), np.zeros(2)
    for step in range(1, 81):
        lens = Aperture(*np.exp(found).tolist())
        frame = renderer.forward(splats, camera_of("pinhole", aperture=lens))
        by_image = device.array(2 * (device.get(frame.image) - truth))
        gradients = renderer.backward(frame, by_image, with_camera=True)
        gradient = device.get(gradients.aperture) * np.exp(found)
        first, second = 0.8 * first + 0.2 * gradient, 0.95 * second + 0.05 * gradient**2
        slope = first / (1 - 0.8**step) / np.sqrt(second / (1 - 0.95**step))
        found -= 0.1 * 0.95**step * slope
    np.testing.assert_allclose(np.exp(found), [0.2, 3.4], rtol=0.02)
