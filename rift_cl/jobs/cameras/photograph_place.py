"""Where the photographs of a fit lie, kept so that they are found again.

The files of cameras are passed on, so they name photographs without a folder. The folder stands in
``config.json`` alone, as it was and as seen from the fit, so that a fit that is moved together with
its photographs finds them as well as one that is moved by itself. A folder that a file names may
be any folder of the machine: it is believed only if the photographs in it are as large, to the
byte, as those of the fit. Whoever passes a fit on cannot make others show files of their own.
"""

from __future__ import annotations

import os
from collections.abc import Iterator, Sequence
from contextlib import suppress
from pathlib import Path
from typing import Any

from rift_cl.io.capture_paths import CaptureFolder
from rift_cl.io.json_fields import Fields
from rift_cl.io.view import View

# Where photographs are that were put beside a fit before it was passed on.
_BESIDE = "photographs"


def place_record(views: Sequence[View], fit: Path) -> dict[str, Any]:
    """What ``config.json`` holds of where photographs and masks are.

    Args:
        views: one or more of one capture.
        fit: the folder of the fit.
    """
    start = start_of(views[0])
    files = [file for view in views for file in (view.image, view.mask) if file is not None]
    root = Path(os.path.commonpath([start, *(file.parent for file in files)]))
    record = {
        "folder": str(root),
        "below": start.relative_to(root).as_posix(),
        "bytes": _sizes(views),
    }
    # To another drive of Windows there is no way.
    with suppress(ValueError):
        record["from_fit"] = Path(os.path.relpath(root, fit.absolute())).as_posix()
    return record


def start_of(view: View) -> Path:
    """The folder that the name of a view starts from."""
    return view.image.parents[len(Path(view.name).parts) - 1]


def kept_places(config: Fields, fit: Path) -> Iterator[CaptureFolder]:
    """Where the photographs of a fit may be, for ``are_those`` to tell; last, beside the fit.

    Args:
        config: what ``config.json`` holds.
        fit: the folder of the fit.

    Raises:
        FileFormatError: the configuration is damaged.
    """
    record = _record(config)
    below = record.text("below") or ""
    for name, start in (("folder", Path()), ("from_fit", fit)):
        way = record.text(name)
        if way is not None and "\0" not in way:
            yield CaptureFolder(_absolute(start / way), below)
    yield CaptureFolder(_absolute(fit), f"{_BESIDE}/{below}")


def are_those(views: Sequence[View], config: Fields) -> bool:
    """Whether photographs that a fit was made of are there, and no other files in their places."""
    sizes = _record(config).values.get("bytes")
    known = _sizes(views)
    return (
        isinstance(sizes, dict)
        and any(known.values())
        and all(size is None or size == sizes.get(name) for name, size in known.items())
    )


def moved_place(folder: Path, name: str) -> CaptureFolder:
    """Where photographs are that have moved to a folder, or to ``images`` there.

    Args:
        folder: what somebody says.
        name: of one of them.
    """
    root = _absolute(folder)
    below = "images" if not (root / name).is_file() and (root / "images").is_dir() else ""
    return CaptureFolder(root, below)


def _record(config: Fields) -> Fields:
    values = config.values.get("photographs")
    return Fields(f"{config.where}: photographs", values if isinstance(values, dict) else {})


def _absolute(path: Path) -> Path:
    return Path(os.path.normpath(path.absolute()))


def _sizes(views: Sequence[View]) -> dict[str, int | None]:
    """Bytes of each photograph and of each mask, by its way from the photographs' folder."""
    found = {}
    for view in views:
        for file in filter(None, (view.image, view.mask)):
            found[Path(os.path.relpath(file, start_of(view))).as_posix()] = _size(file)
    return found


def _size(path: Path) -> int | None:
    """Bytes of a file; None where there is none."""
    with suppress(OSError):
        return path.stat().st_size
    return None
