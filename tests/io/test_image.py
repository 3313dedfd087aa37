"""Pictures go out and come back; what is no picture is refused."""

from __future__ import annotations

import re
import struct
import zlib
from pathlib import Path

import numpy as np
import OpenImageIO
import pytest
import tifffile
import view_files

from rift_cl.errors import (
    DTypeError,
    FileFormatError,
    InputError,
    NonFiniteError,
    ResourceLimitError,
    ShapeError,
)
from rift_cl.io import read_image, write_png
from rift_cl.io.captures.photograph_folder import photograph_names, photographs_in
from rift_cl.io.images.pixels import write_pixels

RANDOM = np.random.default_rng(3)


@pytest.mark.parametrize("shape", [(5, 7), (5, 7, 3), (5, 7, 4), (1, 1)])
def test_codes_come_back(tmp_path: Path, shape: tuple[int, ...]) -> None:
    codes = RANDOM.integers(0, 256, shape, dtype=np.uint8)
    write_png(tmp_path / "a.png", codes)
    image = read_image(tmp_path / "a.png")
    assert image.dtype == np.float32
    np.testing.assert_array_equal(np.rint(image * 255), codes)
    np.testing.assert_allclose(image, codes / 255, atol=1e-7)


def test_real_numbers_are_clipped_and_rounded(tmp_path: Path) -> None:
    write_png(tmp_path / "a.png", [[-1.0, 0.0, 0.5001 / 255, 0.4999 / 255, 1.0, 7.0]])
    np.testing.assert_array_equal(read_image(tmp_path / "a.png") * 255, [[0, 0, 1, 0, 255, 255]])


@pytest.mark.parametrize(
    ("name", "image", "kind"),
    [
        ("a.jpg", np.zeros((2, 2)), InputError),
        ("a.png", np.zeros(4), ShapeError),
        ("a.png", np.zeros((2, 2, 2)), ShapeError),
        ("a.png", np.zeros((0, 2)), ShapeError),
        ("a.png", np.zeros((2, 2), np.int64), DTypeError),
        ("a.png", np.zeros((2, 2), np.complex64), DTypeError),
        ("a.png", np.full((2, 2), np.nan), NonFiniteError),
    ],
)
def test_what_no_png_can_hold(
    tmp_path: Path, name: str, image: np.ndarray, kind: type[Exception]
) -> None:
    with pytest.raises(kind):
        write_png(tmp_path / name, image)
    assert not list(tmp_path.iterdir())


def store(path: Path, pixels: np.ndarray, format: str, suffix: str) -> Path:
    kind = {"f": "float", "u": "uint8"}[pixels.dtype.kind]
    output = OpenImageIO.ImageOutput.create(format)
    spec = OpenImageIO.ImageSpec(pixels.shape[1], pixels.shape[0], pixels.shape[2], kind)
    spec.attribute("tiff:write_exif", 0)
    path = path.with_suffix(suffix)
    assert output.open(str(path), spec) and output.write_image(pixels) and output.close()
    return path


@pytest.mark.parametrize(
    ("format", "suffix", "error"),
    [("openexr", ".exr", 0), ("tiff", ".tif", 0), ("tiff", ".TIFF", 0), ("hdr", ".hdr", 0.02)],
)
def test_formats_with_real_numbers(tmp_path: Path, format: str, suffix: str, error: float) -> None:
    pixels = RANDOM.random((6, 8, 3), dtype=np.float32) + 1
    image = read_image(store(tmp_path / "a", pixels, format, suffix))
    np.testing.assert_allclose(image, pixels, atol=error)


def test_jpeg(tmp_path: Path) -> None:
    pixels = np.full((16, 16, 3), 128, np.uint8)
    image = read_image(store(tmp_path / "a", pixels, "jpeg", ".jpg"))
    np.testing.assert_allclose(image, 128 / 255, atol=0.01)


@pytest.mark.parametrize("name", ["a.exr", "a.tif", "b.tif", "a.png"])
def test_alpha_is_straight_whatever_the_file_holds(tmp_path: Path, name: str) -> None:
    """OpenEXR and most TIFF hold colours times alpha; where alpha is 0 they stay as they are."""
    pixels = np.full((4, 4, 4), [0.5, 0.25, 1.0, 0.5], np.float32)
    pixels[0, 0, 3] = 0
    straight = name in ("b.tif", "a.png")
    stored = pixels.copy()
    if not straight:
        stored[pixels[..., 3] > 0, :3] *= 0.5
    kind = "uint8" if straight else "float"
    attributes = {"oiio:UnassociatedAlpha": 1} if straight else {}
    image = read_image(view_files.store(tmp_path / name, stored, kind, **attributes))
    np.testing.assert_allclose(image, pixels, atol=0.6 / 255 if straight else 1e-6)


def test_depth_beside_colours_is_not_divided_by_alpha(tmp_path: Path) -> None:
    spec = OpenImageIO.ImageSpec(2, 2, 5, "float")
    spec.channelnames, spec.alpha_channel, spec.z_channel = ("R", "G", "B", "A", "Z"), 3, 4
    output = OpenImageIO.ImageOutput.create("openexr")
    path = tmp_path / "a.exr"
    pixels = np.full((2, 2, 5), [0.1, 0.2, 0.3, 0.5, 7], np.float32)
    assert output.open(str(path), spec) and output.write_image(pixels) and output.close()
    expected = np.full((2, 2, 5), [0.2, 0.4, 0.6, 0.5, 7])
    np.testing.assert_allclose(read_image(path), expected, atol=1e-6)


