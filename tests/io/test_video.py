"""Videos: the sharpest frames, evenly spaced and upright; files without frames are refused."""

from __future__ import annotations

import struct
from fractions import Fraction
from pathlib import Path

import numpy as np
import pytest
from photograph_files import run

from rift_cl.errors import FileFormatError, InputError, OutputError
from rift_cl.io import read_image
from rift_cl.io.captures.video import check_video, holds_video, sharpest_frames, video_notes

HEIGHT, WIDTH = 48, 64
# The sharp frames; in a stretch of 5 the others are one grey.
SHARP = (2, 5, 14, 16)
COLOUR_TAGS = ("color_primaries", "color_trc", "colorspace")


def checkers(number: int) -> np.ndarray:
    """A chequered frame whose upper left corner is white; as bright as its number says."""
    y, x = np.indices((HEIGHT, WIDTH))
    codes = np.where((y // 4 + x // 4) % 2, 60, 60 + 8 * number).astype(np.uint8)
    codes[:16, :24] = 255
    return np.repeat(codes[..., None], 3, axis=2)


def store_video(
    path: Path, frames: list[np.ndarray], audio_only: bool = False, **tags: object
) -> Path:
    av = pytest.importorskip("av")
    with av.open(str(path), "w") as container:
        if audio_only:
            stream = container.add_stream("aac", rate=8000)
            frame = av.AudioFrame.from_ndarray(np.zeros((1, 1024), np.float32), "fltp", "mono")
            frame.sample_rate = 8000
            container.mux(stream.encode(frame))
        else:
            stream = container.add_stream("mpeg4", rate=10)
            stream.height, stream.width = frames[0].shape[:2]
            stream.pix_fmt, stream.bit_rate = "yuv420p", 4_000_000
            for name, value in tags.items():
                setattr(stream.codec_context, name, value)
            for codes in frames:
                container.mux(stream.encode(av.VideoFrame.from_ndarray(codes, "rgb24")))
        container.mux(stream.encode())
    return path


def store_planes(
    path: Path, size: tuple[int, int], codes: tuple[float, ...], colorspace: int
) -> Path:
    """A video of one frame of one colour, given as codes of Y', Cb and Cr."""
    av = pytest.importorskip("av")
    height, width = size
    frame = av.VideoFrame(width, height, "yuv420p")
    frame.colorspace = colorspace
    for plane, code in zip(frame.planes, codes, strict=True):
        plane.update(np.full(plane.buffer_size, round(code), np.uint8).tobytes())
    with av.open(str(path), "w") as container:
        stream = container.add_stream("mpeg4", rate=10)
        stream.height, stream.width, stream.pix_fmt, stream.bit_rate = *size, "yuv420p", 4_000_000
        # The file keeps all three or none.
        for name in COLOUR_TAGS:
            setattr(stream.codec_context, name, colorspace)
        container.mux(stream.encode(frame))
        container.mux(stream.encode())
    return path


@pytest.fixture
def video(tmp_path: Path) -> Path:
    grey = np.full((HEIGHT, WIDTH, 3), 90, np.uint8)
    frames = [checkers(k) if k in SHARP else grey for k in range(20)]
    return store_video(tmp_path / "walk.mp4", frames)


def test_of_each_stretch_the_sharp_frame_is_taken(video: Path, tmp_path: Path) -> None:
    assert holds_video(video) and not holds_video(tmp_path) and not holds_video(tmp_path / "a.mp4")
    reports, taken = run(sharpest_frames(video, tmp_path / "frames", 4))
    assert taken == (4, 20) and [report.done for report in reports] == [1, 2, 3, 4]
    files = sorted((tmp_path / "frames").glob("*.jpg"))
    assert [file.name for file in files] == [f"{k:05}.jpg" for k in (1, 2, 3, 4)]
    for file, number in zip(files, SHARP, strict=True):
        image = 255 * read_image(file)
        assert np.abs(image - checkers(number)).mean() < 8
        assert image[:12, :20].min() > 220


def test_frames_are_taken_up_again_unless_the_video_or_the_number_changed(
    video: Path, tmp_path: Path
) -> None:
    folder = tmp_path / "frames"
    run(sharpest_frames(video, folder, 4))
    times = [file.stat().st_mtime_ns for file in sorted(folder.iterdir())]
    assert run(sharpest_frames(video, folder, 4)) == ([], (4, 20))
    assert [file.stat().st_mtime_ns for file in sorted(folder.iterdir())] == times
    (folder / "00003.jpg").unlink()
    assert len(run(sharpest_frames(video, folder, 4))[0]) == 4
    assert run(sharpest_frames(video, folder, 100))[1] == (20, 20)
    (folder / "notes.txt").write_text("keep")
    with pytest.raises(OutputError, match=r"notes\.txt"):
        run(sharpest_frames(video, folder, 4))


@pytest.mark.parametrize(
    ("matrix", "down", "right"),
    [
        ((-1, 0, 0, 1), 0, 1),
        ((0, 1, -1, 0), 0, 1),
        ((0, -1, 1, 0), 1, 0),
        ((-1, 0, 0, -1), 1, 1),
        ((1, 0, 0, -1), 1, 0),
        ((0, 1, 1, 0), 0, 0),
        ((0, -1, -1, 0), 1, 1),
    ],
)
def test_frames_are_turned_and_mirrored_as_the_file_says(
    video: Path, tmp_path: Path, matrix: tuple[int, ...], down: int, right: int
) -> None:
    """QuickTime's matrix a b c d: x' = a x + c y, y' = b x + d y, down and to the right."""
    data = bytearray(video.read_bytes())
    a, b, c, d = (65536 * value for value in matrix)
    # Version, times, track, duration, layer, group, volume: 40 bytes before the matrix.
    place = data.index(b"tkhd") + 4 + 40
    data[place : place + 36] = struct.pack(">9i", a, b, 0, c, d, 0, 0, 0, 1 << 30)
    video.write_bytes(data)
    run(sharpest_frames(video, tmp_path / "frames", 4))
    image = read_image(tmp_path / "frames" / "00001.jpg")
    high, wide = (WIDTH, HEIGHT) if matrix[0] == 0 else (HEIGHT, WIDTH)
    assert image.shape == (high, wide, 3)
    # The white corner is 16 x 24 pixels as stored, and the only white.
    corners = image[:: high - 1, :: wide - 1].min(axis=2)
    assert corners[down, right] > 0.85
    assert np.count_nonzero(corners > 0.85) == 1
    # Turns and mirrors that leave the corner where it is differ in what is next to it.
    white = image.min(axis=2) > 0.7
    extent = (16, 24) if matrix[0] else (24, 16)
    rows, columns = white.any(axis=1).sum(), white.any(axis=0).sum()
    assert abs(rows - extent[0]) <= 2 and abs(columns - extent[1]) <= 2


def test_files_without_frames_are_refused_in_a_sentence(video: Path, tmp_path: Path) -> None:
    sound = store_video(tmp_path / "sound.mp4", [], audio_only=True)
    with pytest.raises(InputError, match=r"sound\.mp4: .*no pictures"):
        check_video(sound)
    for name, content in (
        ("empty.mp4", b""),
        ("text.mov", b"no video"),
        ("cut.mp4", video.read_bytes()[:200]),
    ):
        path = tmp_path / name
        path.write_bytes(content)
        with pytest.raises((InputError, FileFormatError), match=name.replace(".", r"\.")):
            check_video(path)
    assert not (tmp_path / "frames").exists()


def test_without_the_library_one_sentence_says_what_to_install(
    video: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("rift_cl.io.captures.video.find_spec", lambda name: None)
    with pytest.raises(InputError, match=r"film,view\]' in the .*or pip install av") as caught:
        check_video(video)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize("curve, name", [(1, None), (16, "PQ"), (18, "HLG")])
def test_high_dynamic_range_is_said(tmp_path: Path, curve: int, name: str | None) -> None:
    tags = {"color_trc": curve, "color_primaries": 9, "colorspace": 9}
    notes = video_notes(store_video(tmp_path / "a.mp4", [checkers(2)], **tags))
    assert len(notes) == (name is not None)
    assert all(f"high dynamic range ({name})" in note for note in notes)


def test_pixels_that_are_not_square_are_said(tmp_path: Path) -> None:
    tags = {**dict.fromkeys(COLOUR_TAGS, 1), "sample_aspect_ratio": Fraction(4, 3)}
    (note,) = video_notes(store_video(tmp_path / "a.mp4", [checkers(2)], **tags))
    assert "1.33 times as wide as high" in note


@pytest.mark.parametrize(
    ("size", "tag", "weights", "matrix"),
    [
        ((720, 1280), 2, (0.2126, 0.0722), "BT.709"),
        ((48, 1280), 2, (0.2126, 0.0722), "BT.709"),
        ((576, 64), 2, (0.299, 0.114), "BT.601"),
        ((48, 64), 1, (0.2126, 0.0722), None),
    ],
)
def test_colours_of_a_video_that_names_no_matrix_are_those_of_players(
    tmp_path: Path,
    size: tuple[int, int],
    tag: int,
    weights: tuple[float, float],
    matrix: str | None,
) -> None:
    """Red in Y'CbCr by Rec. ITU-R BT.709 and BT.601, from the weights of red and blue."""
    wr, wb = weights
    rgb = np.array([0.8, 0.1, 0.1])
    y = np.dot([wr, 1 - wr - wb, wb], rgb)
    planes = 16 + 219 * y, 128 + 112 * (rgb[2] - y) / (1 - wb), 128 + 112 * (rgb[0] - y) / (1 - wr)
    path = store_planes(tmp_path / "a.mp4", size, planes, tag)
    run(sharpest_frames(path, tmp_path / "frames", 1))
    found = read_image(tmp_path / "frames" / "00001.jpg").mean((0, 1))
    np.testing.assert_allclose(found, rgb, atol=4 / 255)
    notes = video_notes(path)
    assert len(notes) == (matrix is not None)
    assert all(f"{matrix} is assumed" in note for note in notes)


def test_a_video_that_nothing_decodes(video: Path) -> None:
    """What is known of a stream without a decoder has no width to ask for."""
    video.write_bytes(video.read_bytes().replace(b"stsd", b"free"))
    with pytest.raises(FileFormatError, match="no decoder"):
        check_video(video)
