"""Cameras that other programs leave: which they are is said, of the file and of its folder."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path

import capture_files as made
import numpy as np
import pytest

from rift_cl.commands.fit.kind import kind_of_fit
from rift_cl.errors import InputError
from rift_cl.io import open_capture
from rift_cl.io.captures.other_cameras import other_cameras, other_program

POSE = "1.0 0.0 0.0 2.5\n0 1 0 -3e-2\n0 0 1 4\n0 0 0 1\n"
SHOT = {"rotation": [0, 0, 0], "camera": "v2"}
SOLVED = [{"cameras": {"v2": {"projection_type": "brown"}}, "shots": {"a.png": SHOT}}]


def text(content: object) -> Callable[[Path], None]:
    words = content if isinstance(content, str) else json.dumps(content)
    return lambda path: path.write_text(words) and None


FILES = {
    "poses_bounds.npy": ("LLFF", lambda path: np.save(path, np.ones((3, 17)))),
    "cameras.npz": ("IDR and NeuS", lambda path: np.savez(path, world_mat_0=np.eye(4))),
    "reconstruction.json": ("OpenSfM", text(SOLVED)),
    "cameras.json": ("INRIA", text([{"id": 0, "img_name": "a", "rotation": [[1]]}])),
    "metadata.json": ("Record3D", text({"w": 4, "h": 3, "K": [1], "poses": [[0, 0, 0, 1]]})),
    "cameras.sfm": ("Meshroom", text({"version": ["1", "2"]})),
    "Barn.log": ("Tanks and Temples", text(f"0 0 0\n{POSE}1 1 0\n{POSE}")),
    "cams.csv": ("RealityCapture", text("#name,x,y,alt,heading\na.png,1,2,3,4\n")),
    "cameras.xml": ("Metashape", text('<?xml version="1.0"?>\n<document>\n  <chunk label="1">')),
    "bundle.out": ("Bundler", text("# Bundle file v0.3\n1 1\n")),
    "model.nvm": ("VisualSFM", text("NVM_V3\n1\n")),
    "keyframes/corrected_cameras/1.json": ("Polycam", text({"blur_score": 9, "t_00": 0.5})),
}


def laid(folder: Path, name: str) -> Path:
    path = folder / name
    path.parent.mkdir(parents=True, exist_ok=True)
    FILES[name][1](path)
    return path


@pytest.mark.parametrize("name", FILES)
def test_cameras_of_other_programs_are_named_with_what_to_do(tmp_path: Path, name: str) -> None:
    program, path = FILES[name][0], laid(tmp_path, name)
    found = other_program(path)
    assert found is not None and program in found.name
    with pytest.raises(InputError) as refused:
        open_capture(path)
    assert found.way in str(refused.value) and name in str(refused.value)
    assert kind_of_fit([str(path)]) == "photos"
    [note] = other_cameras(tmp_path)
    assert found.way in note and str(Path(name).parent) in note
    # Python is told, too, that nothing here is posed.
    with pytest.raises(InputError, match="holds no capture") as refused:
        open_capture(tmp_path)
    assert found.way in str(refused.value)


def test_files_of_the_same_names_that_hold_no_cameras_are_let_be(tmp_path: Path) -> None:
    made.transforms(tmp_path)
    for name in ("angles.csv", "notes.xml", "run.log", "metadata.json", "list.json", "job.out"):
        (tmp_path / name).write_text('{"frames": [[1, 2], {"img_name": 3}]}\n0 1\n')
    np.savez(tmp_path / "scan.npz", projections=np.ones((2, 3, 4)))
    np.save(tmp_path / "poses.npy", np.ones(3))
    assert other_cameras(tmp_path) == []
    assert kind_of_fit([str(tmp_path / "scan.npz")]) == "xray"


def test_no_mark_takes_long_on_a_file_that_was_made_to(tmp_path: Path) -> None:
    """Each of these would keep a pattern with two ways to read a character busy for minutes."""
    for name, piece in {
        "a.log": b"0 0 0\n" + b"1" * 65536,
        "b.xml": b"<document" * 8000,
        "c.json": b"[{" + b'"' * 65536,
        "d.json": b" " * 65536,
        "e.csv": b" " * 65536,
    }.items():
        (tmp_path / name).write_bytes(piece)
    assert other_cameras(tmp_path) == []
