"""Equations 1 to 5 of the paper: what is printed, what was corrected, and that the parts agree."""

from __future__ import annotations

import math

import numpy as np
import pytest

from rift_cl.errors import InputError, NonFiniteError, ShapeError
from rift_cl.geometry.camera_type import CameraType
from rift_cl.optics.depth_of_field import diffraction_depth
from rift_cl.reference.paper_equations import (
    axial_band,
    axial_frequency,
    chief_ray,
    image_cutoff,
    missing_cone,
    passed_band,
    to_image_frequency,
    to_object_frequency,
)

GREEN = 550e-6


def test_equation_1_is_a_unit_vector_towards_the_aperture() -> None:
    rays = chief_ray([[0, 0, 0], [3, 0, 0]], [3, 0, 4])
    np.testing.assert_allclose(rays, [[0.6, 0, 0.8], [0, 0, 1]])


def test_equation_2_as_printed_is_the_carrier_plus_the_coherent_cutoff() -> None:
    point, aperture, A = np.array([1.0, -2.0, 0.0]), np.array([5.0, 3.0, 270.0]), 4.0
    band = passed_band(point, aperture, A, GREEN)
    printed = (aperture[:2] + A / 2 - point[:2]) / (GREEN * 270)
    np.testing.assert_allclose(band.carrier + band.coherent, printed)
    assert band.incoherent == 2 * band.coherent == pytest.approx(26.94, abs=0.01)


@pytest.mark.parametrize("P", [0.8, 1.0, 1.3])
def test_equation_3_corrected_agrees_with_2_and_4_and_as_printed_it_does_not(P: float) -> None:
    camera = CameraType("c", 16.0, 4.0, 2e-3, (4, 4), pupil_magnification=P)
    z = 60.0
    m = camera.magnification(z)
    in_object = passed_band([0, 0, 0], [0, 0, z], 4.0, GREEN).incoherent
    in_image = image_cutoff(4.0, -m, GREEN, P)
    assert in_image == pytest.approx(in_object / m)
    assert to_object_frequency(in_image, m) == pytest.approx(in_object)
    printed = 4.0 / (GREEN * 4.0 * m * 4.0)
    assert abs(printed / in_image - 1) > 0.5
    assert image_cutoff(4.0, 0.0, GREEN) == pytest.approx(1 / (GREEN * 4))


def test_equation_4_keeps_the_sign_and_is_its_own_inverse() -> None:
    xi = np.array([-3.0, 0.0, 7.0])
    np.testing.assert_allclose(to_object_frequency(to_image_frequency(xi, -0.2), -0.2), xi)
    np.testing.assert_allclose(to_image_frequency(xi, -0.5), -2 * xi)


def test_equation_5_is_a_sphere_and_nothing_beyond_it_travels() -> None:
    K = 1.33 / GREEN
    xi, eta = 0.3 * K, -0.4 * K
    zeta = axial_frequency(xi, eta, GREEN, 1.33)
    assert xi**2 + eta**2 + zeta**2 == pytest.approx(K**2)
    assert np.isnan(axial_frequency(1.01 * K, 0, GREEN, 1.33))


def test_the_3d_otf_is_the_difference_set_of_the_cap() -> None:
    """No two points of the cap differ by more than the band, and some by nearly all of it."""
    NA, rng = 0.5, np.random.default_rng(1)
    a = NA / GREEN
    radius, angle = a * np.sqrt(rng.random((2, 200_000))), 2 * np.pi * rng.random((2, 200_000))
    # Half of the pairs lie on one diameter, and one of their points on the edge.
    angle[1, ::2], radius[1, ::2] = angle[0, ::2], a
    x, y = radius * np.cos(angle), radius * np.sin(angle)
    z = axial_frequency(x, y, GREEN)
    rho, zeta = np.hypot(x[0] - x[1], y[0] - y[1]), np.abs(z[0] - z[1])
    limit = axial_band(rho, NA, GREEN)
    assert (zeta <= limit * (1 + 1e-9) + 1e-6).all()
    for low in np.linspace(0.1, 0.9, 5) * a:
        near = (rho > low) & (rho < low + 0.05 * a)
        assert (zeta[near] / limit[near]).max() > 0.99


def test_the_axial_band_has_the_cone_the_extent_and_the_cutoff_of_theory() -> None:
    NA, a = 0.3, 0.3 / GREEN
    assert axial_band([0, 2 * a, 3 * a], NA, GREEN).tolist() == pytest.approx([0, 0, 0])
    most = (1 - math.sqrt(1 - NA**2)) / GREEN
    assert axial_band(a, NA, GREEN) == pytest.approx(most)
    assert axial_band(np.linspace(0, 2 * a, 201), NA, GREEN).max() == pytest.approx(most)
    slope = axial_band(1e-6 * a, NA, GREEN) / (1e-6 * a)
    assert math.pi / 2 - math.atan(slope) == pytest.approx(missing_cone(NA), abs=1e-5)


def test_stopping_down_shrinks_the_axial_band_and_that_is_the_depth_of_field() -> None:
    """Against the paper's reading of equation 5: less along the axis, hence more depth."""
    for N in (4, 8, 16):
        NA = math.sin(math.atan(16 / N / 540))
        band = axial_band(NA / GREEN, NA, GREEN)
        assert diffraction_depth(16 / N, 270, GREEN) == pytest.approx(1 / band, rel=1e-9)
        small = axial_band(NA / 2 / GREEN, NA / 2, GREEN)
        assert small == pytest.approx(band / 4, rel=1e-3)
        assert axial_frequency(NA / 2 / GREEN, 0, GREEN) > axial_frequency(NA / GREEN, 0, GREEN)


def test_hostile_values_are_refused_in_words() -> None:
    with pytest.raises(InputError, match="in the aperture"):
        chief_ray([1, 2, 3], [1, 2, 3])
    with pytest.raises(ShapeError, match="point"):
        chief_ray([1, 2], [1, 2, 3])
    with pytest.raises(ShapeError, match="fit"):
        chief_ray([[1, 2, 3]] * 2, [[1, 2, 4]] * 3)
    with pytest.raises(NonFiniteError, match="aperture"):
        chief_ray([1, 2, 3], [1, 2, math.nan])
    with pytest.raises(InputError, match="one depth"):
        passed_band([[0, 0, 0], [0, 0, 1]], [0, 0, 5], 1, GREEN)
    with pytest.raises(InputError, match="one depth"):
        passed_band([0, 0, 5], [0, 0, 5], 1, GREEN)
    with pytest.raises(InputError, match="wavelength"):
        passed_band([0, 0, 0], [0, 0, 5], 1, 0.0)
    with pytest.raises(InputError, match="magnification"):
        to_image_frequency(1.0, 0.0)
    with pytest.raises(InputError, match="magnification"):
        image_cutoff(4, math.nan, GREEN)
    with pytest.raises(InputError, match="f_number"):
        image_cutoff(-4, 1.0, GREEN)
    for NA in (0.0, 1.0, 1.5, math.nan):
        with pytest.raises(InputError, match="numerical_aperture"):
            axial_band(1.0, NA, GREEN)
        with pytest.raises(InputError, match="numerical_aperture"):
            missing_cone(NA)
