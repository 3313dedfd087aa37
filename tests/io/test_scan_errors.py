"""Arrays that do not fit and files that are not what they seem: errors that say so."""

from __future__ import annotations

from pathlib import Path

import h5py
import numpy as np
import pytest
import scan_files as made

from rift_cl.errors import (
    DTypeError,
    FileFormatError,
    InputError,
    NonFiniteError,
    ShapeError,
)
from rift_cl.io import open_scan


@pytest.mark.parametrize("rows", [(0, 0), (-1, 2), (2, 5), (3, 2)])
def test_rows_that_are_not_there(tmp_path: Path, rows: tuple[int, int]) -> None:
    made.data_exchange(tmp_path / "a.h5")
    with pytest.raises(InputError, match="rows 0 to 4"):
        open_scan(tmp_path / "a.h5").read(*rows)


def test_a_file_that_changed_since(tmp_path: Path) -> None:
    path = tmp_path / "a.h5"
    made.data_exchange(path)
    scan = open_scan(path)
    with h5py.File(path, "a") as file:
        del file["exchange/data"]
        file["exchange/data"] = made.counts(6, 4, 7)
    with pytest.raises(FileFormatError, match=r"had shape \(6, 4, 5\)"):
        scan.read(0, 1)
    path.unlink()
    with pytest.raises(InputError, match="no such file"):
        scan.read(0, 1)


def replaced(path: Path, name: str, value: object) -> Path:
    made.data_exchange(path)
    with h5py.File(path, "a") as file:
        del file["exchange/" + name]
        file["exchange/" + name] = value
    return path


@pytest.mark.parametrize(
    ("name", "value", "kind", "message"),
    [
        ("theta", np.arange(7.0), ShapeError, "7 angles for 6 projections"),
        ("theta", np.zeros((3, 2)), ShapeError, "one number per frame"),
        ("theta", [0, 1, np.nan, 3, 4, 5], NonFiniteError, "angle 2"),
        ("theta", [b"x"] * 6, DTypeError, "exchange/theta"),
        ("data", np.zeros((6, 4, 5), np.bool_), DTypeError, "exchange/data.*bool"),
        ("data", np.zeros((6, 4, 5), np.complex64), DTypeError, "complex64"),
        ("data", "text", DTypeError, "exchange/data"),
        ("data", np.zeros((6, 0, 5)), ShapeError, "holds nothing"),
        ("data", h5py.Empty("f4"), ShapeError, "holds nothing"),
        ("data", np.zeros((6, 4, 5, 2)), ShapeError, r"wanted \(angle, row, bin\)"),
        ("data_white", np.zeros((2, 4, 6)), ShapeError, "rows and bins must agree"),
        ("data_dark", np.zeros(5), ShapeError, "rows and bins must agree"),
    ],
)
def test_arrays_that_do_not_fit(
    tmp_path: Path, name: str, value: object, kind: type[Exception], message: str
) -> None:
    with pytest.raises(kind, match=message):
        open_scan(replaced(tmp_path / "a.h5", name, value))


@pytest.mark.parametrize(
    ("arrays", "kind", "message"),
    [
        ({"angles": np.zeros(5)}, ShapeError, "5 angles for 6"),
        ({"angles": np.array([0, 1, 2, 3, 4, np.inf])}, NonFiniteError, "angle 5"),
        ({"projections": np.zeros((6, 4, 5), "?")}, DTypeError, "bool"),
        ({"projections": np.array([[[None]]])}, DTypeError, "object"),
        ({"projections": np.zeros((6, 0, 5))}, ShapeError, "holds nothing"),
        ({"flats": np.zeros((2, 4, 6))}, ShapeError, "must agree"),
    ],
)
def test_npz_arrays_that_do_not_fit(
    tmp_path: Path, arrays: dict[str, np.ndarray], kind: type[Exception], message: str
) -> None:
    usual = {"projections": np.zeros((6, 4, 5)), "angles": np.zeros(6)}
    np.savez(tmp_path / "a.npz", **{**usual, **arrays})
    with pytest.raises(kind, match=message):
        open_scan(tmp_path / "a.npz")


def test_files_that_hold_no_scan_list_what_they_hold(tmp_path: Path) -> None:
    with h5py.File(tmp_path / "a.h5", "w") as file:
        for index in range(12):
            file[f"g/d{index:02}"] = np.zeros((2, index + 1))
    with pytest.raises(FileFormatError, match=r"'/g/d00' \(2, 1\).*'/g/d07' \(2, 8\), \.\.\.:"):
        open_scan(tmp_path / "a.h5")
    with pytest.raises(FileFormatError, match=r"'g/x'.*'/g/d00'"):
        open_scan(tmp_path / "a.h5", dataset="g/x")
    with pytest.raises(FileFormatError, match="--theta"):
        open_scan(tmp_path / "a.h5", dataset="g/d01")
    np.savez(tmp_path / "a.npz", other=np.zeros((2, 3)))
    with pytest.raises(FileFormatError, match=r"'other' \(2, 3\).*dataset="):
        open_scan(tmp_path / "a.npz")


def test_names_that_lie(tmp_path: Path) -> None:
    (tmp_path / "text.h5").write_text("not a scan")
    with pytest.raises(FileFormatError, match="says HDF5"):
        open_scan(tmp_path / "text.h5")
    made.data_exchange(tmp_path / "really_hdf5.npz")
    with pytest.raises(FileFormatError, match=r"NPZ.*HDF5"):
        open_scan(tmp_path / "really_hdf5.npz")
    made.data_exchange(tmp_path / "a.dat")
    with pytest.raises(InputError, match=r"not from '\.dat'.*\.yaml.*register_scan_reader"):
        open_scan(tmp_path / "a.dat")
    with pytest.raises(InputError, match=r"gone\.h5"):
        open_scan(tmp_path / "gone.h5")
    (tmp_path / "folder.h5").mkdir()
    with pytest.raises(InputError, match="is not a file"):
        open_scan(tmp_path / "folder.h5")
