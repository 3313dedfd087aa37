"""The frames of a video, as the child process of ``decoder`` decodes them.

PyAV decodes, in the wheels of which FFmpeg comes along; it is an extra.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rift_cl.errors import FileFormatError, InputError
from rift_cl.io.boundary import check_claim, reading

# Sharpness is judged on pictures so wide: finer than that it is noise.
_JUDGED = 480
# Curves of high dynamic range, by their numbers in ITU-T H.273.
_HDR = {16: "PQ", 18: "HLG"}
# The number there of a matrix that a video does not name.
_UNSPECIFIED = 2


def notes_of_video(path: Path) -> list[str]:
    """What of a video is assumed, or taken otherwise than a player shows it, a sentence each.

    Raises:
        InputError: there are no pictures in the file.
        FileFormatError: the file is damaged.
    """
    with _stream(path) as (_, stream):
        curve = _HDR.get(int(stream.codec_context.color_trc))
        aspect, matrix = stream.sample_aspect_ratio or 1, _assumed_matrix(stream.codec_context)
    notes = []
    if matrix:
        notes.append(
            f"the video does not say by which matrix its colours are coded: {matrix} is assumed, "
            "as players do for its size"
        )
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


class BestFrames:
    """The sharpest frame of each stretch of a video that has any, one after the other.

    Args:
        path: the video.
        frames: how many it has.
        stretches: how many there are to be.
    """

    def __init__(self, path: Path, frames: int, stretches: int) -> None:
        self.order = (path, frames, stretches)
        self._found = _best_frames(path, frames, stretches)
        self.passed = 0

    def frame(self, number: int) -> NDArray[np.uint8] | None:
        """(y, x, 3) one of them, upright; None behind the last.

        Args:
            number: which; none that has been passed.
        """
        best = None
        while self.passed <= number:
            self.passed += 1
            best = next(self._found, None)
        return best


def _best_frames(path: Path, total: int, wanted: int) -> Iterator[NDArray[np.uint8]]:
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


def video_length(path: Path) -> int:
    """How many frames a video has, counted: what headers claim is often missing."""
    with _stream(path) as (container, stream), reading(path, "the video"):
        return sum(1 for packet in container.demux(stream) if packet.size)


@contextmanager
def _stream(path: Path) -> Iterator[tuple[Any, Any]]:
    """The file, and the pictures in it."""
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
    """The frame's colours, turned and mirrored as the file says that it is shown."""
    with reading(path, "the video"):
        codes = frame.reformat(format="rgb24", src_colorspace=_matrix(frame)).to_ndarray()
        a, b, c, d = _display_matrix(frame)
    if abs(b) + abs(c) > abs(a) + abs(d):
        codes, a, d = codes.swapaxes(0, 1), c, b
    return np.ascontiguousarray(codes[:: -1 if d < 0 else 1, :: -1 if a < 0 else 1])


def _display_matrix(frame: Any) -> tuple[int, int, int, int]:
    """QuickTime's a, b, c, d: a pixel is shown at x' = a x + c y, y' = b x + d y, y downwards.

    PyAV's own ``rotation`` knows no mirrors.
    """
    from av.sidedata.sidedata import Type

    for data in frame.side_data:
        if data.type == Type.DISPLAYMATRIX:
            # FFmpeg has the matrix by rows, in the byte order of the machine.
            a, b, _, c, d, *_ = np.frombuffer(bytes(data), np.int32, 9).tolist()
            return a, b, c, d
    return 1, 0, 0, 1


def _matrix(frame: Any) -> Any:
    """The matrix to decode a frame by, in PyAV's terms; None for its own."""
    from av.video.reformatter import Colorspace

    matrices = {None: None, "BT.709": Colorspace.ITU709, "BT.601": Colorspace.ITU601}
    return matrices[_assumed_matrix(frame)]


def _assumed_matrix(pictures: Any) -> str | None:
    """By which matrix luma and chroma are decoded where a video names none; None where it does.

    FFmpeg takes BT.601 whatever the size. Players take BT.709 of what is larger than the television
    of old (mpv's rule).

    Args:
        pictures: a frame, or the context that frames are decoded in.
    """
    layout = pictures.format
    if layout is None or layout.is_rgb or len(layout.components) < 3:
        return None
    if int(pictures.colorspace) != _UNSPECIFIED:
        return None
    return "BT.709" if pictures.width >= 1280 or pictures.height > 576 else "BT.601"
