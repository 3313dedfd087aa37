"""Cut-offs and MTFs: the textbook's values, and how far the simple product is from the truth."""

from __future__ import annotations

import math

import numpy as np
import pytest

from rift_cl.errors import InputError, ShapeError
from rift_cl.geometry import Aperture
from rift_cl.optics.optical_transfer import coherent_cutoff, incoherent_cutoff, optical_transfer
from rift_cl.reference.pupil import (
    annular_mtf,
    defocus_mtf,
    defocus_waves,
    defocused_otf,
    diffraction_mtf,
    numerical_otf,
)

SHARE = np.linspace(0, 1, 1001)


def _product_error(waves: float, cutoff: float = math.inf) -> np.ndarray:
    """Blur disc times diffraction minus the exact MTF; the disc's argument is 8 pi W v."""
    product = diffraction_mtf(SHARE) * defocus_mtf(SHARE, 8 * waves, cutoff)
    return product - np.abs(defocused_otf(SHARE, waves))


@pytest.mark.parametrize(("N", "coherent"), [(4, 13.5), (8, 6.7), (16, 3.4)])
def test_cutoffs_are_those_of_the_papers_camera(N: float, coherent: float) -> None:
    """f = 16 mm, 270 mm away, 550 nm: in line pairs per millimetre."""
    A = 16 / N
    assert coherent_cutoff(A, 270, 550e-6) == pytest.approx(coherent, abs=0.05)
    assert incoherent_cutoff(A, 270, 550e-6) == 2 * coherent_cutoff(A, 270, 550e-6)
    assert Aperture(A / 2, 100.0, 550e-6).cutoff(270) == pytest.approx(
        incoherent_cutoff(A, 270, 550e-6)
    )


def test_mtfs_begin_at_one_and_end_at_their_cutoffs() -> None:
    assert diffraction_mtf([0, 1, 1.5]).tolist() == [1, 0, 0]
    assert diffraction_mtf(0.5) == pytest.approx(0.39100, abs=1e-5)
    assert defocus_mtf([0.0, 3.8317059702 / math.pi], 1.0) == pytest.approx([1, 0], abs=1e-9)
    np.testing.assert_array_equal(diffraction_mtf(-SHARE), diffraction_mtf(SHARE))


def test_coverage_counts_with_the_same_mtf() -> None:
    k = np.linspace(0, 60, 241)
    for cutoff, pixel, blur in ((30.0, 0.02, 0.05), (math.inf, 0.03, 0.0), (50.0, 0.0, 0.4)):
        lens = diffraction_mtf(k / cutoff) * defocus_mtf(k, blur, cutoff)
        here = lens * np.abs(np.sinc(k * pixel))
        there = optical_transfer(k, pixel, cutoff, blur).value
        np.testing.assert_allclose(there, here, atol=1e-9)


def test_the_exact_otf_is_the_autocorrelation_of_the_pupil() -> None:
    n = 401
    x = np.linspace(-1, 1, n)
    square = x[:, None] ** 2 + x**2
    v = np.arange(n) * (x[1] - x[0]) / 2
    for waves in (0.0, 0.4, 1.3, 4.0):
        pupil = (square <= 1) * np.exp(2j * np.pi * waves * square)
        found = numerical_otf(pupil)[0, :n]
        np.testing.assert_allclose(found, defocused_otf(v, waves), atol=5e-4)
    found = numerical_otf(((square <= 1) & (square >= 0.49)).astype(float))[0, :n]
    np.testing.assert_allclose(found, annular_mtf(v, 0.7), atol=2e-3)


def test_the_exact_otf_has_its_limits() -> None:
    np.testing.assert_allclose(defocused_otf(SHARE, 0), diffraction_mtf(SHARE), atol=1e-12)
    np.testing.assert_allclose(defocused_otf(SHARE, 1.7), defocused_otf(SHARE, -1.7))
    # Far out of focus and at low frequencies, light goes straight: the blur disc.
    assert np.abs(_product_error(30.0)).max() < 0.01
    assert defocused_otf([0, 1], 3.0).tolist() == pytest.approx([1, 0], abs=1e-12)


def test_doubling_the_nodes_of_the_quadrature_changes_nothing() -> None:
    """Its error is that of rounding: the integrand is smooth."""
    v = np.linspace(0, 1, 21)
    for waves in (0.3, 12.0):
        t = (np.pi / 2 - np.arcsin(v)) / 5000
        angles = np.arcsin(v) + t * (np.arange(5000)[:, None] + 0.5)
        sums = np.cos(8 * np.pi * waves * v * (np.sin(angles) - v)) * np.cos(angles) ** 2
        np.testing.assert_allclose(defocused_otf(v, waves), 4 / np.pi * t * sums.sum(0), atol=2e-5)


