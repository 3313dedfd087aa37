"""``rift.reconstruct_scan`` does what the command does."""

import json

import numpy as np
import pytest

import rift_cl as rift
from rift_cl.commands.cli import main
from rift_cl.errors import CheckpointError, InputError


def test_the_function_and_the_command_make_the_same_slices(scan, tmp_path):
    seen = []
    made = rift.reconstruct_scan(
        scan.counts, tmp_path / "a", filter="hann", rows=(0, 2), format="h5", progress=seen.append
    )
    options = ["--filter", "hann", "--rows", "0", "2", "--format", "h5"]
    assert main(["reconstruct", str(scan.counts), "--out", str(tmp_path / "b"), *options]) == 0
    volume = made.read()
    assert volume.shape == (2, 96, 96)
    np.testing.assert_array_equal(volume, rift_volume(tmp_path / "b/volume.h5"))
    assert made.path == tmp_path / "a/volume.h5"
    assert made.settings.center == made.metrics["center"]
    assert made.settings.center == json.loads((tmp_path / "b/metrics.json").read_text())["center"]
    assert seen[-1].done == seen[-1].total == 2


@pytest.mark.parametrize("kind", ["parallel", "cone"])
def test_a_finished_run_is_given_back_as_it_is(scan, tmp_path, kind):
    source, given = scan.counts, {"center": 45.0}
    if kind == "cone":
        source, given = tmp_path / "cone.npz", {"kind": "attenuation"}
        np.savez(
            source,
            projections=np.hanning(16) * np.ones((24, 4, 16), np.float32),
            angles=2 * np.pi * np.arange(24) / 24,
            source_to_axis=60.0,
            source_to_detector=120.0,
            pitch=2.0,
        )
        given["center"] = 7.5
    made = rift.reconstruct_scan(source, tmp_path / "out", resume=True, **given)
    before = {path: path.stat().st_mtime_ns for path in (tmp_path / "out").rglob("*")}
    again = rift.reconstruct_scan(source, tmp_path / "out", resume=True, **given)
    assert {path: path.stat().st_mtime_ns for path in (tmp_path / "out").rglob("*")} == before
    assert again.metrics == made.metrics and again.path == made.path
    assert again.settings.center == made.settings.center == given["center"]
    assert again.notes == (
        *made.notes,
        f"{tmp_path / 'out'}: the reconstruction is complete already",
    )
    with pytest.raises(CheckpointError):
        rift.reconstruct_scan(source, tmp_path / "out", resume=True, filter="hann", **given)


def rift_volume(path):
    from rift_cl.io import read_volume

    return read_volume(path)


@pytest.mark.parametrize(
    ("settings", "sentence"),
    [
        ({"colour": "red"}, "no setting 'colour'"),
        ({"method": "best"}, "method is 'best'"),
        ({"steps": "many", "method": "sirt"}, "steps is 'many'"),
        ({"dry_run": True}, "leave it out"),
        ({"filter": "hann", "method": "sirt"}, "filter does not apply"),
    ],
)
def test_what_cannot_be_used_is_told(scan, tmp_path, settings, sentence):
    with pytest.raises(InputError, match=sentence):
        rift.reconstruct_scan(scan.counts, tmp_path / "out", **settings)
    assert not (tmp_path / "out").exists()
