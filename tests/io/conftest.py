"""A disk that can be filled, and the way to the files that the tests of this folder share."""

from __future__ import annotations

import json
import subprocess
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import capture_files as made
import pytest
from photograph_files import NAMES

from rift_cl.io.lenses.lens_file import open_lens
from rift_cl.optics.lens_prescription import LensPrescription
from rift_cl.sample.stock_lenses import stock_lens


@pytest.fixture
def small_disk(tmp_path: Path) -> Iterator[Path]:
    """A file system of 64 KiB, where the tests are allowed to mount one."""
    place = tmp_path / "small"
    place.mkdir()
    command = ["mount", "-t", "tmpfs", "-o", "size=64k", "tmpfs", str(place)]
    try:
        done = subprocess.run(command, capture_output=True, text=True, check=False)
    except OSError as error:
        pytest.skip(f"no small disk: {error}")
    if done.returncode:
        pytest.skip(f"no small disk: {done.stderr.strip()}")
    try:
        yield place
    finally:
        subprocess.run(["umount", "-l", str(place)], check=True)


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """Four bare photographs."""
    made.photographs(tmp_path / "bare", NAMES)
    return tmp_path / "bare"


@pytest.fixture
def seen(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Callable[[], dict[str, Any]]:
    """Put the stand-in in place of pycolmap; gives what it was asked."""
    monkeypatch.syspath_prepend(str(Path(__file__).parent / "fake_pycolmap"))
    path = tmp_path / "seen.json"
    monkeypatch.setenv("FAKE_PYCOLMAP_SEEN", str(path))
    return lambda: json.loads(path.read_text())


@pytest.fixture
def triplet() -> LensPrescription:
    """The stock Cooke triplet."""
    return open_lens(stock_lens("cooke_triplet"))


@pytest.fixture
def save(tmp_path: Path) -> Callable[..., Path]:
    """Writes a text as a file, by default as a Zemax lens."""

    def _save(text: str, name: str = "lens.zmx", encoding: str = "utf-8") -> Path:
        (tmp_path / name).write_bytes(text.encode(encoding))
        return tmp_path / name

    return _save
