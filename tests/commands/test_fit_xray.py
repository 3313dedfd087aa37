"""``rift fit xray`` from a scan to splats, slices and a report."""

from __future__ import annotations

import json
import re
import shutil

import numpy as np
import pytest

import rift_cl as rift
from rift_cl.commands.cli import main
from rift_cl.commands.fit.kind import kind_of_fit
from rift_cl.commands.fit_xray.job import XrayFit
from rift_cl.commands.fit_xray.settings import FitXraySettings
from rift_cl.errors import CheckpointError, InputError, StoppedError
from rift_cl.geometry.seen_grid import seen_grid
from rift_cl.io.scans.formats import open_scan
from rift_cl.io.volumes import read_volume, read_volume_place
from rift_cl.metrics import psnr
from rift_cl.splat.voxels import voxelise

SIZE, VIEWS, PITCH = 48, 36, 0.5


@pytest.fixture(scope="module")
def scans(tmp_path_factory):
    """The head in one slice and in four, 48 x 48, from 36 views; and the true slices."""
    folder, found = tmp_path_factory.mktemp("scans"), {}
    for rows in (1, 4):
        grid = rift.Grid((rows, SIZE, SIZE), PITCH)
        scan = rift.Parallel(np.arange(VIEWS) * np.pi / VIEWS, SIZE, PITCH)
        values = 0.2 * rift.phantom.shepp_logan_sinogram(grid, scan)
        path = folder / f"{rows}.npz"
        np.savez(path, projections=values, angles=scan.angles, pitch=PITCH)
        found[rows] = path, 0.2 * rift.phantom.shepp_logan(grid)
    return found


def settings(path, out, **more):
    given = {"steps": 60, "splats": 400, "center": (SIZE - 1) / 2, "checkpoint_every": 20}
    return FitXraySettings.of(path, out, **(given | more))


def fit(path, out, *more, splats=400):
    arguments = ["fit", "xray", str(path), "--out", str(out), "--steps", "60"]
    arguments += ["--splats", str(splats), "--center", str((SIZE - 1) / 2), "--quiet"]
    return main([*arguments, *more])


@pytest.mark.parametrize("rows", [1, 4])
def test_a_scan_becomes_densities_slices_and_a_report(scans, tmp_path, capsys, rows):
    path, truth = scans[rows]
    out = tmp_path / "fit"
    splats = 400 * rows
    by = "coverage" if rows == 1 else "ramp"
    unit = ("--unit", "mm") if rows == 4 else ()
    more = ("--homogenise", "0.5", "--homogenise-by", by, "--steps", "120", *unit)
    assert fit(path, out, *more, splats=splats) == 0
    assert "held out" in capsys.readouterr().out
    slices = read_volume(out / "slices")
    metrics = json.loads((out / "metrics.json").read_text())
    scores = metrics["scores"]["held out"]
    assert slices.shape == truth.shape and slices.min() >= 0
    # Filtered backprojection of these views has 21.5 dB and less.
    assert psnr(slices, truth, peak=0.2) > 22
    assert scores["fit_error"] < scores["fbp_error"] and metrics["start_error"] < 0.25
    scene = rift.SplatScene.load(out / "scene.ply")
    assert scene.mode == "xray" and len(scene) == splats == metrics["splats"]
    assert slices.sum() == pytest.approx(truth.sum(), rel=0.05)
    # Everything is in the scan's unit: the head is as large, and so is the splats' mass. Above and
    # below a stack of rows they may hold some that no row sees.
    assert 0.6 < np.abs(scene.means[:, :2]).max() / (0.5 * SIZE * PITCH) < 1.1
    mass = np.exp(scene.logit_opacities + scene.log_scales[:, :2].sum(axis=1))
    if rows == 1:
        area = 2 * np.pi * mass.sum()
        assert area == pytest.approx(truth.sum() * PITCH**2, rel=0.05)
    # Whoever sums the file's Gaussians as they are has the density that slices and scores show.
    assert scene.eps2d == 0
    raised = rift.Grid(slices.shape, PITCH, ((rows - 1) / 2 * PITCH, 0, 0))
    device = rift.default_device()
    summed = device.get(voxelise(device, scene.upload(device), raised))
    assert np.linalg.norm(summed - slices) < 2e-3 * np.linalg.norm(slices)
    page = (out / "report.html").read_text()
    assert page.count('class="slider"') == 1 and "filtered backprojection" in page
    assert f"Attenuation per {'mm' if unit else 'unit of length'}:" in page
    config = json.loads((out / "config.json").read_text())
    assert config["complete"] and config["job"] == "fit xray"


