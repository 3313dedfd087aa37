"""``rift reconstruct`` on real scans: a tooth, dendrites, and the Helsinki challenge's wedge."""

import json

import numpy as np
import pytest

from rift_cl.commands.cli import main
from rift_cl.io import read_volume
from rift_cl.io.images.image import read_image


def run(*arguments):
    return main([str(argument) for argument in arguments])


@pytest.mark.full
def test_real_tooth(shared_data, tmp_path):
    tooth = shared_data / "tooth" / "tooth.h5"
    assert run("reconstruct", tooth, "--out", tmp_path / "out") == 0
    volume = read_volume(tmp_path / "out" / "slices")
    assert volume.shape == (2, 640, 640)
    metrics = json.loads((tmp_path / "out" / "metrics.json").read_text())
    assert metrics["center"] == pytest.approx(296, abs=0.5)
    # Enamel and dentine stand out of the air about them, which is zero.
    air, tooth_part = volume[0, 50:150, 50:150], volume[0, 280:340, 240:300]
    assert abs(air.mean()) < 2e-4
    assert tooth_part.mean() > 2e-3


def matthews(found, truth):
    """Matthews correlation of two segmentations, the challenge's score."""
    return np.corrcoef(found.ravel(), truth.ravel())[0, 1]


def otsu(image):
    """The threshold that parts an image into two classes with the least variance (Otsu 1979)."""
    counts, edges = np.histogram(image, 256)
    middle = (edges[1:] + edges[:-1]) / 2
    below, sums = np.cumsum(counts), np.cumsum(counts * middle)
    above = below[-1] - below
    with np.errstate(all="ignore"):
        between = below * above * (sums / below - (sums[-1] - sums) / above) ** 2
    return edges[1:][np.nanargmax(between)]


@pytest.mark.full
def test_rings_of_the_tooth_go_and_its_edges_stay(shared_data, tmp_path):
    tooth, images = shared_data / "tooth" / "tooth.h5", {}
    for rings in ("on", "off"):
        out = tmp_path / rings
        options = ("--center", 295.9, "--rows", 0, 1, "--rings", rings)
        assert run("reconstruct", tooth, "--out", out, *options) == 0
        images[rings] = read_volume(out / "slices")[0]
    # About the axis, the mean over directions differs from that of the radii about it.
    y, x = np.mgrid[:640, :640] - 319.5
    radius = np.hypot(x, y).astype(int).ravel()
    ripple = {}
    for rings, image in images.items():
        mean = np.bincount(radius, image.ravel()) / np.bincount(radius)
        ripple[rings] = np.std(np.diff(mean[5:280], 2))
    assert ripple["on"] < 0.6 * ripple["off"]
    assert np.corrcoef(images["on"].ravel(), images["off"].ravel())[0, 1] > 0.98


@pytest.mark.full
def test_real_dendrites(shared_data, tmp_path):
    path = shared_data / "dendrites" / "RealDataDend.mat"
    out = tmp_path / "out"
    options = ("--rings", "on", "--filter", "hann", "--cutoff", 0.3, "--center", 631.2)
    assert run("reconstruct", path, "--out", out, *options) == 0
    image = read_volume(out / "slices")[0]
    assert image.shape == (1260, 1260)
    air, alloy = image[20:100, 600:660].mean(), image[600:700, 600:700].mean()
    assert abs(air) < 0.15 * alloy


@pytest.mark.full
@pytest.mark.parametrize("scan", ["ta", "tb"])
def test_the_wedge_of_the_helsinki_challenge(shared_data, tmp_path, scan):
    folder, scores = shared_data / "htc2022", {}
    truth = read_image(folder / f"{scan}_category7_truth.png") > 0.5
    methods = {
        "fbp": ("--compensate", "capped-voronoi"),
        "tv": ("--nonnegative", "--weight", 0.2, "--steps", 150, "--pixel", 0.29664),
    }
    for method, options in methods.items():
        path, out = folder / f"{scan}_category7.mat", tmp_path / method
        size = 256 if "--pixel" in options else 512
        common = ("--out", out, "--method", method, "--size", size)
        assert run("reconstruct", path, *common, *options) == 0
        image = read_volume(out / "slices")[0][::-1]
        found = np.kron(image > otsu(image), np.ones((512 // size,) * 2, bool))
        scores[method] = matthews(found, truth)
    assert scores["fbp"] > 0.3
    # The second one is struts, most of which run along directions that no view sees.
    assert scores["tv"] > {"ta": 0.65, "tb": 0.45}[scan]
