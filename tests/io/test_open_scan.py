"""Scans are found and read row by row, whatever layout they are in."""

from __future__ import annotations

import pickle
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pytest
import scan_files as made

from rift_cl.errors import FileFormatError, InputError, ShapeError
from rift_cl.io import ScanFile, open_scan, scan_of_arrays

VIEWS = made.counts(6, 4, 5, dtype="<f4")


def whole(scan: ScanFile) -> np.ndarray:
    return scan.read(0, scan.shape[1]).projections


@pytest.mark.parametrize("dtype", ["<u2", ">u2", ">f4", "<f8", "<f2", "<i8"])
def test_data_exchange(tmp_path: Path, dtype: str) -> None:
    data = made.data_exchange(tmp_path / "a.h5", dtype)
    scan = open_scan(tmp_path / "a.h5")
    assert (scan.shape, scan.kind, scan.source) == ((6, 4, 5), "counts", "Data Exchange")
    assert (scan.pitch, scan.unit) == (None, "")
    np.testing.assert_allclose(scan.angles, np.deg2rad(made.DEGREES), rtol=1e-15)
    assert all(fact in repr(scan) for fact in ("a.h5", "6 parallel views", "4 rows of 5", "counts"))
    rows = scan.read(1, 3)
    assert rows.projections.dtype == np.float32
    np.testing.assert_array_equal(rows.projections, data[:, 1:3].astype(np.float32))
    assert rows.flats is not None and rows.darks is not None
    np.testing.assert_array_equal(rows.flats, made.counts(2, 4, 5)[:, 1:3] + 2000)
    np.testing.assert_array_equal(rows.darks, made.counts(3, 4, 5)[:, 1:3] + 1000)


def test_radians_and_other_units(tmp_path: Path) -> None:
    path = tmp_path / "a.h5"
    made.data_exchange(path)
    with h5py.File(path, "a") as file:
        file["exchange/theta"].attrs["units"] = "Radians"
    with pytest.raises(InputError, match=r"150 in 6 views.*radians"):
        open_scan(path)
    np.testing.assert_array_equal(open_scan(path, angle_unit="radians").angles, made.DEGREES)
    with h5py.File(path, "a") as file:
        file["exchange/theta"].attrs["units"] = "gon"
    with pytest.raises(FileFormatError, match="'gon'"):
        open_scan(path)
    with h5py.File(path, "a") as file:
        del file["exchange/theta"].attrs["units"]
    np.testing.assert_allclose(open_scan(path).angles, np.deg2rad(made.DEGREES))


def test_data_exchange_without_angles_takes_named_ones(tmp_path: Path) -> None:
    path = tmp_path / "a.h5"
    made.data_exchange(path)
    with h5py.File(path, "a") as file:
        file.move("exchange/theta", "elsewhere/angle")
        del file["exchange/data_white"]
    with pytest.raises(FileFormatError, match=r"--theta.*/elsewhere/angle|/elsewhere.*--theta"):
        open_scan(path)
    with pytest.raises(InputError, match=r"counts.*--flats"):
        open_scan(path, theta="elsewhere/angle")
    scan = open_scan(path, theta="elsewhere/angle", kind="attenuation")
    np.testing.assert_allclose(scan.angles, np.deg2rad(made.DEGREES))
    assert scan.read(0, 1).flats is None


def test_a_single_flat_without_its_axis(tmp_path: Path) -> None:
    path = tmp_path / "a.h5"
    made.data_exchange(path)
    with h5py.File(path, "a") as file:
        file["one"] = made.counts(4, 5) + 2000
    rows = open_scan(path, flats="one").read(2, 4)
    np.testing.assert_array_equal(rows.flats, made.counts(4, 5)[None, 2:4] + 2000)


