"""``rift sweep``: one command with many settings, in one table."""

import csv
import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from rift_cl.commands.cli import main
from rift_cl.commands.run_folder.run_folder import RunFolder
from rift_cl.commands.sweep.job import Sweep
from rift_cl.commands.sweep.one_run import is_done
from rift_cl.commands.sweep.one_run import run as one_run
from rift_cl.commands.sweep.report import Row, score_table, write_table
from rift_cl.commands.sweep.settings import SweepSettings
from rift_cl.commands.sweep.variations import variations
from rift_cl.errors import CheckpointError, InputError, OutputError
from rift_cl.io import read_volume

WANTED = "Dask is not installed (pip install dask distributed)"

INPUT = 3


def save_scan(path, seed):
    projections = np.random.default_rng(seed).random((12, 2, 16), dtype=np.float32)
    np.savez(path, projections=projections, angles=np.arange(12) * np.pi / 12)
    return path


@pytest.fixture(scope="module")
def scans(tmp_path_factory):
    folder = tmp_path_factory.mktemp("sweep")
    return [save_scan(folder / f"{name}.npz", seed) for seed, name in enumerate("ab")]


def run(*arguments):
    return main([str(argument) for argument in arguments])


def sweep(scans, out, vary=("method=fbp,cgls",), **options):
    fixed = ("center=7.5", "kind=attenuation", "footprint=strip")
    return SweepSettings("reconstruct", tuple(scans), vary=vary, fixed=fixed, out=out, **options)


def done(settings):
    job = Sweep(settings)
    reports = list(job.run())
    return job, reports


def test_every_combination_is_a_run(scans, tmp_path):
    runs = variations(sweep(scans, tmp_path, ("filter=hann,ram-lak", "rows=0 1,0 2")))
    assert [run.name for run in runs][:3] == [
        "a_filter=hann_rows=0-1",
        "a_filter=hann_rows=0-2",
        "a_filter=ram-lak_rows=0-1",
    ]
    assert len(runs) == 8 and len({run.settings.out for run in runs}) == 8
    last = runs[-1]
    assert last.varied == {"input": "b", "filter": "ram-lak", "rows": "0 2"}
    assert (last.settings.scan, last.settings.rows) == (scans[1], (0, 2))
    assert (last.settings.filter, last.settings.center) == ("ram-lak", 7.5)


@pytest.mark.parametrize(
    ("vary", "said"),
    [
        (("methods=fbp",), "did you mean 'method'"),
        (("method=fbp,fpb",), "'fpb', wanted one of"),
        (("steps=3",), "--steps does not apply to --method fbp"),
        (("out=a",), "out cannot be"),
        (("method",), "NAME=VALUE"),
        (("center=1,2",), "center is given twice"),
        (("size=4,4",), "two runs"),
        (("size=4", "size=8"), "size is given twice"),
    ],
)
def test_what_is_refused_before_any_run(scans, tmp_path, vary, said):
    with pytest.raises(InputError, match=said):
        Sweep(sweep(scans[:1], tmp_path / "out", vary))
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize(
    ("inputs", "names"),
    [
        (("day1/scan.h5", "day2/scan.h5", "day2/flat.h5"), ["day1-scan", "day2-scan", "flat"]),
        (("one/day/a.h5", "two/day/a.h5"), ["one-day-a", "two-day-a"]),
        (("day/a.h5", "day/a.npz"), ["a.h5", "a.npz"]),
    ],
)
def test_inputs_of_one_name_are_told_apart_by_folders_and_endings(tmp_path, inputs, names):
    runs = variations(sweep([tmp_path / name for name in inputs], tmp_path / "out", ()))
    assert [run.name for run in runs] == names


def test_a_setting_of_all_runs_is_given_once(scans, tmp_path):
    given = sweep(scans[:1], tmp_path / "out", ("size=4",))
    with pytest.raises(InputError, match="center is given twice"):
        variations(replace(given, fixed=(*given.fixed, "center=8")))


