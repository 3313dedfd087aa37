"""TIFF folders and stacks: every type of sample, every way of naming flats, darks and angles."""

from __future__ import annotations

import pickle
from functools import partial
from pathlib import Path

import numpy as np
import OpenImageIO
import pytest
import tiff_files as made

from rift_cl.errors import InputError, ShapeError
from rift_cl.io import ScanFile, open_scan
from rift_cl.io.scans.tiff_float64 import Float64Pages

# Frames of numbers that all differ, to be read as they are.
as_they_are = partial(open_scan, kind="attenuation")


def whole(scan: ScanFile) -> np.ndarray:
    return scan.read(0, scan.shape[1]).projections


def check_rows(scan: ScanFile, stack: np.ndarray) -> None:
    """Every range of rows is that part of the stack."""
    assert scan.shape == stack.shape
    rows = stack.shape[1]
    for start, stop in ((0, rows), (0, 1), (rows - 1, rows), (3, 4), (5, 13), (8, 16)):
        read = scan.read(start, stop).projections
        assert read.dtype == np.float32 and read.flags.c_contiguous
        np.testing.assert_array_equal(read, stack[:, start:stop].astype(np.float32))


STORED = ["u1", "i1", "u2", "i2", "u4", "i4", "f2", "f4", "f8", ">u2", ">f4", ">f8"]


@pytest.mark.parametrize("dtype", STORED)
@pytest.mark.parametrize(
    "options",
    [
        {},
        {"rowsperstrip": 7},
        {"rowsperstrip": 1, "bigtiff": True},
        {"tile": (16, 16)},
        {"compression": "zlib", "rowsperstrip": 8},
        {"compression": "zlib", "tile": (16, 16)},
        {"photometric": "miniswhite"},
    ],
    ids=str,
)
def test_every_sample_in_every_layout(tmp_path: Path, dtype: str, options: dict) -> None:
    stack = made.frames(dtype=dtype)
    options = {**options, "byteorder": dtype[0] if dtype[0] == ">" else "<"}
    check_rows(as_they_are(made.write_pages(tmp_path / "a.tif", stack, **options)), stack)


@pytest.mark.parametrize("dtype", ["u2", "i4"])
def test_differences_of_neighbours(tmp_path: Path, dtype: str) -> None:
    stack = made.frames(dtype=dtype)
    made.write_pages(tmp_path / "a.tif", stack, compression="zlib", predictor=2)
    check_rows(as_they_are(tmp_path / "a.tif"), stack)


@pytest.mark.parametrize("kind", ["uint8", "uint16", "uint", "float", "double"])
@pytest.mark.parametrize("packed", ["none", "zip", "lzw", "packbits"])
def test_what_openimageio_writes(tmp_path: Path, kind: str, packed: str) -> None:
    if kind == "double" and packed in ("lzw", "packbits"):
        pytest.skip("refused; see test_tiff_faults")
    dtype = {"uint8": "u1", "uint16": "u2", "uint": "u4", "float": "f4", "double": "f8"}[kind]
    stack = made.frames(dtype=dtype)
    output = OpenImageIO.ImageOutput.create("tiff")
    for page, frame in enumerate(stack):
        spec = OpenImageIO.ImageSpec(made.BINS, made.ROWS, 1, kind)
        spec.attribute("compression", packed)
        spec.attribute("tiff:write_exif", 0)
        assert output.open(str(tmp_path / "a.tif"), spec, "AppendSubimage" if page else "Create")
        assert output.write_image(frame[..., None])
    output.close()
    check_rows(as_they_are(tmp_path / "a.tif"), stack)


def test_float64_keeps_what_float32_cannot(tmp_path: Path) -> None:
    stack = made.frames(dtype="f8") + 1e-9
    made.write_pages(tmp_path / "a.tif", stack, compression="zlib", tile=(16, 16))
    pages = Float64Pages(tmp_path / "a.tif")
    np.testing.assert_array_equal(pages.rows(4, 3, 18, (made.ROWS, made.BINS)), stack[4, 3:18])


def test_files_follow_their_numbers(tmp_path: Path) -> None:
    stack = made.frames(12)
    made.write_series(tmp_path / "a", "Proj {}.TIF", stack)
    scan = as_they_are(tmp_path / "a")
    check_rows(scan, stack)
    assert (scan.kind, scan.pitch, scan.fan, scan.source) == ("attenuation", None, None, "TIFF")
    check_rows(pickle.loads(pickle.dumps(scan)), stack)


def test_assumed_angles_are_told(tmp_path: Path) -> None:
    scan = as_they_are(made.write_series(tmp_path / "a", "p_{:04}.tif", made.frames()))
    np.testing.assert_allclose(scan.angles, np.deg2rad(np.arange(6) * 30.0), rtol=1e-15)
    assert not scan.angles.flags.writeable
    assert "6 projections are taken as evenly spread over 180 degrees" in scan.notes[1]
    with pytest.raises(InputError, match=r"'p_0001.tif' .uint16.*counts.*--flats"):
        open_scan(tmp_path / "a")


