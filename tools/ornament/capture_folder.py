"""The folder of a rendered capture: every picture whole, and an interrupted run goes on.

``render.json`` says what is being rendered while pictures are still missing; it becomes
``transforms.json`` when the last one is there, so that a reader who finds that finds all of them.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rift_cl import Report, RiftError
from rift_cl.errors import OutputError
from rift_cl.io import atomic_path, make_folder, write_json, write_png
from rift_cl.io.images.pixels import write_pixels
from rift_cl.io.json_fields import read_json_object
from rift_cl.io.output import writing

TRANSFORMS, PLAN = "transforms.json", "render.json"


def render_capture(
    out: Path, record: Mapping[str, Any], draw: Callable[[int], NDArray[Any]]
) -> Iterator[Report]:
    """Render every frame that is not there yet.

    Args:
        out: the folder; made if it is not there.
        record: the content of transforms.json.
        draw: gives frame ``number`` as (height, width, 3) in display light.

    Yields:
        A report after every picture.

    Raises:
        OutputError: the folder holds other things, or cannot be written.
    """
    _check(out, record)
    make_folder(out / "images")
    if not (out / TRANSFORMS).exists():
        write_json(out / PLAN, record)
    frames = record["frames"]
    for number, frame in enumerate(frames):
        path = out / frame["file_path"]
        if not path.exists():
            _write(path, draw(number))
        yield Report(number + 1, len(frames), "pictures")
    write_json(out / TRANSFORMS, record)
    with writing(out / PLAN):
        (out / PLAN).unlink(missing_ok=True)


def _write(path: Path, picture: NDArray[Any]) -> None:
    """A picture in display light, as PNG or JPEG, as its name says."""
    if path.suffix == ".png":
        write_png(path, picture)
        return
    codes = np.rint(255 * np.clip(picture, 0, 1)).astype(np.uint8)
    attributes = {"Compression": "jpeg:85"}
    with atomic_path(path) as part:
        write_pixels(part, codes, format="jpeg", attributes=attributes)


def _check(out: Path, record: Mapping[str, Any]) -> None:
    """Demand a folder that is new, or holds a run of just this record."""
    with writing(out):
        if not out.exists() or (out.is_dir() and not any(out.iterdir())):
            return
    earlier = next((out / name for name in (TRANSFORMS, PLAN) if (out / name).is_file()), None)
    if earlier is None:
        raise OutputError(f"{out}: holds other things already; name another folder (--out)")
    try:
        found = dict(read_json_object(earlier).values)
    except RiftError as error:
        raise OutputError(f"{error}; name another folder (--out)") from error
    keys = sorted({*found, *record})
    changed = [key for key in keys if found.get(key) != record.get(key)]
    if changed:
        raise OutputError(
            f"{earlier}: holds pictures that differ in {', '.join(changed)}; name another folder "
            "(--out)"
        )
