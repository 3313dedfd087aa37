"""Volumes are written whole or not at all, in every format."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from volume_files import FORMATS, SHAPE, VOLUME, left, save

from rift_cl.errors import (
    DTypeError,
    InputError,
    OutputError,
    ShapeError,
)
from rift_cl.io import open_volume, read_volume


@FORMATS
def test_round_trip(tmp_path: Path, format: str) -> None:
    save(tmp_path / "v", format)
    assert left(tmp_path) == ["v"]
    back = read_volume(tmp_path / "v")
    assert back.dtype == np.float32
    np.testing.assert_array_equal(back, VOLUME)


@FORMATS
def test_slabs_in_any_order_and_of_any_layout(tmp_path: Path, format: str) -> None:
    with open_volume(tmp_path / "v", SHAPE, format=format, spacing=1) as writer:
        writer.write(4, VOLUME[4:].astype(">f8"))
        writer.write(1, np.asfortranarray(VOLUME[1:4]))
        writer.write(0, VOLUME[1:2])
        writer.write(0, VOLUME[:1])
    np.testing.assert_array_equal(read_volume(tmp_path / "v"), VOLUME)


@FORMATS
def test_an_earlier_volume_is_replaced_at_the_end_alone(tmp_path: Path, format: str) -> None:
    save(tmp_path / "v", format)
    other = VOLUME[:3] + 1
    with open_volume(tmp_path / "v", other.shape, format=format, spacing=1) as writer:
        writer.write(0, other)
        np.testing.assert_array_equal(read_volume(tmp_path / "v"), VOLUME)
    np.testing.assert_array_equal(read_volume(tmp_path / "v"), other)
    assert left(tmp_path) == ["v"]


@FORMATS
@pytest.mark.parametrize("kind", [KeyError, KeyboardInterrupt, OSError])
def test_an_exception_discards(tmp_path: Path, format: str, kind: type[BaseException]) -> None:
    save(tmp_path / "v", format)
    with (
        pytest.raises(kind, match="mine") as caught,
        open_volume(tmp_path / "v", SHAPE, format=format, spacing=1) as writer,
    ):
        writer.write(0, VOLUME[:2] + 1)
        raise kind("mine")
    assert type(caught.value) is kind
    assert left(tmp_path) == ["v"]
    np.testing.assert_array_equal(read_volume(tmp_path / "v"), VOLUME)


@FORMATS
def test_missing_slices(tmp_path: Path, format: str) -> None:
    with (
        pytest.raises(OutputError, match="2 of 5 slices"),
        open_volume(tmp_path / "v", SHAPE, format=format, spacing=1) as writer,
    ):
        writer.write(0, VOLUME[:1])
        writer.write(3, VOLUME[3:])
    assert left(tmp_path) == []


@FORMATS
def test_slabs_that_do_not_fit(tmp_path: Path, format: str) -> None:
    writer = open_volume(tmp_path / "v", SHAPE, format=format, spacing=1)
    assert left(tmp_path) == []
    with pytest.raises(OutputError, match="not open"):
        writer.write(0, VOLUME)
    with writer:
        for start, block in [(4, VOLUME[:2]), (-1, VOLUME[:1]), (0, VOLUME[0]), (0, VOLUME[:0])]:
            with pytest.raises(ShapeError):
                writer.write(start, block)
        with pytest.raises(ShapeError, match=r"\(2, 7, 6\), wanted \(n, 6, 7\)"):
            writer.write(0, VOLUME[:2].transpose(0, 2, 1))
        with pytest.raises(DTypeError, match="complex64"):
            writer.write(0, VOLUME.astype(np.complex64))
        writer.write(0, VOLUME)
    np.testing.assert_array_equal(read_volume(tmp_path / "v"), VOLUME)


@pytest.mark.parametrize(
    "changed",
    [
        {"format": "raw"},
        {"shape": (5, 6)},
        {"shape": (0, 6, 7)},
        {"spacing": 0},
        {"spacing": (1, 2)},
        {"origin": (1, 2)},
        {"origin": float("nan")},
    ],
)
def test_arguments(tmp_path: Path, changed: dict[str, object]) -> None:
    arguments = {"shape": SHAPE, "format": "h5", "spacing": 1.0, **changed}
    with pytest.raises(InputError):
        open_volume(tmp_path / "v", **arguments)