def test_flats_as_taken_beside_projections_the_other_way_round(tmp_path: Path) -> None:
    path = tmp_path / "a.h5"
    made.data_exchange(path)
    with h5py.File(path, "a") as file:
        taken = file["exchange/data"][()]
        del file["exchange/data"]
        file["exchange/data"] = np.moveaxis(taken, 0, -1)
    rows = open_scan(path, axes="row,bin,angle").read(1, 3)
    np.testing.assert_array_equal(rows.projections, taken[:, 1:3])
    assert rows.flats is not None
    np.testing.assert_array_equal(rows.flats, made.counts(2, 4, 5)[:, 1:3] + 2000)


def test_unsigned_counts_stored_as_signed_are_told(tmp_path: Path) -> None:
    path = tmp_path / "a.h5"
    made.data_exchange(path)
    with h5py.File(path, "a") as file:
        for name in ("data", "data_white", "data_dark"):
            values = (40 * file["exchange"][name][()].astype("<u4")).astype("<u2").view("<i2")
            values[..., 2] = -30000
            del file["exchange"][name]
            file["exchange"][name] = values
    with pytest.raises(InputError, match=r"far below zero.*store it as uint16"):
        open_scan(path)


def test_flats_without_a_beam_are_told(tmp_path: Path) -> None:
    path = tmp_path / "a.h5"
    made.data_exchange(path)
    with h5py.File(path, "a") as file:
        file["exchange/data"][...] = 20000
        file["exchange/data_white"][...] = file["exchange/data_dark"][:1]
    with pytest.raises(InputError, match=r"flats, .*no brighter than the darks, .*--flats"):
        open_scan(path)


@pytest.mark.parametrize("group", ["entry1/tomo_entry", "entry0000", "/"])
def test_nxtomo(tmp_path: Path, group: str) -> None:
    data = made.nxtomo(tmp_path / "a.nxs", group=group)
    scan = open_scan(tmp_path / "a.nxs")
    assert (scan.shape, scan.kind, scan.pitch, scan.unit) == ((4, 4, 5), "counts", 3.5, "um")
    assert scan.source == "NXtomo /" + group.strip("/")
    np.testing.assert_allclose(scan.angles, np.deg2rad([20, 30, 50, 70]))
    rows = scan.read(1, 4)
    np.testing.assert_array_equal(rows.projections, data[made.KEYS == 0, 1:4])
    np.testing.assert_array_equal(rows.flats, data[made.KEYS == 1, 1:4])
    np.testing.assert_array_equal(rows.darks, data[made.KEYS == 2, 1:4])
    (tmp_path / "a.nxs").rename(tmp_path / "a.nx")
    assert open_scan(tmp_path / "a.nx").source == scan.source


@pytest.mark.parametrize(
    ("name", "value", "told"),
    [
        ("x_flipped", True, True),
        ("y_flipped", np.array([1]), True),
        ("x_flipped", False, False),
        ("x_flipped", "yes", False),
        ("transformations/ry", 180.0, True),
        ("transformations/rx", np.pi, True),
        ("transformations/rx", 0.0, False),
        ("transformations/height", 180.0, False),
    ],
)
def test_frames_that_nxtomo_calls_mirrored(
    tmp_path: Path, name: str, value: Any, told: bool
) -> None:
    data = made.nxtomo(tmp_path / "a.nxs")
    with h5py.File(tmp_path / "a.nxs", "a") as file:
        detector = file["entry1/tomo_entry/instrument/detector"]
        detector[name] = value
        kind = "translation" if "height" in name else "rotation"
        detector[name].attrs["transformation_type"] = kind
        detector[name].attrs["units"] = "rad" if value is np.pi else "deg"
    scan = open_scan(tmp_path / "a.nxs")
    assert any(repr(name) in note and "--reversed" in note for note in scan.notes) == told
    np.testing.assert_array_equal(whole(scan), data[made.KEYS == 0])


def sized(path: Path, name: str, value: float, unit: str = "um") -> None:
    """Add a size of a pixel to an HDF5 file."""
    with h5py.File(path, "a") as file:
        file[name] = value
        file[name].attrs["units"] = unit


