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
from pathlib import Path, PureWindowsPath
from typing import Any

from rift_cl.errors import RiftError
from rift_cl.io.boundary import reading
from rift_cl.io.captures.capture_paths import CaptureFolder, mask_of
from rift_cl.io.captures.view import View
from rift_cl.io.json_fields import Fields

# Where photographs are that were put into a fit before it was passed on.
_OWN = "photographs"


def place_record(views: Sequence[View], fit: Path) -> dict[str, Any]:
    """What ``config.json`` holds of where photographs and masks are.

    Args:
        views: one or more of one capture.
        fit: the folder of the fit.
    """
    place = _place_of(views)
    record = {"folder": str(place.root), "below": place.below, "bytes": _sizes(views)}
    # To another drive of Windows there is no way.
    with suppress(ValueError):
        record["from_fit"] = Path(os.path.relpath(place.root, fit.absolute())).as_posix()
    return record


def names_of_masks(views: Sequence[View]) -> list[dict[str, str]]:
    """What each frame says of its mask: nothing where all of them are found by their names.

    COLMAP's masks lie beside the folder that the names of photographs start from, where a path
    inside the fit's folder would not lead.
    """
    place = _place_of(views)
    if all(_is_by_name(view, place) for view in views):
        return [{} for _ in views]
    masks = [(view.mask, _start_of(view)) for view in views]
    return [
        {} if mask is None else {"mask_path": Path(os.path.relpath(mask, start)).as_posix()}
        for mask, start in masks
    ]


def kept_places(config: Fields, fit: Path) -> Iterator[CaptureFolder]:
    """Where the photographs of a fit may be, for ``are_those`` to tell.

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
        if way is not None and "\0" not in way and not _is_of_another_machine(way):
            yield CaptureFolder(_absolute(start / way), below)


def own_place(config: Fields, fit: Path) -> CaptureFolder:
    """Where photographs are that were put into a fit; arguments and errors as above."""
    below, folder = _record(config).text("below") or "", _absolute(fit)
    # A link that leads out of the fit is followed no more than a name that does.
    if (folder / _OWN).is_symlink():
        return CaptureFolder(folder, f"{_OWN}/{below}")
    return CaptureFolder(folder / _OWN, below)


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

    Raises:
        RiftError: nobody may look there, or no path leads there.
    """
    root = _absolute(folder)
    with reading(folder, "the folder of photographs"):
        is_there, has_images = (root / name).is_file(), (root / "images").is_dir()
    if is_there and root.name == "images":
        # Masks lie beside it.
        return CaptureFolder(root.parent, root.name)
    return CaptureFolder(root, "images" if has_images and not is_there else "")


def _place_of(views: Sequence[View]) -> CaptureFolder:
    """The folder that holds all photographs and masks of one or more views of one capture."""
    start = _start_of(views[0])
    files = [file for view in views for file in (view.image, view.mask) if file is not None]
    root = Path(os.path.commonpath([start, *(file.parent for file in files)]))
    return CaptureFolder(root, start.relative_to(root).as_posix())


def _start_of(view: View) -> Path:
    """The folder that the name of a view starts from."""
    return view.image.parents[len(Path(view.name).parts) - 1]


def _is_by_name(view: View, place: CaptureFolder) -> bool:
    """Whether the mask of a view, or that it has none, is found without being named."""
    with suppress(RiftError):
        return view.mask == mask_of(view.name, place, view.name)
    return False


def _is_of_another_machine(way: str) -> bool:
    """Whether Windows would ask another machine for it, and say there who asks."""
    return PureWindowsPath(way).drive.startswith("\\\\")


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
            found[Path(os.path.relpath(file, _start_of(view))).as_posix()] = _size(file)
    return found


def _size(path: Path) -> int | None:
    """Bytes of a file; None where there is none."""
    with suppress(OSError):
        return path.stat().st_size
    return None
