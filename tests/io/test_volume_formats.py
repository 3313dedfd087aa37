"""What other programs find in the volumes, by readers that this package has no part in."""

from __future__ import annotations

import json
import os
from itertools import pairwise
from pathlib import Path

import h5py
import mrcfile
import numpy as np
import OpenImageIO
import pytest
import tifffile
import zarr
from volume_files import FORMATS, VOLUME

from rift_cl.errors import (
    FileFormatError,
    InputError,
    NonFiniteError,
    PathEscapeError,
    ShapeError,
)
from rift_cl.io import open_volume, read_volume
from rift_cl.io.volumes.layout import VolumeLayout

SPACING = (1.0, 0.5, 0.25)
WINDOW = (-2.0, 2.0)
TYPES = pytest.mark.parametrize("dtype", ["uint16", "uint8"])


def write(path: Path, format: str, volume: np.ndarray = VOLUME, **more: object) -> tuple[int, int]:
    options = {"spacing": SPACING, "unit": "mm", "origin": (3.0, -1.0, -2.0), **more}
    with open_volume(path, volume.shape, format=format, **options) as writer:
        writer.write(0, volume)
    return writer.clipped


def expected(dtype: str) -> np.ndarray:
    """The window's arithmetic, written down once more."""
    levels = np.iinfo(dtype).max
    clipped = np.clip(VOLUME.astype(np.float64), *WINDOW)
    return np.rint((clipped - WINDOW[0]) * levels / (WINDOW[1] - WINDOW[0])).astype(dtype)


def scaled(dtype: str) -> dict[str, object]:
    return {"dtype": dtype, "window": WINDOW}


def picture(path: Path) -> np.ndarray:
    """By OpenImageIO, all pages."""
    pages, index = [], 0
    source = OpenImageIO.ImageInput.open(str(path))
    while source.seek_subimage(index, 0):
        pages.append(source.read_image(index, 0, 0, 1, source.spec().format)[..., 0])
        index += 1
    source.close()
    return np.array(pages)


@FORMATS
def test_equal_volumes_are_equal_bytes(tmp_path: Path, format: str) -> None:
    """However they are cut into slabs."""
    volume = np.random.default_rng(3).standard_normal((40, 70, 300)).astype(np.float32)
    for name, slabs in (("a", [0, 16, 32, 40]), ("b", [20, 21, 40, 0, 7, 20])):
        with open_volume(tmp_path / name, volume.shape, format=format, spacing=1) as writer:
            for start, stop in pairwise(slabs):
                if start < stop:
                    writer.write(start, volume[start:stop])
    files = [sorted(p for p in (tmp_path / n).rglob("*") if p.is_file()) for n in "ab"]
    if not files[0]:
        files = [[tmp_path / n] for n in "ab"]
    assert len(files[0]) == len(files[1]) > 0
    for one, other in zip(*files, strict=True):
        assert one.read_bytes() == other.read_bytes().replace(b'"name": "b"', b'"name": "a"')


def test_no_time_in_hdf5(tmp_path: Path) -> None:
    write(tmp_path / "v", "h5")
    with h5py.File(tmp_path / "v") as file:
        told = h5py.h5o.get_info(file["volume"].id)
        assert (told.mtime, told.ctime) == (0, 0)


