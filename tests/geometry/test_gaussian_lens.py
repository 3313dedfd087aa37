"""The y-nu reduction: cardinal points and pupils against exact and independent values."""

from __future__ import annotations

import math
from fractions import Fraction

import pytest

from rift_cl.errors import InputError
from rift_cl.io.lenses.lens_file import open_lens
from rift_cl.optics.gaussian_lens import GaussianLens, gaussian_lens
from rift_cl.optics.glass import Glass
from rift_cl.optics.lens_prescription import LensPrescription, Surface
from rift_cl.sample.stock_lenses import STOCK_LENSES, stock_lens

# Computed with optiland 0.6.3 (its paraxial module) from the same published prescriptions, in the
# unit of the publication: f, P and entrance pupil from the first vertex, P' and exit pupil from
# the image plane, both pupil diameters, and where that image plane lies.
PEERS = {
    "cooke_triplet": (
        (49.999783071431914, 12.654110097005727, 11.512158673746795, 10.0),
        (-49.7927055124731, -50.961347703805274, 10.233729452318345, 42.20778),
    ),
    "double_gauss": (
        (100.00374787083724, 70.6829897381641, 57.911999997719626, 20.00074957416745),
        (-100.00373763164491, -114.64441695254195, 22.928885438346853, 61.487536),
    ),
    "singlet": (
        (25.397595913429043, 0.0, 0.0, 12.7),
        (-25.402183998762048, -25.402183998762045, 12.7, 21.48),
    ),
    "achromat": (
        (20.0059952749227, 0.073790045280262, 0.0, 3.33433254582045),
        (-20.0059952749227, -20.080058494732313, 3.3466764157887186, 19.606992633759062),
    ),
}


def _singlet(r1: float, r2: float, t: float, n: float, **kinds: object) -> LensPrescription:
    surfaces = (Surface(r1, t, Glass("g", "constant", (n,))), Surface(r2, 0.0))
    return LensPrescription("lens", surfaces, 0, 1.0, **kinds)  # type: ignore[arg-type]


@pytest.mark.parametrize("name", STOCK_LENSES)
def test_stock_lenses_have_the_cardinal_points_of_an_independent_program(name: str) -> None:
    lens = gaussian_lens(open_lens(stock_lens(name)))
    unit = 25.4 if name == "achromat" else 1.0
    (f, P, pupil, diameter), (rear, exit_pupil, exit_diameter, image) = PEERS[name]
    close = {"rel": 1e-9, "abs": 1e-9}
    assert lens.focal_length / unit == pytest.approx(f, **close)
    assert lens.front_principal / unit == pytest.approx(P, **close)
    assert lens.entrance_pupil / unit == pytest.approx(pupil, **close)
    assert lens.pupil_diameter / unit == pytest.approx(diameter, **close)
    assert lens.rear_principal / unit == pytest.approx(rear + image, **close)
    assert lens.exit_pupil / unit == pytest.approx(exit_pupil + image, **close)
    assert lens.exit_pupil_diameter / unit == pytest.approx(exit_diameter, **close)


def test_the_triplet_is_that_of_the_books_to_six_digits() -> None:
    lens = gaussian_lens(open_lens(stock_lens("cooke_triplet")))
    assert lens.focal_length == pytest.approx(49.999783, abs=1e-6)
    assert lens.front_principal == pytest.approx(12.654110, abs=1e-6)
    assert lens.rear_principal - 42.20778 == pytest.approx(-49.792706, abs=1e-6)
    assert lens.rear_focus - 42.20778 == pytest.approx(0.207078, abs=1e-6)


@pytest.mark.parametrize("radii", [(50, -50), (30, 80), (40, math.inf), (math.inf, -25)])
def test_a_singlet_obeys_the_lens_makers_formula(radii: tuple[float, float]) -> None:
    """1/f = (n-1)(1/R1 - 1/R2 + (n-1) t / (n R1 R2)), the principal planes by their formulas."""
    n, t = 1.5, 6.0
    c1, c2 = 1 / radii[0], 1 / radii[1]
    f = 1 / ((n - 1) * (c1 - c2 + (n - 1) * t * c1 * c2 / n))
    lens = gaussian_lens(_singlet(*radii, t, n))
    assert lens.focal_length == pytest.approx(f, rel=1e-12)
    assert lens.front_principal == pytest.approx(-f * (n - 1) * t * c2 / n, abs=1e-12)
    assert lens.rear_principal == pytest.approx(-f * (n - 1) * t * c1 / n, abs=1e-12)


