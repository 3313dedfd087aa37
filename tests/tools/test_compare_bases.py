"""The comparison of bases: small studies, verdicts that follow from figures, reports from JSON."""

import json
import subprocess
import sys
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from rift_cl import open_device

TOOL = Path(__file__).parents[2] / "tools" / "compare_bases.py"
STUDIES = (
    "angular_dense",
    "angular_fixed",
    "angular_views",
    "images",
    "slices",
    "volumes",
)


def run(*arguments):
    command = [sys.executable, str(TOOL), *map(str, arguments)]
    return subprocess.run(command, capture_output=True, text=True, timeout=280, check=False)


@pytest.mark.study
def test_a_study_is_computed_kept_and_drawn_again(tmp_path):
    first = run("--tiny", "--only", "angular_fixed", "volumes", "--seeds", 4, "--out", tmp_path)
    assert first.returncode == 0, first.stderr
    assert "against SH" in first.stdout
    assert "HG 1" in first.stdout
    file = tmp_path / "volumes.json"
    record = json.loads(file.read_text())
    assert record["environment"]["device"]
    assert {r["basis"] for r in record["result"]["runs"]} == {"Gaussian", "HG 1"}
    # What is kept is taken as it is; what was lost is computed again.
    record["result"]["runs"][0]["pairs"] = 77.0
    file.write_text(json.dumps(record))
    (tmp_path / "angular_fixed.json").write_text("damaged")
    again = run("--tiny", "--only", "angular_fixed", "volumes", "--seeds", 4, "--out", tmp_path)
    assert again.returncode == 0, again.stderr
    assert json.loads(file.read_text())["result"]["runs"][0]["pairs"] == 77.0
    page = (tmp_path / "report.html").read_text()
    assert page.count("<h2>") == 2
    assert "## PSNR in dB" in (tmp_path / "bases.md").read_text()
    assert (tmp_path / "volumes_time_60.png").read_bytes().startswith(b"\x89PNG")
    (tmp_path / "report.html").unlink()
    assert run("--report-only", "--out", tmp_path).returncode == 0
    assert (tmp_path / "report.html").read_text() == page


@pytest.mark.parametrize(
    ("arguments", "word"),
    [
        (("--only", "nonsense"), "nonsense"),
        (("--quick", "--full"), "--quick"),
        (("--seeds", 1, 1), "--seeds"),
        (("--seeds", -1), "--seeds"),
    ],
)
def test_bad_arguments(ended, tmp_path, arguments, word):
    status, said = ended(TOOL, *arguments, "--out", tmp_path / "out")
    assert status == 3
    assert word in said
    assert "Traceback" not in said


@pytest.mark.parametrize("name", [*STUDIES, pytest.param("radiance", marks=pytest.mark.study)])
def test_every_study_yields_its_runs_and_shows_them(tool, tmp_path, name):
    plan = tool("bases.plan").Plan("tiny", tmp_path, (0,))
    study, device = tool(f"bases.{name}"), open_device()
    results = list(study.compute(plan, device, {"runs": []}))
    result = json.loads(json.dumps(results[-1]))
    assert len(result["runs"]) == result["total"] > 1
    assert all(len(row) == len(t.columns) for t in study.tables(result) for row in t.rows)
    assert study.pictures(result)
    assert study.verdicts(result)
    # What is there is not computed again.
    kept = list(study.compute(plan, device, result))[-1]
    assert kept["runs"] == result["runs"]


def test_kinds_of_radiance_splats_share_a_budget_and_get_the_gaussians_time(
    tool, tmp_path, monkeypatch
):
    radiance = tool("bases.radiance")
    speeds = {"Gaussian, SH 1": 0.1, "HG 1, SH 1": 0.2}
    asked_for = []

    def fitted(asked, lengths, seed, device):
        asked_for.append(dict(lengths))
        return [
            {"basis": kind, "seed": seed, "taken": steps, "splats": 9, "per_splat": 30,
             "wall": speeds[kind] * steps, "wall_ms": 1.0, "cpu_ms": 1.0, "ssim": 0.5,
             "psnr": 20.0 - 3 * (kind[0] == "H")}
            for kind, steps in lengths.items()
        ]  # fmt: skip

    monkeypatch.setattr(radiance, "_fitted", fitted)
    monkeypatch.setattr(radiance, "_LEAST_STEPS", 8)
    plan = tool("bases.plan").Plan("tiny", tmp_path, (0, 1, 2))
    monkeypatch.setattr(radiance, "settings", lambda _: {"steps": [40], "kinds": list(speeds)})
    result = list(radiance.compute(plan, None, {"runs": []}))[-1]
    assert len(result["runs"]) == result["total"] == 12
    # After the warm-up: the same steps, then half as many for what takes twice the time.
    assert asked_for[1:3] == [dict.fromkeys(speeds, 40), {"HG 1, SH 1": 20}]
    assert all("HG 1, SH 1 loses" in said for said in radiance.verdicts(result))
    assert len(list(radiance.tables(result))) == 2
    assert radiance.pictures(result)


def test_every_kind_of_radiance_splats_is_one_that_a_fit_takes(tool, tmp_path):
    radiance = tool("bases.radiance")
    asked = {"downscale": 4, "parameters": 2000}
    for kind in radiance.KINDS:
        found = radiance._settings(asked, kind, 30, 0, tmp_path, None)
        found.check()
        assert 1900 < found.training.splats * found.training.numbers <= 2000


