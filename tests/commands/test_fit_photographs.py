"""``rift fit`` of photographs as people have them: what is decided, said, and left behind.

The stand-in of pycolmap places every photograph; what matters here is the way round it.
"""

from __future__ import annotations

import dataclasses
import json
import shutil
from pathlib import Path

import numpy as np
import pytest
from PIL import Image
from test_video import store_video

from rift_cl.cl.discovery import default_device
from rift_cl.commands.cli import main
from rift_cl.commands.fit_photos import bare_input
from rift_cl.commands.fit_photos.job import Fit
from rift_cl.commands.fit_photos.photograph_size import (
    MOST_PIXELS,
    check_window,
    fitting_downscale,
    size_words,
)
from rift_cl.commands.fit_photos.settings import FitPhotosSettings
from rift_cl.errors import InputError
from rift_cl.geometry.camera import Camera
from rift_cl.io import View

STAND_IN = Path(__file__).parents[1] / "io" / "fake_pycolmap"
SHORT = ("--steps", "2", "--splats", "50", "--checkpoint-every", "0")


@pytest.fixture
def posed(tmp_path, monkeypatch):
    monkeypatch.syspath_prepend(str(STAND_IN))
    monkeypatch.setenv("FAKE_PYCOLMAP_SEEN", str(tmp_path / "seen.json"))
    monkeypatch.setenv("FAKE_PYCOLMAP_SIZE", "32 24")


def frames(count: int) -> list[np.ndarray]:
    random = np.random.default_rng(0)
    return [random.integers(0, 256, (24, 32, 3)).astype(np.uint8) for _ in range(count)]


@pytest.fixture
def photographs(tmp_path) -> Path:
    folder = tmp_path / "holiday"
    folder.mkdir()
    for number, codes in enumerate(frames(4)):
        Image.fromarray(codes).save(folder / f"IMG_{number}.png")
    return folder


def test_photographs_of_formats_that_are_not_read_are_named(photographs, tmp_path, posed, capsys):
    (photographs / "IMG_5.webp").write_bytes(b"odd")
    assert main(["fit", str(photographs), "--out", str(tmp_path / "fit"), *SHORT]) == 0
    assert "a photograph is of a format that is not read: IMG_5.webp; convert" in (
        capsys.readouterr().err
    )


def test_what_is_odd_in_a_folder_is_said_in_two_lines(photographs, tmp_path, posed, capsys):
    shutil.copy(photographs / "IMG_1.png", photographs / "IMG_1 (1).png")
    for name in (".DS_Store", "IMG_0.AAE", "IMG_0.MOV", "notes.txt", "Thumbs.db"):
        (photographs / name).write_bytes(b"odd")
    (photographs / "IMG_3_mask.png").write_bytes((photographs / "IMG_3.png").read_bytes())
    assert main(["fit", str(photographs), "--out", str(tmp_path / "fit"), *SHORT]) == 0
    said = [line for line in capsys.readouterr().err.splitlines() if line.startswith("rift: ")]
    assert said[0] == (
        "rift: 5 files that are no photographs are left alone: .DS_Store, IMG_0.AAE, IMG_0.MOV, "
        "Thumbs.db and 1 more"
    )
    assert said[1] == (
        "rift: 1 of 5 photographs is left out: IMG_1 (1).png (is the same photograph as IMG_1.png)"
    )
    assert said[2] == (
        "rift: 4 of 5 photographs have a pose; their sparse points are seen 0.5 pixels off, on "
        "average"
    )
    assert said[3] == "rift: 1 of 3 photographs have a mask: black is left out"
    assert len(said) == 4


def test_poses_of_another_program_are_told_before_they_are_found_anew(
    photographs, tmp_path, posed, capsys, monkeypatch
):
    (photographs / "bundle.out").write_text("# Bundle file v0.3\n")
    note = f"poses are found anew: {photographs / 'bundle.out'} holds cameras of Bundler, which"
    assert note in Fit(FitPhotosSettings(capture=photographs, out=tmp_path / "fit")).plan()["notes"]

    def fail(*_, **__):
        raise InputError("no poses")
        yield

    monkeypatch.setattr(bare_input, "pose_photographs", fail)
    assert main(["fit", str(photographs), "--out", str(tmp_path / "fit"), *SHORT]) == 3
    assert note in capsys.readouterr().err


def test_a_dry_run_counts_photographs_without_poses(photographs, tmp_path, posed, capsys):
    Image.fromarray(np.zeros((30, 64, 3), np.uint8)).save(photographs / "wide.png")
    (photographs / "odd.png").write_bytes(b"odd")
    words = ("fit", str(photographs), "--out", str(tmp_path / "fit"), "--dry-run", "--downscale")
    for factor, size in (("1", "64 x 30"), ("4", "16 x 7")):
        assert main([*words, factor, *SHORT]) == 0
        said = " ".join(capsys.readouterr().out.split())
        assert f"5, the largest of 64 x 30 pixels, fitted at {size}" in said
        assert "MiB, and the tile lists" in said
    assert not (tmp_path / "fit").exists()