def test_the_product_is_pessimistic_by_up_to_a_quarter() -> None:
    """What a user of coverage should know: exact with no defocus, worst at a third of a wave."""
    least, most = {}, {}
    for waves in (0.0, 0.1, 0.25, 0.35, 0.5, 1.0, 2.0, 5.0, 30.0):
        error = _product_error(waves)
        least[waves], most[waves] = error.min(), error.max()
    assert min(least.values()) == least[0.35] == pytest.approx(-0.248, abs=0.002)
    assert max(most.values()) == most[1.0] == pytest.approx(0.096, abs=0.002)
    assert least[0.1] == pytest.approx(-0.062, abs=0.002)
    assert least[1.0] == pytest.approx(-0.130, abs=0.002)
    assert least[5.0] == pytest.approx(-0.037, abs=0.002)
    assert least[0.0] == pytest.approx(0, abs=1e-9)


def test_with_the_cutoff_in_the_blur_the_product_is_right_to_two_hundredths() -> None:
    worst = max(np.abs(_product_error(w, 1.0)).max() for w in np.geomspace(0.05, 20, 24))
    assert worst < 0.017


def test_blur_and_waves_are_two_names_for_defocus() -> None:
    """pi b k = 8 pi W v, with the blur disc of ``Aperture``."""
    aperture = Aperture(2.0, 270.0, 550e-6)
    for z in (200.0, 260.0, 300.0):
        waves = float(defocus_waves(4.0, z, 270.0, 550e-6))
        edge = aperture.blur(z) * aperture.cutoff(z)
        assert edge == pytest.approx(8 * abs(waves))
    assert defocus_waves(4.0, 200.0, math.inf, 550e-6) == pytest.approx(16 / (8 * 550e-6) / 200)


def test_a_ring_flattens_the_band_but_no_pupil_is_a_high_pass() -> None:
    """The figures of "Natural filter": inner radius 0.7."""
    assert annular_mtf([0.5, 0.85], 0.7) == pytest.approx([0.119, 0.133], abs=1e-3)
    assert diffraction_mtf([0.5, 0.85]) == pytest.approx([0.391, 0.068], abs=1e-3)
    np.testing.assert_allclose(annular_mtf(SHARE, 0), diffraction_mtf(SHARE))
    rng = np.random.default_rng(0)
    for _ in range(5):
        otf = numerical_otf(rng.random((32, 32)) * np.exp(2j * np.pi * rng.random((32, 32))))
        assert np.abs(otf).max() == pytest.approx(1) == abs(otf[0, 0])


def test_full_minus_half_the_aperture_is_a_band_pass() -> None:
    """Two exposures of the same light: the difference is zero at zero."""
    v = np.array([0, 0.1, 0.25, 0.5, 0.7])
    band = diffraction_mtf(v) - diffraction_mtf(2 * v)
    assert band == pytest.approx([0, 0.126, 0.294, 0.391, 0.188], abs=1e-3)


@pytest.mark.parametrize("bad", [0, -1, math.nan, math.inf, "wide", None])
def test_lengths_are_positive(bad: float) -> None:
    for arguments in ((bad, 1, 1), (1, bad, 1), (1, 1, bad)):
        with pytest.raises(InputError):
            incoherent_cutoff(*arguments)
    with pytest.raises(InputError, match=r"wavelength|diameter|focus"):
        defocus_waves(1, 1.0, 0.0 if bad == math.inf else bad, 1)


def test_hostile_values_are_refused_in_words() -> None:
    with pytest.raises(InputError, match="frequencies"):
        diffraction_mtf([math.nan])
    with pytest.raises(InputError, match="frequencies"):
        defocused_otf(["much"], 1.0)
    with pytest.raises(InputError, match="blur"):
        defocus_mtf(1.0, math.nan)
    with pytest.raises(InputError, match="cutoff"):
        defocus_mtf(1.0, 1.0, 0)
    with pytest.raises(InputError, match="cutoff"):
        defocus_mtf(1.0, 1.0, np.array([1.0, 2.0]))  # type: ignore[arg-type]
    with pytest.raises(InputError, match="waves"):
        defocused_otf(0.5, 1e6)
    with pytest.raises(InputError, match="obstruction"):
        annular_mtf(0.5, 1.0)
    with pytest.raises(ShapeError, match="shape"):
        numerical_otf(np.ones((4, 5)))
    with pytest.raises(InputError, match="zero"):
        numerical_otf(np.zeros((4, 4)))


def test_strong_defocus_is_the_blur_disc_of_geometry() -> None:
    """As far as the quadrature is allowed to go, where it has many turns of the phase."""
    for waves in (300.0, 1e4):
        v = np.linspace(0, 6, 25) / (8 * np.pi * waves)
        disc = defocus_mtf(v, 8 * waves, 1.0)
        np.testing.assert_allclose(np.abs(defocused_otf(v, waves)), disc, atol=0.01)
    assert abs(defocused_otf(0.5, 1e4)) < 1e-4
