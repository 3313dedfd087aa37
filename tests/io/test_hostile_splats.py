"""Splat files that lie: one named error each, before anything is allocated."""

from __future__ import annotations

import os
import resource
import sys
from pathlib import Path

import numpy as np
import pytest
import splat_files as made
from splat_files import KINDS, valid

import rift_cl as rift
from rift_cl.errors import FileFormatError, NonFiniteError, ResourceLimitError, RiftError
from rift_cl.io.scenes.splat_activations import log_scales_of, opacities_of


def grown() -> int:
    """Peak memory of this process so far, in bytes."""
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    return peak if sys.platform == "darwin" else 1024 * peak


def edited(path: Path, old: str, new: str) -> Path:
    content = path.read_bytes()
    assert content.count(old.encode()) >= 1
    path.write_bytes(content.replace(old.encode(), new.encode(), 1))
    return path


def refused(path: Path, kind: type[RiftError], words: str) -> None:
    before = grown()
    with pytest.raises(kind, match=words) as caught:
        rift.SplatScene.load(path)
    assert str(caught.value).startswith(f"{path}: ")
    assert grown() - before < 20 << 20


@pytest.mark.parametrize("kind", ["binary.ply", "text.ply"])
@pytest.mark.parametrize("count", [8, 10**6, 10**10, 10**17])
def test_counts_that_the_file_cannot_hold(tmp_path: Path, kind: str, count: int) -> None:
    """One record too many shows in a text only when it is read: its numbers may be short."""
    path = edited(valid(tmp_path, kind), "vertex 7\n", f"vertex {count}\n")
    refused(path, FileFormatError, f"claims {count} records.*cut off")


@pytest.mark.parametrize("kind", ["binary.ply", "text.ply"])
@pytest.mark.parametrize("count", [0, 3])
def test_counts_that_would_lose_splats(tmp_path: Path, kind: str, count: int) -> None:
    path = edited(valid(tmp_path, kind), "vertex 7\n", f"vertex {count}\n")
    refused(path, FileFormatError, f"{count} records")


@pytest.mark.parametrize("count", ["-7", "+7", "7.0", "1e3", "0x7", "7_0", "٧", "9" * 5000, "many"])
def test_counts_that_are_no_counts(tmp_path: Path, count: str) -> None:
    path = edited(valid(tmp_path, "binary.ply"), "vertex 7\n", f"vertex {count}\n")
    refused(path, FileFormatError, "claims '.{1,60}' records")


@pytest.mark.parametrize("name", ["a.ply", "a.splat"])
def test_a_file_that_really_is_terabytes(tmp_path: Path, name: str) -> None:
    """A sparse file takes no room on the disk, and would take a terabyte of memory."""
    path = tmp_path / name
    made.scene(0, 3).save(tmp_path / "a.ply")
    count, offset = 2**32, (tmp_path / "a.ply").stat().st_size
    each = 248 if name == "a.ply" else 32
    if name == "a.ply":
        edited(path, "vertex 0\n", f"vertex {count}\n")
        offset += len(str(count)) - 1
    else:
        path.touch()
        offset = 0
    try:
        os.truncate(path, offset + count * each)
    except OSError as error:
        pytest.skip(f"no sparse file: {error}")
    refused(path, ResourceLimitError, "the scene claims .*iB, the memory budget is")


@pytest.mark.parametrize("kind", KINDS)
def test_the_budget_decides(tmp_path: Path, kind: str) -> None:
    path = valid(tmp_path, kind, 1000)
    assert len(rift.SplatScene.load(path, budget=1 << 20)) == 1000
    with pytest.raises(ResourceLimitError, match=f"{kind}: .*claims"):
        rift.SplatScene.load(path, budget=50_000)


