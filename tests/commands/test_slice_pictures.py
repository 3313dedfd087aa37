"""Slices of a report: made smaller by means, kept as slabs pass, through z and along the axis."""

from __future__ import annotations

import numpy as np
import pytest

from rift_cl.commands.pictures.slice_pictures import FRAMES, SIDE, UPRIGHT, show_slices, smaller
from rift_cl.commands.reconstruct.report import Preview
from rift_cl.report.html_page import Page

RANDOM = np.random.default_rng(0)


def test_blocks_of_an_image_become_their_means():
    image = RANDOM.normal(size=(2 * SIDE, SIDE - 3)).astype(np.float32)
    found = smaller(image)
    assert found.shape == (SIDE, SIDE - 3)
    assert found == pytest.approx(image.reshape(SIDE, 2, -1).mean(axis=1), abs=1e-6)
    # What is less than a block is left out; a single axis may be asked for.
    long = np.repeat(np.arange(4.0), SIDE)[None].astype(np.float32)[:, :-1]
    assert smaller(long, axes=(1,)).shape == (1, (4 * SIDE - 1) // 4)
    assert smaller(long, axes=(0,)).shape == long.shape


@pytest.mark.parametrize("slab", [1, 7, 64])
def test_planes_along_the_axis_are_those_of_the_volume(slab):
    volume = RANDOM.normal(size=(64, 40, 30)).astype(np.float32)
    preview = Preview(len(volume))
    # Workers end in any order.
    for start in reversed(range(0, len(volume), slab)):
        preview.take(start, volume[start : start + slab])
    assert len(preview.frames) == FRAMES and len(preview.planes) == UPRIGHT
    for number, image in preview.frames.items():
        assert np.array_equal(image, volume[number])
    for row, plane in preview.planes.items():
        assert np.array_equal(plane, volume[:, row])


def test_few_slices_have_no_planes_along_the_axis():
    preview = Preview(3)
    preview.take(0, np.ones((3, 8, 8), np.float32))
    assert not preview.planes and sorted(preview.frames) == [0, 1, 2]


def test_a_slider_of_slices_begins_in_the_middle_and_says_its_window():
    page, images = Page("t"), [np.full((4, 6), level, np.float32) for level in range(3)]
    show_slices(page, images, labels=["a", "b", "c"], window=(0, 2), what="Slices")
    text = page.html()
    assert "Slices; 3 of them at 4 x 6 pixels, display window 0 to 2." in text
    assert "<output>b</output>" in text and text.count("data:image/jpeg") == 3