def test_matrices_in_exact_fractions_agree() -> None:
    """Three surfaces and a stop between them, by products of rational matrices."""
    media = [Fraction(1), Fraction(3, 2), Fraction(8, 5), Fraction(1)]
    radii, ways = [Fraction(20), Fraction(-15), Fraction(-90)], [Fraction(4), Fraction(2)]

    def product(*factors: list[list[Fraction]]) -> list[list[Fraction]]:
        (a, b), (c, d) = factors[0]
        for (e, f), (g, h) in factors[1:]:
            a, b, c, d = a * e + b * g, a * f + b * h, c * e + d * g, c * f + d * h
        return [[a, b], [c, d]]

    bend = [
        [[Fraction(1), Fraction(0)], [-(media[i + 1] - media[i]) / radii[i], Fraction(1)]]
        for i in range(3)
    ]
    go = [[[Fraction(1), ways[i] / media[i + 1]], [Fraction(0), Fraction(1)]] for i in range(2)]
    whole = product(bend[2], go[1], bend[1], go[0], bend[0])
    before = product(go[1], bend[1], go[0], bend[0])
    surfaces = [
        Surface(float(r), float(t), Glass("g", "constant", (float(n),)) if n > 1 else None)
        for r, t, n in zip(radii, [*ways, Fraction(0)], media[1:], strict=True)
    ]
    lens = gaussian_lens(LensPrescription("three", tuple(surfaces), 2, 1.0))
    assert lens.focal_length == pytest.approx(float(-1 / whole[1][0]), rel=1e-13)
    assert lens.front_principal == pytest.approx(float((whole[1][1] - 1) / whole[1][0]), rel=1e-12)
    assert lens.rear_principal == pytest.approx(float((1 - whole[0][0]) / whole[1][0]), rel=1e-12)
    assert lens.entrance_pupil == pytest.approx(float(before[0][1] / before[0][0]), rel=1e-12)
    assert lens.stop_radius == pytest.approx(float(before[0][0]) / 2, rel=1e-12)
    # The stop at the last surface is seen through that surface alone, whose vertex it is in.
    assert lens.exit_pupil == pytest.approx(0, abs=1e-12)


@pytest.mark.parametrize("name", STOCK_LENSES)
def test_pupils_are_images_of_each_other(name: str) -> None:
    """P = f / (f - s) with the pupil s before P, and both obey Newton's equation."""
    lens = gaussian_lens(open_lens(stock_lens(name)))
    f, P = lens.focal_length, lens.pupil_magnification
    assert lens.front_principal - lens.entrance_pupil == pytest.approx(f * (1 - 1 / P), abs=1e-9)
    product = (lens.entrance_pupil - lens.front_focus) * (lens.exit_pupil - lens.rear_focus)
    assert product == pytest.approx(-(f**2), rel=1e-9)


@pytest.mark.parametrize("name", STOCK_LENSES)
def test_the_camera_that_is_made_images_where_the_lens_does(name: str) -> None:
    lens = gaussian_lens(open_lens(stock_lens(name)))
    distance = 20 * lens.focal_length
    from_principal = distance + lens.front_principal - lens.entrance_pupil
    image = 1 / (1 / lens.focal_length - 1 / from_principal)
    assert lens.image_position(distance) == pytest.approx(lens.rear_principal + image, rel=1e-9)
    assert lens.image_position(math.inf) == lens.rear_focus
    camera = lens.camera_type(2e-3, (8, 8), unit=1e-3)
    assert camera.magnification(distance * 1e-3) == pytest.approx(image / from_principal, rel=1e-9)
    assert camera.pupil_radius == pytest.approx(lens.pupil_diameter * 0.5e-3)
    assert camera.wavelength == pytest.approx(lens.wavelength * 1e-3)
    assert camera.f_number == pytest.approx(lens.f_number)


def test_openings_may_be_given_in_three_ways() -> None:
    surfaces = open_lens(stock_lens("cooke_triplet")).surfaces
    by_pupil = gaussian_lens(LensPrescription("a", surfaces, 3, 10.0))
    by_number = LensPrescription("b", surfaces, 3, by_pupil.f_number, "f_number")
    by_stop = LensPrescription("c", surfaces, 3, 2 * by_pupil.stop_radius, "stop")
    for other in (by_number, by_stop):
        assert gaussian_lens(other).pupil_diameter == pytest.approx(10.0)


