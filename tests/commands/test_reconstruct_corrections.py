"""What ``rift reconstruct`` corrects in projections, through the command, with truths known."""

import json

import h5py
import numpy as np
import pytest

import rift_cl as rift
from rift_cl.commands.cli import main
from rift_cl.commands.inputs.scan_axis import find_axis
from rift_cl.io import read_volume

INPUT = 3
VIEWS, BINS, ROWS = 120, 80, 12
ANGLES = np.arange(VIEWS) * np.pi / VIEWS


def run(*arguments):
    return main([str(argument) for argument in arguments])


def line_integrals(rows=ROWS, center=None, value=0.02):
    """A ball off the axis that is longer than the rows, (angle, row, bin)."""
    grid = rift.Grid((rows, 64, 64))
    ball = rift.phantom.Ellipsoid((0, 6, -9), (0.7 * rows, 15, 12), 0.0, value)
    return rift.phantom.project([ball], grid, rift.Parallel(ANGLES, BINS, center=center))


def write_counts(path, integrals, change=lambda counts: counts, **names):
    counts = change(1e4 * np.exp(-integrals))
    with h5py.File(path, "w") as file:
        file["exchange/data"] = counts.astype(np.float32)
        file["exchange/data_white"] = np.full((2, *counts.shape[1:]), 1e4, np.float32)
        file["exchange/theta"] = np.rad2deg(ANGLES)
    return path


def reconstruct(path, out, *options):
    assert run("reconstruct", path, "--out", out, "--format", "h5", *options) == 0
    return read_volume(out / "volume.h5")


def notes(out):
    return " ".join(json.loads((out / "metrics.json").read_text())["assumed"])


PHASE = ("--delta-beta", 200, "--energy", 20, "--propagation", 50, "--pitch", 3, "--unit", "um")


@pytest.mark.full
def test_phase_retrieval_blurs_as_its_formula_says_and_keeps_the_level(tmp_path):
    # Weak, so that the logarithm of what is blurred is what is blurred of the logarithm.
    path = write_counts(tmp_path / "scan.h5", line_integrals(value=0.002))
    plain = reconstruct(path, tmp_path / "plain", "--center", 39.5, "--rings", "off")
    phase = reconstruct(path, tmp_path / "phase", "--center", 39.5, "--rings", "off", *PHASE)
    assert "Phase was retrieved after Paganin" in notes(tmp_path / "phase")
    assert 3 * np.abs(np.diff(phase)).max() < 0.8 * np.abs(np.diff(plain)).max()
    assert 3 * phase.sum() == pytest.approx(plain.sum(), rel=0.01)


@pytest.mark.full
def test_slabs_do_not_show(tmp_path, monkeypatch):
    path = write_counts(tmp_path / "scan.h5", line_integrals())
    options = ("--center", 39.5, "--rings", "off", *PHASE)
    whole = reconstruct(path, tmp_path / "whole", *options)
    monkeypatch.setattr("rift_cl.commands.reconstruct.inversion._SLAB", 3)
    slabs = reconstruct(path, tmp_path / "slabs", *options)
    np.testing.assert_allclose(slabs, whole, atol=1e-4 * whole.max())


@pytest.mark.parametrize(
    ("options", "sentence"),
    [
        (PHASE[2:], "--delta-beta is missing"),
        ((*PHASE[:2], *PHASE[4:]), "--energy is missing"),
        (PHASE[:4], "--propagation is missing"),
        (PHASE[:6], "--pitch 0.65 --unit um"),
        ((*PHASE[:5], -50, *PHASE[6:]), "distance"),
        ((*PHASE[:3], 0, *PHASE[4:]), "energy"),
        ((*PHASE[:5], 5e12, *PHASE[6:]), "are pixel"),
    ],
)
def test_phase_retrieval_without_its_numbers_is_told(tmp_path, capsys, options, sentence):
    path = write_counts(tmp_path / "scan.h5", line_integrals(rows=2))
    assert run("reconstruct", path, "--out", tmp_path / "out", "--center", 39.5, *options) == INPUT
    message = capsys.readouterr().err
    assert sentence in message
    assert "Traceback" not in message
    assert not (tmp_path / "out").exists()


