"""Readers of one's own: registered by an extension, used by ``open_scan`` and the commands."""

from __future__ import annotations

import numpy as np
import pytest

import rift_cl as rift
from rift_cl.commands.cli import main
from rift_cl.errors import InputError, NonFiniteError, ShapeError
from rift_cl.io import read_volume
from rift_cl.io.scans.formats import SCAN_READERS
from rift_cl.operators import FILTERS

VIEWS, ROWS, BINS = 24, 3, 16
RANDOM = np.random.default_rng(2)
VALUES = RANDOM.random((VIEWS, ROWS, BINS)).astype(np.float32)
ANGLES = np.arange(VIEWS) * np.pi / VIEWS


def mapped(path, request):
    values = np.memmap(path, np.float32, "r", shape=(VIEWS, ROWS, BINS))
    return rift.scan_of_arrays(path, values, ANGLES, pitch=0.5, unit="mm")


@pytest.fixture
def raw(tmp_path):
    rift.register_scan_reader(".raw", mapped)
    VALUES.tofile(tmp_path / "scan.raw")
    yield tmp_path / "scan.raw"
    SCAN_READERS.remove(".raw")


def test_a_registered_reader_is_asked(raw):
    scan = rift.open_scan(raw)
    assert (scan.shape, scan.kind, scan.pitch) == (VALUES.shape, "attenuation", 0.5)
    assert np.array_equal(scan.read(1, 3).projections, VALUES[:, 1:3])
    assert np.array_equal(
        scan.rows.look("projections", [3, 5], [0, 2]), VALUES[np.ix_([3, 5], [0, 2])]
    )
    assert rift.open_scan(raw, kind="transmission").kind == "transmission"


@pytest.mark.full
def test_the_commands_know_readers_and_filters_by_their_names(raw, tmp_path):
    rift.register_filter("mine", lambda f: f * np.exp(-f))
    np.savez(tmp_path / "same.npz", projections=VALUES, angles=ANGLES, pitch=0.5)
    try:
        for file, out in ((raw, "a"), (tmp_path / "same.npz", "b")):
            words = ["--center", "7.5", "--filter", "mine", "--format", "h5", "--kind"]
            words = [str(file), "--out", str(tmp_path / out), *words, "attenuation", "--quiet"]
            assert main(["reconstruct", *words]) == 0
    finally:
        FILTERS.remove("mine")
    volumes = [read_volume(tmp_path / out / "volume.h5") for out in "ab"]
    assert np.array_equal(*volumes)
    assert main(["reconstruct", str(raw), "--out", str(tmp_path / "c"), "--filter", "mine"]) == 3


def test_a_name_that_is_taken_or_no_extension_is_refused(raw):
    for taken in (".raw", ".h5"):
        with pytest.raises(InputError, match=taken):
            rift.register_scan_reader(taken, mapped)
    for wrong in ("raw", ".RAW", "", None, ".a/b"):
        with pytest.raises(InputError, match="extension"):
            rift.register_scan_reader(wrong, mapped)
    with pytest.raises(InputError, match="reader"):
        rift.register_scan_reader(".other", None)


def test_arrays_have_a_name_and_are_reconstructed_from_a_file(tmp_path):
    scan = rift.scan_of_arrays("mine", VALUES, ANGLES, pitch=0.5, unit="mm")
    np.testing.assert_array_equal(scan.read(1, 3).projections, VALUES[:, 1:3])
    for given in (scan, VALUES):
        with pytest.raises(InputError, match=rf"{type(given).__name__}.*numpy\.savez"):
            rift.reconstruct_scan(given, tmp_path / "out")
    assert not (tmp_path / "out").exists()


def test_arrays_that_make_no_scan_are_refused(tmp_path):
    path = tmp_path / "scan.raw"
    with pytest.raises(ShapeError, match="projections"):
        rift.scan_of_arrays(path, VALUES[0], ANGLES)
    with pytest.raises(ShapeError, match="flats"):
        rift.scan_of_arrays(path, VALUES, ANGLES, flats=np.ones((2, ROWS, 3)))
    with pytest.raises(ShapeError, match="23 angles"):
        rift.scan_of_arrays(path, VALUES, ANGLES[1:])
    with pytest.raises(NonFiniteError, match="angle 0"):
        rift.scan_of_arrays(path, VALUES, np.full(VIEWS, np.nan))
    with pytest.raises(InputError, match=r"scan\.raw.*degrees"):
        rift.scan_of_arrays(path, VALUES, np.arange(VIEWS) * 180.0 / VIEWS)
    flats = np.ones((2, ROWS, BINS))
    assert rift.scan_of_arrays(path, VALUES, ANGLES, flats=flats).kind == "counts"
