"""Depth of field, and the best aperture for a deep target, against the exact OTF."""

from __future__ import annotations

import math

import numpy as np
import pytest

from rift_cl.errors import InputError
from rift_cl.geometry import Aperture
from rift_cl.optics.depth_of_field import (
    BEST_APERTURE,
    BEST_CUTOFF,
    SAFE_APERTURE,
    SAFE_CUTOFF,
    diffraction_depth,
    finite_depth_optimum,
    sharp_range,
)
from rift_cl.optics.optical_transfer import incoherent_cutoff
from rift_cl.reference.pupil import (
    defocus_mtf,
    defocused_otf,
    diffraction_mtf,
    worst_depth_cutoff,
)

GREEN = 550e-6


@pytest.mark.parametrize("focus", [150.0, 900.0])
def test_blur_at_the_limits_is_what_was_allowed(focus: float) -> None:
    focal, aperture = 8000.0, Aperture(2.0, focus)
    found = sharp_range(4.0, focus, 1.5, focal)
    assert found.near < focus < found.far
    for z in found:
        assert aperture.blur(z) * focal / z == pytest.approx(1.5)
    assert found.depth == found.far - found.near


@pytest.mark.parametrize(("N", "depth"), [(4, 20), (8, 80), (16, 321)])
def test_the_depth_that_diffraction_grants_grows_with_the_square_of_n(
    N: float, depth: float
) -> None:
    found = diffraction_depth(16 / N, 270, GREEN)
    assert found == pytest.approx(depth, abs=0.5)
    theta = math.atan(16 / N / 540)
    assert found == pytest.approx(GREEN / (1 - math.cos(theta)), rel=1e-6)


@pytest.mark.parametrize(("depth", "distance"), [(60, 270), (200, 1000), (20, 1000)])
def test_the_best_aperture_for_a_deep_target_is_where_the_exact_otf_has_it(
    depth: float, distance: float
) -> None:
    """One curve for every target: A over z sqrt(2 wavelength / depth)."""
    unit = distance * math.sqrt(2 * GREEN / depth)
    widths = np.arange(0.6, 3, 0.05)
    cutoffs = [worst_depth_cutoff(w * unit, distance, depth, GREEN) for w in widths]
    best = int(np.argmax(cutoffs))
    assert widths[best] == pytest.approx(BEST_APERTURE, abs=0.06)
    assert max(cutoffs) * math.sqrt(GREEN * depth) == pytest.approx(BEST_CUTOFF, abs=0.01)
    found = finite_depth_optimum(depth, distance, GREEN)
    assert found.diameter == pytest.approx(BEST_APERTURE * unit)
    exact = worst_depth_cutoff(found.diameter, distance, depth, GREEN)
    assert found.cutoff == pytest.approx(exact, rel=0.01)


def test_the_safe_aperture_keeps_clear_of_the_fall() -> None:
    unit = 270 * math.sqrt(2 * GREEN / 60)
    scaled = {
        w: worst_depth_cutoff(w * unit, 270, 60, GREEN) * math.sqrt(GREEN * 60)
        for w in (SAFE_APERTURE, BEST_APERTURE, 2.0)
    }
    assert scaled[SAFE_APERTURE] == pytest.approx(SAFE_CUTOFF, abs=0.01)
    assert scaled[2.0] < 0.7 * scaled[BEST_APERTURE]
    assert finite_depth_optimum(60, 270, GREEN, safe=True).cutoff == pytest.approx(
        SAFE_CUTOFF / math.sqrt(GREEN * 60)
    )


