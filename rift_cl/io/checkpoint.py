"""Checkpoints: arrays and facts of a run, each in one file that is whole or not there.

A checkpoint is an NPZ archive (arrays only, nothing is ever unpickled) with one more member,
``facts.json``: the step, what the run says of itself, and the SHA-256 of every array. The newest
two are kept, so that a damaged disk block costs some steps and not the run.
"""

from __future__ import annotations

import hashlib
import json
import zipfile
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.lib import format as npy
from numpy.typing import NDArray

from rift_cl.errors import CheckpointError, RiftError
from rift_cl.io.boundary import reading
from rift_cl.io.npz_archive import NpzArchive
from rift_cl.io.output import atomic_path, check_space, make_folder, writing
from rift_cl.json_parsing import parse_json

_FORMAT = 1
_FACTS = "facts.json"
# Facts are a few kilobytes; more is no checkpoint of ours.
_MOST_FACTS = 1 << 20
_KEPT = 2

Arrays = Mapping[str, NDArray[Any]]


@dataclass(frozen=True, eq=False)
class Checkpoint:
    """A run's state after a step.

    Args:
        step: steps that were done.
        arrays: the state, by name.
        facts: what else the run wants to know; JSON.
    """

    step: int
    arrays: Arrays
    facts: Mapping[str, Any]


def save_checkpoint(folder: Path, checkpoint: Checkpoint) -> Path:
    """Write a checkpoint into a folder and remove all but the newest two.

    Raises:
        OutputError: it cannot be written; those before it are still there.
    """
    make_folder(folder)
    path = folder / f"step-{checkpoint.step:09d}.npz"
    check_space(path, sum(array.nbytes for array in checkpoint.arrays.values()))
    with atomic_path(path) as part, zipfile.ZipFile(part, "w", zipfile.ZIP_STORED) as archive:
        for name, array in checkpoint.arrays.items():
            with archive.open(f"{name}.npy", "w", force_zip64=True) as file:
                npy.write_array(file, np.asarray(array, order="C"), allow_pickle=False)
        archive.writestr(_FACTS, json.dumps(_described(checkpoint)))
    for old in _files(folder)[:-_KEPT]:
        with writing(old):
            old.unlink(missing_ok=True)
    return path


def load_checkpoint(path: Path) -> Checkpoint:
    """Read a checkpoint and check every array against its checksum.

    Raises:
        CheckpointError: it is damaged, or no checkpoint.
        InputError: there is no such file.
    """
    try:
        with reading(path, "the checkpoint"), zipfile.ZipFile(path) as archive:
            facts = _facts(archive)
            table = NpzArchive(path, archive)
            arrays = {name: table.load(name, budget=None) for name in facts["sha256"]}
            damaged = [n for n, array in arrays.items() if _digest(array) != facts["sha256"][n]]
            step, said = int(facts["step"]), dict(facts["facts"])
    except RiftError as error:
        raise CheckpointError(f"{error}: it cannot be resumed from") from error
    if damaged:
        raise CheckpointError(f"{path}: {damaged[0]!r} is not what was written; it is damaged")
    return Checkpoint(step, arrays, said)


def newest_checkpoint(folder: Path) -> tuple[Checkpoint | None, list[str]]:
    """The newest checkpoint in a folder that is whole, and what is wrong with newer ones.

    Returns:
        None where there are no checkpoints at all.

    Raises:
        CheckpointError: there are some, and all are damaged.
    """
    problems: list[str] = []
    for path in reversed(_files(folder)):
        try:
            return load_checkpoint(path), problems
        except CheckpointError as error:
            problems.append(str(error))
    if problems:
        raise CheckpointError(f"{problems[0]}; nor is an older one whole: begin anew")
    return None, problems


def _files(folder: Path) -> list[Path]:
    return sorted(folder.glob("step-*.npz"))


def _described(checkpoint: Checkpoint) -> dict[str, Any]:
    return {
        "format": _FORMAT,
        "step": checkpoint.step,
        "facts": checkpoint.facts,
        "sha256": {name: _digest(array) for name, array in checkpoint.arrays.items()},
    }


def _digest(array: NDArray[Any]) -> str:
    """Of the values; type and shape are in what is hashed, too."""
    array = np.asarray(array, order="C")
    head = f"{array.dtype.str}{array.shape}".encode()
    return hashlib.sha256(head + array.tobytes()).hexdigest()


def _facts(archive: zipfile.ZipFile) -> dict[str, Any]:
    member = archive.getinfo(_FACTS)
    if member.file_size > _MOST_FACTS:
        raise ValueError(f"{_FACTS} has {member.file_size} bytes")
    facts = parse_json(archive.read(member))
    if facts["format"] != _FORMAT:
        raise ValueError(f"its format is {facts['format']!r}, wanted {_FORMAT}")
    if not isinstance(facts["sha256"], dict) or not isinstance(facts["facts"], dict):
        raise ValueError(f"{_FACTS} does not say what it holds")
    return dict(facts)
