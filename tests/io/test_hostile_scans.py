"""Files that lie, lead astray or are damaged: one named error each, and never a crash."""

from __future__ import annotations

import io
import json
import os
import resource
import struct
import subprocess
import sys
import zipfile
from pathlib import Path

import h5py
import numpy as np
import pytest
import scan_files as made

from rift_cl.errors import FileFormatError, ResourceLimitError, RiftError
from rift_cl.io import ScanFile, open_scan
from rift_cl.io.hdf5_tree import open_tree
from rift_cl.io.scans.hdf5_values import read_length


def grown() -> int:
    """Peak memory of this process so far, in bytes."""
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    return peak if sys.platform == "darwin" else 1024 * peak


def hdf5_claim(path: Path, data: tuple[int, ...], theta: int, **layout: object) -> Path:
    with h5py.File(path, "w") as file:
        file.create_dataset("exchange/data", data, "f4", **layout)
        angles = file.create_dataset("exchange/theta", (theta,), "f4", chunks=(min(theta, 1000),))
        angles[:2] = 0, 180
    assert path.stat().st_size < 10_000
    return path


@pytest.mark.parametrize("layout", [{"chunks": (1, 64, 64)}, {}])
def test_terabytes_in_a_kilobyte_of_hdf5(tmp_path: Path, layout: dict[str, object]) -> None:
    path = hdf5_claim(tmp_path / "a.h5", (1000, 30_000, 300_000), 1000, **layout)
    before = grown()
    scan = open_scan(path, budget=1 << 30)
    with pytest.raises(ResourceLimitError, match="budget is 1 GiB"):
        scan.read(0, 30_000)
    with pytest.raises(ResourceLimitError, match=r"rows 0 to 1.*1\.12 GiB"):
        scan.read(0, 1)
    with pytest.raises(ResourceLimitError, match=r"32\.7 TiB"):
        open_scan(path).read(0, 30_000)
    assert grown() - before < 50 << 20


def test_a_chunk_counts_whole(tmp_path: Path) -> None:
    path = hdf5_claim(tmp_path / "a.h5", (8, 20_000, 5_000), 8, chunks=(8, 20_000, 5_000))
    with pytest.raises(ResourceLimitError, match=r"claims 2\.98 GiB"):
        open_scan(path, budget=1 << 20).read(0, 1)


@pytest.mark.parametrize("frames", [10**8, 10**12, 2**60])
def test_angles_without_end(tmp_path: Path, frames: int) -> None:
    path = hdf5_claim(tmp_path / "a.h5", (frames, 1, 1), frames, chunks=(1000, 1, 1))
    before = grown()
    with pytest.raises(ResourceLimitError, match="'/exchange/theta' claims"):
        open_scan(path)
    assert grown() - before < 50 << 20


def header(shape: tuple[int, ...]) -> bytes:
    file = io.BytesIO()
    description = {"descr": "<f4", "fortran_order": False, "shape": shape}
    np.lib.format.write_array_header_2_0(file, description)
    return file.getvalue()


def npz_claim(path: Path, shape: tuple[int, ...], angles: bytes | None = None) -> Path:
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr("projections.npy", header(shape))
        archive.writestr("angles.npy", angles or header((6,)) + np.arange(6, dtype="f4").tobytes())
    return path


@pytest.mark.parametrize("user_block", [0, 512])
@pytest.mark.parametrize("headers", ["earliest", "latest"])
def test_a_heap_of_texts_without_end(tmp_path: Path, headers: str, user_block: int) -> None:
    """HDF5 walks it for ever; the attributes are more than the object's first header holds."""
    path = tmp_path / "a.h5"
    with h5py.File(path, "w", libver=headers, userblock_size=user_block) as file:
        angles = file.create_dataset("angles", data=np.zeros(3))
        for number in range(6):
            angles.attrs[f"units{number}"] = 40 * "degrees"
    with open_tree(path) as tree:
        assert tree.dataset("angles").attrs["units5"] == 40 * "degrees"
    whole = path.read_bytes()
    heap = whole.index(b"GCOL") + 16
    path.write_bytes(whole[:heap] + bytes(16) + whole[heap + 16 :])
    with open_tree(path) as tree, pytest.raises(FileFormatError, match=r"a\.h5: the heap"):
        tree.dataset("angles")


@pytest.mark.parametrize("user_block", [0, 512])
def test_a_heap_of_a_length_without_end(tmp_path: Path, user_block: int) -> None:
    path, size = tmp_path / "a.h5", "instrument/x_pixel_size"
    with h5py.File(path, "w", userblock_size=user_block) as file:
        file[size] = 40 * " " + "50 um"
    with open_tree(path) as tree:
        assert read_length(tree, size) == (50, "um")
    whole = path.read_bytes()
    heap = whole.index(b"GCOL") + 16
    path.write_bytes(whole[:heap] + bytes(16) + whole[heap + 16 :])
    with open_tree(path) as tree, pytest.raises(FileFormatError, match=r"a\.h5: the heap"):
        read_length(tree, size)


