"""Indices of glasses: those of the makers' catalogues, at their lines, and nothing impossible."""

from __future__ import annotations

import math

import pytest

from rift_cl.errors import InputError
from rift_cl.optics.glass import LINE_C, LINE_D, LINE_F, Glass, glass


@pytest.mark.parametrize(
    ("name", "nd", "vd"),
    [
        # Makers' data sheets: Schott 2017, Hikari 2017; Malitson for silica and fluorite.
        ("N-BK7", 1.51680, 64.17),
        ("F2", 1.62004, 36.37),
        ("SF2", 1.64769, 33.85),
        ("F5", 1.60342, 38.03),
        ("N-SF11", 1.78472, 25.68),
        ("N-BAK1", 1.57250, 57.55),
        ("N-SSK2", 1.62229, 53.27),
        ("N-SK2", 1.60738, 56.65),
        ("N-SK16", 1.62041, 60.32),
        ("SK16", 1.620409, 60.28),
        ("N-LASF44", 1.80420, 46.50),
        ("N-FK51A", 1.48656, 84.47),
        ("F_SILICA", 1.45846, 67.82),
        ("CaF2", 1.43385, 95.0),
    ],
)
def test_glasses_have_the_index_and_abbe_number_of_their_data_sheet(
    name: str, nd: float, vd: float
) -> None:
    medium = glass(name)
    d, f, c = (medium.index(line * 1e-3) for line in (LINE_D, LINE_F, LINE_C))
    assert d == pytest.approx(nd, abs=1.1e-5)
    assert (d - 1) / (f - c) == pytest.approx(vd, rel=2e-3)


def test_every_glass_of_the_catalogue_is_one() -> None:
    """The index falls with the wavelength over the visible band."""
    from rift_cl.optics.glass import _catalogue

    assert len(_catalogue()) >= 80
    for name, medium in _catalogue().items():
        indices = [medium.index(w * 1e-6) for w in (420, 480, 550, 590, 650, 690)]
        assert indices == sorted(indices, reverse=True), name


def test_a_model_glass_takes_its_numbers_and_is_close_to_the_real_one() -> None:
    model, real = Glass("517/642", "model", (1.5168, 64.17)), glass("N-BK7")
    d, f, c = (model.index(line * 1e-3) for line in (LINE_D, LINE_F, LINE_C))
    assert d == pytest.approx(1.5168, abs=1e-12)
    assert (d - 1) / (f - c) == pytest.approx(64.17)
    for wavelength in (450e-6, 550e-6, 650e-6):
        assert model.index(wavelength) == pytest.approx(real.index(wavelength), abs=2e-4)


def test_other_names_mean_the_same_glass() -> None:
    assert glass("bk7") == glass(" N-BK7 ")
    assert glass("SILICA") == glass("F_SILICA")


def test_an_unknown_glass_is_named_with_what_is_near_it() -> None:
    with pytest.raises(InputError, match=r"'N-SK17'.*N-SK16.*Abbe"):
        glass("N-SK17")


@pytest.mark.parametrize(
    ("formula", "numbers", "word"),
    [
        ("cauchy", (1.5,), "formula"),
        ("constant", (), "numbers"),
        ("constant", (math.nan,), "numbers"),
        ("constant", (0.5,), "index"),
        ("constant", (70.0,), "index"),
        ("constant", (-1.5,), "index"),
        ("model", (1.5, 0.0), "Abbe"),
        ("model", (1.5, -3.0), "Abbe"),
        ("model", (1.5, math.inf), "numbers"),
        ("sellmeier", (1, 2, 3), "numbers"),
        ("sellmeier", ("a", 0, 0, 0, 0, 0), "numbers"),
        ("sellmeier", (1, 0, 0, LINE_D**2, 0, 0), "index"),
        ("sellmeier", (-9, 0, 0, 0, 0, 0), "index"),
    ],
)
def test_impossible_glasses_are_refused(
    formula: str, numbers: tuple[float, ...], word: str
) -> None:
    with pytest.raises(InputError, match=word):
        Glass("bad", formula, numbers)  # type: ignore[arg-type]


@pytest.mark.parametrize("wavelength", [0, -550e-6, 0.55, 550, math.nan, "green"])
def test_a_wavelength_is_one_of_light_in_millimetres(wavelength: float) -> None:
    with pytest.raises(InputError, match="wavelength"):
        glass("N-BK7").index(wavelength)
