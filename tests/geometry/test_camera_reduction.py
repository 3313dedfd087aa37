"""From a lens to a pinhole: every step has its error, and they shrink where theory has them."""

from __future__ import annotations

import math

import numpy as np
import pytest

from rift_cl.errors import InputError, ShapeError
from rift_cl.io.lenses.lens_file import open_lens
from rift_cl.optics.camera_reduction import Reduction, reduce_camera
from rift_cl.optics.gaussian_lens import gaussian_lens
from rift_cl.optics.lens_prescription import LensPrescription
from rift_cl.optics.real_rays import Rays, trace
from rift_cl.sample.stock_lenses import STOCK_LENSES, stock_lens

PIXEL, SIZE = 1.85e-3, (3036, 4024)


def _losses(found: Reduction) -> dict[str, float]:
    return {loss.what: loss.value for step in found.steps for loss in step.losses}


def _stopped_down(lens: LensPrescription, opening: float) -> LensPrescription:
    return LensPrescription(lens.name, lens.surfaces, lens.stop, opening)


@pytest.mark.parametrize("name", STOCK_LENSES)
def test_every_step_says_what_it_leaves_out(name: str) -> None:
    lens = open_lens(stock_lens(name))
    found = reduce_camera(lens, 25 * 25.4 * (20 if name == "achromat" else 1), PIXEL, SIZE)
    assert len(found.steps) == 3
    for step in found.steps:
        assert len(step.losses) >= 4
        assert all(math.isfinite(loss.value) for loss in step.losses)
    assert found.camera.focal_length == found.gaussian.focal_length


def test_a_smaller_stop_makes_the_paraxial_step_better_and_the_pinhole_step_worse() -> None:
    lens = open_lens(stock_lens("singlet"))
    wide, narrow = (
        _losses(reduce_camera(_stopped_down(lens, A), 300.0, PIXEL, SIZE, 30.0)) for A in (8.0, 4.0)
    )
    spherical = "spherical aberration, focus of the marginal ray"
    assert wide[spherical] / narrow[spherical] == pytest.approx(4, rel=0.1)
    spot = "radius of its spot on the axis, RMS"
    assert wide[spot] / narrow[spot] == pytest.approx(8, rel=0.1)
    # A convex lens bends its edge too much; at third order the RMS spot is half of the largest.
    assert narrow[spherical] < 0
    working = 1 / (4.0 * (1 / 25.4 - 1 / 300))
    assert narrow[spot] * PIXEL == pytest.approx(-narrow[spherical] / (4 * working), rel=0.15)
    assert wide["cut-off of diffraction"] == pytest.approx(2 * narrow["cut-off of diffraction"])
    sharp = "depth in which blur is below one pixel"
    assert narrow[sharp] == pytest.approx(2 * wide[sharp], rel=1e-3)


def test_a_lens_with_its_stop_at_the_front_of_a_plane_back_has_equal_pupils() -> None:
    losses = _losses(reduce_camera(open_lens(stock_lens("singlet")), 300.0, PIXEL, SIZE))
    assert losses["centre of perspective before the front principal plane"] == pytest.approx(0)
    assert losses["working f-number, were the pupils taken as equal"] == pytest.approx(0, abs=1e-9)
    # The principal planes are t - t / n apart, to first order and for this shape exactly.
    n = 1.7847
    apart = losses["space between the principal planes, left out"]
    assert apart == pytest.approx(7 - 7 / n, abs=1e-3)


def test_the_pinhole_step_counts_what_the_other_modules_do() -> None:
    found = reduce_camera(open_lens(stock_lens("cooke_triplet")), 270.0, PIXEL, SIZE, 60.0)
    losses, m = _losses(found), found.camera.magnification(270.0)
    assert losses["cut-off of diffraction"] == pytest.approx(10 / (550e-6 * 270))
    assert losses["cut-off of the pixels"] == pytest.approx(m / (2 * PIXEL))
    near = losses["blur at 240 mm"]
    assert near == pytest.approx(10 * (1 - 240 / 270) * (270 / 240) * m / PIXEL, rel=1e-9)


@pytest.mark.parametrize("bad", [0.0, -270.0, math.nan, math.inf])
def test_impossible_distances_are_refused(bad: float) -> None:
    lens = open_lens(stock_lens("cooke_triplet"))
    for arguments in ((bad, PIXEL), (270.0, bad)):
        with pytest.raises(InputError):
            reduce_camera(lens, *arguments, SIZE)
    with pytest.raises(InputError):
        reduce_camera(lens, 270.0, PIXEL, SIZE, bad)


def test_a_plane_before_the_focus_a_target_at_the_lens_and_too_wide_a_stop_are_refused() -> None:
    lens = open_lens(stock_lens("cooke_triplet"))
    with pytest.raises(InputError, match="focus"):
        reduce_camera(lens, 40.0, PIXEL, SIZE)
    with pytest.raises(InputError, match="the lens"):
        reduce_camera(lens, 270.0, PIXEL, SIZE, 600.0)
    with pytest.raises(InputError, match="misses surface"):
        reduce_camera(_stopped_down(lens, 60.0), 270.0, PIXEL, SIZE)
    with pytest.raises(ShapeError, match="size"):
        reduce_camera(lens, 270.0, PIXEL, (0, 4))


@pytest.mark.parametrize("name", STOCK_LENSES)
def test_the_colours_see_one_point_that_stands_still(name: str) -> None:
    """Against real rays close to the axis, from the same point in every colour."""
    lens = open_lens(stock_lens(name))
    gaussian = gaussian_lens(lens)
    distance, places = 2.2 * gaussian.focal_length, []
    for wavelength in lens.wavelengths:
        go = np.array([[0, 1e-4 / distance, 1.0]])
        start = np.array([[0, 0, gaussian.entrance_pupil - distance]])
        last = trace(lens, Rays(start, go / np.linalg.norm(go)), wavelength)[-1]
        slope = last.direction[0, 1] / last.direction[0, 2]
        places.append(last.position[0, 2] - last.position[0, 1] / slope)
    found = _losses(reduce_camera(lens, distance, PIXEL, (100, 100), 1.0))
    apart = max(places) - min(places)
    assert found["focus between the colours"] == pytest.approx(apart, rel=1e-6)


def test_a_plane_that_equal_pupils_would_never_see_sharp_is_infinitely_far_off() -> None:
    lens = open_lens(stock_lens("double_gauss"))
    gaussian = gaussian_lens(lens)
    assert gaussian.pupil_magnification > 1.1
    for share in (1.0, 0.95):
        found = _losses(reduce_camera(lens, share * gaussian.focal_length, PIXEL, (100, 100), 1.0))
        assert found["magnification, were the pupils taken as equal"] == math.inf
