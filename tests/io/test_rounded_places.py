"""Splats whose places have more digits than float32: harmless, or refused."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import splat_files as made

import rift_cl as rift
from rift_cl.errors import FileFormatError, InputError
from rift_cl.splat.splats import Splats


@pytest.mark.parametrize("text", [False, True])
def test_places_that_float32_would_move_are_refused_with_what_to_subtract(tmp_path, text) -> None:
    """Coordinates of a map, in metres; splats of 5 cm, or of 50 m that nothing happens to."""
    kinds = [(name, "f8" if name in "xyz" else "f4") for name in made.names(0)]
    values = made.retyped(made.records(made.scene(200, 0)), kinds)
    path = tmp_path / "a.ply"
    assert len(load_of(path, values, text)) == 200
    values["y"] += 4e6
    with pytest.raises(FileFormatError, match=r"subtract \(-?0, 4000000, -?0\) from"):
        load_of(path, values, text)
    # One of a hundred may be moved, and wide splats may be.
    values["scale_2"][2:] = np.log(50)
    assert len(load_of(path, values, text)) == 200
    values["scale_2"][:3] = np.log(0.05)
    with pytest.raises(FileFormatError, match="3 of 200"):
        load_of(path, values, text)


def test_splats_of_no_width_may_be_moved_by_nothing_that_shows(tmp_path) -> None:
    kinds = [(name, "f8") for name in made.names(0)]
    values = made.retyped(made.records(made.scene(20, 0)), kinds)
    values["x"] += 1 / 3
    for axis in range(3):
        values[f"scale_{axis}"] = -60
    assert len(load_of(tmp_path / "a.ply", values, False)) == 20


def test_places_of_arrays_are_refused_alike(device) -> None:
    scene = made.scene(200, 0)
    given = {name: value for name, value in vars(scene).items() if value is not None}
    far = {**given, "means": scene.means + np.array([0, 4e6, 0])}
    with pytest.raises(InputError, match=r"SplatScene: means: .* subtract \(-?0, 4000000, -?0\)"):
        rift.SplatScene(**far)
    # Whoever gives float32 has rounded already; what float32 holds is moved by nothing.
    assert len(rift.SplatScene(**{**far, "means": far["means"].astype(np.float32)})) == 200
    assert len(rift.SplatScene(**{**far, "means": np.round(far["means"])})) == 200
    drawn = {"opacities": np.full(200, 0.5), "quats": scene.quats, "colors": np.ones((200, 3))}
    with pytest.raises(InputError, match=r"Splats: means: .* 4000000"):
        Splats.upload(device, means=far["means"], scales=np.full((200, 3), 0.05), **drawn)
    wide = Splats.upload(device, means=far["means"], scales=np.full((200, 3), 50.0), **drawn)
    assert len(wide) == 200


def load_of(path: Path, values: np.ndarray, text: bool) -> rift.SplatScene:
    return rift.SplatScene.load(made.write(path, ("vertex", values), text=text))
