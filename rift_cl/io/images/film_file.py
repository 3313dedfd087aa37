"""A film is written frame by frame: WebM or MP4, as browsers and telephones play them.

PyAV encodes, in the wheels of which FFmpeg comes along; it is an extra. VP9 (libvpx) and AV1
(SVT-AV1) may be used by anybody; H.264 plays on older machines too, but its encoder x264 is under
the GPL, so that it is used where it is asked for alone. Nothing about the maker is written, and the
same frames give the same bytes: one thread, and no version, number or date in the file.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager, suppress
from dataclasses import dataclass
from fractions import Fraction
from functools import partial
from importlib.util import find_spec
from pathlib import Path
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from rift_cl.errors import InputError, OutputError, not_installed
from rift_cl.io.output import atomic_path

FilmKind = Literal["webm", "mp4", "mp4-h264"]
Codes = NDArray[np.uint8]

# ITU-R BT.709 and its range from 16 to 235, in the numbers of FFmpeg.
_BT709, _LIMITED = 1, 1
# Of this process, as Linux lists them.
_THREADS = Path("/proc/self/task")


@dataclass(frozen=True)
class _Encoder:
    """An encoder by FFmpeg's name, the container it goes into, and how well it is to encode."""

    container: str
    codec: str
    options: dict[str, str]


_ENCODERS: dict[FilmKind, _Encoder] = {
    "webm": _Encoder(
        "webm", "libvpx-vp9", {"crf": "24", "deadline": "good", "cpu-used": "4", "b": "0"}
    ),
    "mp4": _Encoder("mp4", "libsvtav1", {"crf": "28", "preset": "9", "svtav1-params": "lp=1"}),
    "mp4-h264": _Encoder("mp4", "libx264", {"crf": "18", "preset": "medium"}),
}


def films_can_be_written() -> bool:
    """Whether the extra is installed."""
    return find_spec("av") is not None


def suffix_of(kind: FilmKind) -> str:
    """The ending of a film's name."""
    return f".{_ENCODERS[kind].container}"


def check_films(kind: FilmKind) -> None:
    """Make sure that films of a kind can be written.

    Raises:
        InputError: PyAV is not installed, or comes without the encoder.
    """
    if not films_can_be_written():
        raise not_installed(f"--film {kind} is written by", "PyAV", "av", "say --film apng")
    import av

    codec = _ENCODERS[kind].codec
    try:
        av.codec.Codec(codec, "w")
    except ValueError as error:
        raise InputError(
            f"--film {kind} wants the encoder {codec}, which this PyAV does not have: pip install "
            "--upgrade av, or choose another --film"
        ) from error


@contextmanager
def film_writer(
    path: Path, kind: FilmKind, size: tuple[int, int], rate: float
) -> Iterator[Callable[[Codes], None]]:
    """Give a function that takes frames; a clean exit leaves the whole film.

    Args:
        path: the file.
        kind: container and codec; see ``check_films``.
        size: (height, width) of the frames in pixels; an odd last row or column is left out.
        rate: frames in a second.

    Yields:
        A function that takes (height, width, 3) codes in display light.

    Raises:
        OutputError: the file cannot be written, or the encoder refuses frames of this size.
    """
    import av

    # SVT-AV1 tells its settings on the standard error stream otherwise.
    os.environ.setdefault("SVT_LOG", "1")
    encoder, options = _ENCODERS[kind], {"fflags": "+bitexact"}
    refused = partial(_encoding, path, encoder, size)
    with atomic_path(path) as part, ExitStack() as until_the_end:
        with refused():
            container = av.open(str(part), "w", format=encoder.container, options=options)
            until_the_end.enter_context(container)
            stream = _stream(container, encoder, size, rate)

        def add(codes: Codes) -> None:
            with refused():
                container.mux(stream.encode(_frame(codes)))

        # What goes wrong between the frames is not the encoder's doing.
        yield add
        with refused():
            container.mux(stream.encode())
            container.close()


@contextmanager
def _encoding(path: Path, encoder: _Encoder, size: tuple[int, int]) -> Iterator[None]:
    """Turn what an encoder raises into an error that names the film."""
    import av

    try:
        with _kept_priority():
            yield
    except (av.FFmpegError, ValueError) as error:
        raise OutputError(
            f"{path}: {encoder.codec} writes no film of {size[1]} x {size[0]} pixels "
            f"({error}); say --film apng, or another --size"
        ) from error


@contextmanager
def _kept_priority() -> Iterator[None]:
    """Take back the real-time priority that SVT-AV1 gives its caller, and itself, where root calls.

    It would last as long as the process, hold for whatever that starts, and let nothing else run.
    """
    if not (hasattr(os, "sched_setscheduler") and _THREADS.is_dir()):
        yield
        return
    policy, priority = os.sched_getscheduler(0), os.sched_getparam(0)
    try:
        yield
    finally:
        if os.sched_getscheduler(0) != policy:
            for thread in _THREADS.iterdir():
                # A thread may end meanwhile.
                with suppress(OSError):
                    os.sched_setscheduler(int(thread.name), policy, priority)


def _stream(container: Any, encoder: _Encoder, size: tuple[int, int], rate: float) -> Any:
    options = {**encoder.options, "flags": "+bitexact"}
    stream = container.add_stream(
        encoder.codec, rate=Fraction(rate).limit_denominator(1000), options=options
    )
    stream.height, stream.width = _even(size[0]), _even(size[1])
    stream.pix_fmt = "yuv420p"
    context = stream.codec_context
    # Quality is constant, whatever it takes; and one thread gives the same bytes every time.
    context.bit_rate, context.thread_count = 0, 1
    context.color_range = _LIMITED
    context.colorspace = context.color_primaries = context.color_trc = _BT709
    return stream


def _frame(codes: Codes) -> Any:
    import av

    height, width = codes.shape[:2]
    whole = np.ascontiguousarray(codes[: _even(height), : _even(width)])
    frame = av.VideoFrame.from_ndarray(whole, format="rgb24")
    return frame.reformat(format="yuv420p", dst_colorspace="ITU709", dst_color_range="MPEG")


def _even(edge: int) -> int:
    """Colours are kept for squares of two pixels."""
    return edge - edge % 2
