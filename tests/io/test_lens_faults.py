"""Lens files that say what cannot be, or nothing at all, are refused in one sentence."""

from __future__ import annotations

import math
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from lens_texts import TRIPLET, changed, zemax

from rift_cl.errors import FileFormatError, InputError, ResourceLimitError, RiftError
from rift_cl.io.lenses.lens_file import open_lens
from rift_cl.optics.gaussian_lens import gaussian_lens
from rift_cl.optics.lens_prescription import LensPrescription
from rift_cl.sample.stock_lenses import stock_lens


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
    text = zemax(triplet)
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
        open_lens(changed(save, **changes))
    assert str(caught.value).count("lens.json") == 1


def test_huge_counts_and_files_are_refused_before_they_are_read(
    save: Callable[..., Path], tmp_path: Path
) -> None:
    many = [{"thickness": 1}] * 1001
    with pytest.raises(ResourceLimitError, match="1001 surfaces"):
        open_lens(changed(save, surfaces=many))
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
    text = zemax(triplet)
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
