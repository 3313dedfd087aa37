"""Prescriptions from JSON and Zemax files: what is read is what was meant, or an error says why."""

from __future__ import annotations

import json
import math
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from rift_cl.errors import FileFormatError, InputError, ResourceLimitError, RiftError
from rift_cl.geometry.gaussian_lens import gaussian_lens
from rift_cl.geometry.lens_prescription import LensPrescription
from rift_cl.io.lens_file import open_lens
from rift_cl.sample.stock_lenses import STOCK_LENSES, stock_lens

# The Cooke triplet as Zemax writes it, with lines that say nothing about rays.
TRIPLET = """VERS 140124 258 36214
MODE SEQ
NAME Cooke triplet, 50 mm f/5
PFIL 0 0 0
LANG 0
UNIT MM X W X CM MR CPMM
ENPD 1.0E+1
ENVD 2.0E+1 1 0
GCAT HIKARI SCHOTT
FTYP 0 0 3 3 0 0 0
XFLN 0.0E+0 0.0E+0 0.0E+0
YFLN 0.0E+0 1.4E+1 2.0E+1
WAVM 1 4.8E-1 1
WAVM 2 5.5E-1 1
WAVM 3 6.5E-1 1
WAVM 4 5.5E-1 1
PWAV 2
SURF 0
  TYPE STANDARD
  CURV 0.0 0 0 0 0 ""
  DISZ INFINITY
  DIAM 0 0 0 0 1 ""
"""
IMAGE = """SURF {}
  TYPE STANDARD
  CURV 0.0 0 0 0 0 ""
  DISZ 0
  DIAM 1.8E+1 0 0 0 1 ""
TOL TOFF   0   0              0              0   0 0 0
"""


def _zemax(lens: LensPrescription) -> str:
    text = TRIPLET
    for index, surface in enumerate(lens.surfaces):
        text += f'SURF {index + 1}\n  TYPE STANDARD\n  CURV {surface.curvature!r} 0 0 0 0 ""\n'
        text += f"  HIDE 0 0 0\n  MIRR 2 0\n  DISZ {surface.thickness!r}\n"
        if index == lens.stop:
            text += "  STOP\n"
        if surface.glass:
            text += f"  GLAS {surface.glass.name} 0 0 1.5 4.0E+1 0 0 0 0 0 0\n"
        text += f'  DIAM {surface.semi_diameter!r} 0 0 0 1 ""\n'
    return text + IMAGE.format(len(lens.surfaces) + 1)


@pytest.fixture
def triplet() -> LensPrescription:
    return open_lens(stock_lens("cooke_triplet"))


@pytest.fixture
def save(tmp_path: Path) -> Callable[..., Path]:
    def _save(text: str, name: str = "lens.zmx", encoding: str = "utf-8") -> Path:
        (tmp_path / name).write_bytes(text.encode(encoding))
        return tmp_path / name

    return _save


def _changed(save: Callable[..., Path], **changes: Any) -> Path:
    """The singlet's file with fields changed; None removes one."""
    fields = {**json.loads(stock_lens("singlet").read_text("utf-8")), **changes}
    kept = {name: value for name, value in fields.items() if value is not None}
    return save(json.dumps(kept), "lens.json")


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
    text = _zemax(triplet).replace("LANG 0", "NOTE 0 Öffnung").replace("\n", ending)
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
    inches = gaussian_lens(open_lens(save(_zemax(triplet).replace("UNIT MM", "UNIT IN"))))
    assert inches.focal_length == pytest.approx(25.4 * 49.999783, abs=1e-4)
    assert inches.f_number == pytest.approx(4.9999783)
    metres = gaussian_lens(open_lens(_changed(save, unit="m")))
    assert metres.focal_length == pytest.approx(25397.595913, abs=1e-5)
    assert metres.f_number == pytest.approx(25.397595913 / 12.7)


def test_openings_and_glasses_have_their_other_forms(
    save: Callable[..., Path], triplet: LensPrescription
) -> None:
    text = _zemax(triplet)
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
        made = open_lens(_changed(save, surfaces=[front, {"thickness": 20}], f_number=None))
        assert gaussian_lens(made).focal_length == pytest.approx(19.93 / 0.5168, rel=1e-4)