EDITS = {
    "list": ("property float z", "property list uchar float z", "list property"),
    "missing": ("property float z", "property float zz", "lacks z;"),
    "points": ("property float f_dc", "property float g_dc", "lacks f_dc_0;"),
    "coefficients": ("property float f_rest_5", "property float g_rest_5", "8 properties f_rest"),
    "harmonic": ("property float f_rest_5\n", "property float f_rest_05\n", "lacks f_rest_5"),
    "twice": ("property float z", "property float y", "two properties 'y'"),
    "type": ("property float z", "property half z", "'property half z', which has no meaning"),
    "no type": ("property float z", "property z", "'property z', which has no meaning"),
    "faces first": (
        "element vertex",
        "element face 2\nproperty list uchar int v\nelement vertex",
        "element 'face' has a list property",
    ),
    "huge first": (
        "element vertex",
        "element other 999999999999999999\nproperty double v\nelement vertex",
        "claims 7 records",
    ),
    "huge behind": (
        "property float rot_3",
        "property float rot_3\nelement other 999999999999999999\nproperty double v",
        "claims 7 records",
    ),
    "two vertex": (
        "property float rot_3",
        "property float rot_3\nelement vertex 7",
        "wanted one element 'vertex'",
    ),
    "other": ("element vertex", "element point", "has element 'point', wanted one"),
    "compressed": ("element vertex", "element chunk 1\nelement vertex", "splat-transform"),
    "no element": ("element vertex 7", "comment", "no meaning"),
    "no format": ("format binary_little_endian 1.0", "comment", "no meaning"),
    "version": ("1.0", "1.1", "1.1', which has no meaning"),
    "order": ("binary_little_endian", "binary_middle_endian", "no meaning"),
    "two formats": ("element", "format ascii 1.0\nelement", "format ascii 1.0', which"),
    "keyword": ("element", "elephant", "line 3 of its header is 'elephant vertex 7'"),
    "wider": ("property float z", "property double z", "claims 7 records.*cut off or damaged"),
    "narrower": ("property float nz", "property uchar nz", "claims 7 records"),
    "end": ("end_header\n", "end_headers\n", "has no PLY header"),
    "start": ("ply\n", "plx\n", "is no PLY file"),
}


@pytest.mark.parametrize("edit", EDITS)
def test_headers_that_describe_something_else(tmp_path: Path, edit: str) -> None:
    old, new, words = EDITS[edit]
    refused(edited(valid(tmp_path, "binary.ply"), old, new), FileFormatError, words)


def test_a_header_without_anything(tmp_path: Path) -> None:
    (tmp_path / "a.ply").write_bytes(b"ply\nend_header\n")
    refused(tmp_path / "a.ply", FileFormatError, "no format or no element")


def test_a_header_without_end(tmp_path: Path) -> None:
    (tmp_path / "a.ply").write_bytes(b"ply\n" + b"comment x\n" * 1_000_000)
    refused(tmp_path / "a.ply", FileFormatError, "has no PLY header")


@pytest.mark.parametrize("name", ["a.ply", "a.splat"])
@pytest.mark.parametrize("content", [b"", b"ply", b"\x1f\x8b\x08", b"x" * 33])
def test_files_of_something_else(tmp_path: Path, name: str, content: bytes) -> None:
    (tmp_path / name).write_bytes(content)
    words = "is no PLY file" if name == "a.ply" else "a splat has 32"
    refused(tmp_path / name, FileFormatError, words)


def test_wide_records_are_read_a_few_at_a_time(tmp_path: Path) -> None:
    """A header of a megabyte can make a block of a few thousand records larger than memory."""
    wide = "".join(f"property double p{i:05}\n" for i in range(40_000))
    path = made.write(tmp_path / "a.ply", ("vertex", made.records(made.scene(60, 0))))
    edited(edited(path, "property float rot_3\n", f"property float rot_3\n{wide}"), "60", "500")
    offset = path.read_bytes().index(b"end_header\n") + 11
    os.truncate(path, offset + 500 * (68 + 320_000))
    before = grown()
    assert len(rift.SplatScene.load(path)) == 500
    assert grown() - before < 60 << 20