@pytest.mark.parametrize(
    ("theta", "degrees"),
    [
        ("360", np.arange(6) * 60.0),
        ("-90:90", np.arange(6) * 30.0 - 90),
        ("10.5:-19.5", 10.5 - np.arange(6) * 5.0),
    ],
)
def test_turns(tmp_path: Path, theta: str, degrees: np.ndarray) -> None:
    made.write_series(tmp_path / "a", "p_{:04}.tif", made.frames())
    scan = as_they_are(tmp_path / "a", theta=theta)
    np.testing.assert_allclose(np.rad2deg(scan.angles), degrees, atol=1e-12)
    assert not any("evenly" in note for note in scan.notes)


DEGREES = np.array([0.0, 10, 5, -3.25, 1e2, 720])
TEXTS = {
    "a.txt": "# degrees\n0\n10\n5 # again\n-3.25\n\n1e2\n720\n",
    "b.csv": "0, 10, 5, -3.25, 100, 720",
    "c.csv": "\ufeff0,\r\n10,\r\n5,\r\n-3.25,\r\n100,\r\n720,\r\n",
    "d.txt": "0 10;5\t-3.25 100  720\n",
}


@pytest.mark.parametrize("name", TEXTS)
def test_angles_in_a_text(tmp_path: Path, name: str) -> None:
    made.write_series(tmp_path / "a", "p_{:04}.tif", made.frames())
    (tmp_path / name).write_bytes(TEXTS[name].encode())
    scan = as_they_are(tmp_path / "a", theta=str(tmp_path / name))
    np.testing.assert_allclose(scan.angles, np.deg2rad(DEGREES), rtol=1e-15)


@pytest.mark.parametrize("place", ["a/angles.txt", "a/theta.csv", "theta.npy", "angles.csv"])
def test_angles_beside_the_projections(tmp_path: Path, place: str) -> None:
    made.write_series(tmp_path / "a", "p_{:04}.tif", made.frames())
    if place.endswith(".npy"):
        np.save(tmp_path / place, DEGREES[:, None])
    else:
        (tmp_path / place).write_text(TEXTS["a.txt"])
    scan = as_they_are(tmp_path / "a")
    np.testing.assert_allclose(scan.angles, np.deg2rad(DEGREES), rtol=1e-15)
    assert "angles in degrees" in scan.notes[0] and place in scan.notes[1]


def test_radians_in_the_place_of_degrees(tmp_path: Path) -> None:
    made.write_series(tmp_path / "a", "p_{:04}.tif", made.frames(18))
    np.savetxt(tmp_path / "a" / "angles.txt", np.linspace(0, np.pi, 18))
    scan = as_they_are(tmp_path / "a")
    np.testing.assert_allclose(scan.angles, np.linspace(0, np.pi, 18))
    assert any("taken as radians, not degrees" in note for note in scan.notes)
    np.savetxt(tmp_path / "a" / "angles.txt", np.linspace(0, 2, 18))
    with pytest.raises(InputError, match=r"2 in 18 views.*--angle-unit"):
        as_they_are(tmp_path / "a")
    scan = as_they_are(tmp_path / "a", angle_unit="degrees")
    np.testing.assert_allclose(np.rad2deg(scan.angles), np.linspace(0, 2, 18))


def calibration(kind: str) -> np.ndarray:
    return made.frames(*((2,) if kind == "flats" else (3,))) + {"flats": 500, "darks": 5}[kind]


def check_calibrated(scan: ScanFile) -> None:
    rows = scan.read(2, 9)
    assert scan.kind == "counts" and rows.flats is not None and rows.darks is not None
    np.testing.assert_array_equal(rows.projections, made.frames()[:, 2:9])
    np.testing.assert_array_equal(rows.flats, calibration("flats")[:, 2:9])
    np.testing.assert_array_equal(rows.darks, calibration("darks")[:, 2:9])


WAYS = {
    "one folder": ("proj_{:04}.tif", "flat_{:04}.tif", "dark_{:04}.tif"),
    "other names": ("s1_{}.tif", "s1_WhiteField_{}.tiff", "DF{}.tif"),
    "folders inside": ("p{}.tif", "flats/f{}.tif", "Dark_Fields/d{}.tif"),
    "folders beside": ("../projections/p{}.tif", "../flat/f{}.tif", "../dark/d{}.tif"),
}