@pytest.mark.parametrize(
    ("old", "new", "word"),
    [
        ("GLAS SK16 ", "GLAS SK61 ", r"surface 1: glass 'SK61' is not.*SK16"),
        ("GLAS F2 ", "GLAS MIRROR ", "surface 3: is a mirror"),
        ("GLAS F2 0 0", "GLAS ___BLANK 1 0 0.5 30", "surface 3: .*index"),
        ("SURF 3\n", "SURF 4\n", "wanted surface 3"),
        ("  DISZ 6.00755\n", "", "surface 2: has no thickness"),
        ("GLAS F2 0 0 1.5 4.0E+1 0 0 0 0 0 0", "GLAS", "surface 3: glass ''"),
        ("TYPE STANDARD\n  CURV 0.045", "TYPE EVENASPH\n  CURV 0.045", "surface 1.*EVENASPH"),
        ("MODE SEQ", "MODE NSC", "only sequential"),
        ("ENPD 1.0E+1", "OBNA 0.1 0", "entrance pupil"),
        ("ENPD 1.0E+1", "FNUM 5.0 1", "entrance pupil"),
        ("ENPD 1.0E+1", "", "how far the lens is open"),
        ("ENPD 1.0E+1", "ENPD -3", "opening"),
        ("ENPD 1.0E+1", "ENPD wide", "line 7: ENPD has 'wide'"),
        ("ENPD 1.0E+1", "ENPD nan", "line 7: ENPD has 'nan'"),
        ("ENPD 1.0E+1", "ENPD", "line 7: 'ENPD' ends too early"),
        ("UNIT MM", "UNIT FURLONG", "FURLONG"),
        ("  DISZ INFINITY\n", "  DISZ 9\n  GLAS F2 0 0 1.6 36\n", "surface 0: .* in glass"),
        ("  STOP\n", "", "0 surfaces .* STOP"),
        ("  MIRR 2 0\n", "  STOP\n", "surfaces .* STOP"),
        ("PWAV 2", "PWAV 7", "primary"),
        ("PWAV 2", "PWAV INFINITY", "primary"),
        ("WAVM 2 5.5E-1", "WAVM 2 5.5E+5", "wavelength"),
        ("DISZ 3.25896", "DISZ -3.25896", "surface 1: thickness"),
        ("DISZ 3.25896", "DISZ INFINITY", "surface 1: thickness"),
        ("DISZ 3.25896", "DISZ 1e300", "surface 1: thickness"),
        ("DIAM 9.5 ", "DIAM -9.5 ", "surface 1: semi_diameter"),
        ("DIAM 9.5 ", "CONI inf\n  DIAM 9.5 ", "CONI"),
    ],
)
def test_what_a_zemax_file_may_not_say_is_named(
    save: Callable[..., Path], triplet: LensPrescription, old: str, new: str, word: str
) -> None:
    text = _zemax(triplet)
    assert old in text
    with pytest.raises(InputError, match=rf"(?s)lens\.zmx.*{word}"):
        open_lens(save(text.replace(old, new)))


@pytest.mark.parametrize(
    ("changes", "word"),
    [
        ({"surfaces": None}, "no 'surfaces'"),
        ({"surfaces": []}, "0 surfaces"),
        ({"surfaces": 3}, "wanted a list"),
        ({"surfaces": [3]}, r"surfaces\[0\]"),
        ({"surfaces": [{"stop": True}]}, "no 'thickness'"),
        ({"surfaces": [{"thickness": 1, "radious": 9, "stop": True}]}, "'radious'"),
        ({"surfaces": [{"thickness": -1, "stop": True}]}, r"surfaces\[0\]: thickness"),
        ({"surfaces": [{"thickness": 1, "radius": 0, "stop": True}]}, r"surfaces\[0\]: radius"),
        ({"surfaces": [{"thickness": 1, "radius": "9", "stop": True}]}, "'radius'"),
        ({"surfaces": [{"thickness": 1, "stop": "yes"}]}, "'stop'"),
        ({"surfaces": [{"thickness": 1, "glass": "N-BK77", "stop": True}]}, "N-BK7"),
        ({"surfaces": [{"thickness": 1, "glass": 1.5, "stop": True}]}, "'glass'"),
        ({"surfaces": [{"thickness": 1, "glass": {"n": 1.5}, "stop": True}]}, "nd and vd"),
        ({"surfaces": [{"thickness": 1, "glass": {"index": -1}, "stop": True}]}, "index"),
        ({"surfaces": [{"thickness": 1, "glass": {"index": "n"}, "stop": True}]}, "glass: 'index'"),
        ({"surfaces": [{"thickness": 1, "conic": "flat", "stop": True}]}, "'conic'"),
        ({"surfaces": [{"thickness": 1, "glass": {"sellmeier": [1]}, "stop": True}]}, "numbers"),
        ({"surfaces": [{"thickness": 1, "glass": "F2", "stop": True}]}, "into glass"),
        ({"surfaces": [{"thickness": 1}]}, "0 surfaces have"),
        ({"surfaces": [{"thickness": 1, "stop": True}] * 2}, "2 surfaces have"),
        ({"unit": "ft"}, "'unit'"),
        ({"unit": 3}, "'unit'"),
        ({"entrance_pupil_diameter": None}, "no opening"),
        ({"f_number": 2}, "exactly one"),
        ({"entrance_pupil_diameter": 0}, "opening"),
        ({"entrance_pupil_diameter": float("nan")}, "entrance_pupil_diameter"),
        ({"wavelengths_um": 0.5}, "wavelengths_um"),
        ({"wavelengths_um": [0.5, "red"]}, r"wavelengths_um\[1\]"),
        ({"wavelengths_um": [0.4861327, 0.5875618, 550]}, "wavelength"),
        ({"weights": [1]}, "weights"),
        ({"weights": [1, None, 2]}, r"weights\[1\] is null"),
        ({"primary": 3}, "'primary'"),
        ({"primary": 0.5}, "'primary'"),
        ({"colour": "red"}, "'colour'"),
    ],
)
def test_what_a_json_file_may_not_say_is_named(
    save: Callable[..., Path], changes: dict[str, Any], word: str
) -> None:
    with pytest.raises(InputError, match=rf"lens\.json.*{word}") as caught:
        open_lens(_changed(save, **changes))
    assert str(caught.value).count("lens.json") == 1


