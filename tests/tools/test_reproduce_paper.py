"""The paper's figures: computed to JSON, drawn from JSON alone, gone on with where they were."""

import importlib
import json
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from rift_cl import Grid, Parallel
from rift_cl.io import open_capture, read_image
from rift_cl.phantom import Ellipsoid

TOOLS = Path(__file__).parents[2] / "tools"
TOOL = TOOLS / "reproduce_paper.py"
# Fits so short that they show nothing but that all of it runs.
TINY = ("--steps", 20, "--splats", 100, "--counts", 4, 8, "--seeds", 3)
FITTED = ("figure_11", "figure_12", "spectral_bias")


def run(*arguments):
    command = [sys.executable, str(TOOL), *map(str, arguments)]
    return subprocess.run(command, capture_output=True, text=True, timeout=280, check=False)


def result_of(folder, name):
    return json.loads((folder / f"{name}.json").read_text())["result"]


@pytest.fixture(scope="module")
def tiny(tmp_path_factory):
    """A folder with all the figures of fits, and what the run said."""
    folder = tmp_path_factory.mktemp("paper")
    done = run("--only", *FITTED, *TINY, "--out", folder)
    assert done.returncode == 0, done.stderr
    return folder, done.stderr


@pytest.fixture
def part(monkeypatch):
    """A module of the tool by its name."""
    monkeypatch.syspath_prepend(str(TOOLS))
    return lambda name: importlib.import_module(f"paper.{name}")


@pytest.mark.study
def test_slices_quick_then_report_alone(tmp_path):
    result = run("--quick", "--only", "figure_05", "figure_06", "--out", tmp_path)
    assert result.returncode == 0, result.stderr
    for number, count in (("05", 5), ("06", 7)):
        record = json.loads((tmp_path / f"figure_{number}.json").read_text())
        assert record["environment"]["device"]
        assert len(record["result"]["views"]) == count
    page = (tmp_path / "report.html").read_text()
    (tmp_path / "report.html").unlink()
    assert run("--report-only", "--out", tmp_path).returncode == 0
    assert (tmp_path / "report.html").read_text() == page


def test_the_papers_claim_holds(tmp_path):
    assert run("--only", "figure_06", "--out", tmp_path).returncode == 0
    rows = result_of(tmp_path, "figure_06")["views"]
    many = [row for row in rows if row["count"] >= 20]
    unfiltered = [row["psnr_unfiltered"] for row in many]
    filtered = [row["psnr_filtered"] for row in many]
    assert max(unfiltered) - min(unfiltered) < 0.1
    assert filtered[-1] > filtered[0] + 10


@pytest.mark.study
def test_a_volume_is_filtered_into_shape_from_projections_and_from_radial_lines(tmp_path):
    assert run("--only", "figure_11_volume", "--out", tmp_path).returncode == 0
    for name in ("projections", "radial k-space"):
        found = result_of(tmp_path, "figure_11_volume")["views"]
        rows = [row for row in found if row["input"] == name]
        assert [row["count"] for row in rows] == [10, 64, 250, 570]
        filtered = [row["psnr_filtered"] for row in rows]
        assert filtered == sorted(filtered)
        assert filtered[-1] > filtered[0] + 10
        assert rows[-1]["psnr_filtered"] > rows[-1]["psnr_unfiltered"] + 10
        assert rows[-1]["ssim_filtered"] > 0.9
        unfiltered = [row["psnr_unfiltered"] for row in rows]
        assert max(unfiltered) - min(unfiltered) < 0.1


def test_radial_lines_hold_the_projections_mass_and_place(part):
    kspace = part("radial_kspace")
    body = [Ellipsoid((1.0, -2.0, 3.0), (4.0, 3.0, 5.0), 0.6, 0.8)]
    grid, scan = Grid((24, 24, 24)), Parallel([0.3, 2.0], bins=40, center=17.5)
    found = kspace.measure(body, grid, scan).astype(float)
    mass = 4 / 3 * np.pi * 4 * 3 * 5 * 0.8
    np.testing.assert_allclose(found.sum(axis=(1, 2)), mass, rtol=1e-5)
    rows = (found.sum(axis=2) * np.arange(24)).sum(axis=1) / mass
    bins = (found.sum(axis=1) * np.arange(40)).sum(axis=1) / mass
    np.testing.assert_allclose(rows, 11.5 + 1.0, atol=0.05)
    shadow = 17.5 + 3.0 * np.cos(scan.angles) - 2.0 * np.sin(scan.angles)
    np.testing.assert_allclose(bins, shadow, atol=0.05)