@pytest.mark.parametrize("way", WAYS)
def test_flats_and_darks_by_their_names(tmp_path: Path, way: str) -> None:
    folder = tmp_path / "scan" / "projections"
    for name, stack in zip(
        WAYS[way], (made.frames(), calibration("flats"), calibration("darks")), strict=True
    ):
        path = folder / name.removeprefix("../projections/")
        made.write_series(path.parent.resolve(), path.name, stack)
    scan = open_scan(folder)
    check_calibrated(scan)
    assert "flats from" in scan.source and "darks from" in scan.source
    outside = [note for note in scan.notes if "outside the scan's folder" in note]
    assert len(outside) == (2 if way == "folders beside" else 0)
    if way == "folders beside":
        assert (
            str(folder.parent / "flat") in outside[0] and str(folder.parent / "dark") in outside[1]
        )
        check_calibrated(open_scan(folder.parent))
        assert not any("outside" in note for note in open_scan(folder.parent).notes)


def test_frames_of_another_size_outside_the_folder_are_passed_over(tmp_path: Path) -> None:
    made.write_series(tmp_path / "scan", "p{}.tif", made.frames())
    made.write_pages(tmp_path / "ff.tif", calibration("flats")[:, :-1])
    scan = as_they_are(tmp_path / "scan")
    (note,) = [note for note in scan.notes if "passed over" in note]
    assert str(tmp_path / "ff.tif") in note and scan.read(0, 1).flats is None
    inside = tmp_path / "scan" / "ff.tif"
    (tmp_path / "ff.tif").rename(inside)
    with pytest.raises(ShapeError, match="they must agree"):
        open_scan(tmp_path / "scan")


def _two_sizes(folder: Path) -> None:
    made.write_series(folder, "f{}.tif", [calibration("flats")[0], calibration("flats")[1, :-1]])


def _coloured(folder: Path) -> None:
    made.write_series(folder, "f{}.tif", np.zeros((2, 8, 9, 3), "u1"), photometric="rgb")


def _damaged(folder: Path) -> None:
    made.write_series(folder, "f{}.tif", calibration("flats"))
    (folder / "f1.tif").write_bytes(b"II*\0")


@pytest.mark.parametrize("write", [_two_sizes, _coloured, _damaged])
def test_frames_outside_the_folder_that_are_no_stack_are_passed_over(tmp_path: Path, write) -> None:
    made.write_series(tmp_path / "scan", "p{}.tif", made.frames())
    write(tmp_path / "flats")
    scan = as_they_are(tmp_path / "scan")
    (note,) = [note for note in scan.notes if "passed over" in note]
    assert note.startswith(str(tmp_path / "flats")) and scan.read(0, 1).flats is None
    with pytest.raises(InputError, match="flats"):
        as_they_are(tmp_path / "scan", flats=str(tmp_path / "flats"))


@pytest.mark.parametrize(
    ("names", "times"),
    [
        (("before", "after"), [0, 0, made.VIEWS, made.VIEWS]),
        (("flats_pre", "flats_post"), [0, 0, made.VIEWS, made.VIEWS]),
        (("1", "2"), None),
        (("before", "2"), None),
    ],
    ids=str,
)
def test_flats_in_folders_of_a_folder(tmp_path: Path, names, times) -> None:
    """All of them are flats, found or named; of when they were taken names may tell."""
    made.write_series(tmp_path / "scan", "p{}.tif", made.frames())
    for name in names:
        made.write_series(tmp_path / "scan" / "flats" / name, "f{}.tif", calibration("flats"))
    for scan in (open_scan(tmp_path / "scan"), open_scan(tmp_path / "scan", flats="flats")):
        rows = scan.read(2, 9)
        np.testing.assert_array_equal(rows.flats, np.tile(calibration("flats"), (2, 1, 1))[:, 2:9])
        at = None if scan.flats_at is None else sorted(scan.flats_at)
        assert at == times
        if times:
            assert (scan.flats_at[0] == 0) == (names[0] < names[1])


def test_stacks_beside_each_other(tmp_path: Path) -> None:
    made.write_pages(tmp_path / "flats.tif", calibration("flats"))
    made.write_pages(tmp_path / "dark.tif", calibration("darks"))
    made.write_pages(tmp_path / "sample.tif", made.frames())
    check_calibrated(open_scan(tmp_path / "sample.tif"))
    check_calibrated(open_scan(tmp_path))