@pytest.mark.full
def test_one_row_stays_in_its_slice(scans, tmp_path):
    assert fit(scans[1][0], tmp_path / "fit") == 0
    scene = rift.SplatScene.load(tmp_path / "fit" / "scene.ply")
    assert (scene.means[:, 2] == 0).all() and (scene.quats[:, 1:3] == 0).all()
    # Half a bin, and the detector's blur.
    across = np.sqrt(0.25 + 0.1) * PITCH
    np.testing.assert_allclose(np.exp(scene.log_scales[:, 2]), across, rtol=1e-5)
    assert (scene.quats[:, 3] != 0).any()


@pytest.mark.full
def test_the_unit_of_line_integrals_changes_nothing_but_the_unit(scans, tmp_path):
    path, _ = scans[1]
    scan = open_scan(path)
    other = tmp_path / "thousand.npz"
    values = 1024 * scan.read(0, 1).projections
    np.savez(other, projections=values, angles=scan.angles, pitch=PITCH)
    found = []
    for number, source in enumerate((path, other)):
        list(XrayFit(settings(source, tmp_path / str(number))).run())
        found.append(rift.SplatScene.load(tmp_path / str(number) / "scene.ply"))
    np.testing.assert_array_equal(found[0].means, found[1].means)
    np.testing.assert_allclose(
        found[1].logit_opacities - found[0].logit_opacities, np.log(1024), rtol=1e-5
    )


@pytest.mark.full
def test_a_fit_that_was_broken_off_goes_on_to_the_same_bits(scans, tmp_path):
    path, more = scans[4][0], {"homogenise": 1.0, "steps": 140}
    whole, cut = tmp_path / "whole", tmp_path / "cut"
    list(XrayFit(settings(path, whole, **more)).run())
    for resume, after in ((False, 25), (True, 110)):
        job = XrayFit(settings(path, cut, resume=resume, **more))
        with pytest.raises(StoppedError, match=r"rift fit xray .*--resume"):
            for report in job.run():
                if report.what == "steps" and report.done >= after:
                    job.stop()
    assert not (cut / "scene.ply").exists()
    list(XrayFit(settings(path, cut, resume=True, **more)).run())
    assert (cut / "scene.ply").read_bytes() == (whole / "scene.ply").read_bytes()


def test_a_fit_goes_on_with_the_scan_that_it_began_with_alone(scans, tmp_path):
    path, out = tmp_path / "scan.npz", tmp_path / "fit"
    shutil.copy(scans[1][0], path)
    job = XrayFit(settings(path, out, checkpoint_every=20))
    with pytest.raises(StoppedError):
        for report in job.run():
            if report.what == "steps" and report.done >= 25:
                job.stop()
    moved = path.rename(tmp_path / "moved.npz")
    job = XrayFit(settings(moved, out, checkpoint_every=20, resume=True))
    with pytest.raises(StoppedError):
        for report in job.run():
            if report.what == "steps":
                job.stop()
    moved.rename(path)
    with np.load(path) as archive:
        arrays = dict(archive)
    arrays["projections"] = arrays["projections"] * 1.1
    np.savez(path, **arrays)
    with pytest.raises(CheckpointError, match=r"scan\.npz was changed since"):
        list(XrayFit(settings(path, out, checkpoint_every=20, resume=True)).run())


