"""``--config run/config.json`` repeats a run of any long command, and options override it."""

import json

import pytest

from rift_cl.commands.cli import main
from rift_cl.commands.plan.input import plan_input
from rift_cl.commands.plan.settings import PlanSettings


def run(*arguments):
    return main([str(argument) for argument in arguments])


def settings_of(out):
    return json.loads((out / "config.json").read_text())["settings"]


def repeat(command, out, again, *options):
    assert run(command, "--config", out / "config.json", "--out", again, *options) == 0
    first, second = settings_of(out), settings_of(again)
    return first, {**second, "out": first["out"], "config": first["config"]}


def figures(out, *but):
    metrics = json.loads((out / "metrics.json").read_text())
    return {name: value for name, value in metrics.items() if name not in ("assumed", *but)}


@pytest.mark.full
def test_plan(tmp_path, capsys):
    out, again = tmp_path / "a", tmp_path / "b"
    options = ("--views", 3, "--seed", 2, "--elevation", -10, 40, "--mode", "volume")
    assert run("plan", *options, "--out", out) == 0
    first, second = repeat("plan", out, again)
    assert first == second
    assert (first["mode"], first["diameter"], first["center"]) == ("volume", 100.0, [0, 0, 0])
    assert first["band"] == pytest.approx(16 / 100)
    for name in ("transforms.json", "views.csv"):
        assert (out / name).read_bytes() == (again / name).read_bytes()
    assert figures(out) == figures(again)


def test_a_target_without_a_pilot_is_decided_to_be_opaque():
    assert plan_input(PlanSettings()).decided.mode == "surface"


@pytest.mark.full
def test_analyze_a_capture(capture, tmp_path, capsys):
    out, again = tmp_path / "a", tmp_path / "b"
    assert run("analyze", capture, "--add", 1, "--out", out) == 0
    first, second = repeat("analyze", out, again)
    assert first == second
    assert first["source"] == str(capture.absolute())
    assert None not in [first[name] for name in ("mode", "center", "diameter", "band")]
    assert figures(out) == figures(again)


def test_analyze_a_scan(scan, tmp_path, capsys):
    out, again = tmp_path / "a", tmp_path / "b"
    assert run("analyze", scan.integrals, "--out", out) == 0
    first, second = repeat("analyze", out, again, "--add", 2)
    assert {**first, "add": 2} == second
    assert (first["mode"], first["center"]) == ("volume", None)
    assert figures(out, "add") == figures(again, "add")


def test_render_and_eval(capture, tmp_path, capsys):
    fit = tmp_path / "fit"
    assert run("fit", capture, "--steps", 6, "--splats", 60, "--hold-out", 4, "--out", fit) == 0
    out, again = tmp_path / "a", tmp_path / "b"
    options = ("--frames", 2, "--size", 32, 24, "--film", "apng")
    assert run("render", fit, *options, "--out", out) == 0
    first, second = repeat("render", out, again)
    assert first == second
    decided = ("fov", "aperture", "eps2d", "background")
    assert None not in [first[name] for name in decided]
    frames = sorted((out / "frames").iterdir())
    assert len(frames) == 2
    for frame in frames:
        assert frame.read_bytes() == (again / "frames" / frame.name).read_bytes()
    assert run("eval", fit, "--out", tmp_path / "c") == 0
    first, second = repeat("eval", tmp_path / "c", tmp_path / "d")
    assert first == second
    assert (first["eps2d"], first["downscale"]) == (0.1, 1)
    assert figures(tmp_path / "c") == figures(tmp_path / "d")


def test_center(scan, tmp_path, capsys):
    out, again = tmp_path / "a", tmp_path / "b"
    assert run("center", scan.counts, "--out", out) == 0
    first, second = repeat("center", out, again)
    assert first == second
    assert (first["row"], first["kind"]) == (1, "counts")
    assert figures(out) == figures(again)


def test_a_dry_run_of_center_writes_nothing(scan, tmp_path, capsys):
    assert run("center", scan.counts, "--out", tmp_path / "out", "--dry-run") == 0
    assert "row 1" in capsys.readouterr().out
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"job": "analyze"}, ("rift analyze", "rift plan")),
        ({"settings": {"veiws": 3}}, ("veiws",)),
        ({"settings": {"veiws": 3}, "rift_cl": "0.0.1"}, ("0.0.1",)),
        ({"complete": False}, ("did not come to its end", "asked for")),
        ({"complete": False, "asked": {"veiws": 3}}, ("veiws",)),
    ],
)
def test_a_config_that_does_not_fit_is_told(tmp_path, capsys, change, words):
    record = {"job": "plan", "settings": {"views": 3}, **change}
    (tmp_path / "config.json").write_text(json.dumps(record))
    assert run("plan", "--config", tmp_path / "config.json") == 3
    told = capsys.readouterr().err
    assert all(word in told for word in words)
    assert told.count("\n") == 1