def test_nxtomo_rows_have_a_pitch_of_their_own(tmp_path: Path) -> None:
    path, name = tmp_path / "a.nxs", "entry1/tomo_entry/instrument/detector/y_pixel_size"
    made.nxtomo(path)
    square = open_scan(path)
    assert (square.row_pitch, square.aspect) == (None, 1)
    sized(path, name, 7e-6, "m")
    scan = open_scan(path)
    assert (scan.pitch, scan.row_pitch) == pytest.approx((3.5, 7)) and scan.aspect == 2
    assert "pitch 7 x 3.5 um (rows x bins)" in scan.notes[0] and "7 x 3.5 um" in repr(scan)
    with h5py.File(path, "a") as file:
        file[name].attrs["units"] = "furlong"
    doubtful = open_scan(path)
    assert doubtful.row_pitch is None and "'furlong'" in " ".join(doubtful.notes)


def test_data_exchange_rows_have_a_pitch_of_their_own(tmp_path: Path) -> None:
    path, detector = tmp_path / "a.h5", "measurement/instrument/detector/"
    made.data_exchange(path)
    sized(path, detector + "pixel_size_x", 3.0)
    sized(path, detector + "pixel_size_y", 9.0)
    scan = open_scan(path)
    assert (scan.pitch, scan.row_pitch, scan.unit) == (3, 9, "um")
    # Optics make all pixels smaller by one factor, and what is told at the sample comes first.
    sized(path, detector + "actual_pixel_size_x", 0.5)
    scan = open_scan(path)
    assert scan.pitch == 0.5 and scan.row_pitch == pytest.approx(1.5)
    sized(path, detector + "actual_pixel_size_y", 1.25)
    assert open_scan(path).row_pitch == 1.25


@pytest.mark.parametrize("value", [0.0, -1.0, np.nan, np.inf])
def test_a_size_that_is_none_has_no_unit(tmp_path: Path, value: float) -> None:
    path = tmp_path / "a.h5"
    made.data_exchange(path)
    sized(path, "measurement/instrument/detector/actual_pixel_size_x", value)
    scan = open_scan(path)
    assert (scan.pitch, scan.row_pitch, scan.unit) == (None, None, "")
    assert any("--pitch" in note and f"{value:g}" in note for note in scan.notes)
    lengths = {"pitch": [2.0, value], "unit": np.array("mm")}
    np.savez(tmp_path / "a.npz", projections=VIEWS, angles=np.arange(6) / 2, **lengths)
    scan = open_scan(tmp_path / "a.npz", kind="attenuation")
    assert (scan.pitch, scan.row_pitch, scan.unit) == (None, None, "")
    scan = scan_of_arrays(path, VIEWS, np.arange(6) / 2, pitch=value, row_pitch=2.0, unit="mm")
    assert (scan.pitch, scan.row_pitch, scan.unit) == (None, None, "")


@pytest.mark.parametrize(
    ("text", "pitch", "unit"),
    [
        ("50 um", 50, "um"),
        (np.bytes_("50"), 50, ""),
        ("5e1micrometers ", 50, "micrometers"),
        ("about 50", None, ""),
        (2000 * "5", None, ""),
        (["50 um", "50 um"], None, ""),
    ],
)
def test_a_size_that_is_a_text(tmp_path: Path, text: Any, pitch: float | None, unit: str) -> None:
    path = tmp_path / "a.h5"
    made.data_exchange(path)
    name = "measurement/instrument/detector/actual_pixel_size_x"
    with h5py.File(path, "a") as file:
        file[name] = text
    scan = open_scan(path)
    assert (scan.pitch, scan.unit) == (pitch, unit)
    assert any("--pitch" in note for note in scan.notes) == (pitch is None)
    with h5py.File(path, "a") as file:
        file[name].attrs["units"] = "mm"
    assert open_scan(path).unit == (unit or (pitch and "mm") or "")