@pytest.mark.parametrize("dtype", ["float32", "uint16", "uint8"])
def test_tiff_slices(tmp_path: Path, dtype: str) -> None:
    write(tmp_path / "v", "tiff", **({} if dtype == "float32" else scaled(dtype)))
    for index in range(5):
        stored = picture(tmp_path / "v" / f"slice_{index:05d}.tif")
        assert stored.dtype == dtype
        wanted = VOLUME if dtype == "float32" else expected(dtype)
        np.testing.assert_array_equal(stored, wanted[index : index + 1])
    with tifffile.TiffFile(tmp_path / "v" / "slice_00004.tif") as file:
        notes, tags = file.imagej_metadata, file.pages.first.tags
        assert tags["XResolution"].value == (4, 1)
        assert tags["YResolution"].value == (2, 1)
        assert tags["ResolutionUnit"].value == 1
        assert "DateTime" not in tags
    assert (notes["unit"], notes["spacing"], notes["xorigin"]) == ("mm", 1.0, 8.0)
    if dtype != "float32":
        levels = np.iinfo(dtype).max
        assert (notes["cf"], notes["c0"], notes["c1"]) == (0, -2.0, 4 / levels)
        assert (notes["min"], notes["max"], notes["vunit"]) == (0, levels, "1/mm")


@pytest.mark.parametrize("dtype", ["float32", "uint16", "uint8"])
def test_tiff_stack(tmp_path: Path, dtype: str) -> None:
    write(tmp_path / "v.tif", "tiff-stack", **({} if dtype == "float32" else scaled(dtype)))
    wanted = VOLUME if dtype == "float32" else expected(dtype)
    np.testing.assert_array_equal(picture(tmp_path / "v.tif"), wanted)
    with tifffile.TiffFile(tmp_path / "v.tif") as file:
        assert file.is_imagej and not file.is_bigtiff
        np.testing.assert_array_equal(file.asarray(), wanted)
        notes, tags = file.imagej_metadata, file.pages.first.tags
        assert file.series[0].axes == "ZYX"
        assert tags["XResolution"].value == (4, 1)
    assert (notes["images"], notes["slices"], notes["unit"]) == (5, 5, "mm")
    assert notes["spacing"] == 1.0
    if dtype == "float32":
        ends = (float(VOLUME.min()), float(VOLUME.max()))
        assert (notes["min"], notes["max"]) == pytest.approx(ends, rel=1e-7)
    else:
        assert (notes["cf"], notes["c0"], notes["c1"]) == (0, -2.0, 4 / np.iinfo(dtype).max)


def test_more_than_four_gigabytes_are_a_bigtiff(tmp_path: Path, monkeypatch) -> None:
    monkeypatch.setattr("rift_cl.io.volumes.tiff_stack._CLASSIC", 1000)
    write(tmp_path / "v.tif", "tiff-stack")
    with tifffile.TiffFile(tmp_path / "v.tif") as file:
        assert file.is_bigtiff
        np.testing.assert_array_equal(file.asarray(), VOLUME)
        assert file.pages.first.description.startswith("ImageJ=")
    np.testing.assert_array_equal(read_volume(tmp_path / "v.tif"), VOLUME)


@pytest.mark.parametrize("step", [1e-8, 6.5e-4, 0.0123456789, 1 / 3, 1.0, 37.7, 9.9e8])
def test_resolutions_that_imagej_can_read(tmp_path: Path, step: float) -> None:
    """As fractions of signed integers."""
    write(tmp_path / "v", "tiff-stack", spacing=step)
    with tifffile.TiffFile(tmp_path / "v") as file:
        above, below = file.pages.first.tags["XResolution"].value
    assert 0 < above < 2**31 and 0 < below < 2**31
    assert below / above == pytest.approx(step, rel=1e-6)


def test_units_that_ascii_lacks(tmp_path: Path) -> None:
    for name, unit, told in (("a", "\u00b5m", "micron"), ("b", "\u2113", "\\u2113")):
        write(tmp_path / name, "tiff-stack", unit=unit)
        with tifffile.TiffFile(tmp_path / name) as file:
            assert f"unit={told}\n" in file.pages.first.description


