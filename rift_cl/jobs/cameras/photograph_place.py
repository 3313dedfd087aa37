"""Where the photographs of a fit lie, kept so that they are found again.

The files of cameras are passed on, so they name photographs without a folder. The folder stands in
``config.json`` alone, as it was and as seen from the fit, so that a fit that is moved together with
its photographs finds them as well as one that is moved by itself.
"""

from __future__ import annotations

import os
from collections.abc import Sequence
from contextlib import suppress
from pathlib import Path

from rift_cl.io.capture_paths import CaptureFolder
from rift_cl.io.json_fields import Fields
from rift_cl.io.photograph_folder import photographs_in
from rift_cl.io.view import View


def place_record(views: Sequence[View], fit: Path) -> dict[str, str]:
    """What ``config.json`` holds of where photographs and masks are.

    Args:
        views: one or more of one capture.
        fit: the folder of the fit.
    """
    start = start_of(views[0])
    files = [file for view in views for file in (view.image, view.mask) if file is not None]
    root = Path(os.path.commonpath([start, *(file.parent for file in files)]))
    record = {"folder": str(root), "below": start.relative_to(root).as_posix()}
    # To another drive of Windows there is no way.
    with suppress(ValueError):
        record["from_fit"] = Path(os.path.relpath(root, fit.absolute())).as_posix()
    return record


def start_of(view: View) -> Path:
    """The folder that the name of a view starts from."""
    return view.image.parents[len(Path(view.name).parts) - 1]


def kept_place(config: Fields, fit: Path) -> CaptureFolder:
    """Where the photographs of a fit are, or were, if they are no longer there.

    Raises:
        FileFormatError: the configuration is damaged.
    """
    values = config.values.get("photographs")
    record = Fields(f"{config.where}: photographs", values if isinstance(values, dict) else {})
    below, way = record.text("below") or "", record.text("from_fit")
    folder = Path(record.text("folder") or fit)
    if not folder.is_dir() and way is not None:
        folder = fit / way
    return CaptureFolder(Path(os.path.normpath(folder.absolute())), below)


def moved_place(folder: Path) -> CaptureFolder:
    """Where photographs are that have moved to a folder, or to ``images`` there."""
    return photographs_in(folder)