def test_a_fit_of_radiance_splats_is_recorded_with_its_steps(tool, tmp_path):
    radiance = tool("bases.radiance")
    kind = next(iter(radiance.KINDS))
    settings = radiance._settings({"downscale": 4, "parameters": 2000}, kind, 30, 0, tmp_path, None)
    scores = {"test": {"fit_psnr": 20.0, "fit_ssim": 0.5}}
    fit = SimpleNamespace(settings=settings, metrics={"splats": 9, "scores": scores})
    record = radiance._record(radiance._Running(kind, fit, wall=2.0, timed=10), 0)
    assert record["taken"] == 30 and record["wall"] == pytest.approx(6.0)
    assert record["parameters"] == 9 * settings.training.numbers


def test_a_study_that_fails_leaves_the_report_of_the_others(tool, tmp_path, monkeypatch):
    compare, fails = tool("compare_bases"), tool("bases.radiance")
    monkeypatch.setattr(compare, "STUDIES", (fails,))
    monkeypatch.setattr(fails, "compute", lambda *_: 1 / 0)
    with pytest.raises(ZeroDivisionError):
        compare._compare(compare.Settings(out=tmp_path, tiny=True))
    assert (tmp_path / "report.html").exists()


@pytest.fixture
def statistics(tool):
    return tool("bases.statistics")


@pytest.mark.parametrize(
    ("gains", "word"),
    [
        ((1.0, 1.1, 0.9), "wins"),
        ((-1.0, -1.1, -0.9), "loses"),
        ((1.0, -1.1, 0.2), "shows no clear difference"),
        ((0.5,), "is ahead"),
        ((-0.5,), "is behind"),
        ((0.0,), "is even"),
    ],
)
def test_a_verdict_follows_from_the_figures(statistics, gains, word):
    found = statistics.Difference.of(gains)
    assert found.word == word
    said = statistics.sentence("one", "other", found, "dB", "here")
    assert f"one {word} against other" in said
    assert f"{np.mean(gains):+.3g} dB" in said


def test_pairs_share_everything_but_the_basis(statistics):
    runs = [
        {"basis": b, "seed": s, "rms": value}
        for b, s, value in [("a", 0, 1.0), ("a", 1, 3.0), ("b", 0, 2.0), ("b", 1, 3.5), ("b", 2, 9)]
    ]
    given = {"what": "rms", "keys": ("seed",)}
    worse = statistics.paired(runs, "a", "b", **given, lower_is_better=True)
    assert (worse.mean, worse.pairs, worse.better) == (0.75, 2, 2)
    assert statistics.paired(runs, "a", "c", **given) is None
    assert "not run" in statistics.sentence("a", "c", None, "dB", "here")


def test_equal_time_reads_between_the_scores(tool):
    history = [{"wall": 1.0, "psnr": 20.0}, {"wall": 3.0, "psnr": 24.0}]
    at_time = tool("bases.additive_fit").at_time
    assert at_time(history, 2.0, "wall", "psnr") == pytest.approx(22.0)
    assert at_time(history, 9.0, "wall", "psnr") == 24.0


def test_modes_made_even_span_the_same_and_are_orthonormal(tool):
    sets = tool("bases.mode_sets")
    modes = sets.in_space(2)
    gram = sets.seen_gram(2, sets.directions(40))
    even = modes.even(gram)
    np.testing.assert_allclose(even.matrix.T @ gram @ even.matrix, np.eye(10), atol=1e-10)
    assert np.linalg.matrix_rank(np.concatenate([modes.matrix, even.matrix], axis=1)) == 10


def test_budgets_of_colours_are_as_large_as_those_of_harmonics(tool):
    families = tool("bases.lobe_families")
    for degree, numbers in ((1, 12), (2, 27), (3, 48)):
        found = families.budget(degree)
        assert all(numbers - 5 <= family.parameters <= numbers for family in found)
        assert len({tuple(f.columns) for f in found if f.kind == "lg"}) == 2
    # Row by row: Gaussian, ring of one zero, then the two of one turn.
    assert families.laguerre_columns(4) == [0, 5, 1, 2]


def test_the_shortened_jacobian_gives_the_whole_gradient(tool):
    fits, lobes = tool("bases.lobe_fits"), tool("bases.lobes")
    sphere = lobes.Hemisphere.gauss(8)
    truth = lobes.lobe_values("ggx 0.35", sphere.directions, 0)
    for family in tool("bases.lobe_families").budget(2)[1:]:
        problem = fits._Projected(family, sphere.directions, truth, sphere.weights, 1e-6)
        x = family.starts(1, np.array([-0.5, 0.1, 0.8]), np.random.default_rng(0))[0]

        def loss(numbers, problem=problem):
            return 0.5 * np.square(problem.residual(numbers)).sum()

        steps = 1e-6 * np.eye(x.size)
        wanted = np.array([(loss(x + s) - loss(x - s)) / 2e-6 for s in steps])
        found = problem.jacobian(x).T @ problem.residual(x)
        np.testing.assert_allclose(found, wanted, atol=1e-6 * np.abs(wanted).max())


def test_a_hemispheres_weights_integrate_polynomials(tool):
    sphere = tool("bases.lobes").Hemisphere.gauss(6)
    assert sphere.weights.sum() == pytest.approx(2 * np.pi)
    assert (sphere.weights * sphere.directions[:, 2] ** 2).sum() == pytest.approx(2 * np.pi / 3)
    assert (sphere.weights * sphere.directions[:, 0] ** 2).sum() == pytest.approx(2 * np.pi / 3)
