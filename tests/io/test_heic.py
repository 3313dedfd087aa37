"""HEIC: upright pixels, one sentence without the library that reads it, damage that is named."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from heic_file import HEIC

from rift_cl.errors import FileFormatError, InputError, ResourceLimitError
from rift_cl.io import demand_photographs, read_image
from rift_cl.io.picture_header import read_picture_header


@pytest.fixture
def photograph(tmp_path: Path) -> Path:
    path = tmp_path / "IMG_0001.HEIC"
    path.write_bytes(HEIC)
    return path


def test_pixels_come_upright(photograph: Path) -> None:
    pytest.importorskip("pi_heif")
    header = read_picture_header(photograph)
    assert header.size == (64, 48) and header.orientation == 1
    assert header.channels == 3 and header.eight_bit and not (header.alpha or header.linear)
    assert header.taken_by == ("Acme", "Phone 1", "26")
    image = read_image(photograph)
    assert image.shape == (64, 48, 3) and image.dtype == np.float32
    for place, color in (
        ((4, -4), (250, 240, 230)),
        ((-4, 4), (200, 30, 30)),
        ((4, 4), (40, 90, 160)),
        ((-4, -4), (40, 90, 160)),
    ):
        np.testing.assert_allclose(255 * image[place], color, atol=2)


def test_damage_and_size_are_named(photograph: Path) -> None:
    pytest.importorskip("pi_heif")
    with pytest.raises(ResourceLimitError, match=r"IMG_0001\.HEIC"):
        read_image(photograph, budget=1000)
    other = photograph.with_suffix(".jpg")
    other.write_bytes(HEIC)
    with pytest.raises(FileFormatError, match=r"is heic, the name says \.jpg"):
        read_image(other)
    for end in (100, 500, 700):
        photograph.write_bytes(HEIC[:end])
        with pytest.raises(FileFormatError, match=r"IMG_0001\.HEIC"):
            read_image(photograph)


def test_without_the_library_one_sentence_says_what_to_install(
    photograph: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    for number in (2, 3):
        photograph.with_name(f"IMG_000{number}.HEIC").write_bytes(HEIC)
    monkeypatch.setattr("rift_cl.io.heic.find_spec", lambda name: None)
    for act in (lambda: read_image(photograph), lambda: demand_photographs(photograph.parent)):
        with pytest.raises(InputError, match="pip install pi-heif") as caught:
            act()
        assert "\n" not in str(caught.value) and photograph.name in str(caught.value)
    assert len(list(photograph.parent.iterdir())) == 3
