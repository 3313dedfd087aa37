"""MAT files that lie about sizes, nest without end, or hold what must not be run."""

from __future__ import annotations

import struct
import time
import zlib
from pathlib import Path

import h5py
import numpy as np
import pytest
import scipy.io
from mat_files import challenge, write_mat
from scan_files import BINS, DEGREES, FRAMES, counts
from test_hostile_scans import grown

from rift_cl.errors import FileFormatError, InputError, PathEscapeError, ResourceLimitError
from rift_cl.io import open_scan
from rift_cl.io.scans import mat5, mat73

HEADER = b"MATLAB 5.0 MAT-file".ljust(124) + b"\x00\x01IM"
SINOGRAM = {"axes": "angle,bin", "kind": "attenuation"}
DOUBLE, STRUCT, FUNCTION, OPAQUE = 6, 2, 16, 17


def tag(kind: int, content: bytes) -> bytes:
    return struct.pack("<II", kind, len(content)) + content + bytes(-len(content) % 8)


def matrix(name: str, kind: int, shape: tuple[int, ...], body: bytes) -> bytes:
    head = tag(6, struct.pack("<II", kind, 0)) + tag(5, struct.pack(f"<{len(shape)}i", *shape))
    return tag(14, head + tag(1, name.encode()) + body)


def packed(element: bytes) -> bytes:
    content = zlib.compress(element)
    return struct.pack("<II", 15, len(content)) + content


def write(path: Path, *elements: bytes) -> Path:
    path.write_bytes(HEADER + b"".join(elements))
    return path


def test_the_pieces_of_these_tests_make_a_file_that_others_read(tmp_path: Path) -> None:
    numbers = np.arange(6.0)
    element = matrix("p", DOUBLE, (2, 3), tag(9, numbers.tobytes()))
    for version in (element, packed(element)):
        path = write(tmp_path / "a.mat", version)
        read = scipy.io.loadmat(path)["p"]
        np.testing.assert_array_equal(read, numbers.reshape(2, 3, order="F"))
        scan = open_scan(path, dataset="p", theta="180", **SINOGRAM)
        np.testing.assert_array_equal(scan.read(0, 1).projections[:, 0], read)


@pytest.mark.parametrize("pack", [bytes, packed])
@pytest.mark.parametrize("shape", [(1 << 20, 1 << 20), (2**31 - 1,) * 32, (3, 3), (0, 5)])
def test_a_shape_that_is_not_stored(tmp_path: Path, pack: type, shape: tuple[int, ...]) -> None:
    element = matrix("p", DOUBLE, shape, tag(9, bytes(48)))
    before = grown()
    with pytest.raises(FileFormatError, match=r"48 bytes"):
        open_scan(write(tmp_path / "a.mat", pack(element)), dataset="p", theta="180")
    assert grown() - before < 50 << 20


