"""TXRM files as scanners leave them: streams in memory stand for the container."""

from __future__ import annotations

import io
from pathlib import Path

import numpy as np
import pytest

from rift_cl.errors import InputError
from rift_cl.io import ScanFile
from rift_cl.io.scans import txrm_scan
from rift_cl.io.scans.scan_file import ScanRequest
from rift_cl.io.scans.txrm_scan import image_name, open_txrm_scan

VIEWS, ROWS, BINS = 12, 3, 8
IMAGES = 1000 + np.arange(VIEWS * ROWS * BINS).reshape(VIEWS, ROWS, BINS).astype("<u2")


class Streams:
    """What the reader asks of a container of streams."""

    def __init__(self, streams: dict[str, bytes]) -> None:
        self.streams = streams

    def __enter__(self) -> Streams:
        return self

    def __exit__(self, *error: object) -> None:
        pass

    def exists(self, name: str) -> bool:
        return name in self.streams

    def get_size(self, name: str) -> int:
        return len(self.streams[name])

    def openstream(self, name: str) -> io.BytesIO:
        return io.BytesIO(self.streams[name])


def opened(monkeypatch: pytest.MonkeyPatch, **changes: np.ndarray | None) -> ScanFile:
    """A scan of counts and its reference image; changes by names whose slash is a double line."""
    arrays = {
        "ImageInfo/NoOfImages": np.array([VIEWS], "<i4"),
        "ImageInfo/ImageHeight": np.array([ROWS], "<i4"),
        "ImageInfo/ImageWidth": np.array([BINS], "<i4"),
        "ImageInfo/DataType": np.array([5], "<i4"),
        "ImageInfo/PixelSize": np.array([2], "<f4"),
        "ImageInfo/Angles": np.linspace(0, 165, VIEWS).astype("<f4"),
        "ReferenceData/Image": np.full((ROWS, BINS), 1300, "<f4"),
        **{image_name(view): image for view, image in enumerate(IMAGES)},
        **{name.replace("__", "/"): values for name, values in changes.items()},
    }
    streams = Streams({name: a.tobytes() for name, a in arrays.items() if a is not None})
    monkeypatch.setattr(txrm_scan.olefile, "OleFileIO", lambda path: streams)
    return open_txrm_scan(Path("scan.txrm"), ScanRequest(), budget=None)


@pytest.mark.parametrize(("code", "dtype"), [(5, "<u2"), (10, "<f4"), (None, "<f4"), (None, "<u2")])
def test_a_reference_is_read_by_its_type(
    monkeypatch: pytest.MonkeyPatch, code: int | None, dtype: str
) -> None:
    flat = 1300 + np.arange(ROWS * BINS).reshape(ROWS, BINS).astype(dtype)
    stated = None if code is None else np.array([code], "<i4")
    scan = opened(monkeypatch, ReferenceData__Image=flat, ReferenceData__DataType=stated)
    rows = scan.read(1, 3)
    assert scan.kind == "counts" and rows.flats is not None
    np.testing.assert_array_equal(rows.flats, flat[None, 1:])
    np.testing.assert_array_equal(rows.projections, IMAGES[:, 1:])


def test_a_reference_that_cannot_be_read_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    with pytest.raises(InputError, match=r"ReferenceData/Image holds 24 bytes"):
        opened(monkeypatch, ReferenceData__Image=np.zeros((ROWS, BINS), "<u1"))
    with pytest.raises(InputError, match=r"ReferenceData/Image holds 96 bytes of type 7"):
        opened(monkeypatch, ReferenceData__DataType=np.array([7], "<i4"))


def test_a_scan_that_ended_early_has_the_images_that_were_taken(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    gone = dict.fromkeys(image_name(view).replace("/", "__") for view in range(9, VIEWS))
    scan = opened(monkeypatch, ImageInfo__ImagesTaken=np.array([9], "<i4"), **gone)
    assert scan.shape == (9, ROWS, BINS) and any("9 of 12 images" in note for note in scan.notes)
    np.testing.assert_allclose(np.rad2deg(scan.angles), 15.0 * np.arange(9), atol=1e-4)
    whole = opened(monkeypatch, ImageInfo__ImagesTaken=np.array([VIEWS], "<i4"))
    assert whole.shape[0] == VIEWS and not any("images" in note for note in whole.notes[1:])
    with pytest.raises(InputError, match="number 10 is missing"):
        opened(monkeypatch, **gone)


@pytest.mark.parametrize(
    ("rays", "beyond", "told"), [(None, 40.0, True), (2, 40.0, False), (None, 0.1, False)]
)
def test_distances_without_a_word_of_the_rays_are_told(
    monkeypatch: pytest.MonkeyPatch, rays: int | None, beyond: float, told: bool
) -> None:
    scan = opened(
        monkeypatch,
        ImageInfo__StoRADistance=np.full(VIEWS, -20, "<f4"),
        ImageInfo__DtoRADistance=np.full(VIEWS, beyond, "<f4"),
        ImageInfo__XrayGeometry=None if rays is None else np.array([rays], "<i4"),
    )
    assert scan.cone is None
    assert any("20 mm" in note and "--geometry" in note for note in scan.notes) == told
