"""Figure 9: four stages of one lens that meet in the same image, and tables a person can read."""

from __future__ import annotations

import json
import math
from types import ModuleType
from typing import Any

import numpy as np
import pytest

from rift_cl.report.html_page import Page
from rift_cl.sample.stock_lenses import STOCK_LENSES


@pytest.fixture
def figure(tool) -> ModuleType:
    return tool("paper.figure_09")


@pytest.fixture
def result(figure: ModuleType) -> dict[str, Any]:
    (found,) = figure.compute(None, None, {})
    return json.loads(json.dumps(found))


def test_real_rays_of_a_point_meet_in_the_drawn_image(result: dict[str, Any]) -> None:
    drawing = result["drawing"]
    place, half = drawing["image"]
    for rays, height in zip(drawing["rays"], (0.0, -half), strict=True):
        ends = np.array([ray[-1] for ray in rays])
        assert ends[:, 0] == pytest.approx(place)
        # Aberrations of an f/5 triplet this close, far below what a drawing shows.
        assert ends[:, 1] == pytest.approx(height, abs=0.15)
        starts = np.array([ray[0] for ray in rays])
        assert np.ptp(starts, axis=0) == pytest.approx(0, abs=1e-9)


def test_elements_are_closed_and_as_thick_as_prescribed(result: dict[str, Any]) -> None:
    thick = []
    for outline in result["drawing"]["glasses"]:
        z, y = np.array(outline).T
        assert (y == y[::-1]).all()
        middle = np.abs(y) < 1e-9
        thick.append(float(np.ptp(z[middle])))
    assert thick == pytest.approx([3.25896, 0.99997, 2.95208])


def test_every_lens_has_a_table_of_finite_losses(result: dict[str, Any]) -> None:
    assert set(result["losses"]) == set(STOCK_LENSES)
    for loss in result["losses"].values():
        steps = [row[0] for row in loss["rows"]]
        assert {step[:6] for step in steps} == {"a to b", "b to c", "c to d"}
        assert all(math.isfinite(row[2]) and row[3] for row in loss["rows"])


def test_a_wider_pupil_stops_paying_where_the_target_is_deep(result: dict[str, Any]) -> None:
    apertures = result["apertures"]
    focused, worst = (np.array(apertures["cutoffs"][n]) for n in ("in focus", "worst depth"))
    assert (np.diff(focused) > 0).all() and (worst <= focused * 1.001).all()
    best = int(worst.argmax())
    assert 0 < best < len(worst) - 1
    assert apertures["best"] == pytest.approx(1.833 / math.sqrt(60 * 550e-6), rel=2e-3)


def test_it_is_drawn_from_json_alone(figure: ModuleType, result: dict[str, Any]) -> None:
    page = Page("page")
    figure.show(page, result)
    html = page.html()
    assert html.count("<table") == len(STOCK_LENSES)
    assert html.count("<img") == 3
    again = Page("page")
    figure.show(again, result)
    assert again.html() == html
    assert json.loads(json.dumps(figure.settings(None))) == figure.settings(None)