def test_huge_counts_and_files_are_refused_before_they_are_read(
    save: Callable[..., Path], tmp_path: Path
) -> None:
    many = [{"thickness": 1}] * 1001
    with pytest.raises(ResourceLimitError, match="1001 surfaces"):
        open_lens(_changed(save, surfaces=many))
    with pytest.raises(ResourceLimitError, match="more than 1000"):
        open_lens(save(TRIPLET + "".join(f"SURF {i}\n" for i in range(1, 5000))))
    with (tmp_path / "big.zmx").open("wb") as file:
        file.truncate(1 << 40)
    with pytest.raises(ResourceLimitError, match="larger"):
        open_lens(tmp_path / "big.zmx")


def test_other_files_are_refused_by_name(tmp_path: Path, save: Callable[..., Path]) -> None:
    with pytest.raises(InputError, match="no such file"):
        open_lens(tmp_path / "none.zmx")
    with pytest.raises(InputError, match="no such file"):
        open_lens(tmp_path / "none.json")
    with pytest.raises(InputError, match=r"\.json or \.zmx"):
        open_lens(save("x", "lens.seq"))
    (tmp_path / "folder.zmx").mkdir()
    with pytest.raises(InputError, match="cannot be opened"):
        open_lens(tmp_path / "folder.zmx")
    for content in ("", "\x00", "SURF 0\n", '{"name": 3}'):
        with pytest.raises(FileFormatError):
            open_lens(save(content))
        with pytest.raises(FileFormatError):
            open_lens(save(content, "lens.json"))


def test_a_file_that_ends_too_early_is_no_lens(
    save: Callable[..., Path], triplet: LensPrescription
) -> None:
    """Cut anywhere before the last surface is complete, it is refused, not read as another lens."""
    text = _zemax(triplet)
    complete = text.rindex("DISZ 0") + len("DISZ 0")
    for end in [*range(0, complete, 23), *range(complete - 40, complete)]:
        with pytest.raises(InputError):
            open_lens(save(text[:end]))
    assert open_lens(save(text[:complete])) == open_lens(save(text))
    text = stock_lens("double_gauss").read_text("utf-8")
    for end in range(0, len(text) - 3, 41):
        with pytest.raises(FileFormatError):
            open_lens(save(text[:end], "lens.json"))


@given(noise=st.binary(max_size=400), place=st.floats(0, 1))
@settings(max_examples=60, deadline=None, suppress_health_check=list(HealthCheck))
def test_noise_in_a_file_is_one_sentence_or_a_lens(
    tmp_path_factory: pytest.TempPathFactory, noise: bytes, place: float
) -> None:
    folder = tmp_path_factory.mktemp("noise")
    good = {".json": stock_lens("singlet").read_bytes(), ".zmx": TRIPLET.encode("utf-16")}
    for kind, content in good.items():
        at = int(place * len(content))
        for damaged in (noise, content[:at] + noise + content[at + len(noise) :]):
            path = folder / f"lens{kind}"
            path.write_bytes(damaged)
            try:
                lens = open_lens(path)
                f = gaussian_lens(lens).focal_length
            except RiftError as error:
                assert str(error) and "Traceback" not in str(error)
            else:
                assert math.isfinite(f) and np.isfinite(lens.opening)
