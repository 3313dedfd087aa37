"""Figures 2 to 4 and 7: what they claim, small, drawn from JSON alone and gone on with."""

from __future__ import annotations

import json
from types import SimpleNamespace

import numpy as np
import pytest

from rift_cl import open_device
from rift_cl.report.html_page import Page

PLAN = SimpleNamespace(full=False)


def run(figure, kept=None):
    return [json.loads(json.dumps(r)) for r in figure.compute(PLAN, open_device(), kept or {})]


@pytest.fixture
def slices(tool):
    return tool("paper.figure_02_04")


@pytest.fixture
def support(tool, monkeypatch):
    figure = tool("paper.figure_07")
    for name, value in {
        "SETS": ((3, 1080.0), (12, 270.0), (24, 270.0)),
        "_FINE": 1,
        "_AZIMUTHS": 2,
        "_DISTANCES": (150.0, 1080.0, 7),
    }.items():
        monkeypatch.setattr(figure, name, value)
    return figure


def test_a_projection_is_a_slice_and_slices_thin_out(slices):
    results = run(slices)
    part = results[-1]
    assert [len(result) for result in results] == [1, 2, 3]
    assert part["slice"]["error"] < 1e-3
    assert part["density"]["slopes"]["plane"] == pytest.approx(-1, abs=0.02)
    assert part["density"]["slopes"]["sphere"] == pytest.approx(-1, abs=0.02)
    assert part["density"]["constants"]["plane"] == pytest.approx(1 / np.pi, rel=0.01)
    assert part["density"]["constants"]["sphere"] == pytest.approx(1 / 2, rel=0.01)
    page = Page("page")
    slices.show(page, part)
    assert page.html().count("<img") == 5
    slices.show(Page("unfinished"), results[0])
    # What is there is not computed again.
    again = run(slices, {name: part[name] for name in ("slice", "orbit")})
    assert len(again) == 1 and again[0]["density"] == part["density"]


def test_nearer_is_wider_more_is_denser_and_depth_of_field_ends_it(support):
    results = run(support)
    far, few, many = results[-1]["sets"]
    assert [len(result["sets"]) for result in results] == [1, 2, 3, 3]
    assert few["middle"] > 3 * far["middle"]
    assert many["middle"] == few["middle"]
    np.testing.assert_allclose(many["density"][10], 2 * few["density"][10], rtol=0.1)
    assert many["told"] == pytest.approx(2 * few["told"], rel=0.1)
    distances = results[-1]["distances"]
    assert distances["middle"] == sorted(distances["middle"], reverse=True)
    assert np.argmax(distances["rim"]) > 0
    page = Page("page")
    support.show(page, results[-1])
    assert page.html().count("<img") == 3
    support.show(Page("unfinished"), results[0])
    assert len(run(support, {**results[-1], "sets": results[-1]["sets"][:2]})) == 2
