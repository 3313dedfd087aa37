"""Checkpoints: the same bits come back, two are kept, and a damaged one is known for it."""

from __future__ import annotations

import json
import zipfile

import numpy as np
import pytest

from rift_cl.errors import CheckpointError, OutputError
from rift_cl.io.checkpoint import Checkpoint, load_checkpoint, newest_checkpoint, save_checkpoint


def checkpoint(step=7, seed=0):
    random = np.random.default_rng(seed)
    arrays = {
        "raw.means": random.normal(size=(50, 3)).astype(np.float32),
        "poses.views": random.normal(size=(4, 4, 4)),
        "step": np.array(step),
    }
    return Checkpoint(step, arrays, {"settings": {"seed": 3}})


def test_what_was_written_comes_back_bit_by_bit(tmp_path):
    given = checkpoint()
    found = load_checkpoint(save_checkpoint(tmp_path / "kept", given))
    assert (found.step, found.facts) == (7, {"settings": {"seed": 3}})
    assert found.arrays.keys() == given.arrays.keys()
    for name, array in given.arrays.items():
        assert found.arrays[name].dtype == array.dtype, name
        assert found.arrays[name].shape == array.shape, name
        assert found.arrays[name].tobytes() == array.tobytes(), name


def test_the_newest_two_are_kept(tmp_path):
    for step in (5, 10, 100, 1000):
        save_checkpoint(tmp_path, checkpoint(step))
    names = sorted(path.name for path in tmp_path.iterdir())
    assert names == ["step-000000100.npz", "step-000001000.npz"]
    assert newest_checkpoint(tmp_path)[0].step == 1000


def test_a_folder_without_any_has_none(tmp_path):
    assert newest_checkpoint(tmp_path / "nothing") == (None, [])


def test_the_older_one_stands_in_for_a_damaged_one(tmp_path):
    for step in (5, 10):
        path = save_checkpoint(tmp_path, checkpoint(step))
    path.write_bytes(path.read_bytes()[:-400])
    found, problems = newest_checkpoint(tmp_path)
    assert found.step == 5
    assert len(problems) == 1 and path.name in problems[0]
    (tmp_path / "step-000000005.npz").write_bytes(b"")
    with pytest.raises(CheckpointError, match="begin anew"):
        newest_checkpoint(tmp_path)


def test_every_damaged_byte_is_noticed_or_harmless(tmp_path):
    """Bytes of names, dates and other bookkeeping may change; what comes back may not."""
    given = checkpoint()
    path = save_checkpoint(tmp_path, given)
    whole, random = path.read_bytes(), np.random.default_rng(1)
    refused = 0
    for _ in range(300):
        bytes_ = bytearray(whole)
        bytes_[random.integers(len(whole))] ^= 1 << random.integers(8)
        path.write_bytes(bytes_)
        try:
            found = load_checkpoint(path)
        except CheckpointError as error:
            assert str(path) in str(error)
            refused += 1
            continue
        for name, array in given.arrays.items():
            assert found.arrays[name].tobytes() == array.tobytes(), name
    assert refused > 200


def test_changed_values_are_noticed_even_if_the_archive_is_sound(tmp_path):
    path = save_checkpoint(tmp_path, checkpoint())
    with zipfile.ZipFile(path) as archive:
        members = {name: archive.read(name) for name in archive.namelist()}
    members["step.npy"] = members["step.npy"][:-8] + np.array(8).tobytes()
    with zipfile.ZipFile(path, "w") as archive:
        for name, content in members.items():
            archive.writestr(name, content)
    with pytest.raises(CheckpointError, match="'step'"):
        load_checkpoint(path)


@pytest.mark.parametrize(
    ("facts", "words"),
    [
        ({"format": 9}, "its format is 9"),
        ({"format": 1, "step": 1, "sha256": [], "facts": {}}, "does not say"),
        ({"format": 1, "sha256": {"away": "0"}, "facts": {}, "step": 1}, "away"),
        ("x" * (1 << 20), "bytes"),
    ],
)
def test_strange_facts_are_refused(tmp_path, facts, words):
    path = tmp_path / "step-000000001.npz"
    with zipfile.ZipFile(path, "w") as archive:
        archive.writestr("facts.json", json.dumps(facts))
    with pytest.raises(CheckpointError, match=words):
        load_checkpoint(path)


def test_one_that_cannot_be_written_leaves_the_others(tmp_path):
    save_checkpoint(tmp_path, checkpoint(5))
    (tmp_path / "step-000000010.npz").mkdir()
    with pytest.raises(OutputError, match="folder"):
        save_checkpoint(tmp_path, checkpoint(10))
    (tmp_path / "step-000000010.npz").rmdir()
    assert newest_checkpoint(tmp_path)[0].step == 5