@pytest.mark.parametrize("dtype", ["float32", "uint16", "uint8"])
def test_hdf5(tmp_path: Path, dtype: str) -> None:
    write(tmp_path / "v.h5", "h5", **({} if dtype == "float32" else scaled(dtype)))
    with h5py.File(tmp_path / "v.h5") as file:
        stored, told = file["volume"][...], dict(file["volume"].attrs)
    assert stored.dtype == dtype
    np.testing.assert_array_equal(stored, VOLUME if dtype == "float32" else expected(dtype))
    assert (told["unit"], told["value_unit"]) == ("mm", "1/mm")
    assert list(told["spacing"]) == list(SPACING)
    assert list(told["origin"]) == [3.0, -1.0, -2.0]
    assert told["element_size_um"] == pytest.approx([1000, 500, 250])
    if dtype != "float32":
        assert list(told["window"]) == list(WINDOW)
        back = told["add_offset"] + told["scale_factor"] * stored
        inside = abs(VOLUME) <= 2
        assert abs(back - VOLUME)[inside].max() <= told["scale_factor"] / 2 * 1.0001


@pytest.mark.parametrize("dtype", ["float32", "uint16"])
def test_mrc(tmp_path: Path, dtype: str) -> None:
    write(tmp_path / "v.mrc", "mrc", **({} if dtype == "float32" else scaled(dtype)))
    assert mrcfile.validate(tmp_path / "v.mrc")
    with mrcfile.open(tmp_path / "v.mrc") as file:
        wanted = VOLUME if dtype == "float32" else expected(dtype)
        np.testing.assert_array_equal(file.data, wanted)
        assert file.is_volume() and int(file.header.mode) == (2 if dtype == "float32" else 6)
        sizes = [float(file.voxel_size[axis]) for axis in "zyx"]
        assert sizes == pytest.approx([1e7, 5e6, 2.5e6])
        assert float(file.header.dmean) == pytest.approx(wanted.mean(), rel=1e-5)
        assert float(file.header.rms) == pytest.approx(wanted.std(), rel=1e-5)
        assert file.get_labels()[0] == "Attenuation in 1/mm"


def test_values_without_a_unit_are_noted_as_such(tmp_path: Path) -> None:
    plain = {"attenuation": False}
    write(tmp_path / "v.h5", "h5", **plain)
    with h5py.File(tmp_path / "v.h5") as file:
        assert (file["volume"].attrs["unit"], file["volume"].attrs["value_unit"]) == ("mm", "1")
    write(tmp_path / "v.tif", "tiff-stack", **scaled("uint16"), **plain)
    with tifffile.TiffFile(tmp_path / "v.tif") as file:
        assert "vunit=1\n" in file.pages.first.description
    write(tmp_path / "v.mrc", "mrc", **plain)
    with mrcfile.open(tmp_path / "v.mrc") as file:
        assert file.get_labels()[0] == "Values without a unit"


def test_mrc_of_no_length(tmp_path: Path) -> None:
    write(tmp_path / "v.mrc", "mrc", unit="bin")
    with mrcfile.open(tmp_path / "v.mrc") as file:
        sizes = [float(file.voxel_size[axis]) for axis in "zyx"]
        assert sizes == pytest.approx([4, 2, 1])
        assert file.get_labels()[-1] == "Voxel size unknown: 1 stands for it"
    with pytest.raises(InputError, match=r"8-bit.*uint16"):
        write(tmp_path / "w.mrc", "mrc", dtype="uint8", window=(0, 1))


@pytest.mark.parametrize(
    ("unit", "name", "metres"),
    [
        ("mm", "millimeter", 1e-3),
        ("um", "micrometer", 1e-6),
        ("\u00b5m", "micrometer", 1e-6),
        ("\u03bcm", "micrometer", 1e-6),
        ("micron", "micrometer", 1e-6),
        ("micrometre", "micrometer", 1e-6),
        ("nm", "nanometer", 1e-9),
        ("\u00c5", "angstrom", 1e-10),
        ("in", "inch", 0.0254),
        ("bin", None, None),
        ("", None, None),
    ],
)
def test_units_of_length(unit: str, name: str | None, metres: float | None) -> None:
    layout = VolumeLayout((1, 1, 1), (3.0, 2.0, 1.0), unit)
    assert layout.unit_name == name
    if metres is None:
        assert layout.lengths(1e-10) is None
    else:
        assert layout.lengths(1e-10) == pytest.approx([n * metres / 1e-10 for n in (3, 2, 1)])


