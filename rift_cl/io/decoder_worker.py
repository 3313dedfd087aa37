"""The child process in which pictures and videos are decoded; see ``decoder``.

python -m rift_cl.io.decoder_worker
"""

from __future__ import annotations

import os
from collections.abc import Callable
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np

from rift_cl.child_process import Buffer, answer_requests
from rift_cl.errors import RiftError
from rift_cl.io.captures.video_frames import BestFrames, notes_of_video, video_length
from rift_cl.io.images.picture_header import decode_header
from rift_cl.io.images.pixels import decode_pixels

_Answer = tuple[dict[str, Any], Buffer]


def main() -> None:
    """Answer requests until the input ends."""
    answer_requests(_answer)


def _answer(request: dict[str, Any]) -> _Answer:
    os.chdir(request["cwd"])
    try:
        return _TASKS[request["task"]](Path(request["path"]), request)
    except RiftError as error:
        return {"error": type(error).__name__, "said": str(error)}, b""


def _pixels(path: Path, request: dict[str, Any]) -> _Answer:
    pixels = decode_pixels(path, request["format"], request["budget"])
    return {"shape": pixels.shape}, np.ascontiguousarray(pixels).data.cast("B")


def _header(path: Path, request: dict[str, Any]) -> _Answer:
    return {"header": asdict(decode_header(path, request["format"]))}, b""


def _video_notes(path: Path, request: dict[str, Any]) -> _Answer:
    return {"notes": notes_of_video(path)}, b""


def _video_length(path: Path, request: dict[str, Any]) -> _Answer:
    return {"frames": video_length(path)}, b""


def _video_frame(path: Path, request: dict[str, Any]) -> _Answer:
    """The frame that is next, or any after a new beginning."""
    number, order = request["number"], (path, request["frames"], request["stretches"])
    begun = _begun.get("video")
    if begun is None or begun.order != order or begun.passed > number:
        begun = _begun["video"] = BestFrames(*order)
    frame = begun.frame(number)
    return ({}, b"") if frame is None else ({"shape": frame.shape}, frame.data.cast("B"))


# The video that is read stretch by stretch.
_begun: dict[str, BestFrames] = {}
_TASKS: dict[str, Callable[[Path, dict[str, Any]], _Answer]] = {
    "pixels": _pixels,
    "header": _header,
    "video notes": _video_notes,
    "video length": _video_length,
    "video frame": _video_frame,
}


if __name__ == "__main__":
    main()