def test_several_nxtomo_scans_must_be_told_apart(tmp_path: Path) -> None:
    path = tmp_path / "a.nxs"
    made.nxtomo(path, group="first")
    made.nxtomo(path, group="second", mode="a")
    with h5py.File(path, "a") as file:
        file["alias"] = h5py.SoftLink("/first")
    with pytest.raises(FileFormatError, match="several NXtomo"):
        open_scan(path)
    assert open_scan(path, dataset="second").source == "NXtomo second"
    with h5py.File(path, "a") as file:
        del file["second"]
    assert open_scan(path).shape == (4, 4, 5)


def test_nxtomo_key_count(tmp_path: Path) -> None:
    path = tmp_path / "a.nxs"
    made.nxtomo(path)
    key = "entry1/tomo_entry/instrument/detector/image_key"
    with h5py.File(path, "a") as file:
        file[key][:] = 1
    with pytest.raises(FileFormatError, match="image key 0"):
        open_scan(path)
    with h5py.File(path, "a") as file:
        del file[key]
        file[key] = np.zeros(5)
    with pytest.raises(ShapeError, match="5 image keys for 8"):
        open_scan(path)


def test_named_arrays(tmp_path: Path) -> None:
    path = tmp_path / "a.hdf5"
    stack = made.counts(6, 4, 5, dtype="<f4")
    with h5py.File(path, "w") as file:
        file["a/stack"], file["a/sino"] = stack, stack[:, 2]
        file["a/angle"], file["a/flat"] = made.DEGREES, stack[0, 2] + 99
        file["soft"] = h5py.SoftLink("/a")
    scan = open_scan(path, dataset="soft/stack", theta="/soft/angle", kind="attenuation")
    assert (scan.kind, scan.shape) == ("attenuation", (6, 4, 5))
    np.testing.assert_array_equal(whole(scan), stack)
    scan = open_scan(path, dataset="/a/sino", theta="a/angle", flats="a/flat")
    assert (scan.kind, scan.shape) == ("counts", (6, 1, 5))
    rows = scan.read(0, 1)
    np.testing.assert_array_equal(rows.projections[:, 0], stack[:, 2])
    np.testing.assert_array_equal(rows.flats, stack[:1, 2:3] + 99)


@pytest.mark.parametrize("beside", [{}, {"mask": np.ones((4, 5))}, {"flats": VIEWS[:2]}])
def test_the_only_stack_beside_angles_is_the_scan(tmp_path: Path, beside: dict[str, Any]) -> None:
    path = tmp_path / "a.npz"
    np.savez(path, attenuation=VIEWS, angles=np.arange(6) / 2, **beside)
    scan = open_scan(path, kind="attenuation")
    np.testing.assert_array_equal(whole(scan), VIEWS)
    assert "its shape says that 'attenuation' are the projections" in " ".join(scan.notes)
    np.savez(path, attenuation=VIEWS, other=VIEWS, angles=np.arange(6) / 2)
    with pytest.raises(FileFormatError, match="attenuation"):
        open_scan(path, kind="attenuation")


def test_npz(tmp_path: Path) -> None:
    data = made.npz(tmp_path / "a.npz")
    scan = open_scan(tmp_path / "a.npz")
    assert (scan.shape, scan.kind, scan.pitch) == ((6, 4, 5), "counts", 0.25)
    rows = scan.read(2, 4)
    np.testing.assert_array_equal(rows.projections, data[:, 2:4])
    assert rows.flats is not None and rows.flats.dtype == np.float32
    np.testing.assert_array_equal(rows.flats, made.counts(2, 4, 5)[:, 2:4] + 500)
    assert rows.darks is None


