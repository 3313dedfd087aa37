"""``rift demo``, ``rift center``, ``rift devices``, ``rift cache``."""

import json
import os
import shlex
import subprocess
import sys
import threading
from pathlib import Path

import numpy as np
import pytest

import rift_cl as rift
from rift_cl.commands.cli import COMMANDS, main
from rift_cl.commands.demo.job import what_to_see

# No fit: tests that look at other things should not wait for one.
NO_FIT = ("--steps", "0")


def test_demo(tmp_path, capsys):
    out = tmp_path / "demo"
    sizes = ["--size", "96", "--views", "8", "60", "150"]
    assert main(["demo", "--out", str(out), *sizes, *NO_FIT]) == 0
    rows = json.loads((out / "metrics.json").read_text())["views"]
    filtered = [row["psnr_filtered"] for row in rows]
    assert [row["count"] for row in rows] == [8, 60, 150]
    assert filtered == sorted(filtered)
    # The paper's point: without the filter more views do not help.
    assert filtered[-1] > rows[-1]["psnr_unfiltered"] + 8
    assert abs(rows[-1]["psnr_unfiltered"] - rows[1]["psnr_unfiltered"]) < 0.2
    assert {"filtered_8.png", "unfiltered_150.png", "report.html"} <= {
        p.name for p in out.iterdir()
    }
    assert not (out / "ornament").exists()
    said = " ".join(capsys.readouterr().out.split())
    assert "PSNR filtered" in said
    assert f"with 150 views the filtered slice has {filtered[-1]:.1f} dB" in said


def test_what_the_table_of_the_demo_shows_is_said():
    many = (512, 14.68, 0.45, 33.69, 0.9)
    better = "with 512 views the filtered slice has 33.7 dB, the unfiltered one 14.7."
    assert what_to_see([(95, 14.68, 0.45, 28.5, 0.74), many]).endswith(better)
    worse = what_to_see([(2, 13.9, 0.4, 2.0, 0.1), (12, 14.6, 0.4, 11.2, 0.3), many])
    assert better in worse and "With 12 views and fewer, streaks cost" in worse


@pytest.mark.full
def test_demo_fits_the_sample_and_shows_both_ways(tmp_path, capsys):
    out = tmp_path / "demo"
    arguments = ["demo", "--out", str(out), "--size", "32", "--views", "4", "--splats", "300"]
    assert main([*arguments, "--steps", "40"]) == 0
    fits = json.loads((out / "metrics.json").read_text())["fits"]
    groups = {"ornament": {"held out", "off_path"}, "wall": {"held out"}}
    assert {name: set(fit["scores"]) for name, fit in fits.items()} == groups
    for name, fit in fits.items():
        assert fit == json.loads((out / name / "metrics.json").read_text())
        for scores in fit["scores"].values():
            assert {"fit_psnr", "nearest_psnr", "blend_psnr"} <= set(scores)
        assert 0 < len(rift.SplatScene.load(out / name / "scene.ply")) <= 300
    page = (out / "report.html").read_text()
    regression = "Regression: splats fitted to pictures of the "
    headings = ["Integration", f"{regression}ornament", "Pictures: off_path", f"{regression}wall"]
    places = [page.index(f"<h2>{heading}") for heading in headings]
    assert places == sorted(places)
    # The best, the middle and the worst picture of three groups.
    assert page.count('class="pair"') == 9
    assert main([*arguments, *NO_FIT]) == 0
    assert not (out / "ornament").exists() and not (out / "wall").exists()
    assert not (out / "film").exists()


@pytest.mark.full
def test_demo_keeps_what_else_lies_under_the_fits_name(tmp_path, capsys):
    out = tmp_path / "demo"
    arguments = ["demo", "--out", str(out), "--size", "32", "--views", "4", *NO_FIT]
    assert main(arguments) == 0
    (out / "ornament").mkdir()
    (out / "ornament" / "notes.txt").write_text("keep")
    assert main(arguments) == 5
    assert (out / "ornament" / "notes.txt").read_text() == "keep"


@pytest.mark.full
def test_demo_can_be_repeated_but_takes_no_other_folder(tmp_path, capsys):
    arguments = ["demo", "--out", str(tmp_path / "demo"), "--size", "32", "--views", "4"]
    assert main([*arguments, *NO_FIT]) == 0
    assert main([*arguments, *NO_FIT]) == 0
    (tmp_path / "mine").mkdir()
    (tmp_path / "mine" / "notes.txt").write_text("keep")
    assert main(["demo", "--out", str(tmp_path / "mine")]) == 5


