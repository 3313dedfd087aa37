"""The figure of planned views: its projector, its claims, drawn from JSON alone, gone on with."""

import importlib
import json
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from rift_cl.report.html_page import Page

TOOLS = Path(__file__).parents[2] / "tools"


@pytest.fixture
def tool(monkeypatch):
    monkeypatch.syspath_prepend(str(TOOLS))
    return lambda name: importlib.import_module(f"paper.{name}")


def test_blobs_look_the_same_from_everywhere(tool):
    blobs = tool("blob_volumes")
    volume = np.zeros((1, 16, 16, 16))
    volume[0, 8, 7, 9] = 1
    spreads = []
    for direction in np.eye(3), np.random.default_rng(0).standard_normal((3, 3)):
        for line in direction:
            A = blobs.BlobProjector(line[None] / np.linalg.norm(line), 16)
            picture = A(volume)[:, 0].astype(float)
            assert picture.sum() == pytest.approx(1, abs=0.02)
            row, column = np.divmod(np.arange(256), 16)
            middle = [(picture * part).sum() / picture.sum() for part in (row, column)]
            spreads.append(
                sum(
                    (picture * (part - m) ** 2).sum()
                    for part, m in zip((row, column), middle, strict=True)
                )
            )
    np.testing.assert_allclose(spreads, 2 * blobs.BLOB**2, rtol=0.03)


def test_the_adjoint_is_the_projectors_and_the_estimate_fits_what_it_was_made_from(tool):
    blobs = tool("blob_volumes")
    volumes = blobs.random_volumes(2, 16, 0)
    random = np.random.default_rng(1)
    A = blobs.BlobProjector(random.standard_normal((12, 3)), 16)
    y = A(volumes)
    back = A.adjoint(random.standard_normal(y.shape))
    again = A.adjoint(y)
    assert back.shape == volumes.shape
    assert (y**2).sum() == pytest.approx((again * volumes).sum(), rel=1e-4)
    power = blobs.radial_power(volumes)
    estimate = blobs.best_linear(A, y.astype(float), power, 0.02, 40)
    misfit = np.linalg.norm(A(estimate) - y) / np.linalg.norm(y)
    assert misfit < 0.05


def test_the_small_case_is_computed_and_drawn_and_gone_on_with(tool, monkeypatch):
    figure, sector = tool("planned_views"), tool("planned_sector")
    for name, value in {
        "SIZE": 16,
        "VIEWS": 6,
        "_LEARNT": 4,
        "_STEPS": 30,
        "NOISE": 0.2,
        "_FREQUENCIES": 300,
    }.items():
        monkeypatch.setattr(sector, name, value)
    monkeypatch.setattr(
        figure, "_cases", lambda plan: [("volume", "sector", 0), ("volume", "free", 0)]
    )
    plan = SimpleNamespace(full=False, size=lambda: {"size": "quick"})
    results = [
        json.loads(json.dumps(result))
        for result in figure.compute(plan, None, {"flat": [], "volume": [], "array": []})
    ]
    assert len(results) == 2
    case = results[-1]["volume"][0]
    assert case["psnr"]["planned"] > case["psnr"]["arc at 60"]
    assert set(case["merit"]) == {"planned", "ring", "arc", "fibonacci", "zigzag", "random"}
    page = Page("page")
    figure.show(page, results[-1])
    assert page.html().count("<table") == 2
    kept = {**results[-1], "volume": results[-1]["volume"][:1]}
    (again,) = figure.compute(plan, None, kept)
    assert again["volume"][1] == results[-1]["volume"][1]


def test_what_is_wanted_can_fail(tool):
    figure = tool("planned_views")
    arcs = {figure.arc_name(elevation): 20.0 for elevation in figure.ARCS}
    good = {"name": "sector", "psnr": {**arcs, figure.TWICE: 20.0, "planned": 21.1}}
    assert figure.volume_passes(good)
    assert not figure.volume_passes({**good, "psnr": {**good["psnr"], "planned": 20.9}})
    assert not figure.volume_passes({**good, "psnr": {**good["psnr"], "arc at 0": 21.0}})
    flat = {
        "kind": "anisotropic",
        "views": 12,
        "psnr": {"even 12": {"MAP": 1.0}, "even 24": {"MAP": 2.0}, "planned 12": {"MAP": 2.1}},
    }
    assert figure.flat_passes(flat, "MAP")
    assert not figure.flat_passes({**flat, "kind": "isotropic"}, "MAP")
    merits = [("wide", 0.5), ("long", 0.6), ("wide and long", 0.45)]
    cases = [{"array": name, "merit": merit} for name, merit in merits]
    assert figure.array_passes(cases)
    assert not figure.array_passes(cases[:2])