@pytest.mark.once
def test_a_sweep_goes_on_and_each_run_is_what_the_command_makes(scans, tmp_path):
    out = tmp_path / "out"
    job = Sweep(sweep(scans[:1], out, ("method=fbp,cgls", "size=8")))
    steps = job.run()
    while not (out / "runs" / "method=fbp_size=8" / "config.json").exists():
        next(steps)
    for report in steps:
        if report.done == 1:
            steps.close()
    first = (out / "runs" / "method=fbp_size=8" / "config.json").read_bytes()
    with pytest.raises(CheckpointError, match=r"method=fbp_size=8 read .*a\.npz, and .*b\.npz"):
        done(sweep(scans[1:], out, ("method=fbp,cgls", "size=8"), resume=True))
    job, reports = done(sweep(scans[:1], out, ("method=fbp,cgls", "size=8"), resume=True))
    assert (reports[0].done, reports[-1].done) == (1, 2)
    assert (out / "runs" / "method=fbp_size=8" / "config.json").read_bytes() == first
    words = ("--center", 7.5, "--kind", "attenuation", "--footprint", "strip", "--size", 8)
    alone = ("reconstruct", scans[0], "--method", "cgls", *words, "--out", tmp_path / "alone")
    assert run(*alone) == 0
    swept = read_volume(out / "runs" / "method=cgls_size=8" / "slices")
    assert swept.tobytes() == read_volume(tmp_path / "alone" / "slices").tobytes()
    rows = list(csv.DictReader((out / "sweep.csv").read_text(encoding="utf-8").splitlines()))
    assert [row["method"] for row in rows] == ["fbp", "cgls"]
    assert float(rows[1]["residual"]) > 0 and rows[0]["residual"] == ""
    page = (out / "report.html").read_text(encoding="utf-8")
    assert page.count("data:image") >= 2 and "runs/method%3Dcgls_size%3D8/report.html" in page
    figures = json.loads((out / "metrics.json").read_text())["figures"]
    assert figures["method=cgls_size=8"]["mean"] == float(rows[1]["mean"])


@pytest.mark.once
def test_a_run_that_cannot_be_done_is_told_beside_the_others(scans, tmp_path, capsys):
    words = ("--fixed", "kind=attenuation", "center=7.5", "--vary", "rows=0 1,0 9")
    assert run("sweep", "reconstruct", scans[0], *words, "--out", tmp_path / "out") == 0
    told = capsys.readouterr()
    assert "--rows is 0 9" in told.err and "│ 0 1 " in told.out
    assert "1 of 2 runs could not be done" in told.out
    assert told.out.index("The first is rows=0-9: ") < told.out.index("--rows is 0 9")
    page = (tmp_path / "out" / "report.html").read_text(encoding="utf-8")
    assert "--rows is 0 9" in page and "why it could not be done<" in page
    words = ("--fixed", "kind=attenuation", "center=7.5", "rows=0 9")
    assert run("sweep", "reconstruct", scans[0], *words, "--out", tmp_path / "none") == INPUT
    capsys.readouterr()
    assert run("sweep", "reconstruct", scans[0], "--vary", "size=4,8", "--dry-run") == 0
    assert "size=8" in capsys.readouterr().out


@pytest.mark.once
def test_the_second_try_of_a_run_goes_on_with_the_first(scans, tmp_path):
    """A worker that is killed leaves the folder that it began."""
    (each,) = variations(sweep(scans[:1], tmp_path, ("size=8",)))
    RunFolder(each.settings.out, each.job).make()
    assert one_run(each.job, each.settings) == "" and is_done(each.settings.out)


@pytest.mark.full
@pytest.mark.once
def test_a_run_of_an_older_sweep_with_other_settings_is_not_done(scans, tmp_path):
    out = tmp_path / "out"
    done(sweep(scans[:1], out, ("size=8",)))
    done(sweep(scans[:1], out, ("size=4",), resume=True))
    other = sweep(scans[1:], out, ("size=8",), resume=True)
    with pytest.raises(CheckpointError, match=r"size=8 read .*a\.npz, and .*b\.npz"):
        done(other)


