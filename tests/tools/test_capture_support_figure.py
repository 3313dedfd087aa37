"""The figure of real captures: which it finds, what it measures, drawn from JSON alone."""

import importlib
import json
import math
from pathlib import Path

import numpy as np
import pytest
from test_start import ring

from rift_cl import open_device
from rift_cl.io.captures.transforms_record import transforms_of
from rift_cl.io.output import write_json
from rift_cl.report.html_page import Page

TOOLS = Path(__file__).parents[2] / "tools"


@pytest.fixture
def figure(monkeypatch):
    monkeypatch.syspath_prepend(str(TOOLS))
    return importlib.import_module("paper.capture_support")


@pytest.fixture
def plan(figure, tmp_path):
    """Captures of an ornament, another one beside them, and a folder that is none."""
    for name, views in (("ornament/orbit", 24), ("ornament/off_path", 5), ("other", 12)):
        (tmp_path / name).mkdir(parents=True)
        record = transforms_of(ring(views), [f"{k}.png" for k in range(views)])
        write_json(tmp_path / name / "transforms.json", record)
    (tmp_path / "notes").mkdir()
    plans = importlib.import_module("paper.plan")
    ornament = plans.Ornament(
        tmp_path / "ornament" / "orbit", tmp_path / "ornament" / "off_path", None
    )
    return plans.Plan(True, tmp_path / "out", None, ornament, (), 1, 1, (0,))


def test_captures_at_hand_are_found_and_measured(figure, plan):
    names = [Path(path).name for path in figure.settings(plan)["captures"]]
    assert names == ["orbit", "off_path", "other"]
    results = [json.loads(json.dumps(r)) for r in figure.compute(plan, open_device(), {})]
    assert [len(result["captures"]) for result in results] == [1, 2, 3]
    orbit, few, _ = results[-1]["captures"]
    # All cameras of the ring stand at one elevation, which is the missing cone's half-angle.
    assert orbit["hole"]["half_angle_degrees"] == pytest.approx(math.degrees(math.atan(0.3)), 0.05)
    assert few["hole"]["share"] > orbit["hole"]["share"] and orbit["views"] == 24
    # The mean over directions falls as 1 / k where pixels pass all.
    mean = np.array(orbit["mean"])
    slope = np.polyfit(np.log(figure._CYCLES[6:18]), np.log(mean[6:18]), 1)[0]
    assert slope == pytest.approx(-1, abs=0.1)
    page = Page("page")
    figure.show(page, results[-1])
    assert page.html().count("<img") == 2 and page.html().count("<table") == 1
    # What is there is not computed again.
    kept = {"captures": results[-1]["captures"][:2]}
    again = list(figure.compute(plan, open_device(), kept))
    assert len(again) == 1 and again[0]["captures"][2] == results[-1]["captures"][2]
    figure.show(Page("empty"), {"captures": []})
