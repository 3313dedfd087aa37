"""``rift fit xray`` takes the axis as ``rift reconstruct`` does, and lies where its slices do."""

from __future__ import annotations

import json

import numpy as np
import pytest

import rift_cl as rift
from rift_cl.commands.cli import main
from rift_cl.commands.fit_xray.job import XrayFit
from rift_cl.commands.fit_xray.settings import FitXraySettings
from rift_cl.commands.python_words import in_python
from rift_cl.geometry.seen_grid import seen_grid
from rift_cl.io.volumes import read_volume, read_volume_place

pytestmark = pytest.mark.once

LENGTHS = {"source_to_axis": 60.0, "source_to_detector": 120.0, "pitch": 1.0}


def fitted(path, out, **options):
    """A fit of few steps: the job, what it says, and its figures."""
    given = {"steps": 2, "splats": 300, "format": "h5", "checkpoint_every": 0, **options}
    job, said = XrayFit(FitXraySettings.of(path, out, **given)), []
    job.announce = said.append
    list(job.run())
    return job, " ".join(said), json.loads((out / "metrics.json").read_text())


def settled(out):
    return json.loads((out / "config.json").read_text())["settings"]


def saved(path, projections, angles, **more):
    np.savez(path, projections=projections.astype(np.float32), angles=angles, **more)
    return path


@pytest.fixture
def half(tmp_path):
    """A half acquisition, its axis near the detector's first bin; and the object's mass."""
    angles, grid = np.arange(60) * np.pi / 30, rift.Grid((2, 56, 56))
    scan = rift.Parallel(angles, 32, center=5.0)
    parts = [
        rift.phantom.Ellipsoid((0.0, 1.0, 2.0), (1e4, 20.0, 22.0), 0.0, 0.02),
        rift.phantom.Ellipsoid((0.0, 12.0, -6.0), (1e4, 4.0, 5.0), 0.0, 0.03),
    ]
    path = saved(tmp_path / "half.npz", rift.phantom.project(parts, grid, scan), angles, pitch=1.0)
    return path, float(rift.phantom.render(parts, grid).sum())


@pytest.mark.full
def test_a_half_acquisition_is_fitted_to_the_farther_end(half, tmp_path):
    path, mass = half
    sliced = rift.reconstruct_scan(path, tmp_path / "slices", center=5.0, format="h5")
    job, said, metrics = fitted(path, tmp_path / "fit", center=5.0)
    slices = read_volume(tmp_path / "fit" / "volume.h5")
    assert slices.shape == sliced.read().shape == (2, 53, 53)
    assert job.input.grid.shape == slices.shape and "extend to the farther end" in said
    assert slices.sum() == pytest.approx(mass, rel=0.03)
    scores = metrics["scores"]["held out"]
    assert metrics["start_error"] < 0.15 and scores["fbp_error"] < 0.05


@pytest.fixture
def displaced(tmp_path):
    """A cone whose axis is near one side of the detector, in a full turn of 40 views."""
    angles = np.arange(40) * np.pi / 20
    scan = rift.Cone(angles, 8, 32, 1.0, 60.0, 120.0, center=(3.5, 7.0))
    balls = [
        rift.phantom.Ellipsoid((0.0, 0.5, -0.5), (1.6, 9.0, 8.0), 0.0, 0.05),
        rift.phantom.Ellipsoid((0.2, 4.0, 2.0), (1.0, 2.0, 2.0), 0.0, 0.05),
    ]
    y = rift.phantom.project(balls, seen_grid(scan), scan)
    return saved(tmp_path / "displaced.npz", y, angles, center=np.array(scan.center), **LENGTHS)


@pytest.mark.full
def test_views_that_are_held_out_leave_a_displaced_detector_its_full_turn(displaced, tmp_path):
    _, _, metrics = fitted(displaced, tmp_path / "fit", center=7.0)
    assert metrics["scores"]["held out"]["fbp_error"] < 0.15
    assert metrics["start_error"] < 0.4


@pytest.fixture
def silent_cone(tmp_path):
    """A cone whose file says nothing of its axis, off the middle; in the right sense, and not."""
    angles = np.arange(60) * np.pi / 30
    scan = rift.Cone(angles, 6, 40, 1.0, 60.0, 120.0, center=(2.5, 22.0))
    balls = [
        rift.phantom.Ellipsoid((0.0, 0.0, 0.0), (1.2, 6.0, 7.0), 0.0, 0.05),
        rift.phantom.Ellipsoid((0.2, 3.0, 2.0), (1.0, 1.5, 1.0), 0.0, 0.10),
        rift.phantom.Ellipsoid((0.0, -2.0, 3.0), (1.0, 1.0, 1.5), 0.0, 0.08),
    ]
    y = rift.phantom.project(balls, seen_grid(scan), scan)
    return {
        sense: saved(tmp_path / f"{sense}.npz", y, sense * angles, **LENGTHS) for sense in (1, -1)
    }


