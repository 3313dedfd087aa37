"""Prescriptions from JSON and Zemax files: what is read is what was meant, or an error says why."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import pytest
from lens_texts import changed, zemax

from rift_cl.io.lenses.lens_file import open_lens
from rift_cl.optics.gaussian_lens import gaussian_lens
from rift_cl.optics.lens_prescription import LensPrescription
from rift_cl.sample.stock_lenses import STOCK_LENSES, stock_lens


@pytest.mark.parametrize("name", STOCK_LENSES)
def test_stock_lenses_name_their_source_and_are_in_focus_where_they_say(name: str) -> None:
    lens = open_lens(stock_lens(name))
    assert lens.source
    gaussian = gaussian_lens(lens)
    assert gaussian.rear_focus == pytest.approx(
        lens.image_distance, abs=0.005 * gaussian.focal_length
    )
    assert f"{gaussian.focal_length:.3g}"[:2] in lens.name


@pytest.mark.parametrize("encoding", ["utf-8", "utf-8-sig", "utf-16", "utf-16-le", "latin-1"])
@pytest.mark.parametrize("ending", ["\n", "\r\n"])
def test_a_zemax_file_is_the_same_lens_in_every_encoding(
    save: Callable[..., Path], triplet: LensPrescription, encoding: str, ending: str
) -> None:
    text = zemax(triplet).replace("LANG 0", "NOTE 0 Öffnung").replace("\n", ending)
    found = open_lens(save(text, encoding=encoding))
    assert found.name == triplet.name
    assert (found.stop, found.opening, found.opening_is) == (3, 10.0, "pupil")
    assert found.wavelengths == triplet.wavelengths and found.primary == 1
    for one, other in zip(found.surfaces, triplet.surfaces, strict=True):
        assert one.radius == pytest.approx(other.radius, rel=1e-14)
        assert (one.thickness, one.glass) == (other.thickness, other.glass)
        assert one.semi_diameter == other.semi_diameter
    assert gaussian_lens(found).focal_length == pytest.approx(49.999783, abs=1e-6)


def test_units_scale_every_length_and_nothing_else(
    save: Callable[..., Path], triplet: LensPrescription
) -> None:
    inches = gaussian_lens(open_lens(save(zemax(triplet).replace("UNIT MM", "UNIT IN"))))
    assert inches.focal_length == pytest.approx(25.4 * 49.999783, abs=1e-4)
    assert inches.f_number == pytest.approx(4.9999783)
    metres = gaussian_lens(open_lens(changed(save, unit="m")))
    assert metres.focal_length == pytest.approx(25397.595913, abs=1e-5)
    assert metres.f_number == pytest.approx(25.397595913 / 12.7)


def test_openings_and_glasses_have_their_other_forms(
    save: Callable[..., Path], triplet: LensPrescription
) -> None:
    text = zemax(triplet)
    by_number = open_lens(save(text.replace("ENPD 1.0E+1", "FNUM 5.0 0")))
    assert gaussian_lens(by_number).pupil_diameter == pytest.approx(49.999783 / 5, abs=1e-6)
    floating = open_lens(save(text.replace("ENPD 1.0E+1", "FLOA")))
    assert gaussian_lens(floating).stop_radius == 5.0
    model = open_lens(save(text.replace("GLAS F2 0 0", "GLAS ___BLANK 1 0 1.62004 36.37 #")))
    assert model.surfaces[2].glass is not None and model.surfaces[2].glass.formula == "model"
    assert gaussian_lens(model).focal_length == pytest.approx(50.0, abs=0.02)
    named = open_lens(save(text.replace("GLAS F2 0 0", "GLAS LIKE-F2 1 0 1.62004 36.37 #")))
    assert named.surfaces == model.surfaces
    surfaces = [
        {"radius": 19.93, "thickness": 7, "glass": medium, "stop": True}
        for medium in (
            {"nd": 1.5168, "vd": 64.17},
            {"index": 1.5168},
            {"sellmeier": [1.30061, 0, 0, 0, 0, 0]},
        )
    ]
    for front in surfaces:
        made = open_lens(changed(save, surfaces=[front, {"thickness": 20}], f_number=None))
        assert gaussian_lens(made).focal_length == pytest.approx(19.93 / 0.5168, rel=1e-4)
