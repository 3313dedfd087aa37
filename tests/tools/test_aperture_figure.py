"""The figure of the aperture: its pictures, what it claims, and the page, from small sizes."""

import json
from dataclasses import replace

import numpy as np
import pytest

from rift_cl import open_device
from rift_cl.errors import InputError
from rift_cl.geometry import Aperture, Camera
from rift_cl.io import open_capture
from rift_cl.io.images.display_light import to_linear
from rift_cl.report.html_page import Page
from rift_cl.splat import Renderer, Splats, SplatSettings


@pytest.fixture
def plan(tool, tmp_path):
    plans = tool("paper.plan")
    sample = plans.sample_ornament()
    return plans.Plan(False, tmp_path, None, sample, (10,), 25, 100, (0,))


def specks(pictures, device):
    """Many small splats in a ball where the sample's cameras look: something to blur."""
    random = np.random.default_rng(0)
    ways = random.normal(size=(2000, 3))
    means = (
        random.uniform(0, 1, (2000, 1)) ** (1 / 3) * ways / np.linalg.norm(ways, axis=1)[:, None]
    )
    splats = Splats.upload(
        device,
        means=means,
        quats=random.normal(size=(2000, 4)),
        scales=random.uniform(0.01, 0.05, (2000, 3)),
        opacities=random.uniform(0.3, 0.9, 2000),
        colors=random.uniform(0, 1, (2000, 3)),
    )
    behind = device.array(np.full(3, 0.5, np.float32))
    return pictures.Drawn(Renderer(SplatSettings(eps2d=0.05), device=device), splats, behind)


def test_the_thin_lens_explains_what_many_pinholes_saw(tool, plan, monkeypatch):
    figure, pictures = tool("paper.aperture_filter"), tool("paper.aperture_pictures")
    monkeypatch.setattr(pictures, "_AZIMUTHS", 4)
    monkeypatch.setattr(pictures, "_PINHOLES", 16)
    device, results = open_device(), []
    monkeypatch.setattr(figure, "sharp_splats", lambda plan, device: specks(pictures, device))
    for result in figure.compute(plan, device, {}):
        results.append(json.loads(json.dumps(result)))
    assert [list(result)[-1] for result in results] == ["shown", "pinhole", "thin lens", "spectra"]
    last = results[-1]
    for radius in last["sharp"]["pinhole"]:
        assert last["sharp"]["thin lens"][radius] > last["sharp"]["pinhole"][radius]
    widest = f"{pictures.radii(plan)[-1]:g}"
    assert last["sharp"]["thin lens"][widest] > last["sharp"]["pinhole"][widest] + 3
    frequencies = np.array(last["spectra"]["frequencies"])
    low, middle = frequencies < 0.03, (frequencies > 0.05) & (frequencies < 0.2)
    for kind in ("pictures", "splats", "disc"):
        transfer = np.array(last["spectra"][kind][widest])
        assert (abs(transfer[low] - 1) < 0.2).all() and (transfer[middle] < 1).all()
        band = np.array(last["spectra"]["difference"][kind])
        assert band[low].max() < 0.5 * band.max()
    page = Page("page")
    figure.show(page, last)
    html = page.html()
    assert html.count("<table") == 1 and html.count("<img") == 4
    figure.show(Page("unfinished"), results[0])
    # What is there is not computed again.
    assert not list(figure.compute(plan, device, last))


def test_a_disc_passes_all_at_zero_and_nothing_at_its_first_zero(tool):
    transfer = tool("paper.aperture_spectra").disc_transfer
    frequencies = np.array([1e-6, 3.8317 / np.pi / 5])
    np.testing.assert_allclose(transfer(np.array(5.0), frequencies), [1, 0], atol=1e-4)


