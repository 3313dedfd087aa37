"""Files that say where source and detector stand, damaged: one error of ours, and little memory."""

from __future__ import annotations

import shutil
from pathlib import Path

import numpy as np
import pytest
import scanner_files as made

from rift_cl.errors import FileFormatError, ResourceLimitError, RiftError
from rift_cl.geometry import Cone
from rift_cl.io import open_scan
from rift_cl.io.scans.beam_file import read_beam

NAMES = ("a.xtekct", "a.log", "a.yaml", "a.json", "a.xml", "a.geom", "a.npy", "a.txt")
ENTITIES = (
    '<!DOCTYPE x [<!ENTITY a "aaaa">]><RTKThreeDCircularGeometry>&a;</RTKThreeDCircularGeometry>'
)


@pytest.mark.parametrize("name", NAMES)
def test_bytes_of_any_kind(tmp_path: Path, name: str) -> None:
    random = np.random.default_rng(3)
    whole = made.nikon(tmp_path / "whole").read_bytes()
    samples = [b"", b"\0" * 50, random.bytes(400), b"[" * 3000, b"{}", b"[1, 2]", b"a: 1\na: [\n"]
    samples += [whole[: len(whole) // 3], whole.replace(b"=50", b"=1e999"), b"nan " * 24]
    for sample in samples:
        (tmp_path / name).write_bytes(sample)
        with pytest.raises(RiftError, match=name):
            read_beam(tmp_path / name)


def test_sizes_are_checked_before_they_are_believed(tmp_path: Path) -> None:
    path = tmp_path / "huge.npy"
    header = "{'descr': '<f8', 'fortran_order': False, 'shape': (100000000, 12), }"
    text = header.ljust(117) + "\n"
    path.write_bytes(b"\x93NUMPY\x01\x00" + len(text).to_bytes(2, "little") + text.encode())
    with pytest.raises(ResourceLimitError, match="huge"):
        read_beam(path)
    (tmp_path / "long.log").write_bytes(b"a=1\n" * (1 << 22))
    with pytest.raises(ResourceLimitError, match="long"):
        read_beam(tmp_path / "long.log")


def test_entities_are_not_expanded(tmp_path: Path) -> None:
    (tmp_path / "a.xml").write_text(ENTITIES)
    with pytest.raises(FileFormatError, match="entities"):
        read_beam(tmp_path / "a.xml", (1.0, 1.0))


def test_a_link_that_leads_elsewhere_is_not_found(tmp_path: Path) -> None:
    """A description that is a link out of the folder of images is none of that folder's."""
    path = made.nikon(tmp_path / "images")
    shutil.move(path, tmp_path / "part.xtekct")
    path.symlink_to(tmp_path / "part.xtekct")
    assert open_scan(tmp_path / "images", kind="counts", flats="mean").cone is None


def test_two_descriptions_are_not_chosen_from(tmp_path: Path) -> None:
    path = made.nikon(tmp_path)
    shutil.copy(path, tmp_path / "other.xtekct")
    with pytest.raises(FileFormatError, match="--geometry"):
        open_scan(tmp_path)
    assert isinstance(open_scan(tmp_path, geometry=path).cone, Cone)


def test_a_zeiss_file_that_is_cut_short(shared_data: Path, tmp_path: Path) -> None:
    whole = shared_data / "txrm" / "chip.txrm"
    if not whole.exists():
        pytest.skip("no real data")
    data = whole.read_bytes()
    for size in (8, 600, 20000, len(data) // 2):
        path = tmp_path / "cut.txrm"
        path.write_bytes(data[:size])
        with pytest.raises(RiftError, match=r"cut\.txrm"):
            open_scan(path, flats="mean").read(0, 256)


def test_a_zeiss_cone(shared_data: Path, tmp_path: Path) -> None:
    """The sample, its geometry written over: 20 mm before the axis, 60 behind, 2 micrometres."""
    olefile = pytest.importorskip("olefile")
    whole = shared_data / "txrm" / "chip.txrm"
    if not whole.exists():
        pytest.skip("no real data")
    path = tmp_path / "cone.txrm"
    shutil.copy(whole, path)
    path.chmod(0o600)
    changes = {
        "XrayGeometry": np.array([1], "<i4"),
        "PixelSize": np.array([2], "<f4"),
        "StoRADistance": np.full(7, -20, "<f4"),
        "DtoRADistance": np.full(7, 60, "<f4"),
    }
    with olefile.OleFileIO(str(path), write_mode=True) as ole:
        for name, values in changes.items():
            ole.write_stream(f"ImageInfo/{name}", values.tobytes())
    scan = open_scan(path, flats="mean")
    assert isinstance(scan.cone, Cone) and scan.unit == "mm"
    assert scan.cone.magnification == 4 and scan.cone.pitch == pytest.approx((0.008, 0.008))
    assert np.rad2deg(scan.angles[0]) == pytest.approx(45, abs=0.1)
