"""Spectral bias in 2D: what the ramp does without a network, and that networks are separate."""

from __future__ import annotations

import itertools

import numpy as np
import pytest

from rift_cl import default_device
from rift_cl.report.html_page import Page


@pytest.fixture
def bias(tool):
    return tool("paper.slice_bias")


@pytest.fixture
def small(bias):
    return bias.Size(pixels=24, views=36, steps=12, width=8, seeds=(0,))


def errors(bias, small, supervision, noise=0.0):
    body = bias.Slice(small, 0, noise, default_device())
    return list(bias._moments(body, "no network", supervision, small, 0))[-1]["error"]


def test_views_sample_as_one_over_the_frequency(bias, small):
    density = bias.Slice(small, 0, 0.0, default_device()).density()
    middles = (bias.band_edges()[1:] + bias.band_edges()[:-1]) / 2
    # The lowest band is as wide as the slice lets it be; footprints lower the highest.
    slope = np.polyfit(np.log(middles[1:6]), np.log(density[1:6]), 1)[0]
    assert -1.6 < slope < -0.8


def test_the_ramp_takes_back_the_bias_of_the_sampling(bias, small):
    pixels, plain, ramped = (errors(bias, small, name) for name in bias.SUPERVISIONS)
    assert max(pixels) < -60
    # Plain projections leave the highest band, which they learn last; the ramp learns it.
    assert plain[-1] > plain[0] + 8 and plain[-1] > -5
    assert ramped[-1] < plain[-1] - 8


def test_the_exponent_falls_as_the_residual_comes_down_to_the_noise(bias, small):
    body = bias.Slice(small, 0, 0.3, default_device())
    rows = body.A(body.truth) - body.data
    plain = body.A.T(rows)
    at_truth = body.gradient(body.truth, "ramped projections")
    np.testing.assert_allclose(at_truth, plain, rtol=0.3, atol=0.3 * np.abs(plain).max())
    assert np.isfinite(errors(bias, small, "ramped projections", noise=0.3)).all()


def test_steps_without_a_network_are_stable(bias, small):
    for supervision, noise in itertools.product(bias.SUPERVISIONS, (0.0, 0.2)):
        body = bias.Slice(small, 1, noise, default_device())
        gradient = lambda image, name=supervision, body=body: body.gradient(image, name)  # noqa: E731
        found = bias._descent(gradient, np.zeros_like(body.truth), body.steepest(supervision))
        norms = [np.linalg.norm(image) for image in itertools.islice(found, 20)]
        assert max(norms) < 3 * np.linalg.norm(body.truth)


def test_a_network_learns_a_slice_and_features_make_it_finer(tool):
    pytest.importorskip("torch")
    fit = tool("paper.coordinate_network").NetworkFit
    truth = tool("paper.slice_bias").white_slice(16, np.random.default_rng(0))
    left = {}
    for sigma in (0.0, 4.0):
        images = fit(16, 24, sigma, 0).images(lambda image: image - truth, truth)
        last = next(itertools.islice(images, 150, None))
        left[sigma] = np.linalg.norm(last - truth) / np.linalg.norm(truth)
    assert left[4.0] < 0.5 < left[0.0] + 0.2


def test_a_figure_goes_on_where_it_was_and_is_drawn(bias, small, tool, tmp_path, monkeypatch):
    monkeypatch.setattr(bias, "QUICK", small)
    monkeypatch.setattr(bias, "torch_is_missing", lambda: True)
    plan = tool("paper.plan").Plan(False, tmp_path, None, None, (4,), 2, 3, (0,))
    result = list(bias.compute(plan, default_device(), {}))[-1]
    cases = [(run["noise"], run["supervision"]) for run in result["runs"]]
    assert cases == [
        *((0.0, name) for name in bias.SUPERVISIONS),
        *((0.1, name) for name in bias.SUPERVISIONS[1:]),
    ]
    monkeypatch.setattr(bias, "_moments", None)
    again = list(bias.compute(plan, default_device(), result))[-1]
    assert again["runs"] == result["runs"]
    page = Page("Figures")
    bias.show(page, result)
    assert "Not claimed" in page.html() and "no network" in page.html()
