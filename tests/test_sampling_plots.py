"""Drawings of sampling: planes of frequencies, hemispheres of directions, cameras."""

from __future__ import annotations

import io

import numpy as np
import pytest
from PIL import Image

from rift_cl.errors import InputError, NonFiniteError, ShapeError
from rift_cl.report.plot import (
    FrequencySlice,
    Stands,
    camera_plot,
    curves,
    direction_maps,
    figure_png,
    frequency_maps,
    section_map,
)
from rift_cl.report.plot.camera_plot import axis_names, upright_frame
from rift_cl.report.plot.direction_map import flattened, unflattened
from rift_cl.sampling.planning.constraints import Constraints

UP = (0.0, 0.0, 1.0)


def pixels(figure):
    return np.asarray(Image.open(io.BytesIO(figure_png(figure))).convert("RGB"))


def maps(values, window=(0.01, 100.0), columns=1):
    slices = [FrequencySlice(values, 5.0, ("kx", "kz"), "plane")]
    return frequency_maps(slices, columns=columns, window=window, label="views", unit="mm")


def test_what_nobody_saw_is_white_and_what_many_saw_is_dark():
    values = np.zeros((40, 40))
    values[:, 20:] = 100.0
    figure = maps(values)
    picture = pixels(figure)
    height = picture.shape[0]
    box = figure.axes[0].get_window_extent()
    row = picture[int(height - (box.y0 + box.y1) / 2)]
    across = np.linspace(box.x0 + 4, box.x1 - 4, 9).astype(int)
    assert (row[across[:4]] == 255).all()
    assert (row[across[5:]] == row[across[5]]).all() and row[across[5]].max() < 100
    assert figure_png(maps(values)) == figure_png(maps(values))


def test_the_first_row_of_a_plane_is_its_lowest_frequency():
    axes = maps(np.arange(9.0).reshape(3, 3)).axes[0]
    image = axes.images[0]
    assert image.origin == "lower" and tuple(image.get_extent()) == (-5, 5, -5, 5)
    assert axes.get_xlabel() == "kx, cycles per mm" and axes.get_ylabel() == "kz, cycles per mm"


@pytest.mark.parametrize(
    ("change", "error"),
    [
        ({"window": (0.0, 1.0)}, InputError),
        ({"window": (2.0, 1.0)}, InputError),
        ({"columns": 0}, ShapeError),
        ({"values": np.zeros(4)}, ShapeError),
        ({"values": [[np.nan]]}, NonFiniteError),
    ],
)
def test_maps_that_cannot_be_drawn_are_refused(change, error):
    with pytest.raises(error):
        maps(**{"values": np.ones((3, 3)), **change})


def test_the_map_of_directions_keeps_areas_and_has_opposites_in_one_place():
    random = np.random.default_rng(0)
    ways = random.normal(size=(20000, 3))
    ways /= np.linalg.norm(ways, axis=1, keepdims=True)
    places = flattened(ways)
    np.testing.assert_allclose(flattened(-ways), places, atol=1e-12)
    radius = np.hypot(*places.T)
    assert radius.max() <= 1 + 1e-12
    # Even directions stay even: half of them within 1 / sqrt 2 of the middle.
    assert np.mean(radius < np.sqrt(0.5)) == pytest.approx(0.5, abs=0.01)
    upper = np.where(ways[:, 2:] < 0, -ways, ways)
    np.testing.assert_allclose(unflattened(places), upper, atol=1e-7)


def test_directions_that_no_view_sees_are_shaded():
    def seen(ways):
        assert ways.shape[1] == 3
        return np.full(len(ways), 4.0)

    def cone(ways):
        return np.abs(ways[:, 2]) > np.cos(0.5)

    views = {"views": [[1.0, 0, 0], [0, -1, -0.2]]}
    shaded, whole = (
        pixels(direction_maps(views, seen, missing, up=UP, label="views"))
        for missing in (cone, lambda ways: np.zeros(len(ways), bool))
    )
    sand = np.array([0xF3, 0xD5, 0xC0])
    assert (shaded == sand).all(axis=2).sum() > 1000 > (whole == sand).all(axis=2).sum()
    with pytest.raises(ShapeError):
        direction_maps({}, seen, cone, up=UP, label="views")


def test_cameras_are_seen_from_above_and_from_the_side():
    places = [[3.0, 0, 1], [0, 4, 1]]
    groups = {"views": Stands(places, [[-1.0, 0, 0], [0, -1, 0]]), "to add": Stands(
        [[0, 0, 5.0]], [[0, 0, -1.0]])}  # fmt: skip
    figure = camera_plot(groups, center=(0, 0, 1), diameter=2, up=UP, unit="mm")
    above, beside = figure.axes
    np.testing.assert_allclose(above.lines[0].get_xydata(), [[3, 0], [0, 4]])
    np.testing.assert_allclose(beside.lines[0].get_xydata(), [[3, 0], [0, 0]])
    np.testing.assert_allclose(beside.lines[1].get_xydata(), [[0, 4]])
    assert above.get_xlabel() == "x, mm" and beside.get_ylabel() == "z, mm"
    assert pixels(figure).std() > 0
    with pytest.raises(ShapeError):
        camera_plot({}, center=(0, 0, 0), diameter=1, up=UP, unit="mm")


@pytest.mark.parametrize("up", [(0, 0, 1), (0, -1, 0), (1, 0, 0), (0.1, 0.2, 0.97)])
def test_an_upright_frame_is_a_rotation_whose_last_axis_is_up(up):
    frame = upright_frame(np.array(up, float))
    np.testing.assert_allclose(frame @ frame.T, np.eye(3), atol=1e-12)
    assert np.linalg.det(frame) == pytest.approx(1)
    np.testing.assert_allclose(frame[2], np.array(up) / np.linalg.norm(up), atol=1e-12)
    np.testing.assert_allclose(frame, Constraints(up=up).axes, atol=1e-12)
    names = axis_names(frame)
    assert names == ("x", "y", "z") if up == (0, 0, 1) else "z" not in names[2]


def test_both_axes_of_curves_can_be_logarithmic():
    series = {"law": ([1.0, 10], [100.0, 10])}
    axes = curves(series, xlabel="k", ylabel="views", log_x=True, log_y=True).axes[0]
    assert (axes.get_xscale(), axes.get_yscale()) == ("log", "log")
    with pytest.raises(InputError, match="log_y"):
        curves({"law": ([1.0], [0.0])}, xlabel="k", ylabel="views", log_y=True)


def section(values, edges=((-2, 2), (-1, 1))):
    return section_map(values, edges=edges, axes=("x", "z"), label="missed", unit="mm")


def test_the_first_row_of_a_section_is_its_lowest_place():
    values = np.zeros((20, 40))
    values[:10] = 0.5
    image = pixels(section(values))
    column = image[:, 300].astype(int).sum(axis=1)
    # Dark below, where half is missed; pale above.
    assert column[60] > column[200] + 100
    assert figure_png(section(np.zeros((20, 40)))) != figure_png(section(values))


@pytest.mark.parametrize(
    ("values", "edges", "error"),
    [
        (np.zeros(4), ((0, 1), (0, 1)), ShapeError),
        (np.full((3, 3), np.nan), ((0, 1), (0, 1)), NonFiniteError),
        (np.zeros((3, 3)), ((0, 1), (1, 1)), InputError),
    ],
)
def test_sections_that_cannot_be_drawn_are_refused(values, edges, error):
    with pytest.raises(error):
        section(values, edges)
