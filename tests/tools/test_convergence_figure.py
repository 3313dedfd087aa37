"""The figure of convergence: every case once, gone on with where it was, drawn from JSON alone."""

import json
from types import SimpleNamespace

import numpy as np
import pytest

from rift_cl import default_device
from rift_cl.report.html_page import Page


@pytest.fixture
def convergence(tool, monkeypatch):
    """The module with so few steps that it shows nothing but that all of it runs."""
    module = tool("paper.convergence")
    monkeypatch.setattr(module, "QUICK_STEPS", {"CGLS": 5, "FISTA-TV": 6})
    monkeypatch.setattr(module, "STEPS", module.QUICK_STEPS)
    monkeypatch.setattr(module, "NOISES", (0.25,))
    return module


def test_all_cases_are_computed_once_and_drawn(convergence):
    plan = SimpleNamespace(full=False, size=lambda: {"size": "quick"})
    assert convergence.settings(plan)["steps"] == {"CGLS": 5, "FISTA-TV": 6}
    results = convergence.compute(plan, default_device(), {})
    for _ in range(7):
        kept = json.loads(json.dumps(next(results)))
    assert len(kept["rows"]) == 7
    kept["rows"][0]["solver"] = "kept as it is"
    result = list(convergence.compute(plan, default_device(), kept))[-1]
    assert len(result["rows"]) == 2 * 2 * 3
    assert result["rows"][0]["solver"] == "kept as it is"
    # The stop is noted, and the run goes on beyond it.
    assert {len(row["runs"][0]["psnr"]) for row in result["rows"]} == {5, 6}
    stops = {row["weight"]: row["runs"][0]["stop"] for row in result["rows"][1:3]}
    assert stops["ramp"] in (1, 2, 3)
    page = Page("t")
    convergence.show(page, json.loads(json.dumps(result)))
    assert page.html().count("<img ") >= 5


def test_the_summary_of_a_run(convergence):
    row = {"runs": [{"psnr": [1, 5.5, 6, 4], "stop": 3}]}
    assert convergence.summary(row) == (6, 2, 3, 6)
    row["runs"].append({"psnr": [3, 2, 1, 0], "stop": None})
    assert convergence.summary(row) == (4.5, 1.5, None, None)


def test_phantoms_lie_between_zero_and_one(convergence):
    grid = convergence.Grid((40, 40))
    for seed in range(3):
        image = convergence._phantom(grid, seed)
        assert image.min() >= 0
        assert image.max() <= 1 + 1e-6
        assert np.ptp(image) > 0.9