@pytest.mark.parametrize(
    ("arguments", "word"),
    [
        (("--size", "4"), "--size"),
        (("--views", "0"), "--views"),
        (("--views",), "--views"),
        (("--steps", "-1"), "steps is -1"),
        (("--splats", "0"), "splats is 0"),
    ],
)
def test_demo_arguments_are_told(tmp_path, capsys, arguments, word):
    assert main(["demo", "--out", str(tmp_path / "demo"), *arguments]) == 3
    assert word in capsys.readouterr().err
    assert not (tmp_path / "demo").exists()


@pytest.mark.full
def test_a_demo_that_is_repeated_leaves_no_old_pictures(tmp_path, capsys):
    out = tmp_path / "demo"
    for views in ("3", "5"):
        arguments = ["demo", "--out", str(out), "--size", "32", "--views", views, *NO_FIT]
        assert main(arguments) == 0
    assert sorted(path.name for path in out.glob("*.png")) == ["filtered_5.png", "unfiltered_5.png"]


@pytest.mark.full
@pytest.mark.parametrize("how", [">&-", "2>&-", "| head -0", "> /dev/full", "2> /dev/full"])
def test_closed_and_full_streams_are_survived(how, tmp_path):
    python = shlex.quote(sys.executable)
    command = f"{python} -m rift_cl.commands.cli demo --size 32 --views 4 --steps 0 --out d {how}"
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join(sys.path)}
    done = subprocess.run(
        ["bash", "-c", command],
        cwd=tmp_path,
        env=environment,
        capture_output=True,
        text=True,
        timeout=100,
        check=False,
    )
    assert done.returncode == (5 if how == "> /dev/full" else 0)
    assert "Traceback" not in done.stderr
    assert ("standard output cannot be written" in done.stderr) == (how == "> /dev/full")
    assert (tmp_path / "d" / "report.html").exists()


def test_a_thread_that_the_system_does_not_give_is_one_sentence(monkeypatch, capsys):
    def start(self):
        raise RuntimeError("can't start new thread")

    monkeypatch.setattr(threading.Thread, "start", start)
    started = COMMANDS["cache"]._replace(run=lambda *_: threading.Thread().start())
    monkeypatch.setitem(COMMANDS, "cache", started)
    assert main(["cache"]) == 3
    said = capsys.readouterr().err
    assert "ulimit" in said and "Traceback" not in said


def test_any_other_error_of_the_interpreter_is_a_defect(monkeypatch):
    def broken(*_):
        raise RuntimeError("anything else")

    monkeypatch.setitem(COMMANDS, "cache", COMMANDS["cache"]._replace(run=broken))
    with pytest.raises(RuntimeError, match="anything else"):
        main(["cache"])


@pytest.mark.full
@pytest.mark.parametrize("encoding", ["ascii", "utf-8"])
@pytest.mark.skipif(sys.platform != "linux", reason="names are bytes on Linux alone")
def test_a_folder_whose_name_is_not_utf8(python, tmp_path, encoding):
    folder = os.fsencode(tmp_path) + b"/caf\xe9"
    done = python(
        "import os, sys\n"
        "from rift_cl.commands.cli import main\n"
        f"folder = os.fsdecode({folder!r})\n"
        "os.mkdir(folder)\n"
        "sys.exit(main(['analyze', folder]))",
        PYTHONIOENCODING=encoding,
    )
    assert done.returncode == 3, done.stderr
    assert "Traceback" not in done.stderr and "udce9" in done.stderr


@pytest.mark.full
def test_a_terminal_of_ascii_gets_a_sentence_and_a_table(python, scan, tmp_path):
    out = os.fsencode(tmp_path) + b"/caf\xe9 \xc2\xb0"
    done = python(
        "import os, sys\n"
        "from rift_cl.commands.cli import main\n"
        f"words = ['reconstruct', {str(scan.integrals)!r}, '--center', '45', '--format', 'h5']\n"
        f"sys.exit(main([*words, '--quiet', '--out', os.fsdecode({out!r})]))",
        PYTHONIOENCODING="ascii",
    )
    assert done.returncode == 0, done.stderr
    assert "udce9" in done.stdout and "\\xb0" in done.stdout
    assert Path(os.fsdecode(out), "volume.h5").is_file()