@pytest.mark.parametrize(
    ("names", "expected"),
    [
        ({"pitch": [0.09, 0.03]}, (0.09, 0.03)),
        ({"pitch": 0.03}, (None, 0.03)),
        ({"dv": 0.09, "du": 0.03}, (0.09, 0.03)),
        ({"row_pitch": 0.09, "bin_pitch": 0.03}, (0.09, 0.03)),
        ({"pixel_size": 0.03}, (None, 0.03)),
        ({"pitch": [-1.0, 0.03]}, (None, 0.03)),
        ({"pitch": [0.09, 0.0]}, (None, None)),
    ],
)
def test_npz_pitches_are_read_as_those_of_cones(
    tmp_path: Path, names: dict[str, Any], expected: tuple[float | None, float | None]
) -> None:
    stack = {"projections": made.counts(6, 4, 5, dtype="<f4"), "angles": np.deg2rad(made.DEGREES)}
    for unit in ("", "mm"):
        told = {"unit": np.array(unit)} if unit else {}
        np.savez(tmp_path / "a.npz", **stack, **names, **told)
        scan = open_scan(tmp_path / "a.npz", kind="attenuation")
        assert (scan.row_pitch, scan.pitch) == expected
        assert scan.unit == (unit if scan.pitch else "")
    if None not in expected:
        np.savez(tmp_path / "b.npz", **stack, **names, **told, sid=50.0, sdd=200.0)
        cone = open_scan(tmp_path / "b.npz", kind="attenuation")
        assert (cone.row_pitch, cone.pitch, cone.unit) == (*expected, "mm")
        assert cone.aspect == pytest.approx(3)


def test_npz_lengths_that_cannot_be_are_told(tmp_path: Path) -> None:
    stack = {"projections": made.counts(6, 4, 5, dtype="<f4"), "angles": np.deg2rad(made.DEGREES)}
    np.savez(tmp_path / "a.npz", **stack, pitch=[0.1, 0.1, 0.1])
    with pytest.raises(ShapeError, match="'pitch' has 3 numbers"):
        open_scan(tmp_path / "a.npz", kind="attenuation")
    np.savez(tmp_path / "b.npz", **stack, pitch=0.1, unit=np.array("m" * 4000))
    with pytest.raises(FileFormatError, match="'unit' is no word"):
        open_scan(tmp_path / "b.npz", kind="attenuation")


def test_angles_may_be_said_outside_any_file(tmp_path: Path) -> None:
    made.data_exchange(tmp_path / "a.h5")
    made.npz(tmp_path / "a.npz")
    np.savetxt(tmp_path / "t.txt", made.DEGREES[::-1])
    for name in ("a.h5", "a.npz"):
        even = open_scan(tmp_path / name, theta="0:180")
        np.testing.assert_allclose(np.rad2deg(even.angles), 30 * np.arange(made.FRAMES), atol=1e-12)
        ended = open_scan(tmp_path / name, theta="0:180:endpoint")
        np.testing.assert_allclose(
            np.rad2deg(ended.angles), np.linspace(0, 180, made.FRAMES), atol=1e-12
        )
        assert "the end included" in ended.notes[0]
        listed = open_scan(tmp_path / name, theta=str(tmp_path / "t.txt"))
        np.testing.assert_allclose(np.rad2deg(listed.angles), made.DEGREES[::-1], atol=1e-12)
        with pytest.raises(FileFormatError, match="thta"):
            open_scan(tmp_path / name, theta="thta")


def test_npz_named_arrays(tmp_path: Path) -> None:
    data = made.npz(tmp_path / "a.npz")
    with np.load(tmp_path / "a.npz") as file:
        arrays = dict(file)
    np.savez(tmp_path / "a.npz", **arrays, raw=data[:4, 1], phi=np.arange(4.0))
    scan = open_scan(tmp_path / "a.npz", dataset="raw", theta="phi", kind="attenuation")
    assert (scan.shape, scan.kind) == ((4, 1, 5), "attenuation")
    np.testing.assert_array_equal(scan.angles, np.arange(4.0))
    np.testing.assert_array_equal(whole(scan)[:, 0], data[:4, 1])


