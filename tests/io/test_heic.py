"""HEIC: upright pixels, one sentence without the library that reads it, damage that is named."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from heic_file import HEIC, heic_with_profile
from photograph_files import run
from PIL import ImageCms
from view_files import store

from rift_cl.errors import FileFormatError, InputError, ResourceLimitError
from rift_cl.io import (
    check_photographs,
    open_capture,
    pose_photographs,
    read_image,
    read_view,
)
from rift_cl.io.images.read_picture import read_picture_header


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


def test_primaries_of_phones_are_named(photograph: Path) -> None:
    pytest.importorskip("pi_heif")
    assert read_picture_header(photograph).profile == ""
    # Primaries of SMPTE EG 432-1 for those of BT.709.
    photograph.write_bytes(HEIC.replace(b"nclx\0\x01", b"nclx\0\x0c"))
    assert read_picture_header(photograph).profile == "Display P3"


@pytest.mark.parametrize("damaged", [False, True])
def test_the_profile_of_a_phone_is_named(photograph: Path, damaged: bool) -> None:
    """In place of the numbers above; a profile that cannot be read costs no pixels."""
    pytest.importorskip("pi_heif")
    profile = ImageCms.ImageCmsProfile(ImageCms.createProfile("sRGB")).tobytes()
    old, new = (name.encode("utf-16-be") for name in ("sRGB built-in", "Display P3\0\0\0"))
    profile = profile.replace(old, new)
    photograph.write_bytes(heic_with_profile(b"damaged" if damaged else profile))
    wanted = "without a name" if damaged else "Display P3"
    assert read_picture_header(photograph).profile == wanted
    assert read_image(photograph).shape == (64, 48, 3)


def test_damage_and_size_are_named(photograph: Path) -> None:
    pytest.importorskip("pi_heif")
    with pytest.raises(ResourceLimitError, match=r"IMG_0001\.HEIC"):
        read_image(photograph, budget=1000)
    other = photograph.with_suffix(".jpg")
    other.write_bytes(HEIC)
    with pytest.raises(FileFormatError, match=r"heic.*\.jpg"):
        read_image(other)
    for end in (100, 500, 700):
        photograph.write_bytes(HEIC[:end])
        with pytest.raises(FileFormatError, match=r"IMG_0001\.HEIC"):
            read_image(photograph)


@pytest.mark.parametrize("damage", [b"MM\0*\0\0", b"no EXIF", b"II*\0\xff\xff\xff\x7f", b"MM\0+"])
def test_damaged_exif_costs_no_pixels(photograph: Path, damage: bytes) -> None:
    pytest.importorskip("pi_heif")
    photograph.write_bytes(HEIC.replace(b"MM\0*\0\0\0\x08", damage.ljust(8, b"\xee")[:8]))
    assert read_picture_header(photograph).taken_by == ()
    pixels = read_image(photograph)
    photograph.write_bytes(HEIC)
    np.testing.assert_array_equal(pixels, read_image(photograph))


@pytest.mark.parametrize("name", [b"hvc1", b"Exif\0\0\0\0\x1airef"])
def test_an_item_whose_type_is_no_text_is_named(photograph: Path, name: bytes) -> None:
    """pi-heif 1.4.0 ends the process for the second."""
    pytest.importorskip("pi_heif")
    photograph.write_bytes(HEIC.replace(name, name.replace(name[2:4], b"\xff\x7f")))
    for read in (read_image, read_picture_header):
        with pytest.raises(FileFormatError, match=r"IMG_0001\.HEIC: an item's type"):
            read(photograph)


def test_without_the_library_one_sentence_says_what_to_install(
    photograph: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    for number in (2, 3):
        photograph.with_name(f"IMG_000{number}.HEIC").write_bytes(HEIC)
    monkeypatch.setattr("rift_cl.io.images.heic.find_spec", lambda name: None)
    for act in (lambda: read_image(photograph), lambda: check_photographs(photograph.parent)):
        with pytest.raises(
            InputError, match=r"film,view\]' in the .*or pip install pi-heif"
        ) as caught:
            act()
        assert "\n" not in str(caught.value) and photograph.name in str(caught.value)
    assert len(list(photograph.parent.iterdir())) == 3


def test_poses_are_found_for_heic_beside_jpeg(
    photograph: Path, tmp_path: Path, seen: Callable, monkeypatch: pytest.MonkeyPatch
) -> None:
    """As upright copies, since COLMAP reads no HEIC; the fit reads the photographs themselves."""
    pytest.importorskip("pi_heif")
    monkeypatch.setenv("FAKE_PYCOLMAP_SIZE", "48 64")
    folder = tmp_path / "bare"
    folder.mkdir()
    for number in range(3):
        # A box of ISO 14496-12 that nobody reads, so that no two files are the same.
        content = HEIC + b"\0\0\0\x09free" + bytes([number])
        (folder / f"IMG_{number}.HEIC").write_bytes(content)
    store(folder / "IMG_3.jpg", np.zeros((64, 48, 3), np.uint8), "uint8")
    _, posed = run(pose_photographs(folder, tmp_path / "poses"))
    names = [f"IMG_{number}.HEIC" for number in range(3)]
    assert posed.placed == (*names, "IMG_3.jpg") and not posed.missing
    assert seen()["names"] == [f"{name}.png" for name in posed.placed]
    assert [len(group) for group in seen()["groups"]] == [3, 1]
    for view in open_capture(posed.model, images=folder).views[:3]:
        np.testing.assert_allclose(read_view(view), read_image(view.image), atol=1e-6)
