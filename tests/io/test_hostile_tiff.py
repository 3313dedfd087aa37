"""TIFF scans that lead astray, are cut short, or claim what they do not hold."""

from __future__ import annotations

import struct
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
import tiff_files as made
import tifffile
from test_hostile_scans import grown

from rift_cl.errors import FileFormatError, PathEscapeError, ResourceLimitError, ShapeError
from rift_cl.io import open_scan


@pytest.fixture
def series(tmp_path: Path) -> Path:
    """A folder with six projections."""
    return made.write_series(tmp_path / "scan" / "p", "p_{:04}.tif", made.frames())


def frame_outside(series: Path, outside: Path) -> None:
    (series / "p_0002.tif").unlink()
    (series / "p_0002.tif").symlink_to(outside / "x1.tif")


def flat_outside(series: Path, outside: Path) -> None:
    (series / "flat.tif").symlink_to(outside / "x1.tif")


def folder_outside(series: Path, outside: Path) -> None:
    (series / "flats").symlink_to(outside)


def sibling_outside(series: Path, outside: Path) -> None:
    (series.parent / "flats").symlink_to(outside)


def angles_outside(series: Path, outside: Path) -> None:
    (series / "angles.txt").symlink_to(outside / "angles.txt")


def sibling_angles_outside(series: Path, outside: Path) -> None:
    (series.parent / "theta.txt").symlink_to(outside / "angles.txt")


@pytest.mark.parametrize(
    "lead",
    [
        frame_outside,
        flat_outside,
        folder_outside,
        sibling_outside,
        angles_outside,
        sibling_angles_outside,
    ],
)
def test_links_that_lead_out(
    series: Path, tmp_path: Path, lead: Callable[[Path, Path], None]
) -> None:
    outside = made.write_series(tmp_path / "outside", "x{}.tif", made.frames())
    (outside / "angles.txt").write_text("0\n1\n2\n3\n4\n5\n")
    lead(series, outside)
    with pytest.raises(PathEscapeError):
        open_scan(series)


def test_projections_behind_a_link_that_leads_out(tmp_path: Path) -> None:
    made.write_series(tmp_path / "outside", "x{}.tif", made.frames())
    (tmp_path / "scan").mkdir()
    (tmp_path / "scan" / "p").symlink_to(tmp_path / "outside")
    with pytest.raises(PathEscapeError, match="leads out"):
        open_scan(tmp_path / "scan")
    assert open_scan(tmp_path / "scan" / "p", kind="attenuation").shape[0] == 6


@pytest.mark.parametrize("bigtiff", [False, True])
@pytest.mark.parametrize("cut", [0, 3, 8, 9, 200, 1000, 3000, -1, -20])
def test_a_stack_cut_short_is_not_a_shorter_scan(tmp_path: Path, cut: int, bigtiff: bool) -> None:
    path = made.write_pages(tmp_path / "a.tif", made.frames(), bigtiff=bigtiff)
    path.write_bytes(path.read_bytes()[:cut])
    with pytest.raises(FileFormatError, match=r"a\.tif"):
        open_scan(path).read(0, made.ROWS)


def claim(path: Path, tags: dict[int, int], dtype: str = "u2", **options: object) -> Path:
    """A TIFF file with some tags forged."""
    tifffile.imwrite(path, made.frames(dtype=dtype)[0], metadata=None, **options)
    with tifffile.TiffFile(path) as file:
        places = {tag.code: tag.valueoffset for tag in file.pages[0].tags if tag.code in tags}
    content = bytearray(path.read_bytes())
    for tag, value in tags.items():
        content[places[tag] : places[tag] + 4] = struct.pack("<I", value)
    path.write_bytes(content)
    return path


@pytest.mark.parametrize("dtype", ["u2", "f8"])
@pytest.mark.parametrize("options", [{}, {"tile": (16, 16)}, {"compression": "zlib"}], ids=str)
@pytest.mark.parametrize(
    "size", [(30_000, 30_000), (20, 1 << 30), (1 << 30, 24), (1 << 31, 1 << 31)]
)
def test_huge_frames_in_a_kilobyte(
    tmp_path: Path, dtype: str, options: dict, size: tuple[int, int]
) -> None:
    tags = {257: size[0], 256: size[1]}
    if "tile" not in options:
        tags[278] = size[0]
    path = claim(tmp_path / "a.tif", tags, dtype, **options)
    before = grown()
    # Old versions of tifffile make one page of it, and which axis is which is asked first.
    with pytest.raises((ResourceLimitError, FileFormatError, ShapeError), match=r"a\.tif"):
        open_scan(path, budget=1 << 24).read(0, 1)
    assert grown() - before < 50 << 20


def test_a_strip_counts_whole(tmp_path: Path) -> None:
    path = made.write_pages(
        tmp_path / "a.tif", np.zeros((1, 4000, 500), "u2"), compression="zlib", rowsperstrip=4000
    )
    with pytest.raises(ResourceLimitError, match=r"part of a frame.*7\.63 MiB"):
        open_scan(path, budget=1 << 20, axes="angle,bin", theta="180")