@FORMATS
@pytest.mark.parametrize("value", [np.nan, np.inf])
def test_floating_samples_may_be_anything(tmp_path: Path, format: str, value: float) -> None:
    for name, volume in (("one", VOLUME.copy()), ("all", np.full_like(VOLUME, value))):
        volume[2, 3, 4] = value
        write(tmp_path / name, format, volume)
        np.testing.assert_array_equal(read_volume(tmp_path / name), volume)


@FORMATS
@TYPES
def test_integers_come_back_as_values(tmp_path: Path, format: str, dtype: str) -> None:
    if (format, dtype) == ("mrc", "uint8"):
        return
    clipped = write(tmp_path / "v", format, **scaled(dtype))
    assert clipped == ((VOLUME < -2).sum(), (VOLUME > 2).sum())
    assert min(clipped) > 0
    back = read_volume(tmp_path / "v")
    levels = np.iinfo(dtype).max
    wanted = (-2 + 4 / levels * expected(dtype).astype(np.float64)).astype(np.float32)
    assert back.dtype == np.float32
    np.testing.assert_allclose(back, wanted, rtol=0, atol=1e-7)


@FORMATS
def test_values_that_no_integer_stands_for(tmp_path: Path, format: str) -> None:
    volume = VOLUME.copy()
    volume[3, 2, 1] = np.nan
    with pytest.raises(NonFiniteError, match=r"slice 3 .*NaN"):
        write(tmp_path / "v", format, volume, dtype="uint16", window=(0, 1))
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize(
    ("more", "told"),
    [
        ({"dtype": "uint16"}, "needs a window"),
        ({"window": (0, 1)}, "float32 needs none"),
        ({"dtype": "int16", "window": (0, 1)}, "wanted float32, uint16 or uint8"),
        ({"dtype": "uint8", "window": (1, 1)}, "upper end must lie above"),
        ({"dtype": "uint8", "window": (2, 1)}, "upper end must lie above"),
        ({"dtype": "uint8", "window": (0, np.inf)}, "two finite values"),
        ({"dtype": "uint8", "window": (np.nan, 1)}, "two finite values"),
        ({"dtype": "uint8", "window": (-1.7e308, 1.7e308)}, "two finite values"),
        ({"dtype": "uint8", "window": (1.0, 1.0 + 3e-16)}, "too narrow"),
        ({"dtype": "uint8", "window": (0, 1, 2)}, "wanted two numbers"),
        ({"dtype": "uint8", "window": "wide"}, "wanted two numbers"),
    ],
)
def test_windows_that_cannot_be_used(tmp_path: Path, more: dict[str, object], told: str) -> None:
    with pytest.raises(InputError, match=told):
        write(tmp_path / "v", "h5", **more)
    assert list(tmp_path.iterdir()) == []


def means(volume: np.ndarray, axes: tuple[int, ...]) -> np.ndarray:
    """Means of pairs in double precision; the last sample of an odd axis counts twice."""
    volume = volume.astype(np.float64)
    for axis in axes:
        if volume.shape[axis] % 2:
            last = np.take(volume, [-1], axis)
            volume = np.concatenate([volume, last], axis)
        pairs = np.moveaxis(volume, axis, 0)
        volume = np.moveaxis((pairs[::2] + pairs[1::2]) / 2, 0, axis)
    return volume