def test_the_simple_product_would_stop_the_lens_down_too_far() -> None:
    """Why a planner of apertures wants the cut-off in its blur disc: 1.14 for 1.78."""
    v, best = np.linspace(0, 1, 4001), {}
    for cutoff in (math.inf, 1.0):
        widths = np.arange(0.8, 2.2, 0.02)
        # Of A over A*: defocus is w^2 / 8 wavelengths, the cut-off w sqrt(2 / (wavelength depth)).
        found = [
            w * math.sqrt(2) * v[np.argmax(diffraction_mtf(v) * defocus_mtf(v, w**2, cutoff) < 0.1)]
            for w in widths
        ]
        best[cutoff] = widths[int(np.argmax(found))], max(found)
    assert best[math.inf] == pytest.approx((1.14, 1.00), abs=0.02)
    assert best[1.0] == pytest.approx((1.74, 1.80), abs=0.03)


def test_neither_distance_nor_lens_moves_the_limit_but_planes_of_focus_do() -> None:
    near, far = (finite_depth_optimum(60, z, GREEN) for z in (270, 2700))
    assert near.cutoff == far.cutoff == pytest.approx(10.1, abs=0.05)
    four = finite_depth_optimum(60, 270, GREEN, planes=4)
    assert four.cutoff == pytest.approx(2 * near.cutoff)


@pytest.mark.parametrize(
    ("safe", "missing"), [(False, (0.02, 0.05, 0.24)), (True, (0.04, 0.08, 0.15))]
)
def test_the_worse_end_of_a_deep_target_is_resolved_as_much_less_as_is_said(
    safe: bool, missing: tuple[float, ...]
) -> None:
    """Each end at its own distance, in light and in defocus: A^2 |1/end - 1/focus| / 8."""
    v, depth = np.linspace(0, 1, 4001), 60.0
    for share, wanted in zip((0.1, 0.2, 0.4), missing, strict=True):
        distance = depth / share
        found, ends = finite_depth_optimum(depth, distance, GREEN, safe=safe), []
        for end in (distance - depth / 2, distance + depth / 2):
            waves = found.diameter**2 * abs(1 / end - 1 / distance) / (8 * GREEN)
            first = v[np.argmax(defocused_otf(v, waves) < 0.1)]
            ends.append(float(first) * incoherent_cutoff(found.diameter, end, GREEN))
        assert 1 - min(ends) / found.cutoff == pytest.approx(wanted, abs=0.006)


@pytest.mark.parametrize("bad", [0, -1.0, math.nan, "deep"])
def test_lengths_are_positive(bad: float) -> None:
    for call in (
        lambda: sharp_range(bad, 100, 1, 100),
        lambda: sharp_range(1, bad, 1, 100),
        lambda: sharp_range(1, np.array([1.0, 2.0]), 1, 100),  # type: ignore[arg-type]
        lambda: diffraction_depth(1, bad, GREEN),
        lambda: finite_depth_optimum(bad, 270, GREEN),
        lambda: finite_depth_optimum(60, 270, GREEN, planes=bad),  # type: ignore[arg-type]
        lambda: worst_depth_cutoff(1, 270, 60, bad),
    ):
        with pytest.raises(InputError):
            call()


def test_a_target_does_not_reach_to_the_lens_and_levels_lie_between_nothing_and_all() -> None:
    with pytest.raises(InputError, match="the lens"):
        finite_depth_optimum(600, 270, GREEN)
    with pytest.raises(InputError, match="level"):
        worst_depth_cutoff(4, 270, 60, GREEN, level=1.0)


@pytest.mark.parametrize("waves", [0.05, 0.6, 3.0, 200.0, 9000.0])
@pytest.mark.parametrize("level", [0.02, 0.1, 0.7])
def test_the_cutoff_is_where_the_exact_otf_crosses_the_level(waves: float, level: float) -> None:
    """Also where the first zero lies a thousand times before the cut-off."""
    depth = waves * 16 * GREEN * 270**2 / 4.0**2
    cutoff = incoherent_cutoff(4.0, 270, GREEN)
    share = worst_depth_cutoff(4.0, 270, depth, GREEN, level) / cutoff
    assert defocused_otf(share, waves) == pytest.approx(level, rel=1e-3)
    assert (defocused_otf(np.linspace(0, share, 200)[:-1], waves) > level).all()