@pytest.mark.full
@pytest.mark.once
def test_a_run_of_an_input_that_was_changed_since_is_not_mixed_with_others(tmp_path):
    scan, out = save_scan(tmp_path / "a.npz", 0), tmp_path / "out"
    done(sweep([scan], out, ("size=8",)))
    save_scan(scan, 1)
    with pytest.raises(CheckpointError, match=r"size=8 read .*a\.npz, which was changed since"):
        done(sweep([scan], out, ("size=8,4",), resume=True))
    job, _ = done(sweep([scan], out, ("size=8,4",), overwrite=True))
    assert len(job.rows) == 2


def test_paths_of_runs_are_whole(scans, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    np.savetxt("angles.txt", np.arange(12))
    given = SweepSettings("reconstruct", (Path("a.npz"),), fixed=("theta=angles.txt",))
    (each,) = variations(given)
    assert each.settings.scan == tmp_path / "a.npz"
    assert each.settings.theta == str(tmp_path / "angles.txt")
    assert each.settings.out == tmp_path / "rift-sweep" / "runs" / "run"


def test_an_input_among_the_runs_is_not_replaced(scans, tmp_path):
    out = tmp_path / "out"
    (out / "runs").mkdir(parents=True)
    inner = save_scan(out / "runs" / "c.npz", 3)
    (out / "config.json").write_text('{"job": "sweep"}')
    with pytest.raises(InputError, match="--inputs"):
        done(sweep([inner], out, overwrite=True))
    assert inner.exists()


def test_figures_of_a_varied_name_have_another_column(scans, tmp_path):
    each = variations(sweep(scans[:1], tmp_path, ("size=4",)))[0]
    rows = [Row(each, {"size": 8.0})]
    assert score_table(rows)[0] == ["size", "found size"]
    write_table(tmp_path / "sweep.csv", rows)
    assert (tmp_path / "sweep.csv").read_text().startswith("run,size,found size,refused\n")


@pytest.mark.parametrize("text", [None, "{"])
def test_figures_that_are_lost_are_named(scans, tmp_path, text):
    each = variations(sweep(scans[:1], tmp_path, ("size=4",)))[0]
    each.settings.out.mkdir(parents=True)
    if text is not None:
        (each.settings.out / "metrics.json").write_text(text)
    with pytest.raises(OutputError, match=r"metrics\.json"):
        Row.of(each, "")


PLAN = ("diameter=40", "mode=volume", "band=0.05")


def test_plans_take_views_for_inputs_or_none(scans, tmp_path):
    alone = SweepSettings("plan", (), vary=("views=2,3", "elevation=0 20,0 60"), out=tmp_path)
    runs = variations(alone)
    assert [run.name for run in runs][:2] == ["views=2_elevation=0-20", "views=2_elevation=0-60"]
    assert runs[-1].settings.elevation == (0.0, 60.0) and runs[-1].settings.have is None
    of_scans = variations(replace(alone, inputs=tuple(scans)))
    assert [run.settings.have for run in of_scans[::4]] == scans
    with pytest.raises(InputError, match="have cannot be"):
        variations(replace(alone, fixed=("have=a.npz",)))


@pytest.mark.full
def test_a_study_of_plans_is_the_same_on_workers(tmp_path):
    pytest.importorskip("distributed", reason=WANTED)
    given = SweepSettings("plan", (), vary=("views=2,3",), fixed=PLAN, out=tmp_path / "here")
    here, _ = done(given)
    there, _ = done(replace(given, out=tmp_path / "there", cluster="local:2"))
    assert [row.figures["views"] for row in there.rows] == [2, 3]
    for one, other in zip(here.rows, there.rows, strict=True):
        folders = one.run.settings.out, other.run.settings.out
        assert len({(folder / "views.csv").read_bytes() for folder in folders}) == 1


@pytest.mark.full
def test_runs_on_workers_have_the_same_bits(scans, tmp_path):
    pytest.importorskip("distributed", reason=WANTED)
    done(sweep(scans, tmp_path / "here"))
    job, _ = done(sweep(scans, tmp_path / "there", cluster="local:2"))
    assert len(job.rows) == 4
    for row in job.rows:
        slices = f"runs/{row.run.name}/slices"
        here, there = (read_volume(tmp_path / place / slices) for place in ("here", "there"))
        assert here.tobytes() == there.tobytes()
