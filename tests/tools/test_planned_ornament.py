"""The planned ornament without its fits: where views stand, what is kept, what is drawn."""

import dataclasses
import json

import numpy as np
import pytest

from rift_cl.errors import OutputError
from rift_cl.report.html_page import Page


@pytest.fixture
def figure(tool):
    return tool("paper.planned_ornament")


@pytest.fixture
def plan(tool, tmp_path):
    plans = tool("paper.plan")
    return plans.Plan(False, tmp_path, None, None, (4,), 10, 50, (0,))


@pytest.fixture
def rows(figure, monkeypatch):
    """Fits that only say that they were made."""
    made = []

    def row(plan, name):
        made.append(name)
        scores = dict.fromkeys(figure._SCORES, 20.0 + len(made))
        merits = {figure.VOLUME: 0.4, figure.SURFACE: 0.3}
        places = [[5.5, 0.0, 0.07 + len(made)], [0.0, 5.5, 1.0]]
        return {"set": name, "views": 2, **scores, "merits": merits, "places": places}

    monkeypatch.setattr(figure, "_row", row)
    return made


def angles(poses):
    places = np.array([pose[:3, 3] for pose in poses]) - (0, 0, 0.07)
    np.testing.assert_allclose(np.linalg.norm(places, axis=1), 5.5)
    rise = np.degrees(np.arcsin(places[:, 2] / 5.5))
    return np.degrees(np.arctan2(places[:, 1], places[:, 0])) % 360, rise


def test_the_cap_is_even_and_all_views_keep_to_it(figure):
    _, cap = angles(figure.poses_of(figure.CAP, figure.Size(200, 1, (6, 8), 1)))
    np.testing.assert_allclose(np.diff(np.sin(np.radians(cap))), np.sin(np.radians(35)) / 200)
    turn, planned = angles(figure.poses_of(figure.VOLUME, figure.Size(5, 1, (6, 8), 1)))
    for found in (cap, planned):
        assert (found >= -1e-9).all() and (found <= 35 + 1e-9).all()
    assert len(planned) == 5 and np.ptp(turn) > 90


@pytest.mark.parametrize("full", [False, True])
def test_no_view_that_is_scored_is_one_that_is_trained_on(figure, plan, full):
    size = figure.Size.of(dataclasses.replace(plan, full=full))
    ring, rise = angles(figure.poses_of(figure.RING, size))
    scored, _ = angles(figure.poses_of(figure.ON_RING, size))
    np.testing.assert_allclose(rise, 12)
    away = np.abs((scored[:, None] - ring + 180) % 360 - 180)
    assert away.min() > 0.1 * 360 / size.views and len(scored) == size.scored
    assert len(figure.poses_of(figure.OFF_RING, size)) == size.scored


def test_points_of_the_surface_face_outward_above_the_base(figure):
    target = figure.targets()[figure.SURFACE]
    np.testing.assert_allclose(np.linalg.norm(target.normals, axis=1), 1)
    np.testing.assert_allclose(target.points, target.normals)
    assert target.points[:, 2].min() > -0.5


def test_what_is_there_is_not_made_again(figure, plan, rows, monkeypatch):
    monkeypatch.setattr(figure, "find_spec", lambda name: object())
    results = [json.loads(json.dumps(result)) for result in figure.compute(plan, None, {})]
    assert rows == list(figure.SETS) and len(results) == 4
    again = list(figure.compute(plan, None, results[1]))
    assert rows[4:] == [figure.VOLUME, figure.SURFACE]
    assert again[-1]["rows"][:2] == results[1]["rows"]
    page = Page("page")
    figure.show(page, results[-1])
    assert page.html().count("<table") == 1 and page.html().count("<img") == 1


def test_without_the_renderer_it_says_what_to_install(figure, plan, rows, monkeypatch, capsys):
    monkeypatch.setattr(figure, "find_spec", lambda name: None)
    *_, last = figure.compute(plan, None, {})
    assert not rows and "pip install mitsuba" in last["missing"]
    assert "pip install mitsuba" in capsys.readouterr().err
    page = Page("page")
    figure.show(page, last)
    assert "pip install mitsuba" in page.html()
    figure.show(Page("nothing"), {"rows": [], "missing": None})


def test_pictures_that_are_there_are_taken_if_they_are_of_these_views(figure, plan, monkeypatch):
    drawn = []

    class Tracer:
        name = "none"

        def __init__(self, *given, **more):
            drawn.append(more["samples"])

        def picture(self, shot, number):
            return np.full((*shot.size, 3), 0.5, np.float32)

    monkeypatch.setattr(figure, "Tracer", Tracer)
    monkeypatch.setattr(figure, "choose_variant", lambda asked: ("none", "for a test"))
    folder = figure._rendered(plan, figure.CAP)
    assert len(list((folder / "images").glob("*.png"))) == 8
    assert figure._rendered(plan, figure.CAP) == folder and drawn == [16]
    monkeypatch.setattr(figure, "_GOLDEN_ANGLE", 77.0)
    with pytest.raises(OutputError, match="differ in frames"):
        figure._rendered(plan, figure.CAP)