@pytest.mark.full
@pytest.mark.parametrize("sense", [1, -1])
def test_axis_and_sense_of_a_cone_are_found(silent_cone, tmp_path, sense):
    out = tmp_path / "fit"
    _, said, metrics = fitted(silent_cone[sense], out)
    assert metrics["center"] == pytest.approx(22.0, abs=0.1)
    assert "The rotation axis was found" in said and ("other sign" in said) == (sense < 0)
    assert metrics["scores"]["held out"]["fbp_error"] < 0.15
    # Its settings say all that was found, so that another fit does the same without asking.
    assert settled(out)["center"] == metrics["center"]
    assert settled(out)["reversed"] == (sense < 0)


@pytest.mark.full
def test_an_axis_that_the_data_of_a_cone_contradict_is_doubted(silent_cone, tmp_path):
    _, said, metrics = fitted(silent_cone[1], tmp_path / "fit", center=19.5)
    assert metrics["center"] == 19.5
    assert "Doubt: the data tell the axis at bin 22" in said and "--center 19.5" in said


def leaning(tilt, rows=16, bins=48, views=40, center=22.3):
    """Projections of columns about an axis that leans, and their angles."""
    angles = np.arange(views) * np.pi / views
    axis = center + np.tan(np.radians(tilt)) * (np.arange(rows) - (rows - 1) / 2)
    t, values = np.arange(bins) - axis[:, None], np.zeros((views, rows, bins))
    columns = ((0, 0, 6, 1.0), (8, 3, 2, 0.6), (-6, -7, 1.8, 0.5), (3, -9, 1.6, 0.5))
    for x, y, size, value in columns:
        away = t - (x * np.cos(angles) + y * np.sin(angles))[:, None, None]
        values += value * np.exp(-((away / size) ** 2) / 2)
    return values, angles


@pytest.mark.full
def test_a_tilted_axis_is_turned_as_slices_have_it(tmp_path):
    path = saved(tmp_path / "leaning.npz", *leaning(3.0), pitch=1.0)
    found, given, unturned = (tmp_path / name for name in ("found", "given", "unturned"))
    sliced = rift.reconstruct_scan(path, tmp_path / "slices", rows=(0, 1))
    job, said, metrics = fitted(path, found)
    turned = "Projections were turned by 3.000 degrees, the tilt of the axis."
    assert turned in said and turned in " ".join(sliced.notes)
    assert settled(found)["tilt"] == pytest.approx(3.0, abs=0.01)
    assert metrics["center"] == pytest.approx(22.3, abs=0.01)
    # Columns stand upright, but where rows beyond the detector's ends are missing.
    values = job.input.read().values[:, 3:-3]
    np.testing.assert_allclose(values, values[:, :1] + 0 * values, atol=0.03)
    # What was found, said again, makes the same splats; said otherwise, it is doubted.
    axis = {"center": settled(found)["center"], "tilt": settled(found)["tilt"]}
    fitted(path, given, **axis)
    assert (given / "scene.ply").read_bytes() == (found / "scene.ply").read_bytes()
    _, said, _ = fitted(path, unturned, tilt=0.0)
    assert (
        "Doubt: the rows' axes lean by 3.00" in said and "turned by" not in said.split("Doubt")[0]
    )


@pytest.mark.full
def test_rows_next_to_those_that_are_fitted_are_read_where_they_are_turned(tmp_path):
    path = saved(tmp_path / "leaning.npz", *leaning(3.0), pitch=1.0)
    job, _, _ = fitted(path, tmp_path / "all")
    few, _, _ = fitted(path, tmp_path / "few", rows=(6, 8))
    whole, part = job.input.read(), few.input.read()
    wanted = whole.scale * whole.values[:, 6:8]
    np.testing.assert_allclose(part.scale * part.values, wanted, rtol=1e-6)


def test_a_tilt_that_is_not_sure_is_told(tmp_path):
    angles, grid = np.arange(45) * np.pi / 45, rift.Grid((48, 48))
    axes = 22.3 + np.tan(np.radians(2.0)) * (np.arange(16) - 7.5)
    scans = [rift.Parallel(angles, 48, center=axis) for axis in axes]
    rows = [rift.phantom.shepp_logan_sinogram(grid, scan) for scan in scans]
    path = saved(tmp_path / "leaning.npz", np.stack(rows, axis=1), angles, pitch=1.0)
    sliced = rift.reconstruct_scan(path, tmp_path / "slices", rows=(0, 1))
    _, said, _ = fitted(path, tmp_path / "fit")
    (sentence,) = (note for note in sliced.notes if "projections were not turned" in note)
    assert sentence in in_python(said, FitXraySettings)


def test_a_tilt_that_is_no_misalignment_is_refused(tmp_path, capsys):
    path = saved(tmp_path / "leaning.npz", *leaning(0.0), pitch=1.0)
    assert main(["fit", "xray", str(path), "--out", str(tmp_path / "fit"), "--tilt", "9"]) == 3
    assert "--tilt" in capsys.readouterr().err