def test_a_dry_run_writes_nothing(scans, tmp_path, capsys):
    assert fit(scans[4][0], tmp_path / "fit", "--dry-run", "--rows", "1", "3") == 0
    printed = capsys.readouterr().out
    assert "1 to 2" in printed and "31 projections" in printed and "5 projections" in printed
    assert not (tmp_path / "fit").exists()


@pytest.mark.full
def test_a_scan_of_counts_finds_its_own_axis(scan, tmp_path):
    """Flat and dark frames, the logarithm and the rotation axis come from the scan."""
    given = settings(scan.counts, tmp_path / "fit", center=None, rows=(1, 2), format="h5")
    list(XrayFit(given).run())
    metrics = json.loads((tmp_path / "fit" / "metrics.json").read_text())
    assert metrics["center"] == pytest.approx(45.0, abs=0.3)
    slices = read_volume(tmp_path / "fit" / "volume.h5")
    assert slices.shape == (1, 96, 96) and metrics["scores"]["held out"]["fit_error"] < 0.12


@pytest.mark.parametrize(
    ("more", "words"),
    [
        (["--rows", "3", "9"], "--rows is 3 9"),
        (["--center", "1000"], "--center is 1000"),
        (["--hold-out", "1"], "leaves no projection"),
        (["--memory", "1K"], "fewer rows"),
        (["--pitch", "-1"], "pitch is -1"),
    ],
)
def test_what_makes_no_sense_is_named_and_leaves_nothing(scans, tmp_path, capsys, more, words):
    assert fit(scans[4][0], tmp_path / "fit", *more) == 3
    assert words in capsys.readouterr().err
    assert not (tmp_path / "fit").exists()


@pytest.mark.parametrize("option", ["--test", "--light", "--refine-poses", "--strategy"])
def test_there_are_no_options_about_photographs(scans, tmp_path, capsys, option):
    with pytest.raises(SystemExit) as caught:
        fit(scans[4][0], tmp_path / "fit", option, "linear")
    assert caught.value.code == 2 and option in capsys.readouterr().err


def test_what_no_view_shows_is_told_before_the_fit(scans, tmp_path):
    """A third of the directions, and what is beyond the detector; of the whole scan neither."""
    path, _ = scans[4]
    scan = open_scan(path)
    values, views = scan.read(0, 4).projections, slice(0, 24)
    np.savez(tmp_path / "cut.npz", projections=values[views, :, 12:36], angles=scan.angles[views])
    told = []
    for source, center in ((path, 23.5), (tmp_path / "cut.npz", 11.5)):
        given = settings(source, tmp_path / "fit", center=center, kind="attenuation")
        job = XrayFit(given)
        job.input.read()
        told.append(job.input.notes)
    whole, cut = (" ".join(notes) for notes in told)
    for words in ("65 of 180 degrees have no view (115 to 180", "beyond a side of the detector"):
        assert words in cut and words not in whole


def test_options_of_scans_are_not_those_of_photographs(capture, tmp_path, capsys):
    with pytest.raises(SystemExit) as caught:
        main(["fit", str(capture), "--out", str(tmp_path / "fit"), "--center", "3"])
    assert caught.value.code == 2 and "--center" in capsys.readouterr().err


def test_photographs_are_no_scan_and_air_is_no_object(capture, tmp_path, capsys):
    assert fit(capture, tmp_path / "fit") == 3
    capsys.readouterr()
    np.savez(tmp_path / "air.npz", sinogram=np.zeros((9, 20)), angles=np.arange(9) / 3)
    job = XrayFit(settings(tmp_path / "air.npz", tmp_path / "air", center=9.5))
    with pytest.raises(InputError, match="nothing to fit"):
        list(job.run())
    assert not (tmp_path / "air").exists()


