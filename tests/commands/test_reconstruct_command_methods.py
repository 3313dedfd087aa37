"""Methods, windows and geometries of ``rift reconstruct``, each against a slice that is known."""

import dataclasses
import json

import h5py
import numpy as np
import pytest

import rift_cl as rift
from rift_cl.commands.cli import main
from rift_cl.commands.reconstruct.job import Reconstruction
from rift_cl.commands.reconstruct.settings import ReconstructSettings
from rift_cl.geometry.fan import FanBeam
from rift_cl.io import read_volume
from rift_cl.io.scans import formats

SIZE, VIEWS = 64, 90
HALF, FULL = np.arange(VIEWS) * np.pi / VIEWS, np.arange(2 * VIEWS) * np.pi / VIEWS


def run(*arguments):
    return main([str(argument) for argument in arguments])


def save_phantom(path, angles, bins, center=None, size=SIZE, rows=1, offset=0.0):
    """Write line integrals of the phantom, 0.2 times its values, and give its true slice."""
    grid, scan = rift.Grid((size, size)), rift.Parallel(angles, bins, center=center)
    integrals = 0.2 * rift.phantom.shepp_logan_sinogram(grid, scan)
    stack = np.repeat(integrals[:, None], rows, axis=1) + offset
    np.savez(path, projections=stack, angles=angles)
    return 0.2 * rift.phantom.shepp_logan(grid)


def reconstruct(path, out, *options):
    """The volume that a command leaves, and what it assumed."""
    assert run("reconstruct", path, "--out", out, *options) == 0
    metrics = json.loads((out / "metrics.json").read_text())
    return read_volume(out / "slices"), " ".join(metrics["assumed"])


def error(image, truth):
    return np.sqrt(np.mean((image - truth) ** 2)) / np.sqrt(np.mean(truth**2))


@pytest.fixture(scope="module")
def half(tmp_path_factory):
    path = tmp_path_factory.mktemp("half") / "scan.npz"
    return path, save_phantom(path, HALF, 72, rows=2)


@pytest.mark.parametrize(
    "options",
    [
        ("--method", "fbp", "--compensate", "capped-voronoi"),
        ("--method", "fbp", "--footprint", "strip"),
        ("--method", "fbp", "--error", 1e-3),
        ("--method", "cgls", "--steps", 8, "--error", 1e-3),
        ("--method", "sirt", "--steps", 40, "--nonnegative"),
        ("--method", "cgls", "--steps", 8, "--footprint", "joseph"),
        ("--method", "cgls", "--steps", 2, "--precondition", "ramp"),
        ("--method", "cgls", "--steps", 8, "--weights", "counts"),
        ("--method", "sirt", "--steps", 40, "--weights", "counts", "--nonnegative"),
        ("--method", "tv", "--steps", 150, "--nonnegative"),
    ],
)
def test_every_method_finds_the_slice(half, tmp_path, options):
    path, truth = half
    volume, _ = reconstruct(path, tmp_path / "out", "--center", 35.5, "--size", SIZE, *options)
    assert volume.shape == (2, SIZE, SIZE)
    assert error(volume[0], truth) < 0.4
    np.testing.assert_allclose(volume[0], volume[1], atol=1e-6)
    if "--nonnegative" in options:
        assert volume.min() >= 0


@pytest.mark.full
def test_an_unfiltered_backprojection_has_no_unit(half, tmp_path, capsys):
    path, _ = half
    options = ("--center", 35.5, "--unit", "mm", "--format", "h5", "--method", "backproject")
    found = []
    for pitch in (0.5, 5.0):
        out = tmp_path / f"{pitch}"
        assert run("reconstruct", path, "--out", out, "--pitch", pitch, *options) == 0
        with h5py.File(out / "volume.h5") as file:
            found.append(file["volume"][...])
            assert file["volume"].attrs["value_unit"] == "1"
        assert "per mm" not in capsys.readouterr().out + (out / "report.html").read_text()
    np.testing.assert_allclose(*found, rtol=1e-5)