def test_every_count_has_both_protocols_and_the_views_off_the_ring(tiny):
    rows = result_of(tiny[0], "figure_11")["regression"]
    assert [row["count"] for row in rows] == [4, 8]
    for row in rows:
        assert [entry["pictures"] for entry in row["sets"].values()] == [1, 8, 8]
        for entry in row["sets"].values():
            assert {"fit_psnr", "blend_psnr", "nearest_ssim", "fit_psnr_foreground"} <= set(entry)
    first, second = (row["sets"] for row in rows)
    # Only by the paper's split does the task itself change with the number of views.
    assert first["held_out"]["degrees"] > 1.5 * second["held_out"]["degrees"]


def test_pictures_and_spectra_are_of_every_count_and_moment(tiny):
    views = result_of(tiny[0], "figure_12")["views"]
    assert [[row["count"] for row in view["rows"]] for view in views] == [[4, 8], [4, 8]]
    result = result_of(tiny[0], "spectral_bias")
    assert [[m["step"] for m in r["moments"]] for r in result["spectra"]] == [[2, 5, 10, 20]] * 2
    found = [(run["count"], run["exponent"]) for run in result["scores"]]
    assert found == [(4, 0), (4, 0.5), (8, 0), (8, 0.5)]
    # Watched while it is trained or not, the same fit comes out.
    scored = next(r for r in result["scores"] if (r["count"], r["exponent"]) == (8, 0.5))
    watched = result["spectra"][1]["moments"][-1]["psnr"]
    assert scored["ring PSNR"] == pytest.approx(watched, abs=0.01)


def test_a_second_run_fits_nothing_and_a_lost_row_costs_no_fit(tiny):
    folder, said = tiny
    assert said.count("fit_20_steps") == 4
    before = {name: result_of(folder, name) for name in FITTED}
    page = (folder / "report.html").read_text()
    record = json.loads((folder / "figure_11.json").read_text())
    del record["result"]["regression"][1]
    # What is kept is taken as it is.
    record["result"]["regression"][0]["splats"] = 99
    (folder / "figure_11.json").write_text(json.dumps(record))
    again = run("--only", *FITTED, *TINY, "--out", folder)
    assert again.returncode == 0, again.stderr
    assert "fit_20_steps" not in again.stderr
    assert "watched" not in again.stderr
    assert result_of(folder, "figure_11")["regression"][0].pop("splats") == 99
    before["figure_11"]["regression"][0]["splats"] = 99
    assert {name: result_of(folder, name) for name in FITTED} == before
    assert len((folder / "report.html").read_text()) == len(page)


def test_the_report_is_drawn_from_the_files_alone(tiny, tmp_path):
    for name in FITTED:
        (tmp_path / f"{name}.json").write_text((tiny[0] / f"{name}.json").read_text())
    assert run("--report-only", "--out", tmp_path).returncode == 0
    page = (tmp_path / "report.html").read_text()
    assert page.count("<h2>") == 3
    # Figure 11: 9 of fits and 2 of slices; two rows of pictures; four kinds of spectra.
    assert page.count("<img ") == 15


def test_full_without_the_ornament_leaves_its_figures_out(ended, tmp_path):
    status, said = ended(TOOL, "--full", "--only", "figure_11", "--out", tmp_path)
    assert status == 0
    assert "figure_11 is left out" in said
    assert "render_ornament.py" in said
    assert not (tmp_path / "figure_11.json").exists()


def test_full_with_a_folder_that_lacks_captures_says_how_they_are_made(ended, tmp_path):
    status, said = ended(TOOL, "--full", "--ornament", tmp_path, "--out", tmp_path / "out")
    assert status == 3
    assert "orbit/transforms.json" in said
    assert "render_ornament.py" in said