def test_the_command_follows_from_what_it_is_given(scans, capture, tmp_path):
    scan, folder = str(scans[1][0]), str(capture)
    assert kind_of_fit([scan, "--steps", "3"]) == kind_of_fit(["--overwrite", scan]) == "xray"
    assert kind_of_fit(["--out", scan, folder]) == kind_of_fit(["--steps", "3"]) == "photos"
    (tmp_path / "config.json").write_text('{"job": "fit xray"}')
    assert kind_of_fit(["--config", str(tmp_path / "config.json")]) == "xray"
    described = tmp_path / "described.yaml"
    described.write_text("projections: frames\nsource_to_axis: 2\n")
    assert kind_of_fit([str(described)]) == "xray"
    (tmp_path / "described.json").write_text('{"geometry": "a.geom"}')
    assert kind_of_fit([str(tmp_path / "described.json")]) == "xray"
    assert kind_of_fit([str(capture / "transforms.json")]) == "photos"
    out = tmp_path / "fit"
    assert main(["fit", scan, "--out", str(out), "--steps", "2", "--splats", "9", "--quiet"]) == 0
    assert json.loads((out / "config.json").read_text())["job"] == "fit xray"


@pytest.mark.full
def test_the_real_tooth_from_one_command(shared_data, tmp_path):
    path = shared_data / "tooth" / "tooth.h5"
    if not path.is_file():
        pytest.skip(f"no real scan: {path} is absent")
    assert fit(path, tmp_path / "fit", "--rows", "0", "1", "--center", "296") == 0
    scores = json.loads((tmp_path / "fit" / "metrics.json").read_text())["scores"]["held out"]
    assert scores["fit_error"] < 0.15


@pytest.fixture(scope="module")
def cone(tmp_path_factory):
    """Two balls, one of them off the middle, from 32 views of a cone; and the true volume."""
    scan = rift.Cone(np.arange(32) * np.pi / 16, 20, 26, 1.0, 40, 80, center=(8.5, 12.5))
    balls = [
        rift.phantom.Ellipsoid((0.0, 0.0, 0.0), (3.0, 4.0, 4.0), 0.0, 0.2),
        rift.phantom.Ellipsoid((1.2, -1.0, 1.5), (1.0, 1.0, 1.0), 0.0, 0.3),
    ]
    path = tmp_path_factory.mktemp("cone") / "cone.npz"
    np.savez(
        path,
        sinogram=rift.phantom.project(balls, seen_grid(scan), scan),
        angles=scan.angles,
        source_to_axis=40.0,
        source_to_detector=80.0,
        pitch=1.0,
        center=np.array(scan.center),
    )
    return path, balls


def test_a_cone_beam_becomes_densities(cone, tmp_path):
    path, balls = cone
    given = settings(path, tmp_path / "fit", center=None, splats=800)
    list(XrayFit(given).run())
    slices = read_volume(tmp_path / "fit" / "slices")
    grid = seen_grid(open_scan(path).cone)
    truth = rift.phantom.render(balls, grid)
    assert slices.shape == truth.shape == (20, 26, 26)
    assert slices.sum() == pytest.approx(truth.sum(), rel=0.03)
    # Upside down, or from the other side, they would be no better than nothing.
    assert psnr(slices, truth, peak=0.5) > psnr(slices, truth[::-1], peak=0.5) + 6
    assert psnr(slices, truth, peak=0.5) > psnr(slices, truth[:, ::-1], peak=0.5) + 3
    scores = json.loads((tmp_path / "fit" / "metrics.json").read_text())["scores"]["held out"]
    assert scores["fit_error"] < 0.09


