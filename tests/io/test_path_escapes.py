"""Scans that lead out of their folder or round in circles are refused before they are followed."""

from __future__ import annotations

from pathlib import Path

import h5py
import numpy as np
import pytest
import scan_files as made

from rift_cl.errors import FileFormatError, PathEscapeError
from rift_cl.io import open_scan


@pytest.fixture
def folders(tmp_path: Path) -> tuple[Path, Path]:
    """A folder to read from, and a scan outside it."""
    inner = tmp_path / "inner"
    inner.mkdir()
    made.data_exchange(tmp_path / "secret.h5")
    (tmp_path / "secret.raw").write_bytes(bytes(480))
    return inner, tmp_path / "secret.h5"


def virtual(file: h5py.File, name: str, source: str, dataset: str) -> None:
    layout = h5py.VirtualLayout((6, 4, 5), "<u2")
    layout[:] = h5py.VirtualSource(source, dataset, (6, 4, 5))
    file.create_virtual_dataset(name, layout)


ESCAPES = ["../secret.h5", "{absolute}", "sub/../../secret.h5", "symlink.h5"]


@pytest.mark.parametrize("target", ESCAPES)
@pytest.mark.parametrize("means", ["link", "soft link to link", "virtual", "group link"])
def test_ways_out_of_the_folder(folders: tuple[Path, Path], target: str, means: str) -> None:
    inner, secret = folders
    target = target.format(absolute=secret)
    (inner / "symlink.h5").symlink_to(secret)
    (inner / "sub").mkdir()
    with h5py.File(inner / "a.h5", "w") as file:
        file["exchange/theta"] = made.DEGREES
        if means == "link":
            file["exchange/data"] = h5py.ExternalLink(target, "/exchange/data")
        elif means == "soft link to link":
            file["elsewhere"] = h5py.ExternalLink(target, "/exchange")
            file["exchange/data"] = h5py.SoftLink("/elsewhere/data")
        elif means == "virtual":
            virtual(file, "exchange/data", target, "exchange/data")
        else:
            del file["exchange"]
            file["exchange"] = h5py.ExternalLink(target, "/exchange")
    with pytest.raises(PathEscapeError, match="outside the folder"):
        open_scan(inner / "a.h5")


def test_a_way_out_by_a_second_file(folders: tuple[Path, Path]) -> None:
    inner, secret = folders
    with h5py.File(inner / "b.h5", "w") as file:
        virtual(file, "data", str(secret), "exchange/data")
    with h5py.File(inner / "a.h5", "w") as file:
        file["exchange/theta"] = made.DEGREES
        virtual(file, "exchange/data", "b.h5", "data")
    with pytest.raises(PathEscapeError, match="outside the folder"):
        open_scan(inner / "a.h5")


def test_raw_files_outside(folders: tuple[Path, Path], monkeypatch: pytest.MonkeyPatch) -> None:
    inner, secret = folders
    with h5py.File(inner / "a.h5", "w") as file:
        raw = [(str(secret.with_suffix(".raw")), 0, 480)]
        file.create_dataset("exchange/data", (6, 4, 5), "f4", external=raw)
        file["exchange/theta"] = made.DEGREES
    with pytest.raises(PathEscapeError, match=r"secret\.raw"):
        open_scan(inner / "a.h5")
    with h5py.File(inner / "a.h5", "a") as file:
        del file["exchange/data"]
        file.create_dataset("exchange/data", (6, 4, 5), "f4", external=[("secret.raw", 0, 480)])
    monkeypatch.chdir(secret.parent)
    with pytest.raises(PathEscapeError, match=r"secret\.raw"):
        open_scan(inner / "a.h5")


def test_links_inside_the_folder_are_followed(tmp_path: Path) -> None:
    (tmp_path / "raw").mkdir()
    data = made.data_exchange(tmp_path / "raw" / "b.h5")
    with h5py.File(tmp_path / "a.h5", "w") as file:
        file["exchange"] = h5py.ExternalLink("raw/b.h5", "/exchange")
        virtual(file, "copy", "raw/b.h5", "exchange/data")
    for name in (None, "copy"):
        scan = open_scan(
            tmp_path / "a.h5", dataset=name, theta="exchange/theta", kind="attenuation"
        )
        np.testing.assert_array_equal(scan.read(0, 4).projections, data)


def test_missing_sources(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    elsewhere = tmp_path / "elsewhere"
    elsewhere.mkdir()
    made.data_exchange(elsewhere / "b.h5")
    monkeypatch.chdir(elsewhere)
    for number, source in enumerate(["b.h5", "b%%b.h5"]):
        path = tmp_path / f"{number}.h5"
        with h5py.File(path, "w") as file:
            file["exchange/theta"] = made.DEGREES
            virtual(file, "exchange/data", source, "exchange/data")
        with pytest.raises(FileFormatError, match=r"not there|pattern"):
            open_scan(path)


@pytest.mark.parametrize("means", ["virtual", "soft", "grown soft"])
def test_circles(tmp_path: Path, means: str) -> None:
    path = tmp_path / "a.h5"
    with h5py.File(path, "w") as file:
        file["exchange/theta"] = made.DEGREES
        if means == "virtual":
            virtual(file, "exchange/data", ".", "other")
            virtual(file, "other", "a.h5", "exchange/data")
        elif means == "soft":
            file["exchange/data"] = h5py.SoftLink("/exchange/data")
        else:
            file["exchange/data"] = h5py.SoftLink("/l9/x")
            file["l0"] = h5py.SoftLink("/")
            for level in range(1, 10):
                file[f"l{level}"] = h5py.SoftLink("/" + f"l{level - 1}/" * 50)
    with pytest.raises(FileFormatError, match=r"circles|of itself"):
        open_scan(path)


def test_links_that_lead_astray_elsewhere_do_not_matter(tmp_path: Path) -> None:
    path = tmp_path / "a.nxs"
    made.nxtomo(path)
    with h5py.File(path, "a") as file:
        for number in range(300):
            file[f"alias{number}"] = h5py.SoftLink("/entry1")
        file["away"] = h5py.ExternalLink("/nowhere.h5", "/")
        file["entry1/gone"] = h5py.ExternalLink("gone.h5", "/")
    assert open_scan(path).shape == (4, 4, 5)


@pytest.mark.parametrize("place", ["entry1/tomo_entry/instrument/detector/data", "entry1"])
def test_an_nxtomo_scan_that_leads_outside(folders: tuple[Path, Path], place: str) -> None:
    inner, secret = folders
    made.nxtomo(secret)
    made.nxtomo(inner / "a.nxs")
    with h5py.File(inner / "a.nxs", "a") as file:
        del file[place]
        file[place] = h5py.ExternalLink("../secret.h5", place)
    with pytest.raises(PathEscapeError, match="outside the folder"):
        open_scan(inner / "a.nxs")
