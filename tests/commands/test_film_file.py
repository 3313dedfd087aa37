"""Films: decoded again they show the frames, name nobody, and are the same every time."""

from __future__ import annotations

import json
import os
import sys
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from rift_cl.commands.cli import main
from rift_cl.commands.render.animation import chosen_film
from rift_cl.errors import InputError, OutputError
from rift_cl.io.images.film_file import film_writer
from rift_cl.io.images.image import read_image
from rift_cl.io.scenes.splat_scene import SplatScene
from rift_cl.metrics import psnr

KINDS = ("webm", "mp4", "mp4-h264")
SIZE = (96, 128)


@pytest.fixture
def av():
    return pytest.importorskip("av", reason="PyAV is not installed")


def frames(count=12, size=SIZE):
    """A soft coloured disc that moves to the right before a gradient."""
    y, x = np.mgrid[: size[0], : size[1]] / size[0]
    made = []
    for number in range(count):
        disc = 1 / (1 + np.exp(40 * (np.hypot(x - 0.3 - number / 20, y - 0.5) - 0.25)))
        color = [disc * c + (1 - disc) * g for c, g in ((0.9, x / 2), (0.4, y), (0.1, 0.5))]
        made.append(np.rint(np.clip(np.stack(color, axis=2), 0, 1) * 255).astype(np.uint8))
    return made


def written(path, kind, pictures, rate=24.0):
    with film_writer(path, kind, pictures[0].shape[:2], rate) as add:
        for picture in pictures:
            add(picture)
    return path.read_bytes()


def decoded(av, path):
    with av.open(str(path)) as container:
        stream = container.streams.video[0]
        pictures = [frame.to_ndarray(format="rgb24") for frame in container.decode(stream)]
        return pictures, float(stream.average_rate), {**container.metadata, **stream.metadata}


@pytest.mark.parametrize("kind", KINDS)
def test_a_film_shows_its_frames_and_says_nothing_else(av, tmp_path, kind):
    chosen(kind)
    content = written(tmp_path / "film", kind, frames(), 12.5)
    found, rate, facts = decoded(av, tmp_path / "film")
    assert len(found) == 12 and rate == pytest.approx(12.5)
    for picture, truth in zip(found, frames(), strict=True):
        assert psnr(picture / 255.0, truth / 255.0) > 34
    # Colours keep their place: no matrix or range is taken for another.
    np.testing.assert_allclose(
        np.mean(found, axis=(0, 1, 2)), np.mean(frames(), axis=(0, 1, 2)), atol=2
    )
    known = {"encoder", "DURATION", "language", "handler_name", "vendor_id"}
    known |= {"major_brand", "minor_version", "compatible_brands"}
    assert set(facts) <= known and not any(c.isdigit() for c in facts.get("encoder", ""))
    assert str(tmp_path).encode() not in content


def chosen(kind):
    """Skip where this PyAV has no such encoder."""
    try:
        assert chosen_film(kind, [SIZE, SIZE]) == kind
    except InputError as error:
        pytest.skip(str(error))


@pytest.mark.parametrize("kind", KINDS)
def test_the_same_frames_give_the_same_bytes(av, tmp_path, kind):
    chosen(kind)
    one, two = (written(tmp_path / name, kind, frames()) for name in "ab")
    assert one == two != written(tmp_path / "c", kind, frames()[::-1])


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.skipif(sys.platform != "linux", reason="threads have priorities in Linux")
def test_no_thread_becomes_more_urgent_than_all_others(av, tmp_path, kind):
    """SVT-AV1 makes itself and its caller real-time threads where root calls it."""
    chosen(kind)
    before = os.sched_getscheduler(0)
    with film_writer(tmp_path / "film", kind, SIZE, 24.0) as add:
        for picture in frames(3):
            add(picture)
            threads = [int(thread.name) for thread in Path("/proc/self/task").iterdir()]
            assert {os.sched_getscheduler(thread) for thread in threads} == {before}
    assert os.sched_getscheduler(0) == before


def test_an_odd_edge_loses_its_last_row(av, tmp_path):
    written(tmp_path / "film", "webm", frames(size=(97, 129)))
    found, _, _ = decoded(av, tmp_path / "film")
    assert found[0].shape == (96, 128, 3)


