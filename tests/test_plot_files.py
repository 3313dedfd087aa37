"""Figures as files of a page: ink that follows the colour scheme, pictures within a budget."""

from __future__ import annotations

import io
import re
from xml.etree import ElementTree

import numpy as np
import pytest
from PIL import Image

from rift_cl.errors import ShapeError
from rift_cl.report import plot
from rift_cl.report.plot.figure import COLORS, INK, LINE, SOFT

STEPS = np.arange(10.0)
RANDOM = np.random.default_rng(0)


def draw(width=1024):
    series = {"loss": (STEPS, STEPS), "other <": (STEPS, 2 * STEPS)}
    return plot.curves(series, xlabel="step", ylabel="loss", width=width)


def test_the_ink_of_a_drawing_is_named_twice_and_used_by_name():
    svg = plot.figure_svg(draw()).decode()
    style, body = re.search(r"<style>(.*?)</style>(.*)", svg, re.DOTALL).groups()
    assert "prefers-color-scheme: dark" in style
    for color in (INK, SOFT, LINE, COLORS[0], COLORS[1]):
        assert color in style and color not in body
    used = set(re.findall(r"var\((--c\d)\)", body))
    assert used and all(style.count(f"{name}:") == 2 for name in used)
    assert "svg { --c0" in style and "fill: var(--c0); }" in style, "or black stays black"
    assert "#000000" not in svg and "#ffffff" not in svg and "http://www.w3.org/1999/xlink" in svg
    ElementTree.fromstring(svg)


def test_equal_figures_give_equal_drawings_whose_references_hold():
    first, second = (plot.figure_svg(draw()) for _ in range(2))
    assert first == second
    names = set(re.findall(rb'id="(\w+)"', first))
    used = set(re.findall(rb'href="#(\w+)"', first)) | set(re.findall(rb"url\(#(\w+)\)", first))
    assert used and used <= names


def test_a_drawing_for_narrow_pages_has_letters_of_the_same_size():
    wide, narrow = plot.figure_svgs(lambda width: draw(width=width))
    assert (b'width="1024"' in wide, b'width="576"' in narrow) == (True, True)
    assert draw(576).axes[0].xaxis.label.get_size() == draw().axes[0].xaxis.label.get_size()


def test_samples_become_the_pixels_of_a_picture():
    image = np.kron(np.array([[-1.0, 0.0], [1.0, 3.0]]), np.ones((16, 16)))
    found = np.asarray(Image.open(io.BytesIO(plot.jpeg(image, window=(0, 2)))), int)
    assert found.shape == (32, 32)
    assert np.abs(found - np.clip(image / 2, 0, 1) * 255).max() <= 3
    photograph = np.stack([np.full((40, 80), level) for level in (0.2, 0.5, 0.9)], axis=2)
    small = np.asarray(Image.open(io.BytesIO(plot.jpeg(photograph, side=20))), int)
    assert small.shape == (10, 20, 3)
    assert np.abs(small - np.array([51, 128, 230])).max() <= 4


def test_frames_keep_to_their_budget_by_one_size_for_all():
    images = [RANDOM.uniform(0, 1, (200, 300)) for _ in range(4)]
    files, size = plot.framed(images)
    assert size == (200, 300)
    budget = sum(map(len, files)) // 3
    fewer, smaller = plot.framed(images, budget=budget)
    assert sum(map(len, fewer)) <= budget < sum(map(len, files))
    assert {Image.open(io.BytesIO(file)).size for file in fewer} == {smaller[::-1]}
    # However small the budget, something is to be seen.
    assert min(plot.framed(images, budget=1)[1]) >= 64


@pytest.mark.parametrize("images", [[], [np.ones((2, 3)), np.ones((3, 2))], [np.ones((2, 2, 4))]])
def test_frames_of_other_shapes_are_told(images):
    with pytest.raises(ShapeError, match="shape"):
        plot.framed(images)
