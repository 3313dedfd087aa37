"""No splat finer than the cameras resolve: the twin's limits, what is drawn, and its gradient."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest
from test_parameters import FREE, RATES, raw_values
from test_start import ring

from rift_cl.geometry import Camera
from rift_cl.geometry.aperture import Aperture
from rift_cl.reference.training import activate, finest_known, finest_seen
from rift_cl.train.band_limit import Detail, camera_table, unseen_length
from rift_cl.train.parameters import Parameters

pytestmark = pytest.mark.dealt


def limited(device, raw, cameras, detail=None):
    parameters = Parameters.of(device, raw)
    unseen, table = unseen_length(cameras), device.array(camera_table(cameras))
    parameters.limit_band(table, near=0.01, unseen=unseen, detail=detail)
    return parameters, unseen


def opened(camera, radius, focus, wavelength):
    lens = Aperture(radius, focus, wavelength)
    return Camera(camera.size, camera.K, camera.view, aperture=lens)


def test_limits_are_the_twins(device):
    cameras, raw = ring(6), raw_values(300)
    raw["means"] *= 3
    parameters, unseen = limited(device, raw, cameras)
    wanted = finest_seen(
        raw["means"].astype(float), camera_table(cameras).astype(float), near=0.01, unseen=unseen
    )
    found = device.get(parameters.band)
    np.testing.assert_allclose(found, wanted, rtol=1e-4)
    assert (found < 0.99 * unseen).any() and (found == np.float32(unseen)).any()


def test_what_is_drawn_is_blurred_and_keeps_its_mass(device):
    raw = raw_values()
    parameters, _ = limited(device, raw, ring(4))
    band = device.get(parameters.band).astype(float)
    scales, opacities = activate(
        raw["log_scales"].astype(float), raw["logits"].astype(float), band=band
    )
    np.testing.assert_allclose(device.get(parameters.drawn.scales), scales, rtol=1e-5)
    np.testing.assert_allclose(device.get(parameters.drawn.opacities), opacities, rtol=1e-5)
    free, before = activate(raw["log_scales"].astype(float), raw["logits"].astype(float))
    np.testing.assert_allclose(opacities * scales.prod(axis=1), before * free.prod(axis=1))


@pytest.mark.parametrize("density", [False, True])
@pytest.mark.parametrize("band", [False, True])
def test_the_gradient_is_the_twins_difference(device, density, band):
    raw, random = raw_values(23), np.random.default_rng(5)
    lengths = random.uniform(0.01, 0.2, 23).astype(np.float32) if band else None
    parameters = Parameters.of(device, raw, density=density, band=lengths)
    by_scales, by_opacities = random.normal(size=(23, 3)), random.normal(size=23)
    sent = {
        "means": np.zeros((23, 3)), "quats": np.zeros((23, 4)),
        "scales": by_scales, "opacities": by_opacities,
    }  # fmt: skip
    sent = {name: device.array(value.astype(np.float32)) for name, value in sent.items()}
    found = SimpleNamespace(splats=SimpleNamespace(**sent), sh=device.zeros((23, 4, 3)))
    parameters.update(found, RATES, **{**FREE, "opacity_penalty": 0.3, "scale_penalty": 0.2})

    def loss(log_scales, logits):
        limit = 0.0 if lengths is None else lengths.astype(float)
        scales, opacities = activate(log_scales, logits, band=limit, density=density)
        free, before = activate(log_scales, logits, density=density)
        drawn = (by_scales * scales).sum() + (by_opacities * opacities).sum()
        return drawn + 0.2 * free.mean() + 0.3 * before.mean()

    given = {name: raw[name].astype(float) for name in ("log_scales", "logits")}
    for name, values in given.items():
        wanted = np.zeros(values.shape)
        for place in np.ndindex(wanted.shape):
            ends = []
            for step in (1e-5, -1e-5):
                moved = {key: value.copy() for key, value in given.items()}
                moved[name][place] += step
                ends.append(loss(**moved))
            wanted[place] = (ends[0] - ends[1]) / 2e-5
        # Adam's mean of gradients after one step, which begins at zero.
        by = device.get(parameters.first[name]) / (1 - 0.9)
        np.testing.assert_allclose(by, wanted, rtol=2e-4, atol=2e-5, err_msg=name)


def test_a_camera_that_comes_nearer_lowers_the_limit(device):
    def at(distance):
        view = np.eye(4)
        view[2, 3] = distance
        return Camera((60, 80), [[90, 0, 40], [0, 90, 30], [0, 0, 1]], view)

    raw = raw_values(1)
    raw["means"][:] = 0
    for cameras in ([at(4)], [at(4), at(2)], [at(4), at(2), at(-3)]):
        parameters, _ = limited(device, raw, cameras)
        nearest = min(camera.view[2, 3] for camera in cameras if camera.view[2, 3] > 0)
        assert device.get(parameters.band)[0] == pytest.approx(np.sqrt(0.2) * nearest / 90)


def test_an_orthographic_camera_resolves_the_same_at_every_depth(device):
    camera = Camera((60, 80), [[50, 0, 40], [0, 50, 30], [0, 0, 1]], np.eye(4), "ortho")
    raw = raw_values(5)
    raw["means"] *= [0.1, 0.1, 30]
    found = device.get(limited(device, raw, [camera])[0].band)
    np.testing.assert_allclose(found, np.sqrt(0.2) / 50, rtol=1e-6)


@pytest.mark.full
@pytest.mark.parametrize("lens", [None, (0.05, 3.0, 0.0), (0.2, np.inf, 1e-3)])
def test_limits_by_coverage_are_the_twins(device, lens):
    cameras, raw = ring(7), raw_values(61)
    raw["means"] *= 3
    if lens is not None:
        cameras = [opened(camera, *lens) for camera in cameras[:4]] + list(cameras[4:])
    detail = Detail(diameter=2.5, snr=900.0)
    parameters, unseen = limited(device, raw, cameras, detail)
    found = device.get(parameters.band)
    given = raw["means"].astype(float), camera_table(cameras).astype(float)
    wanted = finest_known(*given, near=0.01, unseen=unseen, **detail._asdict())
    pixels = finest_seen(*given, near=0.01, unseen=unseen)
    seen = found != np.float32(unseen)
    assert seen.any() and not seen.all()
    # Eight halvings leave 2 % of the range of frequencies.
    np.testing.assert_allclose(found, wanted, rtol=0.03)
    assert (found >= 0.999 * pixels).all() and (found > 1.5 * pixels)[seen].any()


def test_without_noise_coverage_is_limited_by_pixels(device):
    cameras, raw = ring(6), raw_values(50)
    by_pixels = device.get(limited(device, raw, cameras)[0].band)
    found = device.get(limited(device, raw, cameras, Detail(2.0, 1e30))[0].band)
    np.testing.assert_allclose(found, by_pixels, rtol=1e-4)


def test_eight_times_the_views_know_twice_as_fine_detail(device):
    """The share of directions falls as 1 / k and the power as 1 / k^2: views as k^3."""
    raw = raw_values(20)
    raw["means"] *= 0.05
    few, many = (
        device.get(limited(device, raw, ring(3) * count, Detail(2.0, 20.0))[0].band)
        for count in (1, 8)
    )
    np.testing.assert_allclose(few / many, 2, rtol=0.05)


def test_detail_is_what_the_contrast_says_of_a_power_law(device):
    random = np.random.default_rng(0)
    f = np.fft.fftfreq(128)
    k = np.hypot(f[:, None], f)
    spectrum = np.fft.fft2(random.normal(size=(8, 128, 128))) / np.maximum(128 * k, 1)
    images = 0.3 * np.fft.ifft2(spectrum).real[..., None]
    sent = [device.array(image.astype(np.float32)) for image in images]
    camera = Camera((128, 128), [[90, 0, 64], [0, 90, 64], [0, 0, 1]], np.eye(4))
    pictures = SimpleNamespace(cameras=[camera] * 8, target=lambda number: sent[number])
    found = Detail.of(device, pictures, 0.01)
    assert found.snr == pytest.approx(0.3**2 / 0.01**2, rel=0.3)
    assert found.diameter == pytest.approx(128 / 90)
    assert Detail.of(device, pictures, 0.0).snr == 1e30