@pytest.mark.parametrize("format", ["bmp", "targa", "jpeg", "tiff"])
def test_other_formats_under_the_name_of_png(tmp_path: Path, format: str) -> None:
    path = store(tmp_path / "a", np.zeros((4, 4, 3), np.uint8), format, ".png")
    with pytest.raises(FileFormatError, match=r"name says \.png"):
        read_image(path)


@pytest.mark.parametrize("suffix", [".jfif", ".jpe", ".JPEG"])
def test_jpeg_has_other_names(tmp_path: Path, suffix: str) -> None:
    pixels = np.full((4, 6, 3), 0.5, np.float32)
    plain = view_files.store(tmp_path / "a.jpg", pixels, "uint8")
    other = tmp_path / f"b{suffix}"
    other.write_bytes(plain.read_bytes())
    np.testing.assert_array_equal(read_image(other), read_image(plain))
    assert photograph_names(photographs_in(tmp_path)) == ["a.jpg", other.name]


def test_a_wrong_name_and_a_format_that_is_not_read_say_what_to_do(tmp_path: Path) -> None:
    write_png(tmp_path / "a.png", np.zeros((4, 4, 3), np.uint8))
    renamed = (tmp_path / "a.png").rename(tmp_path / "a.jpg")
    with pytest.raises(FileFormatError, match=r"name says \.jpg: rename it to end in \.png"):
        read_image(renamed)
    (tmp_path / "b.webp").write_bytes(b"RIFF1234WEBPVP8 ")
    with pytest.raises(FileFormatError, match=r"b\.webp: .*not read: convert it to PNG or JPEG"):
        read_image(tmp_path / "b.webp")


def test_png_under_another_name(tmp_path: Path) -> None:
    write_png(tmp_path / "a.png", np.zeros((2, 2)))
    for name in ("a.exr", "a.bmp", "a"):
        (tmp_path / name).write_bytes((tmp_path / "a.png").read_bytes())
        with pytest.raises(FileFormatError, match="content is png"):
            read_image(tmp_path / name)
    with pytest.raises(InputError, match="no such file"):
        read_image(tmp_path / "b.png")


def chunk(kind: bytes, data: bytes) -> bytes:
    return struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data))


@pytest.mark.parametrize("size", [60_000, 1_000_000])
def test_claims_of_a_small_png(tmp_path: Path, size: int) -> None:
    head = chunk(b"IHDR", struct.pack(">IIBBBBB", size, size, 8, 0, 0, 0, 0))
    body = head + chunk(b"IDAT", b"") + chunk(b"IEND", b"")
    (tmp_path / "a.png").write_bytes(b"\x89PNG\r\n\x1a\n" + body)
    with pytest.raises((ResourceLimitError, FileFormatError), match=r"a\.png"):
        read_image(tmp_path / "a.png")


def test_budget(tmp_path: Path) -> None:
    write_png(tmp_path / "a.png", np.zeros((64, 64)))
    assert read_image(tmp_path / "a.png", budget=64 * 64 * 4).shape == (64, 64)
    with pytest.raises(ResourceLimitError, match="claims 16 KiB"):
        read_image(tmp_path / "a.png", budget=64 * 64 * 4 - 1)


def test_damaged_pictures(tmp_path: Path) -> None:
    path = tmp_path / "a.png"
    write_png(path, RANDOM.random((32, 32, 3)))
    content = path.read_bytes()
    for cut in range(0, len(content) - 12, len(content) // 25):
        path.write_bytes(content[:cut])
        with pytest.raises(FileFormatError, match=r"a\.png"):
            read_image(path)


def test_the_readers_of_others_are_left_as_they_were(tmp_path: Path) -> None:
    before = OpenImageIO.get_int_attribute("try_all_readers", -1)
    write_png(tmp_path / "a.png", np.zeros((2, 2)))
    read_image(tmp_path / "a.png")
    assert OpenImageIO.get_int_attribute("try_all_readers", -1) == before


def test_tiles_of_float64_are_refused_before_they_are_read_wrong(tmp_path: Path) -> None:
    path, image = tmp_path / "a.tif", RANDOM.random((40, 30))
    tifffile.imwrite(path, image)
    np.testing.assert_allclose(read_image(path), image, atol=1e-7)
    tifffile.imwrite(path, image, tile=(16, 16))
    with pytest.raises(FileFormatError, match="float64 in tiles"):
        read_image(path)


@pytest.mark.parametrize("format", ["tiff", "openexr", "png"])
def test_no_file_holds_the_time_of_writing(tmp_path: Path, format: str) -> None:
    """The same pixels give the same bytes, whenever they are written."""
    pixels = np.zeros((2, 3, 1), np.uint8 if format == "png" else np.float32)
    path = tmp_path / "a"
    write_pixels(path, pixels, format=format, attributes={"tiff:write_exif": 0})
    source = OpenImageIO.ImageInput.create(format)
    assert source.open(str(path), OpenImageIO.ImageSpec())
    assert not source.spec().getattribute("DateTime")
    assert not re.search(rb"20\d\d:\d\d:\d\d ", path.read_bytes())
