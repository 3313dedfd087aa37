"""Chunks of a Zarr array that threads pack: the samples and the bytes, however slabs come."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import zarr

from rift_cl.io.volumes.zarr_chunks import ChunkedArray

SHAPE, CHUNKS = (37, 50, 43), (16, 32, 32)


def made(place: Path, dtype: str) -> ChunkedArray:
    return ChunkedArray(place, SHAPE, CHUNKS, np.dtype(dtype), {"of": "a test"})


def samples(dtype: str) -> np.ndarray:
    return (1000 * np.random.default_rng(8).random(SHAPE)).astype(dtype)


def chunk_files(place: Path) -> dict[str, bytes]:
    return {
        str(path.relative_to(place)): path.read_bytes()
        for path in place.rglob("*")
        if path.is_file()
    }


@pytest.mark.parametrize("dtype", ["<f4", "<u2", "|u1"])
def test_slabs_that_end_inside_chunks_and_come_in_any_order(tmp_path: Path, dtype: str) -> None:
    volume = samples(dtype)
    whole, cut = made(tmp_path / "whole", dtype), made(tmp_path / "cut", dtype)
    whole.write_slices(0, volume)
    for start, stop in [(30, 37), (0, 5), (17, 30), (16, 17), (5, 16)]:
        cut.write_slices(start, volume[start:stop])
    assert chunk_files(tmp_path / "whole") == chunk_files(tmp_path / "cut")
    read = zarr.open_array(str(tmp_path / "cut"), mode="r")
    assert read.dtype == volume.dtype and read.chunks == CHUNKS
    np.testing.assert_array_equal(read[...], volume)


def made_of(place: Path) -> np.ndarray:
    return np.asarray(zarr.open_array(str(place), mode="r")[...])


def test_chunks_beyond_the_end_hold_zeros(tmp_path: Path) -> None:
    array = made(tmp_path / "a", "<f4")
    array.write_slices(0, samples("<f4") + 1)
    last = array.indices(slice(36, 37))[-1]
    assert last == (2, 1, 1)
    assert array.read_chunk(last).shape == (5, 18, 11)
    # As a reader of a larger array of the same chunks sees them.
    header = (tmp_path / "a" / ".zarray").read_text(encoding="utf-8")
    grown = header.replace("37", "48").replace("50", "64").replace("43", "64")
    (tmp_path / "a" / ".zarray").write_text(grown, encoding="utf-8")
    padded = made_of(tmp_path / "a")
    assert padded.shape == (48, 64, 64)
    assert not padded[37:].any() and not padded[:, 50:].any() and not padded[:, :, 43:].any()
    assert padded[:37, :50, :43].all()


def test_what_goes_wrong_in_a_thread_is_raised(tmp_path: Path) -> None:
    array = made(tmp_path / "a", "<f4")
    (tmp_path / "a" / "1" / "0" / "1").mkdir(parents=True)
    with pytest.raises(OSError, match="irectory"):
        array.write_slices(0, samples("<f4"))