def test_a_film_that_fails_leaves_nothing(av, tmp_path):
    chosen("mp4")
    with pytest.raises(OutputError, match=r"libsvtav1.*2 x 2.*--film"):
        written(tmp_path / "film", "mp4", frames(size=(2, 2)))
    with pytest.raises(KeyError), film_writer(tmp_path / "film", "webm", SIZE, 24) as add:
        add(frames(1)[0])
        raise KeyError
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize("error", [ValueError, InputError])
def test_what_fails_between_frames_is_not_the_encoders_refusal(av, tmp_path, error):
    film = film_writer(tmp_path / "film", "webm", SIZE, 24)
    with pytest.raises(error, match=r"^a defect$"), film as add:
        add(frames(1)[0])
        raise error("a defect")
    assert not list(tmp_path.iterdir())


def test_the_kind_of_a_film_by_what_there_is(monkeypatch):
    alike, one, apart = [SIZE, SIZE], [SIZE], [SIZE, (5, 5)]
    assert chosen_film("auto", one) is None and chosen_film("auto", apart) is None
    assert chosen_film("auto", [(1, 8), (1, 8)]) == "apng"
    assert chosen_film("apng", alike) == "apng"
    with pytest.raises(InputError, match="edges of 4 pixels"):
        chosen_film("webm", [(2, 8)] * 2)
    with pytest.raises(InputError, match="one size"):
        chosen_film("webm", apart)
    monkeypatch.setitem(sys.modules, "av", None)
    monkeypatch.setattr("rift_cl.io.images.film_file.find_spec", lambda _: None)
    assert chosen_film("auto", alike) == "apng"
    with pytest.raises(InputError, match=r"film,view\]' in the .*or pip install av; .*--film"):
        chosen_film("mp4", alike)


def test_a_film_that_becomes_a_png_says_what_would_make_it_smaller(tmp_path, monkeypatch, capsys):
    SplatScene(
        means=np.zeros((1, 3)),
        log_scales=np.full((1, 3), -1.0),
        quats=np.tile([1.0, 0, 0, 0], (1, 1)),
        logit_opacities=np.full(1, 2.0),
        sh=np.ones((1, 1, 3)),
    ).save(tmp_path / "scene.ply")
    words = ["--frames", "2", "--size", "24", "16", "--overwrite", "--out", str(tmp_path / "film")]
    told = "pip install '.[capture,heic,film,view]'"
    monkeypatch.setattr("rift_cl.io.images.film_file.find_spec", lambda _: None)
    assert main(["render", str(tmp_path / "scene.ply"), *words]) == 0
    assert told in "".join(capsys.readouterr())
    # Of a film that is asked for there is nothing to say.
    assert main(["render", str(tmp_path / "scene.ply"), *words, "--film", "apng"]) == 0
    assert told not in "".join(capsys.readouterr())


def test_a_rendering_leaves_a_film_of_its_frames_and_a_small_copy_in_the_report(
    av, tmp_path, capsys
):
    random = np.random.default_rng(0)
    SplatScene(
        means=random.normal(size=(60, 3)),
        log_scales=np.full((60, 3), -1.0),
        quats=np.tile([1.0, 0, 0, 0], (60, 1)),
        logit_opacities=np.full(60, 2.0),
        sh=random.normal(size=(60, 1, 3)),
    ).save(tmp_path / "scene.ply")
    out = tmp_path / "film"
    words = ("--frames", "6", "--size", "120", "80", "--quiet", "--out", str(out))
    assert main(["render", str(tmp_path / "scene.ply"), *words]) == 0
    assert "frames, film.webm and report.html" in capsys.readouterr().out
    found, rate, _ = decoded(av, out / "film.webm")
    assert rate == 24 and len(found) == 6
    for number, picture in enumerate(found):
        truth = read_image(out / "frames" / f"{number:04}.png")
        assert psnr(picture / 255.0, truth) > 30
    assert json.loads((out / "metrics.json").read_text())["film"] == "film.webm"
    page = (out / "report.html").read_text()
    assert page.count("data:image/webp") == 1 and "film.webm" in page
    assert not (out / "animation.png").exists()
    again = ("--frames", "2", "--film", "apng", "--overwrite", *words[2:])
    assert main(["render", str(tmp_path / "scene.ply"), *again]) == 0
    assert not (out / "film.webm").exists()
    with Image.open(out / "animation.png") as moving:
        assert moving.n_frames == 2