def test_pictures_of_one_depth_are_filtered_as_the_disc_says(tool):
    """A plane of splats out of focus, drawn by many pinholes, against 2 J1(x) / x."""
    pictures, spectra = tool("paper.aperture_pictures"), tool("paper.aperture_spectra")
    power, device = tool("paper.spectra"), open_device()
    random, camera = np.random.default_rng(1), Camera(
        (96, 96), [[90, 0, 48], [0, 90, 48], [0, 0, 1]], np.eye(4), aperture=Aperture(0.3, 4.0)
    )  # fmt: skip
    splats = Splats.upload(
        device,
        means=np.column_stack([random.uniform(-4, 4, (600, 2)), np.full(600, 9.0)]),
        quats=np.tile([1, 0, 0, 0], (600, 1)),
        scales=np.full((600, 3), 0.04),
        opacities=np.full(600, 0.9),
        colors=random.uniform(0, 1, (600, 3)),
    )
    drawn = pictures.Drawn(Renderer(SplatSettings(), device=device), splats, device.zeros(3))
    edges, middles = power.ring_edges(camera.size)
    shown = [drawn.picture(pictures.pinhole(camera)), pictures.many_pinholes(drawn, camera)]
    for picture in shown:
        to_linear(picture)
    sharp, blurred = (power.radial_power(picture, edges) for picture in shown)
    disc = spectra.disc_transfer(90 * camera.aperture.blur(9.0) / 9, middles)
    low = middles < 0.15
    np.testing.assert_allclose(np.sqrt(blurred / sharp)[low], np.abs(disc)[low], atol=0.08)
    local = spectra.local_power(shown[0] - shown[0][0, 0], edges)
    bare = power.radial_power(shown[0] - shown[0][0, 0], edges)
    np.testing.assert_allclose(local.sum((1, 2)) * 96**2, bare, rtol=1e-3)


def variance(picture):
    """Of its light along x, in square pixels."""
    light = picture[..., 0].astype(np.float32)
    to_linear(light)
    along = light.sum(axis=0) / light.sum()
    x = np.arange(len(along))
    return (along * (x - (along * x).sum()) ** 2).sum()


@pytest.mark.parametrize("depth", [4.0, 9.0])
def test_many_pinholes_spread_a_point_as_far_as_the_disc_says(tool, depth):
    pictures, device = tool("paper.aperture_pictures"), open_device()
    K = [[90, 0, 32], [0, 90, 32], [0, 0, 1]]
    camera = Camera((64, 64), K, np.eye(4), aperture=Aperture(0.3, 4.0))
    shape = {"quats": [[1, 0, 0, 0]], "scales": [[0.05] * 3], "opacities": [0.9]}
    splats = Splats.upload(device, means=[[0, 0, depth]], colors=[[1, 1, 1]], **shape)
    drawn = pictures.Drawn(Renderer(SplatSettings(), device=device), splats, device.zeros(3))
    sharp = pictures.pinhole(camera)
    gained = variance(pictures.many_pinholes(drawn, camera)) - variance(drawn.picture(sharp))
    diameter = 90 * camera.aperture.blur(depth) / depth
    assert gained == pytest.approx(diameter**2 / 16, rel=0.05, abs=0.02)
    assert np.linalg.norm(pictures.pupil_points(100), axis=1).max() < 1
    with pytest.raises(InputError, match="no aperture"):
        pictures.many_pinholes(drawn, sharp)


def test_every_fourth_azimuth_is_scored_with_all_its_apertures(tool, plan, monkeypatch, tmp_path):
    pictures = tool("paper.aperture_pictures")
    capture = plan.captures.ring
    seen, unseen = pictures.split_azimuths(capture, tmp_path / "split")
    assert len(open_capture(seen).views) == 45 and len(open_capture(unseen).views) == 15
    names = [view.image.stem for view in open_capture(unseen).views]
    assert names[:6] == ["0000", "0001", "0002", "0012", "0013", "0014"]


def test_a_capture_that_is_missing_is_asked_for(tool, plan, tmp_path):
    pictures = tool("paper.aperture_pictures")
    given = replace(plan, full=True, ornament=replace(plan.ornament, ring=tmp_path / "orbit"))
    with pytest.raises(InputError, match=r"transforms\.json"):
        pictures.lens_capture(given, None)