def test_center(scan, tmp_path, capsys):
    out = tmp_path / "center"
    assert main(["center", str(scan.counts), "--out", str(out)]) == 0
    said = capsys.readouterr()
    assert float(said.out) == pytest.approx(45, abs=0.2)
    low, high = (float(word) for word in said.err.split("95 % interval: ")[1].split()[:3:2])
    assert 44.5 < low < float(said.out) < high < 45.5
    page = (out / "report.html").read_text()
    assert page.count("data:image/jpeg;base64,") == 17 + 9
    assert page.count("<script>") == 1
    assert "script-src 'sha256-" in page
    by = json.loads((out / "metrics.json").read_text())["by"]
    assert by == "double wedge and centre of mass"


@pytest.mark.parametrize(("span", "shown"), [((), (20.4, 26.6)), (("18", "22"), (18, 22))])
def test_an_axis_that_is_not_found_is_left_to_the_eye(span, shown, tmp_path, capsys):
    noise = np.random.default_rng(0).normal(1, 0.01, (40, 3, 48)).astype(np.float32)
    np.savez(tmp_path / "noise.npz", projections=noise, angles=np.arange(40) * np.pi / 40)
    out = tmp_path / "center"
    words = ["--kind", "attenuation", *(("--span", *span) if span else ()), "--out", str(out)]
    assert main(["center", str(tmp_path / "noise.npz"), *words]) == 3
    said = capsys.readouterr()
    assert said.out == "" and "report.html shows slices" in " ".join(said.err.split())
    page = (out / "report.html").read_text()
    assert page.count("data:image/jpeg;base64,") == 17 + 9
    metrics = json.loads((out / "metrics.json").read_text())
    assert metrics["center"] is None and len(metrics["shown"]) == 17
    assert (metrics["shown"][0], metrics["shown"][-1]) == pytest.approx(shown, abs=3)
    assert metrics["shown"][0] < metrics["shown"][-1]


@pytest.mark.parametrize("span", [("-90", "-80"), ("30", "20")])
def test_a_span_that_is_none_is_not_left_to_the_eye(span, scan, tmp_path, capsys):
    out = tmp_path / "center"
    assert main(["center", str(scan.counts), "--span", *span, "--out", str(out)]) == 3
    assert "shows slices" not in capsys.readouterr().err
    assert not (out / "report.html").exists()


def test_center_of_a_row_that_is_not_there(scan, tmp_path, capsys):
    assert main(["center", str(scan.counts), "--row", "7", "--out", str(tmp_path / "c")]) == 3
    assert "--row is 7" in capsys.readouterr().err


def test_devices(capsys, monkeypatch):
    # One family stands for all: their test is tests/commands/test_driver_test.py.
    monkeypatch.setattr("rift_cl.commands.devices.job.FAMILIES", ["sums"])
    assert main(["devices", "--retest"]) == 0
    printed = capsys.readouterr().out
    assert "*" in printed
    assert "passed" in printed
    assert "1 of 1 families" in printed
    for device in rift.devices():
        assert device.name in printed
        assert device.platform in printed


def test_cache(capsys):
    assert main(["cache"]) == 0
    assert " in " in capsys.readouterr().out


def test_version(capsys):
    assert main(["--version"]) == 0
    assert rift.__version__ in capsys.readouterr().out


@pytest.mark.parametrize("command", ["demo", "devices", "reconstruct", "center", "cache"])
def test_help_has_an_example(command, capsys):
    with pytest.raises(SystemExit) as exit:
        main([command, "--help"])
    assert exit.value.code == 0
    assert "Example:" in capsys.readouterr().out


@pytest.mark.full
def test_every_way_to_ask_gives_the_same_axis(scan, tmp_path, capsys):
    from rift_cl.commands.analyze.input import open_sampled
    from rift_cl.commands.analyze.settings import AnalyzeSettings
    from rift_cl.commands.inputs.scan_axis import find_axis
    from rift_cl.io.scans.formats import open_scan

    with np.load(scan.integrals) as file:
        python = rift.find_center(file["projections"], file["angles"]).center
    assert main(["center", str(scan.integrals), "--out", str(tmp_path / "c")]) == 0
    assert json.loads((tmp_path / "c/metrics.json").read_text())["center"] == python
    options = ["--rows", "0", "1", "--out", str(tmp_path / "r")]
    assert main(["reconstruct", str(scan.integrals), *options]) == 0
    assert json.loads((tmp_path / "r/metrics.json").read_text())["center"] == python
    assert find_axis(open_scan(scan.integrals)).center == python
    analysed = open_sampled(AnalyzeSettings(source=scan.integrals))
    assert analysed.scan.center == python
    assert any(f"at bin {python:.2f}" in note for note in analysed.notes)
