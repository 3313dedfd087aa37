"""The hybrid of splats and a network: it begins as splats, learns by its gradient, and is drawn."""

from __future__ import annotations

import numpy as np
import pytest

torch = pytest.importorskip("torch")

import rift_cl as rift  # noqa: E402
from rift_cl.report.html_page import Page  # noqa: E402

STEPS = 4


@pytest.fixture
def figure(tool, monkeypatch):
    small = tool("paper.small_field")
    tiny = small.FieldSize(
        levels=2, entries=64, finest=16, features=4, samples=4, patch=8, patches=1
    )
    monkeypatch.setattr(small, "QUICK", tiny)
    return tool("paper.hybrid")


@pytest.fixture
def plan(tool, tmp_path):
    plans = tool("paper.plan")
    return plans.Plan(False, tmp_path, None, plans.sample_ornament(), (4,), STEPS, 50, (0,))


@pytest.fixture
def scene(figure, plan):
    return figure._Scene(plan, rift.default_device())


def _after_one_step(scene, model):
    trainer = scene.begun(model, STEPS).trainer
    loss = trainer.step()
    return trainer, float(trainer.device.get(loss)[0])


def test_a_network_at_nothing_leaves_the_fit_as_it_is(scene, figure):
    plain, loss = _after_one_step(scene, figure.PLAIN)
    decoded, same = _after_one_step(scene, figure.NETWORK)
    assert same == pytest.approx(loss, rel=1e-6)
    for name, array in plain.state().items():
        np.testing.assert_allclose(decoded.state()[name], array, rtol=1e-3, atol=1e-5)
    assert any(bool(p.grad.any()) for p in decoded.network.last.parameters())


def test_the_network_learns_by_the_gradient_of_the_loss(scene, figure):
    """Of the constant that is added to all splats: what its gradient says is what comes of it."""
    slopes, losses = [], []
    for shift in (0.02, 0.02 - 1e-3, 0.02 + 1e-3):
        trainer = scene.begun(figure.NETWORK, STEPS).trainer
        with torch.no_grad():
            trainer.network.last.bias += shift
        losses.append(float(trainer.device.get(trainer.step())[0]))
        slopes.append(float(trainer.network.last.bias.grad.sum()))
    assert slopes[0] == pytest.approx((losses[2] - losses[1]) / 2e-3, rel=0.05)


@pytest.mark.study
def test_the_figure_has_all_models_and_goes_on_where_it_was(figure, plan, monkeypatch):
    device = rift.default_device()
    result = list(figure.compute(plan, device, {}))[-1]
    models = [figure.PLAIN, figure.LIGHT, figure.NETWORK, figure.FIELD]
    assert [run["model"] for run in result["runs"]] == models
    for run in result["runs"]:
        last = run["moments"][-1]
        assert last["step"] > 0 and np.isfinite(last["off the ring"]["psnr"])
        assert len(last["ring"]["error"]) == len(result["frequency"])
    monkeypatch.setattr(figure, "_run", None)
    assert list(figure.compute(plan, device, result))[-1]["runs"] == result["runs"]
    page = Page("Figures")
    figure.show(page, result)
    assert "Not claimed" in page.html()
