"""SPZ files are read as the format says, and damaged ones refused before anything is allocated."""

from __future__ import annotations

import gzip
import struct
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import splat_files as made
from splat_readers import read_spz

import rift_cl as rift
from rift_cl.errors import FileFormatError, ResourceLimitError
from rift_cl.io.scenes.formats.spz import encode_spz
from rift_cl.io.scenes.splat_activations import opacities_of


def written(path: Path, content: bytes) -> Path:
    path.write_bytes(content)
    return path


def header(**changes: int) -> bytes:
    fields = {"magic": 0x5053474E, "version": 3, "count": 2, "degree": 0}
    fields |= {"digits": 12, "flags": 0, "reserved": 0} | changes
    return struct.pack("<IIIBBBB", *fields.values())


@pytest.mark.parametrize("degree", range(4))
@pytest.mark.parametrize("antialiased", [False, True])
def test_what_was_written_is_read_as_the_format_says(tmp_path, degree, antialiased) -> None:
    """By a reader of the tests, which shares nothing with either side."""
    given = replace(made.scene(50, degree), antialiased=antialiased)
    content = encode_spz(given)
    found, wanted = rift.SplatScene.load(written(tmp_path / "a.spz", content)), read_spz(content)
    assert found.antialiased == antialiased and found.eps2d is None and found.light == "display"
    np.testing.assert_allclose(found.means, wanted["means"], rtol=1e-6)
    np.testing.assert_allclose(found.log_scales, wanted["log_scales"], rtol=1e-6)
    np.testing.assert_allclose(found.quats, wanted["quats"], atol=1e-6)
    opacities = opacities_of(found.logit_opacities)
    np.testing.assert_allclose(opacities, wanted["opacities"], atol=1e-6)
    np.testing.assert_allclose(found.sh[:, 1:], wanted["rest"], atol=1e-6)
    colors = 0.5 + 0.28209479177387814 * found.sh[:, 0]
    np.testing.assert_allclose(colors, wanted["colors"], atol=1e-6)


def test_what_is_read_is_written_again_to_the_same_numbers(tmp_path) -> None:
    content = encode_spz(made.scene(200, 3))
    once = rift.SplatScene.load(written(tmp_path / "a.spz", content))
    again = rift.SplatScene.load(written(tmp_path / "b.spz", encode_spz(once)))
    for name in ("means", "log_scales", "logit_opacities", "sh"):
        rows, others = getattr(once, name), getattr(again, name)
        np.testing.assert_allclose(
            np.sort(rows.reshape(200, -1), 0), np.sort(others.reshape(200, -1), 0), atol=1e-5
        )


def test_rotations_of_version_2_are_read(tmp_path) -> None:
    places, rest = bytes(18), bytes([128] * 2 + [128] * 6 + [160] * 6)
    turns = bytes([255, 128, 128, 0, 128, 128])
    content = gzip.compress(header(version=2) + places + rest + turns)
    found = rift.SplatScene.load(written(tmp_path / "a.spz", content))
    np.testing.assert_allclose(found.quats, [[0, 1, 0, 0], [0, -1, 0, 0]], atol=0.1)
    np.testing.assert_allclose(found.log_scales, 0)


BODY = bytes(2 * 20)
DAMAGED = {
    "nothing": (b"", "no SPZ header"),
    "no gzip": (b"x" * 100, "cannot be read"),
    "no splats": (gzip.compress(header()[:9]), "no SPZ header"),
    "something else": (gzip.compress(header(magic=1) + BODY), "is no SPZ file"),
    "version": (gzip.compress(header(version=4) + BODY), "version 4.*splat-transform"),
    "degree": (gzip.compress(header(degree=200) + BODY), "degree 200"),
    "digits": (gzip.compress(header(digits=255) + BODY), "255 bits"),
    "fewer": (gzip.compress(header() + BODY[1:]), "holds fewer"),
    "more": (gzip.compress(header() + BODY + b"x"), "holds more"),
    "claim": (gzip.compress(header(count=2**32 - 1) + BODY), "more than .* bytes can hold"),
    "cut off": (gzip.compress(header() + bytes(range(40)))[:-20], "holds fewer"),
    "cut off in the end": (gzip.compress(header() + BODY)[:-1], "holds fewer"),
    "sum": (gzip.compress(header() + BODY)[:-8] + bytes(8), "cannot be read"),
}


@pytest.mark.parametrize("damage", DAMAGED)
def test_files_that_are_none_are_refused(tmp_path, damage) -> None:
    content, words = DAMAGED[damage]
    path = written(tmp_path / "a.spz", content)
    with pytest.raises(FileFormatError, match=words) as caught:
        rift.SplatScene.load(path)
    assert str(caught.value).startswith(f"{path}: ")


def test_the_budget_decides_before_anything_is_unpacked(tmp_path) -> None:
    """A stream of zeros takes a thousandth of what it becomes."""
    count = 1 << 20
    path = written(tmp_path / "a.spz", gzip.compress(header(count=count) + bytes(20 * count)))
    assert path.stat().st_size < 1 << 15
    with pytest.raises(ResourceLimitError, match="the scene claims"):
        rift.SplatScene.load(path, budget=20 * count)


def test_what_lies_behind_the_splats_by_a_flag_is_not_read(tmp_path) -> None:
    content = gzip.compress(header(flags=3) + BODY + b"extension")
    found = rift.SplatScene.load(written(tmp_path / "a.spz", content))
    assert len(found) == 2 and found.antialiased


@pytest.mark.parametrize(
    ("name", "start", "words"),
    [
        ("a.sog", b"PK\x03\x04", "splat-transform"),
        ("a.zip", b"PK\x03\x04", "splat-transform"),
        ("a.glb", b"glTF", "rift export SCENE --to ply"),
        ("a.ply", b"\x1f\x8b\x08\x00", "end its name in .spz"),
    ],
)
def test_files_of_other_formats_are_told_a_way_out(tmp_path, name, start, words) -> None:
    with pytest.raises(FileFormatError, match=words):
        rift.SplatScene.load(written(tmp_path / name, start + bytes(40)))
