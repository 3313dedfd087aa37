"""The figures: crisp panels where they should be, stated windows, named curves, hostile input."""

from __future__ import annotations

import io
import itertools
import subprocess
import sys
import tracemalloc

import numpy as np
import pytest
from matplotlib import image as matplotlib_image

from rift_cl.errors import DTypeError, InputError, NonFiniteError, ShapeError
from rift_cl.report import plot

STEPS = np.arange(1.0, 6.0)


def pixels(figure):
    """Grey levels (y, x) of the picture, from 0 to 255."""
    rgb = matplotlib_image.imread(io.BytesIO(plot.figure_png(figure)), format="png")[..., :3]
    return np.rint(rgb * 255)


def texts(figure):
    axes = [t.get_text() for a in figure.axes for t in a.texts]
    return [t.get_text() for t in figure.texts] + axes


def grid(images, **options):
    return plot.image_grid(images, titles=[""] * len(images), **{"columns": 2, **options})


def test_samples_are_crisp_squares_of_one_size():
    image = np.random.default_rng(0).random((12, 9))
    figure = grid([image], columns=1, window=(0, 1), size=0.6)
    factor = 8  # 0.6 inch of 160 dots over 12 samples
    expected = np.kron(np.minimum(image * 256, 255) // 1, np.ones((factor, factor)))
    shown = pixels(figure)
    found = shown[16 : 16 + 12 * factor, 16 : 16 + 9 * factor, 0]
    np.testing.assert_allclose(found, expected, atol=1)
    assert (shown[:16] == 255).all()
    assert (shown[:, :16][:100] == 255).all()


def test_panels_run_along_rows_and_share_one_window():
    levels = [np.full((4, 4), v) for v in (0.0, 0.25, 1.0)]
    shown = pixels(grid(levels, size=0.5))[..., 0]
    middles = [(56, 56), (56, 152), (152, 56)]
    np.testing.assert_allclose([shown[at] for at in middles], [0, 64, 255], atol=1)


def test_a_row_may_have_its_own_window():
    levels = [np.full((4, 4), v) for v in (0.5, 1.0, 0.5, 1.0)]
    figure = grid(levels, size=0.5, window=[(0, 1), (-1, 1)], row_labels=["one", "two"])
    assert {"one", "two", "Display window by row: 0 to 1; −1 to 1"} <= {
        text.replace("\n", " ") for text in texts(figure)
    }
    shown = pixels(figure)[..., 0]
    left = 16 + 26
    found = [shown[y, left + x] for y in (56, 152) for x in (40, 136)]
    np.testing.assert_allclose(found, [128, 255, 191, 255], atol=1)


def test_the_window_is_stated():
    images = [np.array([[-0.5, 2.0]]), np.array([[0.0, 3.25]])]
    assert "Display window −0.5 to 3.25" in texts(grid(images))
    assert "Display window 0 to 2" in texts(grid(images, window=(0, 2)))
    assert "Display window 0 to 2 per mm" in texts(grid(images, window=(0, 2), unit="per mm"))
    assert "Display window 7 to 8" in texts(grid([np.full((3, 3), 7)]))
    assert not any("Display" in text for text in texts(grid([np.zeros((3, 3, 3))])))


def test_titles_stand_above_and_wrap():
    long = "a title that is far too long for the panel below it"
    images = [np.zeros((5, 5))] * 2
    figure = plot.image_grid(images, titles=[long, "b\nc"], columns=2, size=1.0)
    shown = texts(figure)
    assert "b\nc" in shown
    wrapped = next(t for t in shown if t.startswith("a title"))
    assert wrapped.replace("\n", " ") == long
    assert max(map(len, wrapped.split("\n"))) <= 16
    plain = plot.image_grid(images, titles=["", ""], columns=2, size=1.0)
    assert pixels(figure).shape[0] == pixels(plain).shape[0] + 26 * len(wrapped.split("\n"))


def test_every_text_lies_inside_the_picture():
    figure = plot.image_grid(
        [np.zeros((40, 30))] * 5,
        titles=["one\ntwo", "three", "", "four", "five"],
        columns=2,
        row_labels=["a", "a label of some length", "c"],
        window=[(0, 1), (0, 2), (0, 3e-9)],
        size=0.7,
    )
    check_inside(figure)


def check_inside(figure):
    plot.figure_png(figure)
    width, height = figure.canvas.get_width_height()
    drawn = [*figure.texts, *(t for a in figure.axes for t in [*a.texts, a.title])]
    for text in filter(lambda text: text.get_text(), drawn):
        box = text.get_window_extent()
        assert box.x0 >= 0 and box.y0 >= 0, text.get_text()
        assert box.x1 <= width and box.y1 <= height, text.get_text()


def test_large_images_shrink_without_aliasing():
    stripes = np.tile([0.0, 1.0], (512, 256))
    shown = pixels(grid([stripes], columns=1, size=0.8))[16:-60, 16 : 16 + 128, 0]
    np.testing.assert_allclose(shown[30:60, 30:90], 128, atol=3)


def test_the_same_figure_gives_the_same_bytes():
    image = np.arange(6.0).reshape(2, 3)
    first, second = (plot.figure_png(grid([image])) for _ in range(2))
    assert first == second
    assert first.startswith(b"\x89PNG\r\n\x1a\n")


def test_colours_are_shown_as_they_are():
    red = np.zeros((3, 4, 3))
    red[..., 0] = 2
    figure = grid([red, np.zeros((3, 4))], window=(-5, 5))
    shown = [image.get_array() for image in figure.images]
    assert np.all(shown[0] == (255, 0, 0, 255)) and np.all(shown[1] == (128, 128, 128, 255))


@pytest.mark.parametrize("side", [3, 1800])
def test_samples_stand_where_they_are_and_share_pixels_by_their_mean(side):
    chequers = np.add.outer(np.arange(side) // (side // 3), np.arange(side) // (side // 3)) % 2
    figure = grid([np.zeros((2, 2)), chequers], window=(0, 1))
    picture, panel = pixels(figure)[..., 0], figure.images[1]
    high, wide = panel.get_array().shape[:2]
    low, left = picture.shape[0] - int(panel.oy), int(panel.ox)
    drawn = picture[low - high : low, left : left + wide]
    assert high % 3 == wide % 3 == 0
    truth = np.add.outer(np.arange(3), np.arange(3)) % 2
    assert np.array_equal(drawn, 255 * truth.repeat(high // 3, 0).repeat(wide // 3, 1))


def test_a_picture_of_a_large_slice_takes_little_more_memory_than_the_slice():
    slice = np.zeros((2048, 2048), np.float32)
    plot.figure_png(grid([slice]))
    tracemalloc.start()
    plot.figure_png(grid([slice]))
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert peak < 1.5 * slice.nbytes


@pytest.mark.parametrize(
    ("options", "error", "word"),
    [
        ({"columns": 0}, InputError, "columns"),
        ({"size": 0.0}, InputError, "size"),
        ({"size": float("nan")}, InputError, "size"),
        ({"titles": ["a"]}, ShapeError, "1 titles"),
        ({"row_labels": ["a", "b"]}, ShapeError, "2 row labels"),
        ({"window": (1.0, 1.0)}, InputError, "above black"),
        ({"window": (0.0, 1.0, 2.0)}, ShapeError, "window"),
        ({"window": [(0, 1), (0, 1), (0, 1)]}, ShapeError, "window"),
        ({"window": (0.0, float("inf"))}, NonFiniteError, "window"),
    ],
)
def test_useless_options_are_named(options, error, word):
    with pytest.raises(error, match=word):
        plot.image_grid([np.zeros((3, 3))] * 2, **{"titles": ["", ""], "columns": 2, **options})


@pytest.mark.parametrize(
    ("image", "error"),
    [
        (np.zeros((3, 3, 2)), ShapeError),
        (np.zeros((0, 3)), ShapeError),
        (np.array([[1.0, np.nan]]), NonFiniteError),
        (np.array([["a", "b"]]), DTypeError),
        (np.array([[1j, 0]]), DTypeError),
    ],
)
def test_useless_images_are_named(image, error):
    with pytest.raises(error, match=r"images\[1\]"):
        grid([np.zeros((3, 3)), image])


def test_a_grid_of_nothing_is_refused():
    with pytest.raises(ShapeError, match="0 images"):
        grid([])


def test_curves_carry_their_data_names_and_colours():
    series = {"plain": (STEPS, STEPS**2), "weighted": (STEPS, 30 - STEPS)}
    figure = plot.curves(series, xlabel="Step", ylabel="PSNR [dB]", title="Race")
    (axes,) = figure.axes
    assert (axes.get_xlabel(), axes.get_ylabel()) == ("Step", "PSNR [dB]")
    assert axes.get_title(loc="left") == "Race"
    labels = {label.get_text(): label for label in axes.texts}
    for line, (name, (x, y)) in zip(axes.lines, series.items(), strict=True):
        np.testing.assert_array_equal(line.get_xydata(), np.stack([x, y], axis=1))
        assert labels[name].get_color() == line.get_color()
    assert axes.lines[0].get_color() != axes.lines[1].get_color()
    check_inside(figure)


def test_a_name_stands_at_the_end_of_its_curve():
    series = {"low": (STEPS, 0 * STEPS), "high": (STEPS, 2 * STEPS)}
    figure = plot.curves(series, xlabel="", ylabel="", log_x=True)
    (axes,) = figure.axes
    assert axes.get_xscale() == "log"
    plot.figure_png(figure)
    labels = {label.get_text(): label.get_window_extent() for label in axes.texts}
    for line, name in zip(axes.lines, series, strict=True):
        end = axes.transData.transform(line.get_xydata()[-1])
        assert labels[name].y0 < end[1] < labels[name].y1
        assert labels[name].x0 > end[0]


def test_names_of_curves_that_meet_do_not_overlap():
    series = {f"curve {k}": (STEPS, k * (5 - STEPS)) for k in range(12)}
    figure = plot.curves(series, xlabel="x", ylabel="y")
    check_inside(figure)
    boxes = sorted((t.get_window_extent() for t in figure.axes[0].texts), key=lambda b: b.y0)
    assert all(low.y1 <= high.y0 for low, high in itertools.pairwise(boxes))
    observations = {(line.get_color(), line.get_linestyle()) for line in figure.axes[0].lines}
    assert len(observations) == 12


def test_a_mark_is_drawn_and_valued():
    figure = plot.curves({"cost": (STEPS, STEPS)}, xlabel="", ylabel="", mark=2.75)
    (axes,) = figure.axes
    np.testing.assert_array_equal(axes.lines[-1].get_xdata(), 2.75)
    assert "2.75" in texts(figure)


def test_names_of_files_are_no_formulas():
    name = r"a$\frac$b"
    plot.figure_png(plot.image_grid([np.eye(3)], titles=[name], columns=1, row_labels=[name]))
    plot.figure_png(plot.curves({name: (STEPS, STEPS)}, xlabel="", ylabel="", title=name))


@pytest.mark.parametrize(
    ("series", "error", "word"),
    [
        ({}, ShapeError, "series"),
        ({"a": (STEPS, STEPS[:-1])}, ShapeError, "'a'"),
        ({"a": ([], [])}, ShapeError, "x of a"),
        ({"a": (STEPS, np.zeros((5, 1)))}, ShapeError, "y of a"),
        ({"a": (STEPS, STEPS * np.nan)}, NonFiniteError, "y of a"),
        ({"a": (["u"], ["v"])}, DTypeError, "x of a"),
        ({"a": (STEPS - 1, STEPS)}, InputError, "log_x"),
    ],
)
def test_useless_curves_are_named(series, error, word):
    with pytest.raises(error, match=word):
        plot.curves(series, xlabel="", ylabel="", log_x=True)


def test_a_mark_must_suit_the_axis():
    with pytest.raises(InputError, match="log_x"):
        plot.curves({"a": (STEPS, STEPS)}, xlabel="", ylabel="", log_x=True, mark=0.0)


def test_importing_it_loads_no_matplotlib_and_drawing_no_pyplot():
    code = (
        "import sys; from rift_cl.report import plot; assert 'matplotlib' not in sys.modules\n"
        "plot.figure_png(plot.curves({'a': ([1], [2])}, xlabel='', ylabel=''))\n"
        "assert 'matplotlib.pyplot' not in sys.modules"
    )
    subprocess.run([sys.executable, "-c", code], check=True, timeout=120)