def test_npz_sinogram(tmp_path: Path) -> None:
    sinogram = np.asfortranarray(made.counts(6, 5, dtype=">f8"))
    np.savez(tmp_path / "a.npz", sinogram=sinogram, angles=np.arange(6))
    scan = open_scan(tmp_path / "a.npz", kind="attenuation")
    assert (scan.shape, scan.kind, scan.pitch) == ((6, 1, 5), "attenuation", None)
    np.testing.assert_array_equal(whole(scan)[:, 0], sinogram)


def test_a_scan_can_be_sent_to_another_process(tmp_path: Path) -> None:
    made.data_exchange(tmp_path / "a.h5")
    made.npz(tmp_path / "b.npz")
    for name in ("a.h5", "b.npz"):
        scan = open_scan(tmp_path / name)
        np.testing.assert_array_equal(whole(pickle.loads(pickle.dumps(scan))), whole(scan))


def test_the_tooth(shared_data: Path) -> None:
    scan = open_scan(shared_data / "tooth" / "tooth.h5")
    assert (scan.shape, scan.kind) == ((181, 2, 640), "counts")
    assert scan.angles[-1] == pytest.approx(np.deg2rad(179.0055), abs=1e-6)
    rows = scan.read(1, 2)
    assert rows.flats is not None and rows.darks is not None
    assert rows.flats.shape == rows.darks.shape == (10, 1, 640)
    dark = rows.darks.mean(0)
    line = -np.log((rows.projections - dark) / (rows.flats.mean(0) - dark))
    assert abs(np.median(line[:, 0, :40])) < 0.05
    assert line[:, 0, 250:350].mean() > 0.5


@pytest.mark.parametrize("named", [True, False])
def test_flats_darks_and_angles_in_other_hdf5_files(tmp_path: Path, named: bool) -> None:
    frames = made.counts(6, 4, 5) + 100
    with h5py.File(tmp_path / "scan.h5", "w") as file:
        file["entry/data"] = frames
    for name, array in (
        ("ff", made.counts(2, 4, 5) + 2000),
        ("dd", made.counts(3, 4, 5)),
        ("rot", made.DEGREES),
    ):
        with h5py.File(tmp_path / f"{name}.h5", "w") as file:
            file["entry/values"], file["entry/exposure"] = array, 0.1
    inside = ":/entry/values" if named else ""
    given = {"flats": f"ff.h5{inside}", "darks": f"dd.h5{inside}", "theta": f"rot.h5{inside}"}
    scan = open_scan(tmp_path / "scan.h5", dataset="entry/data", **given)
    assert scan.kind == "counts" and "2 flats and 3 darks" in scan.notes[0]
    np.testing.assert_allclose(scan.angles, np.deg2rad(made.DEGREES))
    rows = pickle.loads(pickle.dumps(scan)).read(1, 3)
    np.testing.assert_array_equal(rows.projections, frames[:, 1:3])
    np.testing.assert_array_equal(rows.flats, made.counts(2, 4, 5)[:, 1:3] + 2000)
    np.testing.assert_array_equal(rows.darks, made.counts(3, 4, 5)[:, 1:3])


def test_what_is_named_in_another_file_and_is_not_there(tmp_path: Path) -> None:
    with h5py.File(tmp_path / "scan.h5", "w") as file:
        file["data"], file["angles"] = made.counts(6, 4, 5), made.DEGREES
    with h5py.File(tmp_path / "two.h5", "w") as file:
        file["a"], file["b"] = made.counts(2, 4, 5), made.counts(2, 4, 5)
    for flats, word in (
        ("none.h5", "none.h5"),
        ("two.h5", "--flats two.h5:/NAME"),
        ("two.h5:/c", "'/c'"),
    ):
        with pytest.raises(InputError, match=word):
            open_scan(tmp_path / "scan.h5", flats=flats)