@pytest.mark.parametrize("dtype", ["float32", "uint16"])
def test_ome_zarr(tmp_path: Path, dtype: str) -> None:
    volume = np.random.default_rng(4).standard_normal((71, 20, 601)).astype(np.float32)
    more = {} if dtype == "float32" else scaled(dtype)
    write(tmp_path / "v.zarr", "zarr", volume, **more)
    group = zarr.open_group(str(tmp_path / "v.zarr"), mode="r")
    image = dict(group.attrs)["multiscales"][0]
    assert image["version"] == "0.4"
    unit = {"type": "space", "unit": "millimeter"}
    assert image["axes"] == [{"name": axis, **unit} for axis in "zyx"]
    levels = [group[entry["path"]] for entry in image["datasets"]]
    assert [level.shape for level in levels] == [(71, 20, 601), (36, 20, 301), (36, 20, 151)]
    stored = levels[0][...]
    if dtype == "float32":
        np.testing.assert_array_equal(stored, volume)
        np.testing.assert_allclose(levels[1][...], means(stored, (0, 2)), atol=1e-6)
        np.testing.assert_allclose(levels[2][...], means(levels[1][...], (2,)), atol=1e-6)
    else:
        np.testing.assert_array_equal(levels[1][...], np.rint(means(stored, (0, 2))))
    scale, shift = image["datasets"][2]["coordinateTransformations"]
    assert (scale["type"], scale["scale"]) == ("scale", [2.0, 0.5, 1.0])
    # The mean of samples 0 and 1 in z, and of 0 to 3 in x.
    assert shift["translation"] == [3.5, -1.0, -2.0 + 1.5 * 0.25]
    window = group.attrs["omero"]["channels"][0]["window"]
    if dtype == "float32":
        assert (window["min"], window["max"]) == (float(volume.min()), float(volume.max()))
        assert window["min"] <= window["start"] < window["end"] <= window["max"] * 1.5
    else:
        assert window == {"min": 0, "max": 65535, "start": 0, "end": 65535}


@pytest.mark.filterwarnings("ignore::DeprecationWarning")
def test_ome_zarr_by_its_own_reader(tmp_path: Path) -> None:
    """The reader of the format's makers."""
    reader = pytest.importorskip("ome_zarr.reader")
    from ome_zarr.io import parse_url

    write(tmp_path / "v.zarr", "zarr", np.tile(VOLUME, (1, 60, 1)))
    nodes = list(reader.Reader(parse_url(tmp_path / "v.zarr"))())
    assert [level.shape for level in nodes[0].data] == [(5, 360, 7), (5, 180, 7)]
    np.testing.assert_array_equal(nodes[0].data[0].compute(), np.tile(VOLUME, (1, 60, 1)))
    assert [axis["unit"] for axis in nodes[0].metadata["axes"]] == ["millimeter"] * 3


@pytest.mark.filterwarnings("ignore::DeprecationWarning")
def test_ome_zarr_by_its_model(tmp_path: Path) -> None:
    """A model that checks the rules of the specification."""
    model = pytest.importorskip("ome_zarr_models.v04.image")
    write(tmp_path / "v.zarr", "zarr", np.tile(VOLUME, (1, 60, 1)))
    image = model.Image.from_zarr(zarr.open_group(str(tmp_path / "v.zarr"), mode="r"))
    assert len(image.attributes.multiscales[0].datasets) == 2


def test_slices_of_zeros_are_written(tmp_path: Path) -> None:
    write(tmp_path / "v", "zarr", np.zeros((17, 4, 4), np.float32))
    assert {p.name for p in (tmp_path / "v" / "0").iterdir()} == {".zarray", ".zattrs", "0", "1"}


def test_a_chunk_that_is_missing(tmp_path: Path) -> None:
    write(tmp_path / "v", "zarr", np.tile(VOLUME, (9, 1, 1)))
    chunk = tmp_path / "v" / "0" / "1" / "0" / "0"
    whole = chunk.read_bytes()
    chunk.write_bytes(whole[:-9])
    with pytest.raises(FileFormatError, match="v: "):
        read_volume(tmp_path / "v")
    chunk.unlink()
    with pytest.raises(FileFormatError, match="0/1/0/0"):
        read_volume(tmp_path / "v")
    if hasattr(os, "mkfifo"):
        os.mkfifo(chunk)
        with pytest.raises(FileFormatError, match="neither a file nor a folder"):
            read_volume(tmp_path / "v")


