"""Phase retrieval: thickness from simulated propagation, the published formula, slabs, refusals."""

import numpy as np
import pytest

from rift_cl.errors import InputError, NonFiniteError, ShapeError
from rift_cl.reconstruct.preprocess import Propagation, halo_rows, paganin

ENERGY, DELTA, BETA = 20.0, 1e-6, 2e-9
WAVELENGTH = 12.39841984e-10 / ENERGY
SETTING = {"pixel": 1e-6, "distance": 0.02, "energy": ENERGY, "delta_beta": DELTA / BETA}
kernels = pytest.mark.parametrize("generalised", [False, True])


def sphere(shape, radius, fine):
    """Thickness of a ball of so many pixels, `fine` samples a pixel, in metres."""
    y, x = (
        (np.arange(n * fine) - (n * fine - 1) / 2).reshape(s) / fine
        for n, s in zip(shape, ((-1, 1), (1, -1)), strict=True)
    )
    return 2 * SETTING["pixel"] * np.sqrt(np.maximum(radius**2 - x**2 - y**2, 0))


def binned(image, fine):
    return image.reshape(image.shape[0] // fine, fine, -1, fine).mean(axis=(1, 3))


def propagated(thickness, fine):
    """What the detector sees behind a homogeneous object: the angular spectrum of its exit wave."""
    wave = np.exp(-2 * np.pi / WAVELENGTH * (1j * DELTA + BETA) * thickness)
    fy, fx = (np.fft.fftfreq(n, SETTING["pixel"] / fine) for n in thickness.shape)
    axial = np.sqrt(1 - WAVELENGTH**2 * (fy[:, None] ** 2 + fx**2)) / WAVELENGTH
    transfer = np.exp(2j * np.pi * SETTING["distance"] * (axial - 1 / WAVELENGTH))
    return binned(np.abs(np.fft.ifft2(np.fft.fft2(wave) * transfer)) ** 2, fine)


@kernels
def test_thickness_is_recovered_from_simulated_propagation(generalised):
    fine, shape, radius = 4, (160, 192), 50
    thickness = sphere(shape, radius, fine)
    seen, truth = propagated(thickness, fine)[None], binned(thickness, fine)
    found = paganin(seen, **SETTING, beta=BETA, generalised=generalised)[0]
    most = truth.max()
    assert np.sqrt(np.mean((found - truth) ** 2)) < 0.01 * most
    inside = sphere(shape, 0.8 * radius, 1) > 0
    assert np.abs(found - truth)[inside].max() < 0.01 * most
    assert found.sum() == pytest.approx(truth.sum(), rel=1e-3)
    # It is the retrieval that does it: the logarithm alone is wrong by far more at the edges.
    mu = 4 * np.pi * BETA / WAVELENGTH
    assert np.abs(-np.log(seen[0]) / mu - truth).max() > 4 * np.abs(found - truth).max()
    integrals = paganin(seen, **SETTING, generalised=generalised)[0]
    np.testing.assert_allclose(integrals, mu * found, rtol=1e-5, atol=1e-7)


@kernels
@pytest.mark.parametrize("height", [1, 3])
@pytest.mark.parametrize("shape", [(2, 5, 8), (1, 31, 46)])
def test_it_is_the_published_formula_on_the_mirrored_image(shape, height, generalised):
    seen = np.random.default_rng(2).uniform(0.2, 1, shape)
    mirrored = np.concatenate([seen, seen[:, ::-1]], axis=1)
    mirrored = np.concatenate([mirrored, mirrored[:, :, ::-1]], axis=2)
    w = SETTING["pixel"]
    h = height * w
    ky, kx = (
        2 * np.pi * np.fft.fftfreq(n, d) for n, d in zip(mirrored.shape[1:], (h, w), strict=True)
    )
    ky = ky[:, None]
    mu = 4 * np.pi * BETA / WAVELENGTH
    alpha = SETTING["distance"] * DELTA / mu
    squared = ky**2 + kx**2
    if generalised:
        squared = 2 / w**2 * (1 - np.cos(w * kx)) + 2 / h**2 * (1 - np.cos(h * ky))
    filtered = np.fft.ifft2(np.fft.fft2(mirrored) / (1 + alpha * squared)).real
    expected = -np.log(filtered[:, : shape[1], : shape[2]]) / mu
    setting = {**SETTING, "pixel": w if height == 1 else (h, w)}
    found = paganin(seen, **setting, beta=BETA, generalised=generalised)
    np.testing.assert_allclose(found, expected, rtol=2e-5)


def test_an_even_image_is_its_logarithm():
    even = np.full((2, 9, 7), 0.3, np.float32)
    np.testing.assert_allclose(paganin(even, **SETTING), -np.log(0.3), rtol=1e-5)


@kernels
@pytest.mark.parametrize("distance", [1e-5, 1e-3, 0.02])
def test_a_slab_with_its_halo_equals_the_whole(distance, generalised):
    setting = {**SETTING, "distance": distance, "generalised": generalised}
    halo, error = halo_rows(**setting, error=1e-4), 1e-4
    # The slab with its halo ends in full light, which it mirrors; in truth nothing passes beyond.
    edge = halo + 20
    seen = np.random.default_rng(3).uniform(0.9, 1, (2, 2 * edge, 24)).astype(np.float32)
    seen[:, edge:] = 0
    whole, slab = (np.exp(-paganin(part, **setting)) for part in (seen, seen[:, :edge]))
    away = np.abs(slab - whole[:, :edge]).max(axis=(0, 2))
    assert away[: edge - halo].max() < error
    # Nor are the rows many more than needed, where the filter is wider than a pixel.
    assert distance < 1e-2 or away[edge - halo // 2] > error


def test_the_halo_is_counted_in_rows():
    tall = {**SETTING, "pixel": (4 * SETTING["pixel"], SETTING["pixel"])}
    assert halo_rows(**tall) == halo_rows(**{**SETTING, "pixel": 4 * SETTING["pixel"]})
    assert halo_rows(**tall) != halo_rows(**SETTING)


def test_the_halo_grows_with_distance_and_accuracy():
    rows = [halo_rows(**{**SETTING, "distance": z}) for z in (0.01, 0.1, 1)]
    assert rows == sorted(set(rows))
    assert halo_rows(**SETTING, error=1e-6) > halo_rows(**SETTING, error=1e-3)


def test_lengths_are_metres_and_energies_kev():
    setting = Propagation(**SETTING)
    assert setting.wavelength == pytest.approx(0.6199e-10, rel=1e-4)
    # sqrt(z delta / mu) with mu = 4 pi beta / wavelength.
    mu = 4 * np.pi * BETA / setting.wavelength
    assert setting.decay_length == pytest.approx(np.sqrt(0.02 * DELTA / mu))


@pytest.mark.parametrize(
    ("changed", "words"),
    [
        ({}, ""),
        ({"energy": 20000.0}, "20000 keV"),
        ({"distance": 2e-5}, "next to nothing"),
        ({"pixel": 1e-3}, "next to nothing"),
        ({"pixel": (1e-6, 1e-3)}, "next to nothing"),
        ({"distance": 20e3}, "wider than the detector's 128 bins"),
    ],
)
def test_numbers_in_another_unit_are_doubted(changed, words):
    doubt = Propagation(**{**SETTING, **changed}).doubt(128)
    assert words in doubt and bool(doubt) == bool(words)


@pytest.mark.parametrize("name", list(SETTING))
@pytest.mark.parametrize("value", [0, -1.0, float("nan"), float("inf"), None, "far"])
def test_physical_numbers_that_are_missing_or_not_positive_are_told(name, value):
    seen = np.ones((1, 4, 4))
    with pytest.raises(InputError, match=f"{name} is {value}"):
        paganin(seen, **{**SETTING, name: value})
    with pytest.raises(InputError, match=name):
        halo_rows(**{**SETTING, name: value})


def test_a_beta_or_an_error_that_means_nothing_is_told():
    with pytest.raises(InputError, match="beta is 0"):
        paganin(np.ones((1, 4, 4)), **SETTING, beta=0)
    with pytest.raises(InputError, match="error is 0"):
        halo_rows(**SETTING, error=0)
    with pytest.raises(InputError, match="in metres"):
        halo_rows(**{**SETTING, "pixel": 1e-12})


@pytest.mark.parametrize(
    ("stack", "kind", "words"),
    [
        (np.ones((4, 4)), ShapeError, "wanted \\(angle, row, bin\\)"),
        (np.ones((0, 4, 4)), ShapeError, "it holds nothing"),
        (np.ones((3, 1, 4)), ShapeError, "rows above and below"),
        (np.full((1, 4, 4), np.nan), NonFiniteError, "transmission"),
        (np.full((1, 4, 4), 3000), InputError, "the mean 3000"),
        (np.ones((1, 4, 4), complex), InputError, "complex"),
    ],
)
def test_stacks_that_are_no_transmissions_are_told(stack, kind, words):
    with pytest.raises(kind, match=words):
        paganin(stack, **SETTING)


def test_nothing_left_of_the_beam_is_bounded():
    found = paganin(np.zeros((1, 4, 4)), **SETTING)
    np.testing.assert_allclose(found, -np.log(1e-7), rtol=1e-6)