def test_another_colour_has_another_focus_and_the_same_stop() -> None:
    lens = open_lens(stock_lens("singlet"))
    green, blue = gaussian_lens(lens), gaussian_lens(lens, lens.wavelengths[0])
    assert blue.focal_length < green.focal_length
    assert blue.stop_radius == green.stop_radius
    f = lens.surfaces[0].radius / (lens.indices(lens.wavelengths[0])[1] - 1)
    assert blue.focal_length == pytest.approx(f)


@pytest.mark.parametrize(
    ("lens", "word"),
    [
        (_singlet(-50, 50, 3, 1.5), "diverges"),
        (_singlet(math.inf, math.inf, 3, 1.5), "infinity"),
        # The stop in the front focus of all that is behind it.
        (
            LensPrescription(
                "t",
                (
                    Surface(math.inf, 100.0),
                    Surface(50.0, 1e-9, Glass("g", "constant", (1.5,))),
                    Surface(math.inf, 0.0),
                ),
                0,
                1.0,
            ),
            "telecentric",
        ),
    ],
)
def test_a_lens_that_is_no_cameras_is_refused(lens: LensPrescription, word: str) -> None:
    with pytest.raises(InputError, match=word):
        gaussian_lens(lens)


@pytest.mark.parametrize(
    ("surface", "word"),
    [
        ((0.0, 1.0), "radius"),
        ((math.nan, 1.0), "radius"),
        (("flat", 1.0), "radius"),
        ((10.0, -1.0), "thickness"),
        ((10.0, math.nan), "thickness"),
        ((10.0, math.inf), "thickness"),
        ((10.0, 1e9), "thickness"),
        ((10.0, 0.0, Glass("g", "constant", (1.5,))), "thickness"),
        ((10.0, 1.0, None, math.nan), "conic"),
        ((10.0, 1.0, "N-BK7"), "glass"),
        ((10.0, 1.0, None, 0.0, -2.0), "semi_diameter"),
    ],
)
def test_surfaces_that_cannot_be_are_refused(surface: tuple[object, ...], word: str) -> None:
    with pytest.raises(InputError, match=word):
        Surface(*surface)  # type: ignore[arg-type]


@pytest.mark.parametrize(
    ("change", "word"),
    [
        ({"surfaces": ()}, "no surface"),
        ({"surfaces": (Surface(9.0, 1.0, Glass("g", "constant", (1.5,))),)}, "into glass"),
        ({"surfaces": (Surface(9.0, 1.0),) * 1001}, "1001 surfaces"),
        ({"stop": 2}, "stop"),
        ({"stop": -1}, "stop"),
        ({"stop": 0.5}, "stop"),
        ({"stop": "0"}, "stop"),
        ({"primary": 0.5}, "primary"),
        ({"opening": 0.0}, "opening"),
        ({"opening": math.nan}, "opening"),
        ({"opening_is": "wide"}, "opening_is"),
        ({"wavelengths": ()}, "wavelengths"),
        ({"wavelengths": (550e-6,) * 101}, "wavelengths"),
        ({"wavelengths": (550.0,)}, "wavelength"),
        ({"wavelengths": (5e-3,) * 2, "weights": (1.0,)}, "weights"),
        ({"weights": (-1.0,)}, "weights"),
        ({"weights": (0.0,)}, "weights"),
        ({"primary": 1}, "primary"),
    ],
)
def test_prescriptions_that_cannot_be_are_refused(change: dict[str, object], word: str) -> None:
    kept: dict[str, object] = {
        "name": "lens",
        "surfaces": (Surface(10.0, 3.0, Glass("g", "constant", (1.5,))), Surface(-10.0, 1.0)),
        "stop": 0,
        "opening": 1.0,
    }
    with pytest.raises(InputError, match=word):
        LensPrescription(**{**kept, **change})  # type: ignore[arg-type]


def test_a_sensor_wants_a_positive_pixel_and_unit() -> None:
    lens: GaussianLens = gaussian_lens(_singlet(50, -50, 3, 1.5))
    with pytest.raises(InputError, match="unit"):
        lens.camera_type(1e-3, (4, 4), unit=0.0)
    with pytest.raises(InputError, match="pixel"):
        lens.camera_type(-1e-3, (4, 4))
    with pytest.raises(InputError, match="focus"):
        lens.image_position(1.0)