def test_stores_of_others(tmp_path: Path) -> None:
    for kind in (2, 3):
        try:
            group = zarr.open_group(str(tmp_path / f"z{kind}"), mode="w", zarr_format=kind)
        except TypeError:
            pytest.skip("Zarr 2 cannot write stores of version 3")
        data = group.create_array("s0", shape=VOLUME.shape, dtype="f4", chunks=(2, 6, 7))
        data[...] = VOLUME
        told = {"multiscales": [{"datasets": [{"path": "s0"}]}]}
        group.attrs.update(told if kind == 2 else {"ome": told})
        np.testing.assert_array_equal(read_volume(tmp_path / f"z{kind}"), VOLUME)
    attributes = json.loads((tmp_path / "z2" / ".zattrs").read_text())
    for path, error in (("../z3/s0", PathEscapeError), ("s1", FileFormatError)):
        attributes["multiscales"][0]["datasets"][0]["path"] = path
        (tmp_path / "z2" / ".zattrs").write_text(json.dumps(attributes))
        with pytest.raises(error):
            read_volume(tmp_path / "z2")
    (tmp_path / "z2" / ".zattrs").write_text("{}")
    with pytest.raises(FileFormatError, match="names no image"):
        read_volume(tmp_path / "z2")


@pytest.mark.each
@pytest.mark.parametrize("format", ["tiff-stack", "mrc", "h5"])
def test_files_that_were_cut_off(tmp_path: Path, format: str) -> None:
    write(tmp_path / "v", format)
    whole = (tmp_path / "v").read_bytes()
    end = {"tiff-stack": 900, "mrc": 1500, "h5": len(whole) - 100}[format]
    (tmp_path / "v").write_bytes(whole[:end])
    with pytest.raises(FileFormatError):
        read_volume(tmp_path / "v")


@pytest.mark.parametrize("format", ["tiff", "tiff-stack"])
def test_a_page_whose_samples_are_nowhere(tmp_path: Path, format: str, capfd) -> None:
    """Readers take such a page for zeros, and only log it."""
    write(tmp_path / "v", format)
    path = tmp_path / "v" / "slice_00000.tif" if format == "tiff" else tmp_path / "v"
    whole = path.read_bytes()
    tag = np.array([273], "<u2").tobytes()  # StripOffsets
    path.write_bytes(whole.replace(tag, b"\xf0\xf0", 1))
    with pytest.raises(FileFormatError):
        read_volume(tmp_path / "v")
    assert capfd.readouterr().err == ""


@pytest.mark.parametrize("order", ["<", ">"])
@pytest.mark.parametrize("dtype", ["float32", "uint16", "uint8"])
def test_stacks_of_imagej_s_own(tmp_path: Path, order: str, dtype: str) -> None:
    """ImageJ writes the most significant byte first."""
    stack = (VOLUME * 40 + 100).astype(dtype)
    tifffile.imwrite(tmp_path / "s.tif", stack, imagej=True, byteorder=order)
    np.testing.assert_array_equal(read_volume(tmp_path / "s.tif"), stack.astype(np.float32))


def test_a_picture_is_no_volume(tmp_path: Path) -> None:
    tifffile.imwrite(tmp_path / "p.tif", VOLUME[0], compression="zlib")
    with pytest.raises(FileFormatError, match="plain"):
        read_volume(tmp_path / "p.tif")
    tifffile.imwrite(tmp_path / "q.tif", np.zeros((4, 5, 3), np.uint8), photometric="rgb")
    with pytest.raises(ShapeError, match="wanted one channel"):
        read_volume(tmp_path / "q.tif")