def test_phase_retrieval_of_a_single_row_is_told(tmp_path, capsys):
    path = write_counts(tmp_path / "scan.h5", line_integrals(rows=1))
    assert run("reconstruct", path, "--out", tmp_path / "out", "--center", 39.5, *PHASE) == INPUT
    assert "a single one" in capsys.readouterr().err


def sharpest(volume):
    return float(np.abs(np.diff(volume, axis=-1)).max())


def test_binning_keeps_the_level_and_halves_the_volume(tmp_path):
    path = write_counts(tmp_path / "scan.h5", line_integrals(center=41.5))
    common = ("--center", 41.5, "--pitch", 0.5, "--unit", "mm", "--rings", "off")
    fine = reconstruct(path, tmp_path / "fine", *common)
    coarse = reconstruct(path, tmp_path / "coarse", *common, "--binning", 2)
    assert coarse.shape == tuple(n // 2 for n in fine.shape)
    blocks = fine.reshape(ROWS // 2, 2, BINS // 2, 2, BINS // 2, 2).mean(axis=(1, 3, 5))
    assert np.abs(coarse - blocks).mean() < 0.02 * fine.max()
    with h5py.File(tmp_path / "coarse/volume.h5") as file:
        np.testing.assert_allclose(file["volume"].attrs["spacing"], 1.0)
        # The middle of the first block of rows, bins and columns, the whole of which is 80 wide.
        np.testing.assert_allclose(file["volume"].attrs["origin"], [0.25, -19.5, -19.5])
    # The axis is found on the detector as it is, and recorded so.
    settings = json.loads((tmp_path / "coarse/config.json").read_text())["settings"]
    assert (settings["center"], settings["pitch"], settings["rows"]) == (41.5, 0.5, [0, ROWS])


def test_binning_of_an_odd_detector_says_what_it_leaves_out(tmp_path):
    path = write_counts(tmp_path / "scan.h5", line_integrals(rows=5)[..., :-1])
    volume = reconstruct(path, tmp_path / "out", "--center", 39.5, "--binning", 2)
    assert volume.shape == (2, 39, 39)
    assert "the last 1 row and the last 1 bin" in notes(tmp_path / "out")


@pytest.mark.full
def test_rows_that_no_blocks_are_made_of_are_told(tmp_path):
    path = write_counts(tmp_path / "scan.h5", line_integrals())
    common = ("--center", 39.5, "--pitch", 0.5, "--unit", "mm", "--rings", "off", "--binning", 2)
    all_of_them = reconstruct(path, tmp_path / "all", *common)
    for first, stop, told in ((3, 9, True), (2, 8, False)):
        out = tmp_path / f"{first}"
        some = reconstruct(path, out, *common, "--rows", first, stop)
        np.testing.assert_allclose(some, all_of_them[1:4], atol=1e-6)
        assert ("the rows 2 to 7 were taken" in notes(out)) == told
        with h5py.File(out / "volume.h5") as file:
            assert file["volume"].attrs["origin"][0] == pytest.approx(1.25)


@pytest.mark.parametrize(
    ("options", "sentence"),
    [
        (("--binning", 13), "12 rows"),
        (("--center", 85), "off the detector"),
        (("--center", -1), "off the detector"),
        (("--binning", 0), "--binning is 0"),
        (("--binning", 4, "--rows", 1, 2), "fewer rows"),
        (("--tilt", 30), "wanted 5 at most"),
        (("--tilt", "nan"), "wanted 5 at most"),
        (("--method", "sirt", "--subsets", 3, "--precondition", "ramp"), "give one of them"),
        (("--subsets", 3), "--subsets"),
    ],
)
def test_options_that_do_not_fit_are_told(tmp_path, capsys, options, sentence):
    path = write_counts(tmp_path / "scan.h5", line_integrals())
    assert run("reconstruct", path, "--out", tmp_path / "out", "--center", 39.5, *options) == INPUT
    message = capsys.readouterr().err
    assert sentence in message
    assert "Traceback" not in message
    assert not (tmp_path / "out").exists()


def tilted_counts(path, degrees):
    """A long object, so that a small tilt moves its projections along the bins alone."""
    slope = np.tan(np.deg2rad(degrees))
    rows = [
        line_integrals(rows=1, center=39.5 + slope * (row - (ROWS - 1) / 2))[:, 0]
        for row in range(ROWS)
    ]
    return write_counts(path, np.stack(rows, axis=1))


@pytest.mark.full
def test_a_tilted_axis_is_made_upright(tmp_path):
    straight = tilted_counts(tmp_path / "straight.h5", 0.0)
    leaning = tilted_counts(tmp_path / "leaning.h5", 4.0)
    common = ("--center", 39.5, "--rings", "off")
    truth = reconstruct(straight, tmp_path / "truth", *common)
    wrong = reconstruct(leaning, tmp_path / "wrong", *common, "--tilt", 0)
    right = reconstruct(leaning, tmp_path / "right", *common, "--tilt", 4)
    assert np.abs(right[0] - truth[0]).max() < 0.5 * np.abs(wrong[0] - truth[0]).max()
    assert "turned by 4.000 degrees" in notes(tmp_path / "right")


@pytest.mark.full
def test_a_tilt_that_the_rows_contradict_is_doubted(tmp_path):
    said = {}
    for degrees in (0.0, 4.0):
        path = tilted_counts(tmp_path / f"{degrees:g}.h5", degrees)
        for name, more in {
            "0": ("--tilt", 0),
            "4": ("--tilt", 4),
            "center": ("--center", 39.5),
            "both": ("--center", 39.5, "--tilt", 4),
            "one row": ("--center", 39.5, "--rows", ROWS // 2, ROWS // 2 + 1),
        }.items():
            out = tmp_path / f"out {degrees:g} {name}"
            reconstruct(path, out, *more)
            said[degrees, name] = "Doubt: the rows' axes lean by" in notes(out)
    assert {case for case, doubted in said.items() if doubted} == {
        (0.0, "4"),
        (0.0, "both"),
        (4.0, "0"),
        (4.0, "center"),
    }


@pytest.mark.full
def test_the_center_command_names_the_tilt_that_its_bin_leaves_out(tmp_path, capsys):
    for degrees in (4.0, 0.0):
        path = tilted_counts(tmp_path / f"{degrees:g}.h5", degrees)
        assert main(["center", str(path), "--out", str(tmp_path / f"found_{degrees:g}")]) == 0
        said = capsys.readouterr().err
        assert ("leans by" in said) == bool(degrees)
        if degrees:
            assert float(said.split("leans by ")[1].split()[0]) == pytest.approx(4, abs=0.3)


@pytest.fixture(scope="module")
def half_acquisition(tmp_path_factory):
    """A full turn with the axis near the detector's end, and the true slice."""
    path = tmp_path_factory.mktemp("half") / "scan.npz"
    angles = np.arange(240) * np.pi / 120
    grid = rift.Grid((80, 80))
    integrals = rift.phantom.shepp_logan_sinogram(grid, rift.Parallel(angles, 60, center=12.0))
    np.savez(path, projections=0.2 * integrals[:, None], angles=angles)
    return path, 0.2 * rift.phantom.shepp_logan(grid)


@pytest.mark.full
@pytest.mark.parametrize(
    "options", [(), ("--method", "cgls", "--steps", 12), ("--method", "sirt", "--subsets", 10)]
)
def test_half_acquisitions_may_be_stitched(half_acquisition, tmp_path, options):
    path, truth = half_acquisition
    common = ("--center", 12, "--size", 80, *options)
    ways = [
        reconstruct(path, tmp_path / way, *common, "--half-acquisition", way)[0]
        for way in ("weighted", "stitched")
    ]
    errors = [np.linalg.norm(image - truth) / np.linalg.norm(truth) for image in ways]
    assert max(errors) < 0.35
    assert errors[1] < errors[0] + 0.05
    assert "stitched into wider views" in notes(tmp_path / "stitched")
    for way in ("weighted", "stitched"):
        # What the shorter side misses the other has.
        assert "wider than the detector" not in notes(tmp_path / way)


def test_subsets_take_fewer_steps(half_acquisition, tmp_path):
    path, _ = half_acquisition
    options = ("--center", 12, "--method", "sirt", "--subsets", 10)
    reconstruct(path, tmp_path / "out", *options)
    assert json.loads((tmp_path / "out/metrics.json").read_text())["steps"] == 10


@pytest.mark.parametrize("slab", [16, 1])
def test_zingers_are_removed_and_counted_in_slabs_of_any_size(tmp_path, monkeypatch, slab):
    integrals, chance = line_integrals(), np.random.default_rng(5)
    hits = tuple(chance.integers(0, n, 40) for n in integrals.shape)

    def hit(counts):
        noisy = chance.poisson(counts).astype(float)
        noisy[hits] += 2e4
        return noisy

    path = write_counts(tmp_path / "scan.h5", integrals, hit)
    common = ("--center", 39.5, "--rings", "off")
    truth = reconstruct(write_counts(tmp_path / "clean.h5", integrals), tmp_path / "truth", *common)
    monkeypatch.setattr("rift_cl.commands.reconstruct.inversion._SLAB", slab)
    struck = reconstruct(path, tmp_path / "struck", *common)
    mended = reconstruct(path, tmp_path / "mended", *common, "--zingers", 6)
    assert np.abs(mended - truth).max() < 0.3 * np.abs(struck - truth).max()
    metrics = json.loads((tmp_path / "mended/metrics.json").read_text())
    assert metrics["zingers"] == len(set(zip(*hits, strict=True)))
    assert "Zingers" in notes(tmp_path / "mended")


@pytest.mark.full
def test_the_axis_is_searched_in_rows_without_zingers(tmp_path):
    integrals = line_integrals()
    hits = np.random.default_rng(5).random(integrals.shape) < 1e-3
    path = write_counts(tmp_path / "scan.h5", integrals, lambda counts: counts + 4e4 * hits)
    struck, mended = (find_axis(rift.open_scan(path), zingers=sigma) for sigma in (None, 6.0))
    assert mended.center == pytest.approx(39.5, abs=0.01)
    assert abs(struck.center - 39.5) > 0.05 and np.ptp(mended.interval) < np.ptp(struck.interval)
    reconstruct(path, tmp_path / "out", "--zingers", 6, "--rows", 5, 6)
    settings = json.loads((tmp_path / "out/config.json").read_text())["settings"]
    assert settings["center"] == mended.center


def test_a_scan_of_one_row_is_binned_along_its_bins(tmp_path):
    path = write_counts(tmp_path / "scan.h5", line_integrals(rows=1))
    volume = reconstruct(path, tmp_path / "out", "--center", 39.5, "--binning", 2)
    assert volume.shape == (1, 40, 40)
    with h5py.File(tmp_path / "out/volume.h5") as file:
        assert file["volume"].attrs["origin"][0] == 0
    assert "Blocks of 1 x 2" in notes(tmp_path / "out")


@pytest.mark.full
@pytest.mark.parametrize("height", [1, 2])
def test_a_tilt_is_found_with_the_axis_and_turned(tmp_path, height):
    """An angle, of rows of any height."""
    slope, rows, fine = 0.05, 24, 4
    head = [part.placed(40, (0, 2, -3)) for part in rift.phantom.SHEPP_LOGAN]
    stack = []
    for row in np.arange(rows) - (rows - 1) / 2:
        center = fine * (48.2 + slope * row + 0.5) - 0.5
        scan = rift.Parallel(ANGLES, fine * 96, 1 / fine, center)
        sharp = rift.phantom.project(head, rift.Grid((64, 64)), scan)
        # What a detector counts is the mean over a bin.
        stack.append(sharp.reshape(VIEWS, 96, fine).mean(axis=2))
    path = write_counts(tmp_path / "scan.h5", 0.02 * np.stack(stack, axis=1))
    with h5py.File(path, "a") as file:
        detector = file.create_group("measurement/instrument/detector")
        detector["pixel_size_x"], detector["pixel_size_y"] = 1.0, float(height)
    reconstruct(path, tmp_path / "out", "--rings", "off")
    settings = json.loads((tmp_path / "out/config.json").read_text())["settings"]
    assert settings["center"] == pytest.approx(48.2, abs=0.1)
    assert settings["tilt"] == pytest.approx(np.rad2deg(np.arctan(slope / height)), rel=0.1)
    assert "the tilt of the axis" in notes(tmp_path / "out")
    again = tmp_path / "again"
    assert run("reconstruct", "--config", tmp_path / "out/config.json", "--out", again) == 0
    first, second = (read_volume(out / "volume.h5") for out in (tmp_path / "out", again))
    np.testing.assert_array_equal(first, second)


def test_a_tilt_that_is_not_turned_is_not_announced(tmp_path, capsys):
    """An axis that drifts from row to row, by more than a detector leans."""
    path = tilted_counts(tmp_path / "scan.h5", 20.0)
    assert run("reconstruct", path, "--out", tmp_path / "out", "--rings", "off") == INPUT
    said = " ".join(capsys.readouterr().err.split())
    assert "turned by 20" not in said and "leans by 20" in said.replace("19.9", "20")
    assert "--centers" in said and "--tilt 0" in said and not (tmp_path / "out").exists()
    reconstruct(path, tmp_path / "left", "--rings", "off", "--tilt", 0)


@pytest.mark.full
def test_each_row_may_have_an_axis_of_its_own(tmp_path):
    chance = np.random.default_rng(3)
    centers = 39.5 + chance.integers(-3, 4, ROWS)
    rows = [line_integrals(rows=1, center=center)[:, 0] for center in centers]
    path = write_counts(tmp_path / "scan.h5", np.stack(rows, axis=1))
    np.savetxt(tmp_path / "axis.txt", centers)
    volume = reconstruct(path, tmp_path / "out", "--centers", tmp_path / "axis.txt")
    assert np.abs(volume - volume[:1]).max() < 0.25 * volume.max()
    upright = reconstruct(path, tmp_path / "one", "--center", 39.5)
    assert np.abs(upright - upright[:1]).max() > 0.6 * upright.max()
    again = tmp_path / "again"
    assert run("reconstruct", "--config", tmp_path / "out/config.json", "--out", again) == 0
    np.testing.assert_array_equal(volume, read_volume(again / "volume.h5"))


@pytest.mark.parametrize(
    ("content", "options", "sentence"),
    [
        ("39.5\n39.5\n", (), "holds 2 rotation axes"),
        ("39.5\n" * 11 + "x\n", (), "line 12"),
        ("39.5\n" * 11 + "nan\n", (), "bins from 0 to 79"),
        ("39.5\n" * 12, ("--center", 3), "leave those out"),
    ],
)
def test_a_list_of_axes_that_does_not_fit_is_told(tmp_path, capsys, content, options, sentence):
    path = write_counts(tmp_path / "scan.h5", line_integrals())
    (tmp_path / "axis.txt").write_text(content)
    arguments = ("--centers", tmp_path / "axis.txt", *options)
    assert run("reconstruct", path, "--out", tmp_path / "out", *arguments) == INPUT
    assert sentence in capsys.readouterr().err
    assert not (tmp_path / "out").exists()


def test_it_is_told_where_there_is_nothing_to_stitch(tmp_path):
    path = write_counts(tmp_path / "scan.h5", line_integrals(rows=1))
    options = ("--center", 39.5, "--half-acquisition", "stitched")
    reconstruct(path, tmp_path / "out", *options)
    assert "Nothing was stitched" in notes(tmp_path / "out")