@pytest.mark.parametrize(
    ("arguments", "word"),
    [
        (("--only", "figure_99"), "figure_99"),
        (("--quick", "--full"), "both"),
        (("--ornament", "."), "--ornament"),
        (("--only", "figure_12", "--counts", "61"), "61"),
    ],
)
def test_bad_arguments(ended, tmp_path, arguments, word):
    status, said = ended(TOOL, *arguments, "--out", tmp_path / "out")
    assert status == 3
    assert word in said
    assert "Traceback" not in said


@pytest.mark.parametrize(
    ("count", "total"), [(2, 60), (10, 60), (24, 60), (60, 60), (250, 570), (570, 570)]
)
def test_no_view_is_both_trained_on_and_scored(part, count, total):
    fixed = range(0, total, 8)
    choice = part("view_choice").choose_views(count, total, fixed)
    assert choice.held_out == tuple(k * total // count for k in range(0, count, 8))
    assert len(set(choice.trained)) + len(choice.held_out) == count
    assert not set(choice.trained) & (set(choice.held_out) | set(fixed))


def test_too_few_free_views_are_refused(part):
    with pytest.raises(part("view_choice").InputError, match="--counts has 56"):
        part("view_choice").choose_views(56, 60, range(0, 60, 8))


def test_an_error_shows_at_its_own_frequency(part):
    spectra = part("spectra")
    edges, middle = spectra.ring_edges((96, 128))
    random = np.random.default_rng(1)
    truth = random.normal(size=(96, 128, 3)).astype(np.float32)
    wave = np.cos(2 * np.pi * 0.2 * np.arange(128)).astype(np.float32)[None, :, None]
    error, power = spectra.error_spectrum([truth + wave], [truth], edges)
    at = int(np.searchsorted(edges, 0.2)) - 1
    assert error[at] > 0.99 * error.sum()
    zero, _ = spectra.error_spectrum([0 * truth], [truth], edges)
    np.testing.assert_allclose(zero, 1)
    assert power[0] == pytest.approx(1, abs=0.01)
    assert np.all(np.diff(middle) > 0)


def test_colour_pictures_come_back_to_half_a_code(part):
    images = part("images")
    image = np.random.default_rng(2).uniform(0, 1, (5, 7, 3)).astype(np.float32)
    back = images.decode(json.loads(json.dumps(images.encode(image, (0.0, 1.0)))))
    assert np.abs(back - image).max() <= 0.5 / 255 + 1e-6


def test_noise_is_the_same_each_time_and_in_the_colours_alone(part, tmp_path):
    choice, source = part("view_choice"), part("plan").sample_ornament().ring
    folders = [
        choice.write_capture(source, [3, 5], tmp_path / name, noise=noise)
        for name, noise in (("a", 0.1), ("b", 0.1), ("c", 0.0))
    ]
    noisy, again, plain = (
        [read_image(view.image) for view in open_capture(folder).views] for folder in folders
    )
    for one, same, true in zip(noisy, again, plain, strict=True):
        np.testing.assert_array_equal(one, same)
        assert (one - true)[..., :3].std() == pytest.approx(0.1, rel=0.1)
        np.testing.assert_array_equal(one[..., 3:], true[..., 3:])
    drawn = [(one - true)[..., :3].ravel() for one, true in zip(noisy, plain, strict=True)]
    assert abs(np.corrcoef(drawn)[0, 1]) < 0.05


def test_noise_has_scores_of_its_own(part, tmp_path, monkeypatch):
    bias = part("spectral_bias")
    monkeypatch.setattr(bias, "_spectra", lambda *_: {"moments": []})
    monkeypatch.setattr(bias, "_scores", lambda _, *case: dict(zip(bias._OF, case, strict=True)))
    plan = part("plan").Plan(False, tmp_path, None, None, (4,), 2, 3, (0, 1), (0.0, 0.2))
    result = list(bias.compute(plan, None, {}))[-1]
    found = [tuple(run[key] for key in bias._OF) for run in result["scores"]]
    assert found == [
        (4, noise, ramp, seed) for noise in (0.0, 0.2) for ramp in (0.0, 0.5) for seed in (0, 1)
    ]
