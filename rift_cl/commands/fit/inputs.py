"""What a fit is fitted to, by its contents, so that one that goes on is known to go on with it.

By contents and not by times of change: a capture that was copied, or fetched again, is the same.
"""

from __future__ import annotations

import hashlib
import os
from collections.abc import Sequence
from pathlib import Path
from typing import Any, NamedTuple

from rift_cl.commands.run_folder.run_inputs import files_of, files_read
from rift_cl.io.boundary import reading
from rift_cl.io.captures.view import View

# Digits that are kept of a digest, of thousands of photographs in every checkpoint.
_DIGITS = 16
_CHUNK = 1 << 20


class FitInput(NamedTuple):
    """One thing that decides what a fit comes to.

    Args:
        name: what a sentence calls it.
        digest: of its contents.
    """

    name: str
    digest: str


def photograph_inputs(views: Sequence[View]) -> list[FitInput]:
    """The photographs with their masks, and the cameras that took them.

    Raises:
        FileFormatError: a file cannot be read.
    """
    found = list[FitInput]()
    for view in views:
        files = (view.image,) if view.mask is None else (view.image, view.mask)
        found.append(FitInput(view.name, _digest_of_files(*files)))
        found.append(FitInput(f"the camera of {view.name}", _digest_of_camera(view)))
    return found


def scan_inputs(settings: Any, files: Sequence[Path], out: Path) -> list[FitInput]:
    """The files of a scan, and what else the options of a run name, files or folders.

    Args:
        settings: of the run.
        files: from which rows of the scan are read.
        out: its folder, whose files are its own.

    Raises:
        FileFormatError: a file cannot be read.
    """
    own = Path(os.path.realpath(out))
    named = [path for each in files_read(settings) for path in files_of(each, own)]
    once = {path.resolve(): path for path in (*named, *files)}
    return [FitInput(str(path), _digest_of_files(path)) for path in once.values()]


def _digest_of_files(*paths: Path) -> str:
    digest = hashlib.sha256()
    for path in paths:
        with reading(path, "its contents"), path.open("rb") as file:
            while chunk := file.read(_CHUNK):
                digest.update(chunk)
    return digest.hexdigest()[:_DIGITS]


def _digest_of_camera(view: View) -> str:
    """Of all that a view says but for where its files are."""
    camera = view.camera
    others = camera.size, camera.model, camera.aperture, view.lens, view.upright, view.crop_radius
    digest = hashlib.sha256(camera.K.tobytes() + camera.view.tobytes())
    digest.update(repr(others).encode())
    return digest.hexdigest()[:_DIGITS]
