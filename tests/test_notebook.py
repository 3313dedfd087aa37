"""What a notebook shows: pictures in the cell, with words for who does not see them, and bars."""

from __future__ import annotations

import re
import sys
from html.parser import HTMLParser
from types import SimpleNamespace

import numpy as np
import pytest

import rift_cl as rift
from rift_cl.commands.progress_bar import show_progress
from rift_cl.errors import DTypeError, InputError, NonFiniteError, ShapeError
from rift_cl.io import SplatScene
from rift_cl.progress import Report

_VOID = {"img", "input", "br"}


class Tags(HTMLParser):
    """Collects tags with their attributes, and holds that each is closed."""

    def __init__(self, html):
        super().__init__()
        self.found, self.open = [], []
        self.feed(html)
        assert not self.open, self.open

    def handle_starttag(self, tag, attrs):
        self.found.append((tag, dict(attrs)))
        if tag not in _VOID:
            self.open.append(tag)

    def handle_endtag(self, tag):
        assert self.open.pop() == tag

    def of(self, name):
        return [attrs for tag, attrs in self.found if tag == name]


def checked(value):
    """The tags of what a notebook shows: offline, small, with words for each picture."""
    html = value._repr_html_()
    tags = Tags(html)
    assert len(html) < 2 << 20
    assert not re.search(r"https?://(?!www\.w3\.org)", re.sub(r"base64,[\w+/=]+", "", html))
    assert not tags.of("script")
    for image in tags.of("img"):
        assert image["alt"].strip()
        assert image["src"].startswith("data:image/")
    return tags


def test_an_image_is_one_picture_with_its_range():
    tags = checked(rift.show(np.linspace(0, 2, 12).reshape(3, 4), alt="a ramp"))
    (image,) = tags.of("img")
    assert image["alt"] == "a ramp, 3 x 4, 0 to 2"
    assert not tags.of("input")


def test_a_volume_is_a_strip_with_a_slider():
    volume = np.random.default_rng(0).random((40, 8, 9))
    shown = rift.show(volume)
    tags = checked(shown)
    images, (slider,) = tags.of("img"), tags.of("input")
    assert len(images) == 32
    assert images[0]["alt"].endswith("slice 1 of 40")
    assert images[-1]["alt"].endswith("slice 40 of 40")
    assert (slider["type"], slider["max"]) == ("range", "31")
    assert slider["aria-label"]
    assert any("tabindex" in attrs for attrs in tags.of("div")), "keys move the strip"
    assert repr(shown) == "<volume (40, 8, 9): 32 pictures>"


def test_colours_and_device_arrays_are_shown(device):
    assert len(checked(rift.show(np.zeros((4, 5, 3)))).of("img")) == 1
    assert rift.show(device.array(np.eye(4))).size == (4, 4)


BAD = {
    "line": (np.zeros(3), ShapeError, r"shape \(3,\)"),
    "empty": (np.zeros((0, 3)), ShapeError, "wanted"),
    "text": (np.array([["a"]]), DTypeError, "values"),
    "NaN": (np.full((3, 3), np.nan), NonFiniteError, "NaN"),
}


@pytest.mark.parametrize("case", BAD)
def test_what_cannot_be_shown_is_named(case):
    values, error, words = BAD[case]
    with pytest.raises(error, match=words):
        rift.show(values)


def scene(count=20):
    random = np.random.default_rng(1)
    return SplatScene(
        means=random.uniform(-1, 1, (count, 3)),
        log_scales=np.full((count, 3), -1.5),
        quats=random.standard_normal((count, 4)),
        logit_opacities=np.ones(count),
        sh=random.uniform(0, 1, (count, 1, 3)),
    )


@pytest.mark.once
def test_a_scene_is_a_picture_and_its_figures(device):
    tags = checked(scene())
    assert len(tags.of("img")) == 1
    assert "splats" in scene()._repr_html_()
    assert not checked(scene(0)).of("img")


def test_a_report_is_a_bar_with_words():
    (bar,) = checked(Report(3, 10, "<steps>", {"loss": 0.5})).of("progress")
    assert (bar["value"], bar["max"]) == ("3", "10")
    assert "3/10 &lt;steps&gt;, loss 0.5" in Report(3, 10, "<steps>", {"loss": 0.5})._repr_html_()


@pytest.fixture
def notebook(monkeypatch):
    """An IPython whose kernel notes what it is told to display."""
    told = []
    handle = SimpleNamespace(update=lambda data, raw: told.append(data))

    def display(data, *, raw, display_id):
        told.append(data)
        return handle

    shell = SimpleNamespace(kernel=object())
    display = SimpleNamespace(display=display)
    # matplotlib asks for the version.
    module = SimpleNamespace(get_ipython=lambda: shell, display=display, version_info=(9, 0))
    monkeypatch.setitem(sys.modules, "IPython", module)
    return SimpleNamespace(told=told, shell=shell)


def test_progress_in_a_notebook_is_one_bar_that_is_brought_up_to_date(notebook, capsys):
    show_progress((Report(n, 100, "steps") for n in range(1, 101)), quiet=False)
    first, last = notebook.told[0], notebook.told[-1]
    assert "begins" in first["text/plain"]
    assert last["text/plain"].startswith("100/100 steps")
    assert "value='100' max='100'" in last["text/html"]
    assert all(Tags(data["text/html"]).of("progress") for data in notebook.told)
    assert len(notebook.told) < 50, "not a picture for each step"
    assert capsys.readouterr() == ("", "")


def test_a_terminal_of_ipython_is_no_notebook(notebook, capsys):
    del notebook.shell.kernel
    show_progress([Report(1, 1, "steps")], quiet=False)
    assert notebook.told == []
    assert "1/1 steps" in capsys.readouterr().err


@pytest.mark.full
@pytest.mark.once
def test_a_function_shows_a_bar_if_it_is_asked_to(notebook, tmp_path, device):
    grid, scan = rift.Grid((16, 16)), rift.Parallel(np.linspace(0, 3, 20), 24)
    sinogram = rift.phantom.shepp_logan_sinogram(grid, scan)
    path = tmp_path / "scan.npz"
    np.savez(path, projections=sinogram[:, None], angles=scan.angles, kind="attenuation")
    quiet = rift.reconstruct_scan(path, center=11.5)
    assert notebook.told == []
    made = rift.reconstruct_scan(path, center=11.5, progress=True)
    assert notebook.told
    assert "slice 1 of 1" in made._repr_html_()
    assert np.array_equal(made.read(), quiet.read())


def test_a_page_needs_viser_and_says_how_to_get_it(tmp_path, monkeypatch):
    monkeypatch.setitem(sys.modules, "viser", None)
    scene().save(tmp_path / "scene.ply")
    with pytest.raises(InputError, match=r"film,view\]' .*or pip install 'viser>=1\.1,<1\.2'"):
        rift.view(tmp_path / "scene.ply")


def test_a_page_is_kept_apart_from_the_notebook(tmp_path):
    pytest.importorskip("viser", reason="viser is not installed")
    scene().save(tmp_path / "scene.ply")
    made = rift.view(tmp_path / "scene.ply")
    (frame,) = Tags(made._repr_html_()).of("iframe")
    assert frame["sandbox"] == "allow-scripts"
    assert frame["title"]
    assert "Content-Security-Policy" in frame["srcdoc"]
    path = made.path
    del made
    assert not path.exists(), "a temporary page goes with its record"
