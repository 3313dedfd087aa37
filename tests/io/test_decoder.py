"""A decoder that dies or hangs is an error that names the file, and the next file is read."""

from __future__ import annotations

import os
import sys
from pathlib import Path

import numpy as np
import pytest

from rift_cl.errors import FileFormatError, ResourceLimitError
from rift_cl.io import read_image, write_png
from rift_cl.io.captures import video as video_module
from rift_cl.io.decoder import Decoder
from rift_cl.io.images import read_picture
from rift_cl.io.images.image_format import image_format
from rift_cl.io.images.picture_header import decode_header
from rift_cl.io.images.pixels import decode_pixels

# Our own worker, which meets its fate before it answers.
FATED = """
import os, signal, time
from rift_cl.io import decoder_worker
ours = decoder_worker._answer
def fated(request):
    {fate}
    return ours(request)
decoder_worker._answer = fated
decoder_worker.main()
"""


@pytest.fixture
def fated(monkeypatch):
    """Gives pictures a decoder whose fate is a statement."""
    made = []

    def make(fate, limit=60.0):
        decoder = Decoder([sys.executable, "-c", FATED.format(fate=fate)], limit)
        made.append(decoder)
        monkeypatch.setattr(read_picture, "_DECODER", decoder)
        return decoder

    yield make
    for decoder in made:
        decoder.close()


@pytest.fixture
def picture(tmp_path: Path) -> Path:
    path = tmp_path / "a.png"
    write_png(path, np.arange(60, dtype=np.uint8).reshape(4, 5, 3))
    return path


def test_the_child_gives_the_pixels_and_the_header_that_are_decoded_here(picture: Path) -> None:
    here = decode_pixels(picture, image_format(picture), 1 << 20)
    pixels = read_picture.read_pixels(picture)
    np.testing.assert_array_equal(pixels, here)
    assert pixels.flags.writeable
    assert read_picture.read_picture_header(picture) == decode_header(picture, "png")


@pytest.mark.full
@pytest.mark.skipif(sys.platform == "win32", reason="nothing is killed by a signal on Windows")
@pytest.mark.parametrize(
    ("fate", "kind", "says"),
    [
        ("os.kill(os.getpid(), signal.SIGSEGV)", FileFormatError, "SIGSEGV"),
        ("os._exit(3)", FileFormatError, "status 3"),
        ("os.kill(os.getpid(), signal.SIGKILL)", ResourceLimitError, "memory"),
    ],
)
def test_a_decoder_that_dies_of_a_file_is_an_error_and_the_next_file_is_read(
    fated, picture, fate, kind, says
):
    fated(f"if request['path'].endswith('bad.png'): {fate}")
    bad = picture.with_name("bad.png")
    bad.write_bytes(picture.read_bytes())
    for _ in range(2):
        with pytest.raises(kind, match=says) as caught:
            read_image(bad)
        assert str(bad) in str(caught.value)
        assert read_image(picture).shape == (4, 5, 3)


def test_a_decoder_that_hangs_is_waited_for_no_longer_than_its_limit(fated, picture):
    fated("time.sleep(600)", limit=0.2)
    with pytest.raises(FileFormatError, match="hung"):
        read_image(picture)


def test_a_decoder_that_cannot_be_started_is_one_sentence(monkeypatch, picture):
    monkeypatch.setattr(read_picture, "_DECODER", Decoder(["/there/is/no/such/program"]))
    with pytest.raises(ResourceLimitError, match="cannot be started"):
        read_image(picture)


def test_paths_start_from_the_folder_that_the_process_is_in_now(monkeypatch, picture, tmp_path):
    read_image(picture)
    (tmp_path / "b").mkdir()
    for folder, name in ((tmp_path, "a.png"), (tmp_path / "b", "../a.png")):
        monkeypatch.chdir(folder)
        assert read_image(name).shape == (4, 5, 3)
    with pytest.raises(FileFormatError, match=r"^c\.png: "):
        Path("c.png").write_bytes(picture.read_bytes()[:50])
        read_image("c.png")


@pytest.mark.skipif(sys.platform == "win32", reason="nothing is killed by a signal on Windows")
def test_what_a_batch_system_sends_to_all_processes_costs_no_file(fated, picture):
    fated("os.kill(os.getpid(), signal.SIGTERM)")
    assert read_image(picture).shape == (4, 5, 3)


@pytest.mark.full
@pytest.mark.skipif(not hasattr(os, "fork"), reason="there is no fork here")
def test_a_forked_process_has_a_decoder_of_its_own(python, picture):
    done = python(
        "import os\n"
        "from rift_cl.io import read_image\n"
        f"path = {str(picture)!r}\n"
        "whole = read_image(path)\n"
        "forked = os.fork()\n"
        "same = all((read_image(path) == whole).all() for _ in range(20))\n"
        "if not forked:\n"
        "    os._exit(0 if same else 1)\n"
        "assert same\n"
        "assert os.waitpid(forked, 0)[1] == 0\n"
        "assert (read_image(path) == whole).all()\n"
    )
    assert (done.returncode, done.stderr) == (0, "")


@pytest.mark.full
def test_a_process_that_ends_takes_its_decoder_along(python, picture):
    done = python(
        "from rift_cl.io import read_image\n"
        "from rift_cl.io.images.read_picture import _DECODER\n"
        f"read_image({str(picture)!r})\n"
        "print(_DECODER._process.pid)\n"
    )
    assert done.returncode == 0, done.stderr
    with pytest.raises(ProcessLookupError):
        os.kill(int(done.stdout), 0)


@pytest.mark.skipif(sys.platform == "win32", reason="nothing is killed by a signal on Windows")
def test_a_video_goes_on_where_its_decoder_died(monkeypatch, tmp_path):
    from test_video import checkers, store_video

    video = store_video(tmp_path / "a.mp4", [checkers(number) for number in range(12)])
    once = tmp_path / "once"
    fate = (
        f"os.path.exists({str(once)!r}) or request.get('number') != 2 or "
        f"(open({str(once)!r}, 'x').close(), os.kill(os.getpid(), signal.SIGSEGV))"
    )
    list(video_module.sharpest_frames(video, tmp_path / "whole", 4))
    command = [sys.executable, "-c", FATED.format(fate=fate)]
    monkeypatch.setattr(video_module, "Decoder", lambda: Decoder(command))
    list(video_module.sharpest_frames(video, tmp_path / "died", 4))
    assert once.exists()
    names = sorted(path.name for path in (tmp_path / "whole").glob("*.jpg"))
    assert len(names) == 4
    for name in names:
        assert (tmp_path / "died" / name).read_bytes() == (tmp_path / "whole" / name).read_bytes()