ROWS = {
    "a word": lambda row: [b"one", *row[1:]],
    "too few": lambda row: row[1:],
    "too many": lambda row: [*row, b"1"],
    "a comment": lambda row: [b"#", *row[1:]],
    "endless": lambda row: [b"0" * 100_000, *row[1:]],
}


@pytest.mark.parametrize("damage", ROWS)
@pytest.mark.parametrize("where", ["one", "all"])
def test_lines_of_text_that_are_no_records(tmp_path: Path, damage: str, where: str) -> None:
    path = valid(tmp_path, "text.ply")
    header, body = path.read_bytes().split(b"end_header\n")
    rows = [row.split(b" ") for row in body.splitlines()]
    chosen = slice(4, 5) if where == "one" else slice(None)
    rows[chosen] = [ROWS[damage](row) for row in rows[chosen]]
    path.write_bytes(header + b"end_header\n" + b"".join(b" ".join(row) + b"\n" for row in rows))
    refused(path, FileFormatError, "records 0 to 7 are no lines of 26 numbers|more than the 7")


def test_splats_that_cannot_be_drawn_are_counted_and_left_out(tmp_path: Path) -> None:
    values = made.records(made.scene(7, 1))
    values["opacity"][[0, 1, 2]] = np.inf, -np.inf, np.nan
    values["scale_1"][4] = 45
    path = made.write(tmp_path / "a.ply", ("vertex", values))
    with pytest.warns(UserWarning, match=r"2 of 7 .*\(log_scales, logit_opacities\)"):
        scene = rift.SplatScene.load(path)
    # Infinite logits are opacities of 1 and 0.
    np.testing.assert_array_equal(scene.means[:, 0], values["x"][[0, 1, 3, 5, 6]])
    np.testing.assert_array_equal(opacities_of(scene.logit_opacities[:2]), [1, 0])
    values = made.retyped(made.records(made.scene(7, 1)), [(n, "f8") for n in made.names(1)])
    values["f_rest_4"][3] = 1e300
    for text in (True, False):
        made.write(path, ("vertex", values), text=text)
        with pytest.warns(UserWarning, match=r"1 of 7 .*\(sh\)"):
            assert len(rift.SplatScene.load(path)) == 6
    values["f_rest_4"][:4] = np.nan
    made.write(path, ("vertex", values))
    refused(path, NonFiniteError, r"4 of 7 .* the file is damaged")
    # What no scene keeps may be what it likes.
    values["f_rest_4"], values["nx"] = 0, np.nan
    made.write(path, ("vertex", values))
    assert len(rift.SplatScene.load(path)) == 7


def test_scales_of_zero_are_flat_splats(tmp_path: Path) -> None:
    """As the logarithm of 0 has them: all splats are read, with what a scale of 0 is drawn as."""
    values = made.records(made.scene(7, 1))
    values["scale_2"] = -np.inf
    scene = rift.SplatScene.load(made.write(tmp_path / "a.ply", ("vertex", values)))
    assert len(scene) == 7
    np.testing.assert_array_equal(scene.log_scales[:, 2], log_scales_of(np.zeros(7, np.float32)))
    np.testing.assert_array_equal(scene.log_scales[:, 0], values["scale_0"])


@pytest.mark.parametrize(
    ("offset", "value", "name"), [(36, np.nan, "means"), (44, np.inf, "log_scales")]
)
def test_splats_of_32_bytes_are_left_out_alike(tmp_path: Path, offset, value, name) -> None:
    path = changed_splat(tmp_path, offset, value)
    with pytest.warns(UserWarning, match=rf"1 of 7 .*\({name}\)"):
        assert len(rift.SplatScene.load(path)) == 6


def test_a_negative_scale_is_refused(tmp_path: Path) -> None:
    path = changed_splat(tmp_path, 44, -1)
    refused(path, FileFormatError, "1 of 7 splats have a negative scale")


def changed_splat(folder: Path, offset: int, value: float) -> Path:
    path = valid(folder, "a.splat")
    content = bytearray(path.read_bytes())
    content[offset : offset + 4] = np.float32(value).tobytes()
    path.write_bytes(content)
    return path