@pytest.mark.full
def test_steps_end_where_noise_is_left(half, tmp_path):
    path, _ = half
    common = ("--center", 35.5, "--method", "cgls", "--steps", 30)
    reconstruct(path, tmp_path / "out", *common, "--noise", 0.2)
    metrics = json.loads((tmp_path / "out/metrics.json").read_text())
    assert metrics["steps"] < 30
    assert metrics["residual"] <= 0.2


@pytest.mark.parametrize("method", ["fbp", "cgls"])
def test_a_part_of_a_slice_is_that_part(half, tmp_path, method):
    path, _ = half
    common = ("--center", 35.5, "--method", method)
    whole, _ = reconstruct(path, tmp_path / "whole", *common)
    part, _ = reconstruct(path, tmp_path / "part", *common, "--roi", 10, 40, 25, 60)
    assert part.shape == (2, 35, 30)
    np.testing.assert_allclose(part, whole[:, 25:60, 10:40], atol=2e-3)


@pytest.mark.parametrize("method", ["fbp", "sirt"])
def test_pixels_of_another_size_hold_the_same_values(half, tmp_path, method):
    path, truth = half
    options = ("--center", 35.5, "--method", method, "--pixel", 2, "--size", SIZE // 2)
    volume, _ = reconstruct(path, tmp_path / "out", *options)
    coarse = truth.reshape(SIZE // 2, 2, SIZE // 2, 2).mean(axis=(1, 3))
    assert volume[0].mean() == pytest.approx(coarse.mean(), rel=0.05)
    assert error(volume[0], coarse) < 0.4


@pytest.mark.parametrize("center", [6.4, 39.0 - 6.4])
@pytest.mark.parametrize("options", [(), ("--method", "sirt", "--steps", 60)])
def test_a_full_turn_with_an_offset_axis_needs_no_word(tmp_path, center, options):
    path = tmp_path / "scan.npz"
    truth = save_phantom(path, FULL, 40, center)
    volume, assumed = reconstruct(path, tmp_path / "out", "--size", SIZE, *options)
    assert "slices extend to the farther end" in assumed
    assert ("opposite views were combined" in assumed) == (not options)
    metrics = json.loads((tmp_path / "out/metrics.json").read_text())
    assert metrics["center"] == pytest.approx(center, abs=0.2)
    assert error(volume[0], truth) < 0.35
    t = np.arange(SIZE) - (SIZE - 1) / 2
    seen = np.hypot(t[:, None], t) < 31  # by every view; corners are not
    assert volume[0][seen].mean() == pytest.approx(truth[seen].mean(), rel=0.02)


@pytest.mark.parametrize(
    ("degrees", "compensate"),
    [
        (np.r_[0:90:3, 90:120], "covered"),
        (np.arange(120), "uniform"),
        (np.r_[0:30, 30:180:3], "voronoi"),
    ],
)
def test_weights_of_views_that_nobody_chose_can_be_chosen_again(tmp_path, degrees, compensate):
    path = tmp_path / "scan.npz"
    save_phantom(path, np.deg2rad(degrees), 40, size=36)
    first, said = reconstruct(path, tmp_path / "first", "--center", 19.5)
    assert ("have no view (119 to 180" in said) == (compensate != "voronoi")
    config = tmp_path / "first" / "config.json"
    assert json.loads(config.read_text())["settings"]["compensate"] == compensate
    again, _ = reconstruct(path, tmp_path / "again", "--config", config)
    np.testing.assert_array_equal(again, first)


@pytest.mark.parametrize("angles", [np.delete(FULL, 70), np.linspace(0, 2 * np.pi, 37)])
def test_views_of_an_offset_axis_stand_for_their_own_side(tmp_path, angles):
    """Where one is missing or both ends of the turn are there, as ``fbp`` has it."""
    path = tmp_path / "scan.npz"
    save_phantom(path, angles, 40, 6.4)
    volume, told = reconstruct(path, tmp_path / "out", "--kind", "attenuation", "--center", 6.4)
    # Directions are counted once, whether the turn is closed or not.
    assert "limited angle" not in told
    A = rift.Projector(rift.Grid((67, 67)), rift.Parallel(angles, 40, center=6.4))
    with np.load(path) as scan:
        image = rift.fbp(A, scan["projections"][:, 0].astype(np.float32))
    np.testing.assert_allclose(volume[0], image, atol=1e-4 * image.max())


@pytest.mark.full
@pytest.mark.parametrize(
    ("method", "missing", "wide", "said"),
    [
        ("fbp", 4, True, "no view between 78 and 88 degrees: those beside them"),
        ("fbp", 20, False, "none between 78 and 120 degrees): objects that reach further"),
        ("cgls", 20, True, "no view between 78 and 120 degrees: what they alone"),
    ],
)
def test_a_hole_in_the_turn_of_an_offset_axis_is_told(tmp_path, method, missing, wide, said):
    path, angles = tmp_path / "scan.npz", np.delete(FULL, range(40, 40 + missing))
    save_phantom(path, angles, 40, 6.4)
    options = ("--kind", "attenuation", "--center", 6.4, "--method", method)
    volume, assumed = reconstruct(path, tmp_path / "out", *options)
    assert volume.shape[1:] == ((67, 67) if wide else (40, 40))
    assert said in assumed
    assert ("wider than the detector" in assumed) == (not wide)
    if method == "fbp":
        stitched = ("--half-acquisition", "stitched", "--out", tmp_path / "stitched")
        assert run("reconstruct", path, *options, *stitched) == 3
        assert not (tmp_path / "stitched/slices").exists()


def test_a_full_turn_whose_axis_is_off_by_a_little_has_the_rim(tmp_path):
    path, bins, center, fine = tmp_path / "scan.npz", 48, 21.5, 8
    away = (np.arange(bins * fine) + 0.5) / fine - 0.5 - center
    radius = 0.98 * (bins - 1 - center)
    chords = 2 * np.sqrt(np.clip(radius**2 - away**2, 0, None)).reshape(bins, fine).mean(axis=1)
    np.savez(path, projections=np.tile(chords, (180, 1))[:, None], angles=FULL)
    options = ("--kind", "attenuation", "--center", center)
    volume, assumed = reconstruct(path, tmp_path / "out", *options)
    assert "wider than the detector" not in assumed
    t = np.arange(bins) - (bins - 1) / 2
    rim = np.abs(np.hypot(t[:, None], t) - 0.85 * radius) < 0.1 * radius
    assert np.sqrt(np.mean((volume[0][rim] - 1) ** 2)) < 0.02


@pytest.mark.parametrize("beyond", [False, True])
def test_slices_of_an_offset_axis_reach_to_the_farther_end(tmp_path, beyond):
    """And it is said where the object does not end there."""
    path = tmp_path / "scan.npz"
    save_phantom(path, FULL, 40, 6.4, size=90 if beyond else SIZE)
    volume, said = reconstruct(path, tmp_path / "out", "--kind", "attenuation", "--center", 6.4)
    assert volume.shape[1:] == (67, 67)
    assert ("beyond that end as well" in said) == beyond


@pytest.mark.full
def test_an_object_wider_than_the_detector_is_continued(tmp_path):
    path, bins = tmp_path / "scan.npz", 40
    truth = save_phantom(path, HALF, bins, size=80)[20:60, 20:60]
    middle = ("--kind", "attenuation", "--center", (bins - 1) / 2)
    padded, assumed = reconstruct(path, tmp_path / "auto", *middle)
    plain, _ = reconstruct(path, tmp_path / "off", *middle, "--pad", "off")
    assert "extrapolated smoothly" in assumed
    t = np.arange(bins) - (bins - 1) / 2
    border = np.abs(np.hypot(t[:, None], t) - 17.5) < 1.5
    bias = [abs((image[0] - truth)[border].mean()) for image in (padded, plain)]
    assert bias[0] < 0.3 * bias[1]
    steps = ("--method", "sirt", "--steps", 30)
    explained, assumed = reconstruct(path, tmp_path / "sirt", *middle, *steps)
    assert "margin of 20 bins" in assumed
    assert "extrapolated smoothly" not in assumed
    assert explained.shape == padded.shape
    assert abs((explained[0] - truth)[border].mean()) < 0.3 * bias[1]


@pytest.mark.full
def test_the_axis_is_that_of_the_rows_that_are_wanted_beside_air(tmp_path):
    path, stack = tmp_path / "scan.npz", np.zeros((VIEWS, 40, 72))
    for first, center in ((1, 35.5), (30, 38.0)):
        save_phantom(path, HALF, 72, center, rows=8)
        with np.load(path) as scan:
            stack[:, first : first + 8] = scan["projections"]
    np.savez(path, projections=stack, angles=HALF)
    options = ("--kind", "attenuation", "--rows", 30, 38, "--method", "backproject")
    _, assumed = reconstruct(path, tmp_path / "out", *options)
    assert "as most show air" in assumed
    metrics = json.loads((tmp_path / "out/metrics.json").read_text())
    assert metrics["center"] == pytest.approx(38.0, abs=0.5)


@pytest.mark.full
def test_the_background_is_brought_to_zero(tmp_path):
    path = tmp_path / "scan.npz"
    truth = save_phantom(path, HALF, 80, offset=0.7)
    options = ("--kind", "attenuation", "--center", 39.5, "--size", SIZE, "--pad", "off")
    volume, assumed = reconstruct(path, tmp_path / "out", *options, "--background", 5)
    assert "outermost 5 bins" in assumed
    assert error(volume[0], truth) < 0.3
    plain, _ = reconstruct(path, tmp_path / "plain", *options)
    assert error(plain[0], truth) > 1.5 * error(volume[0], truth)


def test_rings_are_taken_out_of_counts_alone_unless_told(scan, half, tmp_path):
    cases = [
        (scan.counts, "auto", "vo"),
        (scan.counts, "off", None),
        (half[0], "auto", None),
        (half[0], "on", "vo"),
    ]
    for path, rings, expected in cases:
        settings = ReconstructSettings(path, out=tmp_path / "out", center=40, rings=rings)
        assert Reconstruction(settings).source.clean.rings == expected


@pytest.fixture
def fan_wedge(monkeypatch):
    """Let readers say that a file's views are those of a fan beam."""
    fan, opened = FanBeam(200, 300, 1.5, 35.5), formats.open_scan
    monkeypatch.setattr(
        formats,
        "open_scan",
        lambda *a, **k: dataclasses.replace(opened(*a, **k), fan=fan, pitch=fan.pitch),
    )
    return fan


def save_fan(path, fan, angles):
    gamma = fan.fan_angles(72)
    t = fan.source_to_axis * np.sin(gamma)
    # A disc of radius 20 and value 0.1 at (4, -3).
    theta = angles[:, None] - gamma
    off = t - 4 * np.cos(theta) + 3 * np.sin(theta)
    views = 0.2 * np.sqrt(np.maximum(20.0**2 - off**2, 0))
    np.savez(path, projections=views[:, None], angles=angles)


@pytest.mark.parametrize("options", [(), ("--method", "cgls", "--steps", 12)])
@pytest.mark.parametrize("degrees", [360, 60])
def test_how_a_fan_is_taken_is_said(tmp_path, fan_wedge, options, degrees):
    path = tmp_path / "fan.npz"
    save_fan(path, fan_wedge, np.deg2rad(np.arange(0, degrees, 1.0)))
    volume, assumed = reconstruct(path, tmp_path / "out", *options, "--size", 60)
    assert ("Fan-beam views were resampled" in assumed) == (degrees == 60 and not options)
    assert ("Filtered backprojection of a fan" in assumed) == (degrees == 360 and not options)
    y, x = np.mgrid[:60, :60] - 29.5
    inside = np.hypot(x - 4, y + 3) < 14
    if degrees == 360:
        assert volume[0][inside].mean() == pytest.approx(0.1, rel=0.03)
    else:
        assert "have no view" in assumed


def test_center_finds_the_axis_of_a_fan(tmp_path, fan_wedge, capsys):
    path = tmp_path / "fan.npz"
    save_fan(path, fan_wedge, np.deg2rad(np.arange(0, 360, 2.0)))
    assert run("center", path, "--out", tmp_path / "out", "--quiet") == 0
    assert float(capsys.readouterr().out) == pytest.approx(35.5, abs=0.1)
