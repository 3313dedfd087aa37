"""What limits detail: each cause alone, all together, and sets of one and of many cameras."""

from __future__ import annotations

import numpy as np
import pytest
from observations_of_all_kinds import ring_of_cameras

from rift_cl.errors import InputError
from rift_cl.geometry import Aperture
from rift_cl.optics.optical_transfer import optical_transfer
from rift_cl.reference.pupil import defocused_otf
from rift_cl.sampling.coverage.density import half_sphere
from rift_cl.sampling.criteria.limits import limits
from rift_cl.sampling.targets.observations import Observations
from rift_cl.sampling.targets.target import Target

# Small enough that 60 views are never too few.
SMALL = Target((0, 0, 0), 0.01)


def test_the_constants_are_where_contrast_falls_to_a_tenth():
    observations = Observations(
        np.array([[[0, 0, 1.0]]] * 2),
        np.ones((2, 1)),
        np.zeros((2, 1)),
        np.array([[3.0], [np.inf]]),
        np.array([[0.0], [0.2]]),
    )
    found = limits(observations, SMALL)
    ends = found.diffraction[0, 0], found.focus[1, 0]
    assert optical_transfer(ends[0], 0, 3.0, 0).value == pytest.approx(0.1, abs=1e-4)
    assert optical_transfer(ends[1], 0, np.inf, 0.2).value == pytest.approx(0.1, abs=1e-4)
    np.testing.assert_allclose(found.camera[:, 0], ends, rtol=0.01)


def test_pixels_limit_a_pinhole():
    found = limits(ring_of_cameras(60), SMALL)
    # Half a cycle a pixel; a pixel is a twentieth at that distance.
    np.testing.assert_allclose(found.pixel, 10)
    assert found.cause == ("pixel",) and found.camera_cause() == ("pixel",) * 60
    assert found.reached[0] == pytest.approx(10) and found.length[0] == pytest.approx(0.1)
    assert "pixel limits detail" in found.sentence


def test_a_small_opening_is_limited_by_diffraction():
    aperture = Aperture(radius=0.01, focus=10.0, wavelength=0.001)
    found = limits(ring_of_cameras(60, aperture=aperture), SMALL)
    assert found.cause == ("diffraction",)
    # 2 R / (wavelength z) is 2 cycles per unit.
    assert found.diffraction[0, 0] == pytest.approx(2 * 0.80538)
    assert found.camera[0, 0] < found.diffraction[0, 0]


def test_a_wide_opening_is_limited_by_depth_of_field_away_from_its_focus():
    aperture = Aperture(radius=1.0, focus=10.0)
    target = Target((0, 0, 0), 0.01, points=[[0, 0, 0], [0, 0, 1.0], [2.0, 0, 0]])
    found = limits(ring_of_cameras(60, aperture=aperture), target)
    assert found.cause[0] == "pixel" and found.cause[2] == "depth of field"
    assert found.focus[0, 0] > 1e9


def lens(cutoff, blur, pixel=0.0):
    one = np.ones((1, 1))
    return Observations(np.array([[[0, 0, 1.0]]]), one, pixel * one, cutoff * one, blur * one)


@pytest.mark.parametrize("waves", [0.6, 1.0, 2.0, 6.0])
def test_the_disc_ends_where_it_passes_a_tenth_with_diffraction_taken_off(waves):
    """A blur disc of 8 W / cutoff is a defocus of W wavelengths at the pupil's edge."""
    found = limits(lens(3.0, 8 * waves / 3.0), SMALL).focus[0, 0]
    both, light = (optical_transfer(found, 0, 3.0, blur).value for blur in (8 * waves / 3.0, 0))
    assert both / light == pytest.approx(0.1, abs=1e-4)


@pytest.mark.parametrize("waves", [0.1, 0.3, 0.7, 1.0, 3.0])
def test_detail_ends_where_that_of_a_real_pupil_does(waves):
    found = limits(lens(3.0, 8 * waves / 3.0), SMALL)
    v = np.linspace(0, 1, 2001)
    first = v[np.argmax(defocused_otf(v, waves) < 0.1)]
    assert found.camera[0, 0] == pytest.approx(3.0 * first, rel=0.04)
    # Little defocus alone takes no detail; between, where both weaken it, the stronger is named.
    assert np.isinf(found.focus[0, 0]) == (waves < 0.54)
    assert found.camera_cause() == ("diffraction" if waves < 0.5 else "depth of field",)


def test_defocus_that_halves_detail_is_named_though_alone_it_would_not_end_it():
    found = limits(lens(3.0, 8 * 0.53 / 3.0), SMALL)
    assert np.isinf(found.focus[0, 0]) and found.camera[0, 0] < 0.6 * found.diffraction[0, 0]
    assert found.camera_cause() == ("depth of field",) and found.cause == ("depth of field",)


def test_few_views_of_a_large_target_limit_it():
    found = limits(ring_of_cameras(6), Target((0, 0, 0), 1.0))
    assert found.cause == ("number of views",)
    assert found.reached[0] < found.camera.min()
    assert "number of views limits" in found.sentence


def test_one_camera_and_bare_directions_work():
    one = limits(ring_of_cameras(1), Target((0, 0, 0), 1.0))
    # One slice holds nine tenths of all directions up to 1 / (2 D 0.9).
    assert one.reached[0] == pytest.approx(0.5 / 0.9, rel=0.01)
    bare = limits(Observations.along(half_sphere(100)), Target((0, 0, 0), 1.0))
    assert bare.cause == ("number of views",) and np.isinf(bare.camera).all()
    assert set(bare.camera_cause()) == {""}
    assert "any detail" in bare.sentence


def test_all_limits_together_are_never_beyond_the_first():
    aperture = Aperture(radius=0.3, focus=9.5, wavelength=0.01)
    found = limits(ring_of_cameras(12, aperture=aperture), SMALL)
    first = np.minimum(np.minimum(found.pixel, found.diffraction), found.focus)
    assert (found.camera <= first * (1 + 1e-12)).all() and (found.camera > 0).all()


def test_a_camera_that_sees_nothing_does_not_count():
    cameras = ring_of_cameras(2, focal=4000.0)
    target = Target((0, 0, 0), 1.0, points=[[0, 0, 0]])
    found = limits(cameras, target, weights=[1, 0])
    assert found.camera[1, 0] == 0 and found.camera_cause() == ("pixel", "")
    with pytest.raises(InputError, match="outside every picture"):
        limits(cameras, target, weights=[0, 0])


def test_a_point_outside_every_picture_is_said_to_be_so():
    target = Target((0, 0, 0), 1.0, points=[[0, 0, 0], [0, 0, 50]])
    found = limits(ring_of_cameras(3), target)
    assert found.cause[1] == "field of view" and found.reached[1] == 0 and found.reached[0] > 0
    assert np.isinf(found.length[1]) and "No picture shows point 1" in found.sentence
