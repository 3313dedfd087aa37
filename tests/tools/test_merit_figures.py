"""The studies of merits: what they claim at a small size, drawn from JSON alone, gone on with."""

import importlib
import json
from pathlib import Path

import numpy as np
import pytest

from rift_cl import open_device
from rift_cl.report.html_page import Page

TOOLS = Path(__file__).parents[2] / "tools"


@pytest.fixture
def study(monkeypatch):
    monkeypatch.syspath_prepend(str(TOOLS))
    module = importlib.import_module("paper.merit_study")
    monkeypatch.setattr(module, "_extent", lambda plan: (1, 2))
    monkeypatch.setattr(module, "COUNTS", (12,))
    exact = module.exact
    monkeypatch.setattr(
        module, "exact", lambda observations, target: exact(observations, target, 12)
    )
    known = importlib.import_module("paper.known_objects")
    for name, value in {"_LEARNT": 30, "_STEPS": 8, "_FREQUENCIES": 400}.items():
        monkeypatch.setattr(known, name, value)
    monkeypatch.setattr(module, "_STEPS", 8)
    for place in (module, known):
        monkeypatch.setattr(place, "SIZE", 48)
    return module


def test_the_merit_ranks_sets_of_views_as_reconstructions_do(study):
    device, results = open_device(), []
    for result in study.compute(None, device, {}):
        results.append(json.loads(json.dumps(result)))
    assert [len(result["cases"]) for result in results] == [1, 2]
    for case in results[-1]["cases"]:
        for found in study.correlations(case).values():
            assert found["wiener"] > 0.7
            assert found["exact"] > 0.6
            if case["kind"] == "anisotropic":
                assert found["wiener"] > found["gap"]
    page = Page("page")
    study.show(page, results[-1])
    html = page.html()
    assert html.count("<table") == 1
    assert html.count("<img") == 2
    study.show(Page("unfinished"), results[0])
    study.show(Page("empty"), {"cases": []})
    # What is there is not computed again.
    assert list(study.compute(None, device, results[-1])) == []


def test_gates_are_those_that_are_named(study):
    found = {"wiener": 0.85, "gap": 0.5}
    assert study.passes("anisotropic", found)
    assert not study.passes("isotropic", found)
    assert not study.passes("anisotropic", {**found, "gap": 0.6})


@pytest.mark.parametrize("count", [12, 32])
def test_sets_of_views_are_what_they_are_called(study, count):
    families = importlib.import_module("paper.angle_families")
    for family in families.FAMILIES:
        angles = families.family_angles(family, count, 1)
        assert angles.shape == (count,)
        assert families.gaps(angles).sum() == pytest.approx(np.pi)
        assert np.array_equal(angles, families.family_angles(family, count, 1))
        assert not np.array_equal(angles, families.family_angles(family, count, 2))
    wedge = families.gaps(families.family_angles("wedge", count, 1))
    assert wedge.max() > 0.2
    assert np.sort(wedge)[:-1].std() < 1e-9
    steps = families.gaps(families.family_angles("subsampled", count, 1)) / wedge.sum()
    fine = [n for n in (2, 3, 4) if np.allclose(steps * n * count % 1 % 0.999999, 0, atol=1e-5)]
    assert fine


def test_objects_are_drawn_out_as_far_as_asked(study):
    objects = importlib.import_module("paper.random_objects")
    across = objects.ALONG + np.pi / 2
    for stretch in (1.0, 8.0):
        power = objects.mean_power(objects.random_objects(20, 64, stretch, 3), isotropic=False)
        line = np.fft.fftfreq(64, 1 / 64)
        radius = np.hypot(line[:, None], line)
        turn = np.arctan2(line[:, None], line[None])
        within = (radius > 4) & (radius < 12)
        near = np.cos(2 * (turn - across)) > 0.7
        ratio = power[within & near].mean() / power[within & ~near].mean()
        assert (ratio > 8) if stretch > 1 else (0.5 < ratio < 2)


def test_the_merit_of_a_surface_ranks_views_as_what_they_tell(monkeypatch):
    monkeypatch.syspath_prepend(str(TOOLS))
    module = importlib.import_module("paper.surface_views")
    for name, value in {"SPLATS": 64, "PIXELS": 24, "FOCAL": 40.0, "_TEST": 8}.items():
        monkeypatch.setattr(module, name, value)
    monkeypatch.setattr(module, "_sets", lambda plan: 1)
    device = open_device()
    results = [json.loads(json.dumps(r)) for r in module.compute(None, device, {})]
    assert [len(result["cases"]) for result in results] == [1, 2]
    for case in results[-1]["cases"]:
        assert all(0 < one["error"] < 1 for one in case["sets"])
        assert module.correlations(case)["surface"] > 0.8
    page = Page("page")
    module.show(page, results[-1])
    assert page.html().count("<img") == 2
    module.show(Page("empty"), {"cases": []})
