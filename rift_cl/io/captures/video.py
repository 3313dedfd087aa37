"""A video becomes photographs: of each stretch of it the sharpest frame.

A hand that walks round something blurs most frames a little and some not at all. The video is cut
into stretches of equal length, one for each frame that is wanted, and of each the frame whose
Laplacian varies most is kept (Pech-Pacheco et al. 2000): frames are evenly spaced, and sharp.

PyAV decodes, in the wheels of which FFmpeg comes along; it is an extra.
"""

from __future__ import annotations

import os
from collections.abc import Generator, Iterator
from contextlib import contextmanager
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rift_cl.errors import FileFormatError, InputError, RiftError
from rift_cl.io.boundary import check_claim, reading
from rift_cl.io.images.pixels import write_pixels
from rift_cl.io.json_fields import read_json_object
from rift_cl.io.output import make_folder, staged_folder, write_json, writing
from rift_cl.progress import Report

VIDEOS = (".mp4", ".mov", ".m4v", ".webm", ".mkv", ".avi")
_RECORD = "frames.json"
# Sharpness is judged on pictures so wide: finer than that it is noise.
_JUDGED = 480
# Curves of high dynamic range, by their numbers in ITU-T H.273.
_HDR = {16: "PQ", 18: "HLG"}
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
    with _stream(path):
        pass


def video_notes(path: Path) -> list[str]:
    """What of a video is taken otherwise than a player shows it, a sentence each.

    Raises:
        RiftError: see ``check_video``.
    """
    with _stream(path) as (_, stream):
        curve = _HDR.get(int(stream.codec_context.color_trc))
        aspect = stream.sample_aspect_ratio or 1
    notes = []
    if curve:
        notes.append(
            f"the video has high dynamic range ({curve}), which is not undone: colours come out "
            "pale, so that a recording without it (SDR) serves better"
        )
    if aspect != 1:
        notes.append(
            f"the video's pixels are {float(aspect):.3g} times as wide as high and are taken for "
            "squares, which poses suffer from: make them square first"
        )
    return notes


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
    total = _length(path)
    if not total:
        raise InputError(f"{path}: the video holds no frames")
    wanted = min(count, total)
    make_folder(folder.parent)
    with staged_folder(folder, _strange) as part:
        taken = 0
        for taken, best in enumerate(_best_frames(path, total, wanted), 1):
            with writing(part):
                write_pixels(part / f"{taken:05}.jpg", best, format="jpeg", attributes=dict(_JPEG))
            yield Report(taken, wanted, "frames of the video taken")
        if not taken:
            raise InputError(f"{path}: the video holds no frames that can be decoded")
        write_json(part / _RECORD, order | {"taken": taken, "total": total})
    return taken, total


def _best_frames(path: Path, total: int, wanted: int) -> Iterator[NDArray[np.uint8]]:
    """(y, x, 3) the sharpest frame of each stretch."""
    best, sharpest, stretch = None, -1.0, 0
    for number, frame in enumerate(_frames(path)):
        now = min(number * wanted // total, wanted - 1)
        if now != stretch and best is not None:
            yield _upright(path, best)
            best, sharpest = None, -1.0
        stretch, sharp = now, _sharpness(path, frame)
        if sharp > sharpest:
            best, sharpest = frame, sharp
    if best is not None:
        yield _upright(path, best)


def _frames(path: Path) -> Iterator[Any]:
    with _stream(path) as (container, stream):
        stream.thread_type = "AUTO"
        frames = container.decode(stream)
        while True:
            with reading(path, "the video"):
                frame = next(frames, None)
            if frame is None:
                return
            yield frame


def _length(path: Path) -> int:
    """Frames in a video, counted: what headers claim is often missing."""
    with _stream(path) as (container, stream), reading(path, "the video"):
        return sum(1 for packet in container.demux(stream) if packet.size)


@contextmanager
def _stream(path: Path) -> Iterator[tuple[Any, Any]]:
    """The file, and the pictures in it."""
    if find_spec("av") is None:
        raise InputError(
            f"{path}: videos are read by PyAV, which is not installed: pip install av (or "
            "'.[film]' where the source is), or give a folder of its frames"
        )
    import av

    with reading(path, "the video"):
        container = av.open(str(path))
    with container:
        if not container.streams.video:
            raise InputError(f"{path}: the video holds no pictures")
        stream = container.streams.video[0]
        if stream.codec_context is None:
            raise FileFormatError(f"{path}: no decoder is known for the video's pictures")
        if not (stream.width and stream.height):
            raise FileFormatError(f"{path}: the video does not say how large its pictures are")
        check_claim(path, "a frame", 12 * stream.width * stream.height, None)
        yield container, stream


def _sharpness(path: Path, frame: Any) -> float:
    """Variance of the Laplacian of a frame, grey and made small."""
    width = min(_JUDGED, frame.width)
    height = max(1, frame.height * width // frame.width)
    with reading(path, "the video"):
        small = frame.reformat(width, height, format="gray", interpolation="AREA")
        grey = small.to_ndarray().astype(np.float32)
    if min(grey.shape) < 3:
        return 0.0
    inner = grey[1:-1, 1:-1]
    around = grey[:-2, 1:-1] + grey[2:, 1:-1] + grey[1:-1, :-2] + grey[1:-1, 2:]
    return float(np.var(around - 4 * inner))


def _upright(path: Path, frame: Any) -> NDArray[np.uint8]:
    """The frame's colours, turned as the file says that it is shown."""
    with reading(path, "the video"):
        codes = frame.to_ndarray(format="rgb24")
    return np.ascontiguousarray(np.rot90(codes, round(frame.rotation / 90)))


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
