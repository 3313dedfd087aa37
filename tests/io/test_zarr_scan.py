"""Scans in Zarr stores: the numbers of the same scan in NPZ, and what is refused."""

import json
import os

import numpy as np
import pytest
import zarr

from rift_cl.commands.inputs.scan_identity import WatchedScan
from rift_cl.errors import FileFormatError, InputError, PathEscapeError, ResourceLimitError
from rift_cl.io.scans.formats import is_scan_file, open_scan

ANGLES = np.pi * np.arange(10) / 10
COUNTS = np.random.default_rng(2).integers(200, 900, (10, 7, 12)).astype(np.uint16)
FLATS = np.full((2, 7, 12), 1000, np.uint16)


ZARR_3 = hasattr(zarr, "config")


def write(path, arrays, *, chunks=(4, 3, 12), version=2):
    """A store of Zarr 2 or 3 with arrays by their places."""
    path.mkdir()
    group = {"zarr_format": version, **({"node_type": "group"} if version == 3 else {})}
    (path / ("zarr.json" if version == 3 else ".zgroup")).write_text(json.dumps(group))
    for name, values in arrays.items():
        given = {"shape": values.shape, "dtype": values.dtype, "chunks": chunks[: values.ndim]}
        given |= {"zarr_format": version} if ZARR_3 else {}
        array = zarr.open_array(str(path / name), mode="w", **given)
        array[...] = values
    return path


@pytest.fixture
def store(tmp_path):
    arrays = {"projections": COUNTS, "angles": ANGLES, "flats": FLATS}
    return write(tmp_path / "scan.zarr", arrays)


def told_as_numbers(scan):
    rows = scan.read(2, 6)
    some = scan.rows.look("projections", [1, 7], [0, 5])
    return scan.angles, rows.projections, rows.flats, some


@pytest.mark.parametrize(
    "version", [2, pytest.param(3, marks=pytest.mark.skipif(not ZARR_3, reason="Zarr 2"))]
)
def test_a_store_holds_what_an_archive_holds(tmp_path, version):
    arrays = {"projections": COUNTS, "angles": ANGLES, "flats": FLATS, "darks": 0 * FLATS + 3}
    path = write(tmp_path / "scan.zarr", arrays, version=version)
    np.savez(tmp_path / "scan.npz", **arrays)
    found, wanted = open_scan(path), open_scan(tmp_path / "scan.npz")
    assert (found.kind, found.shape) == (wanted.kind, wanted.shape) and is_scan_file(path)
    for mine, theirs in zip(told_as_numbers(found), told_as_numbers(wanted), strict=True):
        assert mine.tobytes() == theirs.tobytes()


def test_data_exchange_and_arrays_that_are_named(tmp_path):
    degrees = np.rad2deg(ANGLES)
    names = {"data": COUNTS, "theta": degrees, "data_white": FLATS, "data_dark": 0 * FLATS}
    path = write(tmp_path / "a.zarr", {f"exchange/{name}": v for name, v in names.items()})
    found = open_scan(path)
    assert found.source == "Data Exchange"
    np.testing.assert_allclose(found.angles, ANGLES)
    turned = {"raw/stack": COUNTS.swapaxes(0, 1), "raw/flat": FLATS.swapaxes(0, 1)}
    path = write(tmp_path / "b.zarr", turned)
    zarr.open_array(str(path / "raw/stack")).attrs["_ARRAY_DIMENSIONS"] = ["row", "angle", "bin"]
    found = open_scan(path, dataset="raw/stack", theta="0:180")
    assert found.shape == COUNTS.shape
    assert found.read(1, 3).projections.tobytes() == COUNTS[:, 1:3].astype(np.float32).tobytes()


def test_a_chunk_that_is_missing_is_no_zeros(store):
    scan = open_scan(store)
    before = WatchedScan(scan).identity()
    (store / "projections/2.1.0").unlink()
    assert WatchedScan(scan).identity() != before
    scan.read(0, 3)
    with pytest.raises(FileFormatError, match=r"chunk 2\.1\.0 is missing"):
        scan.read(3, 4)


def test_claims_are_checked_first(tmp_path):
    """Of rows that are not there, and of chunks that are larger than the memory."""
    path = write(tmp_path / "scan.zarr", {"projections": COUNTS, "angles": ANGLES})
    header = path / "projections/.zarray"
    for rows, chunk in ((1 << 50, 3), (7, 1 << 50)):
        forged = json.loads(header.read_text())
        forged["shape"][1] = rows
        forged["chunks"][1] = chunk
        header.write_text(json.dumps(forged))
        scan = open_scan(path, kind="attenuation", values=False)
        with pytest.raises(ResourceLimitError, match="claims"):
            scan.read(0, min(rows, 1 << 40))


def test_strange_codecs_are_refused(store):
    header = store / "projections/.zarray"
    forged = json.loads(header.read_text())
    forged["compressor"] = {"id": "pickle"}
    header.write_text(json.dumps(forged))
    with pytest.raises(FileFormatError, match="pickle"):
        open_scan(store)


def test_what_is_no_scan_or_leads_astray(store, tmp_path):
    with pytest.raises(FileFormatError, match="neither 'projections'"):
        open_scan(write(tmp_path / "b.zarr", {"other": COUNTS}))
    with pytest.raises(InputError):
        open_scan(store, dataset="../../other")
    (tmp_path / "empty.zarr").mkdir()
    with pytest.raises(InputError):
        open_scan(tmp_path / "empty.zarr")
    (store / "angles" / "out").symlink_to("/etc")
    with pytest.raises(PathEscapeError, match="outside"):
        open_scan(store)
    (store / "angles" / "out").unlink()
    os.mkfifo(store / "angles" / "pipe")
    with pytest.raises(FileFormatError, match="neither a file"):
        open_scan(store)


@pytest.mark.skipif(not hasattr(zarr.Group, "create_array"), reason="zarr 2 has other arguments")
@pytest.mark.parametrize("kept", [False, True])
def test_chunks_of_zeros_are_read_where_they_are_written(tmp_path, kept):
    """zarr-python leaves chunks of zeros out, and the sentence says how it does not."""
    values = np.zeros((4, 6, 8), np.float32)
    values[:, :3, 2:6] = 0.5
    store = zarr.open_group(tmp_path / "a.zarr", mode="w")
    config = {"write_empty_chunks": kept}
    array = store.create_array(
        "projections", shape=values.shape, chunks=(4, 3, 8), dtype="f4", config=config
    )
    array[:] = values
    store.create_array("angles", data=np.arange(4) * np.pi / 4, config={"write_empty_chunks": True})
    scan = open_scan(tmp_path / "a.zarr", kind="attenuation", values=False)
    if kept:
        np.testing.assert_array_equal(scan.read(3, 6).projections, values[:, 3:6])
        return
    with pytest.raises(FileFormatError, match="'write_empty_chunks': True"):
        scan.read(3, 6)