def test_splats_move_as_far_however_far_the_source_is(tmp_path):
    """Rates of positions go by the volume: parallel beams and far sources are the same scan."""
    ball = rift.phantom.Ellipsoid((1.2, -1.0, 1.5), (3.0, 4.0, 4.0), 0.0, 0.2)
    angles, errors = np.arange(32) * np.pi / 16, []
    for number, away in enumerate((None, 40_000.0)):
        if away is None:
            scan, facts = rift.Parallel(angles, 24, 0.5), {}
            grid = rift.Grid((18, 24, 24), 0.5)
        else:
            scan = rift.Cone(angles, 18, 24, 1.0, away, 2 * away)
            facts = {"source_to_axis": away, "source_to_detector": 2 * away}
            grid = seen_grid(scan)
        values = rift.phantom.project([ball], grid, scan)
        path = tmp_path / f"{number}.npz"
        np.savez(path, sinogram=values, angles=angles, pitch=0.5 if away is None else 1.0, **facts)
        list(XrayFit(settings(path, tmp_path / str(number), center=11.5, splats=300)).run())
        metrics = json.loads((tmp_path / str(number) / "metrics.json").read_text())
        errors.append(metrics["scores"]["held out"]["fit_error"])
    assert errors[1] == pytest.approx(errors[0], rel=0.1)


@pytest.mark.parametrize("what", ["below zero", "few views", "noise", "cut off"])
def test_densities_below_zero_are_told_and_streaks_are_not(tmp_path, what):
    """Splats cannot be negative; filtered backprojection is, in more ways than one."""
    grid, views = rift.Grid((8, 32, 32)), 9 if what == "few views" else 32
    scan = rift.Parallel(np.arange(views) * np.pi / views, 32)
    shapes = [rift.phantom.Ellipsoid((0.0, 0.0, 0.0), (9.0, 12.0, 12.0), 0.0, 0.2)]
    if what == "below zero":
        shapes.append(rift.phantom.Ellipsoid((0.0, 2.0, 6.0), (3.0, 3.0, 3.0), 0.0, -0.3))
    values = rift.phantom.project(shapes, grid, scan)
    if what == "noise":
        values += 0.3 * np.random.default_rng(0).normal(size=values.shape)
    if what == "cut off":
        values = values[..., 8:-8]
    np.savez(tmp_path / "scan.npz", projections=values, angles=scan.angles, pitch=1.0)
    given = {"center": (values.shape[-1] - 1) / 2, "kind": "attenuation", "steps": 100}
    job, notes = XrayFit(settings(tmp_path / "scan.npz", tmp_path / "fit", **given)), []
    job.announce = notes.append
    list(job.run())
    told = [note for note in notes if "below zero" in note]
    assert len(told) == (what == "below zero")
    # -0.1 is blurred by a voxel.
    lowest = [float(re.search(r"down to (\S+) per", note)[1]) for note in told]
    assert all(-0.1 < value < -0.05 for value in lowest)


@pytest.mark.full
def test_volumes_lie_where_those_of_reconstruct_do(scans, cone, tmp_path):
    (parallel, _), (point, _) = scans[4], cone
    axis, few = (SIZE - 1) / 2, {"steps": 1, "hold_out": 0, "format": "h5"}
    given = {"center": axis, "rows": (1, 3), "unit": "mm"}
    for name, path, options in (("parallel", parallel, given), ("cone", point, {"center": 12.5})):
        fitted, sliced = tmp_path / f"{name} fit", tmp_path / f"{name} slices"
        list(XrayFit(settings(path, fitted, splats=50, **{**few, **options})).run())
        rift.reconstruct_scan(path, sliced, format="h5", kind="attenuation", **options)
        place = read_volume_place(fitted / "volume.h5")
        assert place.origin == pytest.approx(read_volume_place(sliced / "volume.h5").origin)
        assert place.origin[0] == pytest.approx(PITCH if name == "parallel" else -8.5 / 2)


@pytest.mark.parametrize(
    ("option", "value"), [("--rows", ("0", "4")), ("--pitch", ("2",))], ids=["rows", "pitch"]
)
def test_what_a_cones_geometry_has_settled_is_no_option(cone, tmp_path, capsys, option, value):
    assert main(["fit", "xray", str(cone[0]), "--out", str(tmp_path / "f"), option, *value]) == 3
    assert option in capsys.readouterr().err
    assert not (tmp_path / "f").exists()