def test_a_video_is_fitted_by_its_frames(tmp_path, posed, capsys):
    tags = {"color_trc": 18, "color_primaries": 9, "colorspace": 9}
    video = store_video(tmp_path / "walk.mp4", frames(12), **tags)
    out = tmp_path / "fit"
    arguments = ["fit", str(video), "--out", str(out), "--frames", "6", *SHORT]
    assert main([*arguments, "--dry-run"]) == 0
    assert not out.exists() and "6 sharp frames" in capsys.readouterr().out
    assert main(arguments) == 0
    said = capsys.readouterr().err
    assert "6 of the video's 12 frames are taken, the sharpest" in said
    assert "high dynamic range (HLG)" in said
    assert len(list((out / "frames").glob("*.jpg"))) == 6
    kept = json.loads((out / "transforms.json").read_text())
    assert kept["frames"][0]["file_path"] == "00001.jpg"
    assert json.loads((out / "config.json").read_text())["settings"]["downscale"] == 1


def test_a_video_without_frames_leaves_nothing_behind(tmp_path, posed, capsys):
    sound = store_video(tmp_path / "sound.mp4", [], audio_only=True)
    assert main(["fit", str(sound), "--out", str(tmp_path / "fit"), *SHORT]) == 3
    assert "the video holds no pictures" in capsys.readouterr().err
    assert not (tmp_path / "fit").exists()


def view(width: int, height: int) -> View:
    K = [[width, 0, width / 2], [0, width, height / 2], [0, 0, 1]]
    return View("a", Camera((height, width), K, np.eye(4)), Path("a.png"), None, None)


@pytest.mark.parametrize("size", [(160, 120), (1920, 1080), (4032, 3024), (3024, 4032), (9000, 40)])
def test_the_least_factor_that_makes_photographs_small_enough_is_taken(size):
    device = default_device()
    most = MOST_PIXELS[device.traits.is_cpu]
    factor = fitting_downscale([view(64, 48), view(*size)], device)
    pixels = size[0] * size[1]
    assert pixels / factor**2 <= most and (factor == 1 or pixels / (factor - 1) ** 2 > most)


def test_the_size_that_is_fitted_is_said():
    assert size_words([view(40, 30), view(4032, 3024)], 3) == (
        "photographs of 4032 x 3024 pixels are fitted at 1344 x 1008; --downscale 1 fits them as "
        "they are, in about 9 times the time"
    )


@pytest.mark.full
def test_a_size_that_is_asked_for_is_kept(capture, tmp_path, monkeypatch):
    monkeypatch.setattr(
        "rift_cl.commands.fit_photos.photograph_size.MOST_PIXELS", {True: 400, False: 400}
    )
    asked = FitPhotosSettings.of(capture=capture, out=tmp_path / "fit", downscale=1)
    assert Fit(asked).downscale == 1
    decided = Fit(FitPhotosSettings.of(capture=capture, out=tmp_path / "fit"))
    assert decided.downscale > 1 and "made smaller by" in decided.plan()["largest photograph"]
    assert "--downscale 1 fits them as they are" in decided._notes()[0]
    with pytest.raises(InputError, match="--frames is 2"):
        FitPhotosSettings.of(capture=capture, out=tmp_path / "fit", frames=2).check()


@pytest.mark.parametrize(
    ("size", "factor", "words"),
    [
        ((96, 80), 50, "--downscale 50 leaves 1 x 1 pixels of b.png, .*take --downscale 7 or less"),
        ((96, 80), 8, "leaves 12 x 10 pixels of b.png"),
        ((20, 12), 2, "take --downscale 1, or do without .*--ssim-weight 0.*--hold-out 0"),
        ((20, 10), 1, "along each side: do without .*--ssim-weight 0"),
    ],
)
def test_photographs_smaller_than_the_window_of_ssim(size, factor, words):
    views = [view(640, 480), dataclasses.replace(view(*size), name="b.png")]
    with pytest.raises(InputError, match=words):
        check_window(views, factor, way_out="do without it: --ssim-weight 0, --hold-out 0")
    check_window([views[0]], min(factor, 43))


def test_a_downscale_that_leaves_too_little_is_refused_before_anything_is_done(
    capture, tmp_path, capsys
):
    words = ["fit", str(capture), "--out", str(tmp_path / "fit"), "--downscale", "6", "--dry-run"]
    assert main(words) == 3
    told = capsys.readouterr().err
    assert "--downscale 6 leaves 13 x 10 pixels" in told and "--ssim-weight 0" in told
    # Without SSIM in the loss and without scores nothing wants more pixels.
    assert main([*words, "--ssim-weight", "0", "--hold-out", "0"]) == 0