def bomb(size: int) -> bytes:
    """A packed matrix (1, size / 8) of zeros, of a thousandth of the size."""
    stream = zlib.compressobj(1)
    head = matrix("p", DOUBLE, (2, size // 16), b"")
    whole = struct.pack("<II", 14, len(head) + size) + head[8:] + struct.pack("<II", 9, size)
    content = stream.compress(whole)
    for _ in range(size >> 20):
        content += stream.compress(bytes(1 << 20))
    content += stream.flush()
    return struct.pack("<II", 15, len(content)) + content


def test_a_bomb_is_unpacked_neither_when_it_is_listed_nor_when_it_is_read(tmp_path: Path) -> None:
    path = write(tmp_path / "a.mat", bomb(1 << 27))
    assert path.stat().st_size < 1 << 20
    before, begin = grown(), time.perf_counter()
    with pytest.raises(ResourceLimitError, match="budget is 16 MiB"):
        open_scan(path, dataset="p", theta="180", budget=1 << 24, **SINOGRAM)
    assert grown() - before < 50 << 20 and time.perf_counter() - begin < 0.5


def test_a_structure_is_measured_before_it_is_unpacked(tmp_path: Path) -> None:
    fields = tag(5, struct.pack("<i", 8)) + tag(1, b"a".ljust(8, b"\0"))
    inner = struct.pack("<II", 14, 1 << 31)
    whole = matrix("s", STRUCT, (1, 1), fields + inner)
    element = struct.pack("<II", 14, (1 << 31) + len(whole)) + whole[8:]
    path = write(tmp_path / "a.mat", packed(element))
    with pytest.raises(ResourceLimitError, match="'s' claims 2 GiB"):
        open_scan(path, dataset="p", theta="180", budget=1 << 26)
    with pytest.raises(FileFormatError, match="ends early"):
        open_scan(path, dataset="p", theta="180", budget=1 << 40)


def nested(depth: int) -> bytes:
    element = matrix("", DOUBLE, (1, 1), tag(9, bytes(8)))
    for level in range(depth):
        fields = tag(5, struct.pack("<i", 8)) + tag(1, b"a".ljust(8, b"\0"))
        name = "s" if level == depth - 1 else ""
        element = matrix(name, STRUCT, (1, 1), fields + element)
    return element


def test_structures_in_structures(tmp_path: Path) -> None:
    with pytest.raises(FileFormatError, match=r"'s\.a\.a\.a' \(1, 1\)"):
        open_scan(write(tmp_path / "a.mat", nested(3)))
    with pytest.raises(FileFormatError, match="real numbers"):
        open_scan(write(tmp_path / "a.mat", nested(5000)))


def test_functions_and_objects_are_passed_over(tmp_path: Path) -> None:
    strange = [matrix("f", kind, (1, 1), nested(1)) for kind in (FUNCTION, OPAQUE, 3, 1, 200)]
    good = matrix("p", DOUBLE, (2, 3), tag(9, bytes(48)))
    path = write(tmp_path / "a.mat", *strange, good)
    assert open_scan(path, dataset="p", theta="180", **SINOGRAM).shape == (2, 1, 3)


def test_more_arrays_than_a_file_has(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    for module in (mat5, mat73):
        monkeypatch.setattr(module, "_MOST_ARRAYS", 40)
    small = [matrix(f"v{i}", DOUBLE, (1, 1), tag(9, bytes(8))) for i in range(50)]
    with pytest.raises(FileFormatError, match="more than 40 arrays"):
        open_scan(write(tmp_path / "a.mat", *small))
    with h5py.File(tmp_path / "b.mat", "w", userblock_size=512) as file:
        for index in range(50):
            file[f"v{index}"] = np.zeros((1, 1))
    with pytest.raises(FileFormatError, match="more than 40 arrays"):
        open_scan(tmp_path / "b.mat")


@pytest.mark.parametrize(
    "element",
    [
        tag(9, bytes(8)),
        struct.pack("<II", 14, 1 << 30) + bytes(64),
        struct.pack("<II", 15, 40) + bytes(40),
        packed(tag(9, bytes(8))),
        tag(14, tag(6, bytes(8))),
        tag(14, b""),
        matrix("p", DOUBLE, (-1, 5), tag(9, bytes(8))),
        matrix("p", STRUCT, (1, 1), tag(5, struct.pack("<i", 0)) + tag(1, b"a")),
        matrix("p", STRUCT, (1, 1), tag(5, struct.pack("<i", 1)) + tag(1, b"a") + tag(9, b"")),
        2 * matrix("p", DOUBLE, (1, 1), tag(9, bytes(8))),
    ],
)
def test_elements_out_of_place(tmp_path: Path, element: bytes) -> None:
    with pytest.raises(FileFormatError, match=r"a\.mat:.*MAT"):
        open_scan(write(tmp_path / "a.mat", element))


def test_a_packed_array_whose_sum_is_wrong(tmp_path: Path) -> None:
    content = bytearray(packed(matrix("p", DOUBLE, (2, 3), tag(9, bytes(48)))))
    content[-1] ^= 1
    with pytest.raises(FileFormatError, match="incorrect data check"):
        path = write(tmp_path / "a.mat", bytes(content))
        open_scan(path, dataset="p", theta="180", **SINOGRAM).read(0, 1)


@pytest.mark.parametrize("version", ["5", "5 packed", "7.3"])
def test_files_cut_short(tmp_path: Path, version: str) -> None:
    path = write_mat(tmp_path / "a.mat", {"CtDataFull": challenge()}, version)
    content = path.read_bytes()
    cuts = {0, 1, 124, 128, 130, 512, 520, *range(0, len(content), len(content) // 40)}
    for cut in cuts | {len(content) - 1}:
        if cut >= len(content):
            continue
        path.write_bytes(content[:cut])
        with pytest.raises(InputError, match=r"a\.mat"):
            open_scan(path).read(0, 1)


def test_names_that_lie(tmp_path: Path) -> None:
    (tmp_path / "a.mat").write_bytes(struct.pack("<5i", 0, 2, 2, 0, 2) + bytes(40))
    with pytest.raises(FileFormatError, match="MAT or HDF5"):
        open_scan(tmp_path / "a.mat")


def test_links_that_lead_out_of_a_new_file(tmp_path: Path) -> None:
    folder = tmp_path / "in"
    folder.mkdir()
    with h5py.File(tmp_path / "secret.h5", "w") as file:
        file["p"] = counts(FRAMES, BINS)
    path = write_mat(folder / "a.mat", {"t": DEGREES}, "7.3")
    with h5py.File(path, "a") as file:
        file["p"] = h5py.ExternalLink("../secret.h5", "/p")
    with pytest.raises(PathEscapeError, match="outside the folder"):
        open_scan(path, dataset="p", theta="t")


def test_links_that_go_round(tmp_path: Path) -> None:
    path = write_mat(tmp_path / "a.mat", {"t": DEGREES}, "7.3")
    with h5py.File(path, "a") as file:
        file["g/g"] = h5py.SoftLink("/g")
        file["h/h"] = file["h"] if "h" in file else file.create_group("h")
    with pytest.raises(FileFormatError, match=r"it holds 't'"):
        open_scan(path)


def test_a_text_of_complex_codes_is_no_text(tmp_path: Path) -> None:
    path = write_mat(tmp_path / "a.mat", {"CtDataFull": challenge()}, "5")
    flags = struct.pack("<4I", 6, 8, 4, 0)
    # Every array of class char claims to be complex.
    path.write_bytes(path.read_bytes().replace(flags, struct.pack("<4I", 6, 8, 0x800 | 4, 0)))
    assert open_scan(path).shape[0] == len(DEGREES)
