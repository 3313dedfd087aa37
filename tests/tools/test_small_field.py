"""The small radiance field: what its rays see, that it learns, and the figure that it is in."""

from __future__ import annotations

import math

import numpy as np
import pytest

torch = pytest.importorskip("torch")

from rift_cl.geometry import Camera, look_at  # noqa: E402

BEHIND = np.float32([0.2, 0.3, 0.4])


@pytest.fixture
def small(tool):
    return tool("paper.small_field")


@pytest.fixture
def size(small):
    return small.FieldSize(
        levels=3, entries=256, finest=16, features=8, samples=12, patch=6, patches=2
    )


@pytest.fixture
def camera():
    view = look_at((3, 0.5, 1), (0, 0, 0), (0, 0, 1))
    return Camera((8, 10), [[9, 0, 5], [0, 9, 4], [0, 0, 1]], view)


def field(small, size):
    torch.manual_seed(0)
    box = np.full(3, -1.0), np.full(3, 1.0)
    return small.SmallField(size, small.HashGrid(size), box, BEHIND)


def fog(places, ways):
    """The same density and colour everywhere."""
    return torch.full((len(places),), 0.7), torch.full((len(places), 3), 0.9)


def test_fog_of_one_density_is_its_integral(small, size):
    found = field(small, size)
    found.forward = fog
    origins = torch.tensor([[-3.0, 0, 0], [-3.0, 5, 0]])
    ways = torch.tensor([[1.0, 0, 0], [1.0, 0, 0]])
    colors = found.rays(origins, ways).numpy()
    left = math.exp(-0.7 * 2)
    np.testing.assert_allclose(colors[0], 0.9 * (1 - left) + left * BEHIND, rtol=1e-5)
    np.testing.assert_allclose(colors[1], BEHIND, rtol=1e-6)


def test_rays_go_through_the_pixels_that_the_camera_draws_there(small, camera):
    origins, ways = small.camera_rays(camera, slice(2, 5), slice(3, 4))
    assert origins.shape == ways.shape == (3, 1, 3)
    point = (origins[1, 0] + 2.5 * ways[1, 0]).numpy().astype(float)
    seen = camera.K @ (camera.view[:3, :3] @ point + camera.view[:3, 3])
    np.testing.assert_allclose(seen[:2] / seen[2], (3.5, 3.5), rtol=1e-5)


def test_features_of_a_hash_grid_are_trilinear_in_a_cell(small, size):
    grid = small.HashGrid(size)
    torch.nn.init.normal_(grid.tables)
    places = torch.tensor([[0.01, 0.02, 0.03], [0.05, 0.02, 0.03]])
    ends = grid(places)
    middle = grid(places.mean(dim=0, keepdim=True))
    torch.testing.assert_close(middle[0], ends.mean(dim=0))
    assert ends.shape == (2, grid.width)


def test_a_field_learns_photographs_of_one_colour(small, size, camera):
    image = np.full((8, 10, 3), 0.8, np.float32)
    fit = small.FieldFit(field(small, size), [image], [camera], ramp=False, seed=0)
    before = np.abs(fit.field.picture(camera) - image).mean()
    for _ in range(40):
        fit.step()
    after = np.abs(fit.field.picture(camera, rows=3) - image)
    assert after.mean() < 0.6 * before


def test_the_ramp_keeps_the_norm_and_favours_detail(small):
    y, x = torch.meshgrid(torch.arange(8.0), torch.arange(8.0), indexing="ij")
    coarse, fine = torch.cos(2 * math.pi * x / 8), torch.cos(math.pi * y)
    both = (coarse + fine)[None, :, :, None]
    found = small.ramped(both)[0, :, :, 0]
    assert float(found.norm()) == pytest.approx(float(both.norm()), rel=1e-5)
    shares = [float((found * wave).sum() / (wave * wave).sum()) for wave in (coarse, fine)]
    k = [math.hypot(1 / 8, 1 / 8), math.hypot(1 / 2, 1 / 8)]
    assert shares[0] / shares[1] == pytest.approx(k[0] / k[1], rel=1e-4)


@pytest.mark.study
def test_the_figure_has_all_models_and_goes_on_where_it_was(tool, small, tmp_path, monkeypatch):
    import rift_cl as rift
    from rift_cl.report.html_page import Page

    bias, plans = tool("paper.field_bias"), tool("paper.plan")
    tiny = small.FieldSize(
        levels=2, entries=64, finest=16, features=4, samples=4, patch=8, patches=1
    )
    monkeypatch.setattr(small, "QUICK", tiny)
    monkeypatch.setattr(
        bias, "FIELDS", {"hash grid, ramp": (None, True), "features 1": (1.0, False)}
    )
    plan = plans.Plan(False, tmp_path, None, plans.sample_ornament(), (4,), 4, 50, (0,))
    result = list(bias.compute(plan, rift.default_device(), {}))[-1]
    assert [run["model"] for run in result["runs"]] == [*bias.SPLATS, *bias.FIELDS]
    assert result["density"][0] == pytest.approx(max(result["density"]))
    for run in result["runs"]:
        last = run["moments"][-1]
        assert len(run["moments"]) == 3 and last["step"] > 0 and last["cpu_s"] > 0
        assert len(last["ring"]["error"]) == len(result["frequency"])
    monkeypatch.setattr(bias, "splat_moments", None)
    monkeypatch.setattr(bias, "field_moments", None)
    again = list(bias.compute(plan, rift.default_device(), result))[-1]
    assert again["runs"] == result["runs"]
    page = Page("Figures")
    bias.show(page, result)
    assert "Not claimed" in page.html()
