"""A video becomes photographs: of each stretch of it the sharpest frame.

A hand that walks round something blurs most frames a little and some not at all. The video is cut
into stretches of as many frames each, one for each frame that is wanted, and of each the frame
whose Laplacian varies most is kept (Pech-Pacheco et al. 2000): frames are evenly spaced, and sharp.
Where a phone changes its frame rate, stretches differ in time.

PyAV decodes, in a child process (``video_frames``).
"""

from __future__ import annotations

import os
from collections.abc import Generator, Iterator
from contextlib import closing
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rift_cl.errors import InputError, RiftError, not_installed
from rift_cl.io.decoder import Decoder
from rift_cl.io.images.pixels import write_pixels
from rift_cl.io.json_fields import read_json_object
from rift_cl.io.output import make_folder, staged_folder, write_json, writing
from rift_cl.progress import Report

VIDEOS = (".mp4", ".mov", ".m4v", ".webm", ".mkv", ".avi")
_RECORD = "frames.json"
# Bytes that a frame has at most: eight times as wide and high as 8K.
_LARGEST = 1 << 33
_JPEG = {"Compression": "jpeg:95", "jpeg:subsampling": "4:4:4"}


def is_video(name: str) -> bool:
    """Whether a file has the name of a video."""
    return Path(name).suffix.lower() in VIDEOS


def holds_video(path: str | os.PathLike[str]) -> bool:
    """Whether a path is a file that has the name of a video."""
    return is_video(os.fspath(path)) and Path(path).is_file()


def check_video(path: Path) -> None:
    """Make sure that a video can be read; no frame is decoded.

    Raises:
        InputError: PyAV is not installed, or there are no pictures in the file.
        FileFormatError: the file is damaged.
    """
    video_notes(path)


def video_notes(path: Path) -> list[str]:
    """What of a video is assumed, or taken otherwise than a player shows it, a sentence each.

    Raises:
        RiftError: see ``check_video``.
    """
    _check_installed(path)
    with closing(Decoder()) as decoder:
        return list(map(str, decoder.decode(path, "video notes")[0]["notes"]))


def _check_installed(path: Path) -> None:
    if find_spec("av") is None:
        what = f"{path}: videos are read by"
        raise not_installed(what, "PyAV", "av", "give a folder of its frames")


def sharpest_frames(
    path: Path, folder: Path, count: int
) -> Generator[Report, None, tuple[int, int]]:
    """Write the sharpest frame of each of ``count`` stretches as JPEG, upright.

    Args:
        path: the video.
        folder: receives the frames, named in their order; made, or replaced as a whole. If it
            holds those of the same video, by size and time, they are taken.
        count: how many; all, where there are fewer.

    Returns:
        How many frames were taken, of how many.

    Raises:
        InputError: PyAV is not installed, or there are no frames in the file.
        FileFormatError: the file is damaged.
        ResourceLimitError: a frame does not fit into memory.
        OutputError: the frames cannot be written.
    """
    status = path.stat()
    order = {"video": [status.st_size, status.st_mtime_ns], "frames": count}
    earlier = _earlier(folder, order)
    if earlier is not None:
        return earlier
    _check_installed(path)
    # A child of its own: it keeps its place in the video from one stretch to the next.
    with closing(Decoder()) as decoder:
        return (yield from _taken(decoder, path, folder, order))


def _taken(
    decoder: Decoder, path: Path, folder: Path, order: dict[str, Any]
) -> Generator[Report, None, tuple[int, int]]:
    """Have the frames decoded and written; see ``sharpest_frames``."""
    total = int(decoder.decode(path, "video length")[0]["frames"])
    if not total:
        raise InputError(f"{path}: the video holds no frames")
    wanted = min(int(order["frames"]), total)
    make_folder(folder.parent)
    with staged_folder(folder, _strange) as part:
        taken = 0
        for taken, best in enumerate(_best_frames(decoder, path, total, wanted), 1):
            with writing(part):
                write_pixels(part / f"{taken:05}.jpg", best, format="jpeg", attributes=dict(_JPEG))
            yield Report(taken, wanted, "frames of the video taken")
        if not taken:
            raise InputError(f"{path}: the video holds no frames that can be decoded")
        write_json(part / _RECORD, order | {"taken": taken, "total": total})
    return taken, total


def _best_frames(
    decoder: Decoder, path: Path, total: int, wanted: int
) -> Iterator[NDArray[np.uint8]]:
    """(y, x, 3) the sharpest frame of each stretch that has any."""
    for number in range(wanted):
        answer, codes = decoder.decode(
            path, "video frame", _LARGEST, number=number, frames=total, stretches=wanted
        )
        if "shape" in answer:
            yield np.frombuffer(codes, np.uint8).reshape(answer["shape"])


def _earlier(folder: Path, order: dict[str, Any]) -> tuple[int, int] | None:
    """How many frames an earlier run took of the same video, if they are all there."""
    try:
        record = read_json_object(folder / _RECORD)
    except RiftError:
        return None
    taken, total = record.values.get("taken"), record.values.get("total")
    same = all(record.values.get(name) == value for name, value in order.items())
    if not (same and isinstance(taken, int) and isinstance(total, int)):
        return None
    there = all((folder / f"{number:05}.jpg").is_file() for number in range(1, taken + 1))
    return (taken, total) if there else None


def _strange(names: list[str]) -> str | None:
    ours = {_RECORD, f"{_RECORD}.part"}
    return next((n for n in names if n not in ours and Path(n).suffix != ".jpg"), None)