def test_terabytes_in_a_kilobyte_of_npz(tmp_path: Path) -> None:
    before = grown()
    with pytest.raises(ResourceLimitError, match="TiB"):
        open_scan(npz_claim(tmp_path / "a.npz", (6, 10**6, 10**6)))
    with pytest.raises(ResourceLimitError, match="'angles' claims"):
        open_scan(npz_claim(tmp_path / "a.npz", (6, 4, 5), header((10**12,))))
    assert grown() - before < 50 << 20


def test_npz_that_stores_less_than_it_claims(tmp_path: Path) -> None:
    with pytest.raises(FileFormatError, match="claims 24000000 bytes"):
        open_scan(npz_claim(tmp_path / "a.npz", (6, 1000, 1000)))


def test_npz_whose_directory_lies_about_its_size(tmp_path: Path) -> None:
    path = npz_claim(tmp_path / "a.npz", (6, 1000, 1000))
    content = bytearray(path.read_bytes())
    entry = content.index(b"PK\x01\x02")
    claimed = len(header((6, 1000, 1000))) + 24_000_000
    content[entry + 24 : entry + 28] = struct.pack("<I", claimed)
    path.write_bytes(content)
    with pytest.raises(FileFormatError, match="the archive"):
        open_scan(path).read(0, 1)


class Marker:
    """Leaves a file behind when it is unpickled."""

    def __init__(self, path: Path) -> None:
        self.path = path

    def __reduce__(self) -> tuple[object, ...]:
        return os.mkdir, (str(self.path),)


def test_a_pickle_is_never_opened(tmp_path: Path) -> None:
    trap = np.array([Marker(tmp_path / "sprung")], dtype=object)
    np.savez(tmp_path / "a.npz", projections=np.zeros((1, 2, 2)), angles=trap)
    with pytest.raises(RiftError, match="object"):
        open_scan(tmp_path / "a.npz")
    assert not (tmp_path / "sprung").exists()


def outcome(path: Path) -> ScanFile | RiftError:
    """What becomes of a file; anything but a scan or our own error fails the test."""
    try:
        scan = open_scan(path, budget=1 << 26)
        rows = scan.read(0, 1)
    except RiftError as error:
        assert str(path) in str(error)
        return error
    assert rows.projections.shape == (scan.shape[0], 1, scan.shape[2])
    assert scan.angles.shape == scan.shape[:1] and np.isfinite(scan.angles).all()
    return scan


@pytest.mark.parametrize("kind", ["a.h5", "a.nxs", "a.npz"])
def test_files_cut_short(tmp_path: Path, kind: str) -> None:
    path = tmp_path / kind
    {"a.h5": made.data_exchange, "a.nxs": made.nxtomo, "a.npz": made.npz}[kind](path)
    content = path.read_bytes()
    cuts = {0, 1, 7, 8, 9, 100, len(content) - 1, *range(0, len(content), len(content) // 40)}
    for cut in cuts:
        path.write_bytes(content[:cut])
        assert isinstance(outcome(path), FileFormatError), cut


FUZZ = """
import sys, warnings
sys.path[:0] = sys.argv[1:3]
warnings.simplefilter("error")
from pathlib import Path
from test_hostile_scans import fuzz
print(fuzz(Path(sys.argv[3])))
"""


def fuzz(folder: Path) -> str:
    """Damage files at random; how many became an error and how many a scan, as JSON."""
    random = np.random.default_rng(7)
    makers = {"a.h5": made.data_exchange, "a.nxs": made.nxtomo, "a.npz": made.npz}
    tally = {"errors": 0, "scans": 0}
    for name, make in makers.items():
        path = folder / name
        make(path)
        intact = np.fromfile(path, np.uint8)
        for _ in range(50):
            damaged = intact.copy()
            # Headers come first in HDF5, and are where damage is dangerous.
            reach = len(damaged) if random.random() < 0.5 else min(2048, len(damaged))
            where = random.integers(0, reach, random.integers(1, 9))
            damaged[where] = random.integers(0, 256, where.size)
            damaged.tofile(path)
            tally["errors" if isinstance(outcome(path), RiftError) else "scans"] += 1
    return json.dumps(tally)


@pytest.mark.full
def test_damaged_files(tmp_path: Path) -> None:
    """In a process of its own, so that a crash is a failure and not the end of the tests."""
    here = Path(__file__)
    command = [sys.executable, "-c", FUZZ, str(here.parent), str(here.parents[2]), str(tmp_path)]
    done = subprocess.run(command, capture_output=True, text=True, timeout=120, check=False)
    assert done.returncode == 0, done.stderr[-2000:]
    tally = json.loads(done.stdout.splitlines()[-1])
    assert sum(tally.values()) == 150
    assert min(tally.values()) > 10
