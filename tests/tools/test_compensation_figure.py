"""The figure of density compensation: what it claims, drawn from JSON alone, gone on with."""

import importlib
import json
from pathlib import Path

import numpy as np
import pytest

from rift_cl import open_device
from rift_cl.report.html_page import Page

TOOLS = Path(__file__).parents[2] / "tools"


@pytest.fixture
def figure(monkeypatch):
    monkeypatch.syspath_prepend(str(TOOLS))
    module = importlib.import_module("paper.compensation")
    for name, value in {
        "SIZE": 48,
        "OBJECTS": 2,
        "COUNTS": (12,),
        "_SHOWN": ("random", 12),
    }.items():
        monkeypatch.setattr(module, name, value)
    monkeypatch.setattr(module, "_trials", lambda plan: 2)
    return module


def test_it_is_worth_it_where_angles_are_irregular_and_costs_nothing_where_they_are_even(figure):
    device, results = open_device(), []
    for result in figure.compute(None, device, {}):
        results.append(json.loads(json.dumps(result)))
    assert [len(result["scores"]) for result in results] == [1, 2, 3, 4]
    for entry in results[-1]["scores"]:
        for scores in entry["psnr"]:
            for name in ("capped Voronoi", "Pipe-Menon", "exact"):
                gain = np.mean(scores[name]) - np.mean(scores["ramp"])
                assert abs(gain) < 0.1 if entry["angles"] == "even" else gain > 1
    page = Page("page")
    figure.show(page, results[-1])
    html = page.html()
    assert html.count("<table") == 2
    assert html.count("<img") == 3
    figure.show(Page("unfinished"), {**results[0], "shown": None})
    # What is there is not computed again.
    kept = {**results[-1], "scores": results[-1]["scores"][:-1]}
    again = list(figure.compute(None, device, kept))
    assert len(again) == 1
    assert again[0]["scores"][-1] == results[-1]["scores"][-1]


@pytest.mark.parametrize("kind", ["random", "even", "wedge", "cluster"])
def test_sets_of_angles_are_what_they_are_called(figure, kind):
    angles = np.sort(figure.angles_of(kind, 40, 1) % np.pi)
    gaps = np.diff(angles, append=angles[0] + np.pi) * 40 / np.pi
    assert {"random": 2, "even": 1, "wedge": 12, "cluster": 3}[kind] <= gaps.max() + 1e-9
    if kind == "even":
        np.testing.assert_allclose(gaps, 1)
    if kind == "wedge":
        assert gaps.max() == pytest.approx(40 / 3 + 2 / 3)
