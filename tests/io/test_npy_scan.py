"""Scans in NPY files: what lies beside the projections, what is named, and files that lie."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from rift_cl.commands.inputs.scan_identity import WatchedScan
from rift_cl.errors import FileFormatError, InputError
from rift_cl.io import open_scan

VIEWS, ROWS, BINS = 40, 3, 32
DEGREES = np.arange(VIEWS) * 4.5


def lines() -> np.ndarray:
    """Line integrals of something round, of another radius in every row, that wobbles."""
    bins = np.linspace(-1.2, 1.2, BINS) - 0.05 * np.cos(np.deg2rad(DEGREES))[:, None, None]
    return np.maximum(np.linspace(0.7, 1, ROWS)[:, None] - bins**2, 0)


TURN = {"theta": "0:180", "axes": "angle,row,bin"}
COUNTS = np.rint(3000 * np.exp(-lines()) + 100).astype("u2")
FLATS = np.full((2, ROWS, BINS), 3100, "u2")
DARKS = np.full((ROWS, BINS), 100, "u2")


def saved(folder: Path, **arrays: np.ndarray) -> Path:
    """NPY files that are called so; the path of the first."""
    folder.mkdir(parents=True, exist_ok=True)
    for name, values in arrays.items():
        np.save(folder / f"{name}.npy", values)
    return folder / f"{next(iter(arrays))}.npy"


def counted(folder: Path) -> Path:
    return saved(folder, proj=COUNTS, flat=FLATS, dark=DARKS, theta=DEGREES)


def test_a_folder_of_files_is_the_archive_of_the_same_arrays(tmp_path: Path) -> None:
    scan = open_scan(counted(tmp_path))
    np.savez(tmp_path / "a.npz", proj=COUNTS, flat=FLATS, dark=DARKS, theta=DEGREES)
    archive = open_scan(tmp_path / "a.npz")
    assert (scan.kind, scan.shape) == (archive.kind, archive.shape) == ("counts", COUNTS.shape)
    assert np.array_equal(scan.angles, archive.angles)
    ours, theirs = scan.read(1, ROWS), archive.read(1, ROWS)
    for part in ("projections", "flats", "darks"):
        assert np.array_equal(getattr(ours, part), getattr(theirs, part)), part
    assert any("'theta', 'flat', 'dark'" in note for note in scan.notes)


@pytest.mark.parametrize("turned", [(0, 1, 2), (1, 0, 2), (2, 1, 0)])
@pytest.mark.parametrize("order", ["C", "F"])
def test_axes_and_orders_of_storage_give_the_same_rows(
    tmp_path: Path, turned: tuple[int, int, int], order: str
) -> None:
    stored = np.asarray(lines().transpose(turned), dtype=">f4", order=order)
    path = saved(tmp_path, sino=stored)
    axes = ",".join(np.array(["angle", "row", "bin"])[list(turned)])
    scan = open_scan(path, theta="0:180", axes=axes, kind="attenuation")
    wanted = lines().astype(np.float32)
    assert np.array_equal(scan.read(0, 2).projections, wanted[:, :2])
    assert np.array_equal(scan.rows.look("projections", [2, 0], [1]), wanted[[2, 0], 1:2])


def test_files_that_are_named_may_lie_anywhere(tmp_path: Path, monkeypatch) -> None:
    path = saved(tmp_path / "a", proj=COUNTS)
    saved(tmp_path / "b", beam=FLATS, shut=DARKS, t=DEGREES)
    monkeypatch.chdir(tmp_path)
    named = {"flats": "b/beam.npy", "darks": str(tmp_path / "b/shut.npy"), "theta": "b/t.npy"}
    scan = open_scan(path, **named)
    monkeypatch.chdir(tmp_path / "a")
    assert np.array_equal(scan.read(0, 1).flats, FLATS[:, :1])
    with pytest.raises(InputError, match=r"none\.npy"):
        open_scan(path, flats="none.npy", **TURN)


def test_a_run_is_another_one_with_other_flats(tmp_path: Path) -> None:
    path = counted(tmp_path)
    before = WatchedScan(open_scan(path)).identity()
    assert WatchedScan(open_scan(path)).identity() == before
    saved(tmp_path, flat=np.full((3, ROWS, BINS), 3090, "u2"))
    assert WatchedScan(open_scan(path)).identity() != before


def test_nothing_beside_that_is_a_link_or_does_not_fit_is_taken(tmp_path: Path) -> None:
    path = saved(tmp_path / "a", proj=lines(), flat=np.ones((2, ROWS, BINS + 1)))
    saved(tmp_path, theta=DEGREES)
    (tmp_path / "a/theta.npy").symlink_to(tmp_path / "theta.npy")
    with pytest.raises(FileFormatError, match="--theta"):
        open_scan(path)
    scan = open_scan(path, **TURN)
    assert scan.kind == "attenuation" and scan.rows.flats is None
    saved(tmp_path / "a", angles=DEGREES[:-1])
    with pytest.raises(InputError, match=rf"{VIEWS - 1} angles"):
        open_scan(path)


def test_what_is_no_array_of_numbers_is_refused_and_never_unpickled(tmp_path: Path) -> None:
    class Bomb:
        def __reduce__(self):
            return Path.touch, (tmp_path / "boom",)

    odd = np.array([Bomb()], dtype=object)
    np.save(tmp_path / "proj.npy", odd, allow_pickle=True)
    with pytest.raises(InputError, match="wanted integers or real numbers"):
        open_scan(tmp_path / "proj.npy", theta="0:180")
    path = saved(tmp_path, proj=lines().astype(complex))
    with pytest.raises(InputError, match="complex"):
        open_scan(path, theta="0:180")
    assert not (tmp_path / "boom").exists()
    with pytest.raises(InputError, match="dataset"):
        open_scan(path, theta="0:180", dataset="proj")


def test_a_file_that_changed_or_was_cut_short_is_refused(tmp_path: Path) -> None:
    path = counted(tmp_path)
    scan = open_scan(path)
    path.write_bytes(path.read_bytes()[:-8])
    with pytest.raises(FileFormatError, match="cut short"):
        open_scan(path)
    with pytest.raises(FileFormatError, match="cut short"):
        scan.read(0, 1)
    saved(tmp_path, proj=COUNTS[:, :-1])
    with pytest.raises(FileFormatError, match="open the scan again"):
        scan.read(0, 1)
    with pytest.raises(FileFormatError, match="the content is of no known kind"):
        (tmp_path / "proj.npy").write_bytes(b"PKnothing of the kind")
        open_scan(path)