@pytest.mark.parametrize("rows", [None, (3, 9)])
def test_splats_stand_where_the_slices_do(tmp_path, rows):
    angles, grid = np.arange(30) * np.pi / 30, rift.Grid((12, 32, 32), 0.5)
    scan = rift.Parallel(angles, 32, 0.5)
    balls = [rift.phantom.Ellipsoid((-0.3, 1.0, -2.0), (0.9, 3.0, 3.0), 0.0, 0.2)]
    y = rift.phantom.project(balls, grid, scan)
    path, out = saved(tmp_path / "scan.npz", y, angles, pitch=0.5), tmp_path / "fit"
    fitted(path, out, center=15.5, steps=40, rows=rows, splats=200)
    slices, place = read_volume(out / "volume.h5"), read_volume_place(out / "volume.h5")
    scene = rift.SplatScene.load(out / "scene.ply")
    mass = np.exp(scene.logit_opacities + scene.log_scales.sum(axis=1))
    middle = np.array(
        [
            (slices * (first + step * np.indices(slices.shape)[axis])).sum() / slices.sum()
            for axis, (first, step) in enumerate(zip(place.origin, place.spacing, strict=True))
        ]
    )
    np.testing.assert_allclose(mass @ scene.means / mass.sum(), middle[::-1], atol=0.2)
    # Heights count from the detector's row 0, whichever rows are fitted.
    assert middle[0] == pytest.approx(5.5 * 0.5 - 0.3, abs=0.15)


@pytest.mark.parametrize("kind", ["part of a turn", "helix", "displaced"])
def test_cones_that_no_formula_takes_are_fitted(tmp_path, kind):
    """Of a helix it is the held-out views that leave uneven steps."""
    turn, center, height, more = np.arange(72) * np.pi / 36, 11.5, 1.5, {}
    if kind == "part of a turn":
        turn = np.radians(np.linspace(-40, 40, 36))
    elif kind == "helix":
        turn = np.arange(96) * np.pi / 24
        more = {"heights": np.linspace(-1, 1, 96)}
    else:
        turn, center, height = turn[:60], 5.0, 20.0
    scan = rift.Cone(turn, 10, 24, 1.0, 60.0, 120.0, center=(4.5, center), **more)
    balls = [
        rift.phantom.Ellipsoid((0.0, 0.3, -0.3), (height, 4.5, 4.0), 0.0, 0.05),
        rift.phantom.Ellipsoid((0.2, 2.0, 1.0), (0.9, 1.0, 1.0), 0.0, 0.05),
    ]
    y = rift.phantom.project(balls, seen_grid(scan), scan)
    path = saved(tmp_path / "scan.npz", y, turn, center=np.array(scan.center), **more, **LENGTHS)
    _, said, metrics = fitted(path, tmp_path / "fit", center=center, kind="attenuation")
    assert "20 steps of conjugate gradients stand in for it" in said
    assert "cgls, sirt and tv" not in said
    assert ("The source moves along the axis" in said) == (kind == "helix")
    assert metrics["start_error"] < 0.4
    assert metrics["scores"]["held out"]["fbp_error"] < 0.15


@pytest.mark.full
def test_rows_that_are_farther_apart_than_bins_are_fitted_where_they_are(tmp_path):
    """A scan by pixels twice as high, beside one of all rows."""
    balls = [
        rift.phantom.Ellipsoid((0.0, 1.0, 2.0), (9.0, 8.0, 8.0), 0.0, 0.02),
        rift.phantom.Ellipsoid((3.0, -4.0, 3.0), (3.0, 3.0, 3.0), 0.0, 0.03),
    ]
    angles = np.arange(40) * np.pi / 40
    y = rift.phantom.project(balls, rift.Grid((24, 32, 32)), rift.Parallel(angles, 32, center=15.5))
    stacks = {1: y, 2: y.reshape(40, 12, 2, 32).mean(axis=2)}
    means, masses, errors = {}, {}, {}
    for height, stack in stacks.items():
        path, out = tmp_path / f"{height}.npz", tmp_path / f"fit {height}"
        saved(path, stack, angles, pitch=[0.5 * height, 0.5])
        job, _, metrics = fitted(path, out, center=15.5, steps=30)
        place, slices = read_volume_place(out / "volume.h5"), read_volume(out / "volume.h5")
        assert place.spacing == pytest.approx((0.5 * height, 0.5, 0.5)) and place.origin[0] == 0
        assert job.input.grid.shape == slices.shape == (24 // height, 32, 32)
        masses[height] = slices.sum() * np.prod(place.spacing)
        places = np.asarray(rift.SplatScene.load(out / "scene.ply").means)[:, 2]
        # Row 0 of blocks is half a row lower than the first of their rows.
        means[height] = float(places.mean()) + 0.25 * (height - 1)
        errors[height] = metrics["scores"]["held out"]["fit_error"]
    print(masses, means, errors)
    assert masses[2] == pytest.approx(masses[1], rel=0.05)
    assert means[2] == pytest.approx(means[1], abs=0.25)
    assert errors[2] < 1.5 * errors[1]
