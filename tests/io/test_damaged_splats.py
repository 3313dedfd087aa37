"""Splat files cut short or damaged at random: one named error each, and never a crash."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from splat_files import ARRAYS, KINDS, valid

import rift_cl as rift
from rift_cl.errors import FileFormatError, RiftError


@pytest.mark.parametrize("kind", KINDS)
def test_files_cut_short(tmp_path: Path, kind: str) -> None:
    path = valid(tmp_path, kind)
    content = path.read_bytes()
    # Nothing shows that the last digits of a text or whole records of a .splat file are missing.
    last = content.rindex(b" ") if kind == "text.ply" else len(content) - 1
    cuts = {0, 1, 3, 4, 5, last, *range(0, last, len(content) // 60)}
    for cut in cuts:
        if kind == "a.splat" and cut and cut % 32 == 0:
            continue
        path.write_bytes(content[:cut])
        with pytest.raises(FileFormatError, match=kind):
            rift.SplatScene.load(path)


@pytest.mark.parametrize("kind", KINDS)
def test_a_file_that_shrinks_while_it_is_read(
    tmp_path: Path, kind: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = valid(tmp_path, kind)
    module = "splat_file" if kind == "a.splat" else "splat_ply"

    def shrink(*_: object) -> None:
        os.truncate(path, path.stat().st_size // 2)

    monkeypatch.setattr(f"rift_cl.io.scenes.{module}.check_claim", shrink)
    with pytest.raises(FileFormatError, match=f"{kind}: .*(cut off|no lines)"):
        rift.SplatScene.load(path)


def outcome(path: Path) -> rift.SplatScene | RiftError:
    """What becomes of a file; anything but a scene or our own error fails the test."""
    try:
        scene = rift.SplatScene.load(path, budget=1 << 26)
    except RiftError as error:
        assert str(error).startswith(f"{path}: "), error
        return error
    assert all(np.isfinite(getattr(scene, name)).all() for name in ARRAYS)
    assert scene.means.shape == (len(scene), 3) and scene.degree in range(5)
    return scene


def scattered(random: np.random.Generator, content: np.ndarray) -> np.ndarray:
    """Other bytes in a few places, half of the times near the beginning."""
    reach = len(content) if random.random() < 0.5 else min(400, len(content))
    where = random.integers(0, reach, random.integers(1, 5))
    content[where] = random.integers(0, 256, where.size)
    return content


def rewired(random: np.random.Generator, content: np.ndarray) -> np.ndarray:
    """A piece copied to another place, or left out."""
    start, stop, place = np.sort(random.integers(0, min(len(content), 900), 3))
    piece = content[start:stop] if random.random() < 0.5 else content[:0]
    return np.concatenate([content[:start], piece, content[stop:place], piece, content[place:]])


def renumbered(random: np.random.Generator, content: np.ndarray) -> np.ndarray:
    """Digits for other digits, so that most damage passes for numbers."""
    digits = np.flatnonzero((content >= 48) & (content < 58))
    if digits.size:
        where = random.choice(digits, random.integers(1, 4))
        content[where] = random.integers(48, 58, where.size)
    return content


DAMAGES: list[Callable[[np.random.Generator, np.ndarray], np.ndarray]]
DAMAGES = [scattered, rewired, renumbered]


def fuzz(folder: Path, kind: str) -> str:
    """Damage a file at random; how many became an error and how many a scene, as JSON."""
    random = np.random.default_rng([7, KINDS.index(kind)])
    path = valid(folder, kind)
    intact = np.fromfile(path, np.uint8)
    tally = {"errors": 0, "scenes": 0}
    for step in range(450):
        DAMAGES[step % len(DAMAGES)](random, intact.copy()).tofile(path)
        tally["errors" if isinstance(outcome(path), RiftError) else "scenes"] += 1
    return json.dumps(tally)


FUZZ = """
import sys, warnings
sys.path[:0] = sys.argv[1:3]
warnings.simplefilter("error")
warnings.filterwarnings("ignore", ".*: they are left out")
from pathlib import Path
from test_damaged_splats import fuzz
print(fuzz(Path(sys.argv[3]), sys.argv[4]))
"""


@pytest.mark.full
@pytest.mark.parametrize("kind", KINDS)
def test_damaged_files(tmp_path: Path, kind: str) -> None:
    """In a process of its own, so that a crash is a failure and not the end of the tests."""
    here = Path(__file__)
    command = [sys.executable, "-c", FUZZ, str(here.parent), str(here.parents[2]), str(tmp_path)]
    done = subprocess.run([*command, kind], capture_output=True, text=True, timeout=60, check=False)
    assert done.returncode == 0, done.stderr[-2000:]
    tally = json.loads(done.stdout.splitlines()[-1])
    assert sum(tally.values()) == 450
    assert min(tally.values()) > 40, tally