def test_named_flats_and_darks(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    made.write_series(tmp_path / "p", "p{}.tif", made.frames())
    made.write_series(tmp_path / "other" / "before", "x{}.tif", calibration("flats"))
    made.write_pages(tmp_path / "p" / "d" / "all.tif", calibration("darks"))
    check_calibrated(open_scan(tmp_path / "p", flats="../other/before", darks="d/all.tif"))
    monkeypatch.chdir(tmp_path / "other")
    check_calibrated(open_scan("../p", flats="before", darks=str(tmp_path / "p" / "d")))
    with pytest.raises(InputError, match=r"'gone'"):
        open_scan("../p", flats="gone")


def test_darks_without_flats_are_not_used(tmp_path: Path) -> None:
    made.write_series(tmp_path, "p{}.tif", made.frames())
    made.write_series(tmp_path, "dark{}.tif", calibration("darks"))
    scan = as_they_are(tmp_path)
    assert (scan.kind, scan.read(0, 1).darks) == ("attenuation", None)
    assert any("darks are not used" in note for note in scan.notes)


@pytest.mark.parametrize("theta", [None, "0:180"])
def test_sinograms_ask_for_angles_only_where_none_are_given(tmp_path: Path, theta) -> None:
    made.write_series(tmp_path, "sino_{}.tif", made.frames())
    with pytest.raises(InputError, match="--axes row,angle,bin") as caught:
        as_they_are(tmp_path, theta=theta)
    assert ("--theta" in str(caught.value)) == (theta is None)


@pytest.mark.parametrize(
    ("table", "column"),
    [
        ("index,angle_deg\n{rows:,}", ""),
        ("file;angle\n{files:;}", ""),
        ("0 of them\tTheta\n{rows:\t}", ""),
        ("# written by the stage\nframe, rotation\n{rows:,}", ":rotation"),
        ("{rows:,}", ":2"),
        ("file;angle\n{commas:;}", ":angle"),
    ],
)
def test_angles_in_a_column_of_a_table(tmp_path: Path, table: str, column: str) -> None:
    made.write_series(tmp_path / "tomo", "p_{}.tif", made.frames())
    degrees = np.arange(made.VIEWS) * 30.5
    part = next(sign for sign in ",;\t" if sign + "}" in table)
    lines = {
        "rows": [f"{n}{part}{angle}" for n, angle in enumerate(degrees)],
        "files": [f"p_{n}.tif{part}{angle}" for n, angle in enumerate(degrees)],
        "commas": [
            f"p_{n}.tif{part}{angle}".replace(".5", ",5") for n, angle in enumerate(degrees)
        ],
    }
    head, _, tail = table.partition("{")
    log = tmp_path / "log.csv"
    log.write_text(head + "\n".join(lines[tail.split(":")[0]]) + "\n")
    scan = as_they_are(tmp_path / "tomo", theta=f"{log}{column}")
    np.testing.assert_allclose(scan.angles, np.deg2rad(degrees))


@pytest.mark.parametrize(
    ("text", "column", "words"),
    [
        ("index,rotation\n0,1\n1,2\n", "", ["line 1", "'rotation'", "log.csv:COLUMN"]),
        ("0,1\n1,2\n", "", ["line 1", "2 columns"]),
        ("1,20\n2,40\n", "", ["2 columns", "point"]),
        ("index,angle\n0,1\n1,2\n", ":phi", ["'phi'", "'angle'"]),
        ("index,angle\n0,1\n1\n", "", ["line 3", "column 2"]),
        ("index,angle\n0,1\n1,up\n", "", ["line 3", "'up'"]),
    ],
)
def test_tables_that_do_not_tell_their_angles(
    tmp_path: Path, text: str, column: str, words: list[str]
) -> None:
    made.write_series(tmp_path / "tomo", "p_{}.tif", made.frames(2))
    (tmp_path / "log.csv").write_text(text)
    with pytest.raises(InputError) as told:
        as_they_are(tmp_path / "tomo", theta=f"{tmp_path / 'log.csv'}{column}")
    assert all(word in str(told.value) for word in words)


def test_a_view_that_is_missing_is_told_beside_angles_of_all(tmp_path: Path) -> None:
    folder = made.write_series(tmp_path / "tomo", "p_{}.tif", made.frames())
    (folder / "p_4.tif").unlink()
    (tmp_path / "all.txt").write_text("\n".join(str(30 * n) for n in range(made.VIEWS)))
    with pytest.raises(InputError, match=r"jump after 'p_3.tif'"):
        as_they_are(folder, theta=str(tmp_path / "all.txt"))


def test_flats_frame_by_frame_beside_sinograms(tmp_path: Path) -> None:
    counts = np.rint(1000 + 500 * np.hanning(made.BINS)).astype("u2")
    sinograms = np.broadcast_to(counts, (made.ROWS, made.VIEWS, made.BINS))
    flats = np.full((3, made.ROWS, made.BINS), 3000, "u2") + np.arange(made.BINS, dtype="u2")
    made.write_pages(tmp_path / "sino.tif", sinograms)
    made.write_pages(tmp_path / "flat.tif", flats)
    given = {"axes": "row,angle,bin", "theta": "0:180", "flats": str(tmp_path / "flat.tif")}
    scan = open_scan(tmp_path / "sino.tif", **given)
    read = scan.read(2, 5)
    assert read.projections.shape == (made.VIEWS, 3, made.BINS) and read.flats is not None
    np.testing.assert_array_equal(read.flats, flats[:, 2:5])
