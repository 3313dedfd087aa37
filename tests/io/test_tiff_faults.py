"""TIFF scans that cannot be read: one sentence each that names the file."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import OpenImageIO
import pytest
import tiff_files as made
import tifffile

from rift_cl.errors import (
    DTypeError,
    FileFormatError,
    InputError,
    NonFiniteError,
    RiftError,
    ShapeError,
)
from rift_cl.io import open_scan


@pytest.fixture
def series(tmp_path: Path) -> Path:
    """A folder with six projections."""
    return made.write_series(tmp_path / "scan" / "p", "p_{:04}.tif", made.frames())


def test_a_folder_without_tiff(tmp_path: Path) -> None:
    with pytest.raises(FileFormatError, match=r"TIFF files"):
        open_scan(tmp_path)
    for name in ("one", "two"):
        made.write_series(tmp_path / name, "p{}.tif", made.frames())
    with pytest.raises(FileFormatError, match=r"'one', 'two'"):
        open_scan(tmp_path)
    with pytest.raises(InputError, match="no such file"):
        open_scan(tmp_path / "three")


@pytest.mark.parametrize(
    ("frame", "message"),
    [
        (made.frames()[0, :-1], "holds 19 x 24 uint16, p_0001.tif holds 20 x 24 uint16"),
        (made.frames()[0].astype("f4"), "holds 20 x 24 float32, p_0001.tif holds 20 x 24 uint16"),
    ],
)
def test_the_first_file_that_differs_is_named(
    series: Path, frame: np.ndarray, message: str
) -> None:
    for index in (4, 5):
        tifffile.imwrite(series / f"p_{index:04}.tif", frame)
    with pytest.raises(ShapeError, match=f"p_0004.tif: {message}"):
        open_scan(series)


def test_pages_that_differ(tmp_path: Path) -> None:
    with tifffile.TiffWriter(tmp_path / "a.tif") as file:
        for frame in (made.frames()[0], made.frames()[0, :, :-1]):
            file.write(frame, contiguous=False, metadata=None)
    with pytest.raises(ShapeError, match=r"a.tif, page 1: holds 20 x 23"):
        open_scan(tmp_path / "a.tif")


def test_pages_in_one_of_several_files(series: Path) -> None:
    made.write_pages(series / "p_0003.tif", made.frames())
    with pytest.raises(FileFormatError, match=r"p_0003.tif: .*6 pages.*6 files"):
        open_scan(series)


def test_flats_of_another_size(series: Path) -> None:
    made.write_series(series, "flat{}.tif", made.frames()[:2, :-1])
    with pytest.raises(ShapeError, match=r"flat1.tif: .*19 x 24"):
        open_scan(series)


@pytest.mark.parametrize(
    ("frame", "options", "kind", "message"),
    [
        (np.zeros((4, 5, 3), "u1"), {"photometric": "rgb"}, ShapeError, "3 channels"),
        (np.zeros((4, 5), "?"), {}, DTypeError, "samples of 1 bits"),
        (np.zeros((4, 5), "u8"), {}, FileFormatError, "64 bits per sample"),
        (np.zeros((4, 5), "c8"), {}, RiftError, "a.tif"),
    ],
)
def test_samples_without_a_meaning(
    tmp_path: Path, frame: np.ndarray, options: dict, kind: type[Exception], message: str
) -> None:
    tifffile.imwrite(tmp_path / "a.tif", frame, **options)
    with pytest.raises(kind, match=message):
        open_scan(tmp_path / "a.tif")


@pytest.mark.parametrize("packed", ["lzw", "packbits"])
def test_float64_in_other_packing(tmp_path: Path, packed: str) -> None:
    spec = OpenImageIO.ImageSpec(5, 4, 1, "double")
    spec.attribute("compression", packed)
    output = OpenImageIO.ImageOutput.create("tiff")
    assert output.open(str(tmp_path / "a.tif"), spec) and output.write_image(np.ones((4, 5, 1)))
    output.close()
    with pytest.raises(FileFormatError, match=r"float64.*packed"):
        open_scan(tmp_path / "a.tif", axes="angle,bin", theta="180").read(0, 1)


def test_names_that_leave_it_open(series: Path) -> None:
    (series / "p_0002.tif").rename(series / "other_0002.tif")
    with pytest.raises(FileFormatError, match=r"'other_#', 'p_#'"):
        open_scan(series)
    (series / "other_0002.tif").rename(series / "flat_dark.tif")
    with pytest.raises(FileFormatError, match=r"flat_dark\.tif"):
        open_scan(series)


def test_a_folder_of_flats(tmp_path: Path) -> None:
    made.write_series(tmp_path, "flat{}.tif", made.frames())
    with pytest.raises(FileFormatError, match="flats or darks"):
        open_scan(tmp_path)


def test_two_folders_of_flats(series: Path) -> None:
    for name in ("flats", "white_before"):
        made.write_series(series / name, "f{}.tif", made.frames())
    with pytest.raises(FileFormatError, match=r"'flats'.*'white_before'"):
        open_scan(series)
    assert open_scan(series, flats="flats").kind == "counts"


def test_a_missing_number_needs_angles(series: Path) -> None:
    (series / "p_0003.tif").unlink()
    with pytest.raises(FileFormatError, match=r"jump after 'p_0002.tif'"):
        open_scan(series)
    assert open_scan(series, theta="180", kind="attenuation").shape[0] == 5


def test_a_dataset_has_no_meaning(series: Path) -> None:
    with pytest.raises(InputError, match="named arrays"):
        open_scan(series, dataset="x")


@pytest.mark.parametrize(
    ("name", "content", "kind", "message"),
    [
        ("a.txt", "0\n1\n2\n", ShapeError, "3 angles for 6 projections"),
        ("a.txt", "", ShapeError, "0 angles for 6"),
        ("a.txt", "0\n1\nnan\n3\n4\n5", NonFiniteError, "angle 2"),
        ("a.txt", "0\n1\n1e999\n3\n4\n5", NonFiniteError, "angle 2"),
        ("a.txt", "angle\n0\n1\n2\n3\n4\n5", FileFormatError, "line 1 holds 'angle'"),
        ("a.csv", "0, 1\n1, 2\n", FileFormatError, r"line 1 \('0 1'\) holds 2 columns"),
        ("a.txt", b"\xff\xfe\x00", FileFormatError, "cannot be read"),
        ("a.npy", b"no array", FileFormatError, "cannot be read"),
        ("a.npy", np.zeros((2, 3)), ShapeError, "wanted angles along one axis"),
        ("a.npy", np.array([{}] * 6), DTypeError, "object"),
        ("a.npy", np.zeros(6, "?"), DTypeError, "bool"),
        ("a.doc", "", InputError, "angles are read from .txt"),
    ],
)
def test_angles_that_cannot_be_used(
    series: Path, name: str, content: object, kind: type[Exception], message: str
) -> None:
    path = series / name
    if isinstance(content, np.ndarray):
        np.save(path, content)
    else:
        path.write_bytes(content if isinstance(content, bytes) else str(content).encode())
    with pytest.raises(kind, match=message) as caught:
        open_scan(series, theta=name)
    assert str(path) in str(caught.value)


def test_two_lists_of_angles(series: Path) -> None:
    for name in ("angles.txt", "theta.csv"):
        (series / name).write_text("0\n1\n2\n3\n4\n5\n")
    with pytest.raises(FileFormatError, match=r"'angles.txt'.*'theta.csv'"):
        open_scan(series)


def test_a_file_that_cannot_be_read(series: Path) -> None:
    (series / "p_0003.tif").write_bytes(b"nothing of the kind")
    with pytest.raises(FileFormatError, match=r"p_0003\.tif"):
        open_scan(series)
    (series / "p_0003.tif").unlink()
    (series / "p_0003.tif").mkdir()
    with pytest.raises(InputError, match=r"p_0003\.tif"):
        open_scan(series)


def test_files_that_changed_since(series: Path) -> None:
    scan = open_scan(series, kind="attenuation")
    tifffile.imwrite(series / "p_0004.tif", made.frames()[0, :-1])
    with pytest.raises(ShapeError, match=r"p_0004\.tif"):
        scan.read(0, 1)
    (series / "p_0004.tif").unlink()
    with pytest.raises(InputError, match=r"p_0004\.tif"):
        scan.read(0, 1)


def test_an_imagej_stack_that_hides_its_images(tmp_path: Path) -> None:
    text = "ImageJ=1.53\nimages=900\nslices=900\n"
    tifffile.imwrite(tmp_path / "a.tif", made.frames()[0], description=text, metadata=None)
    with pytest.raises(FileFormatError, match="keeps 900"):
        open_scan(tmp_path / "a.tif")


@pytest.mark.skipif(OpenImageIO.VERSION < 30200, reason="older versions give no reason")
def test_a_compression_that_is_not_read_is_named(tmp_path: Path) -> None:
    """A whole file by its header's word for ZSTD, which the decoder is built without."""
    path = tmp_path / "a.tif"
    tifffile.imwrite(path, np.zeros((5, 4, 6), "u2"), photometric="minisblack", metadata=None)
    with tifffile.TiffFile(path, mode="r+") as file:
        for page in file.pages:
            page.tags["Compression"].overwrite(50000)
    with pytest.raises(FileFormatError, match=r"compressed by ZSTD.*LZW or Deflate") as told:
        open_scan(path, kind="counts", flats="mean")
    assert "damaged" not in str(told.value)
