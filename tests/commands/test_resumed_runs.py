"""``--resume`` of every command: a run that was cut off at any write ends with the same bytes."""

import json
import os

import numpy as np
import pytest

from rift_cl.commands.cli import main
from rift_cl.io import output
from rift_cl.io.scenes.splat_scene import SplatScene

INPUT = 3
# What differs from run to run, for it holds dates and times.
DATED = ("config.json", "metrics.json", "report.html")


class KilledError(BaseException):
    """What nobody expects."""


@pytest.fixture(scope="module")
def scene(tmp_path_factory):
    random = np.random.default_rng(0)
    path = tmp_path_factory.mktemp("scene") / "ball.ply"
    SplatScene(
        means=random.normal(size=(40, 3)),
        log_scales=np.full((40, 3), np.log(0.2)),
        quats=np.tile([1.0, 0, 0, 0], (40, 1)),
        logit_opacities=np.full(40, 5.0),
        sh=random.normal(size=(40, 1, 3)),
    ).save(path)
    return path


FULL = pytest.mark.full


@pytest.fixture(
    params=["render", "reconstruct", *(pytest.param(n, marks=FULL) for n in ("center", "analyze"))]
)
def words(request):
    """A command and its options, small."""
    name = request.param
    if name == "render":
        more = ["--frames", 3, "--size", 16, 12, "--film", "apng", "--depth"]
        return [name, request.getfixturevalue("scene"), *more]
    scan = request.getfixturevalue("scan").integrals
    more = {
        "reconstruct": ["--center", 45, "--format", "h5"],
        "center": ["--span", 40, 50],
        "analyze": ["--add", 1, "--band", 0.1],
    }
    return [name, scan, *more[name]]


def run(words, out, *more):
    return main([str(word) for word in [*words, "--out", out, "--quiet", *more]])


def left(out):
    """What a run leaves, by name."""
    found = {p.relative_to(out).as_posix(): p for p in sorted(out.rglob("*")) if p.is_file()}
    return {name: path.read_bytes() for name, path in found.items() if name not in DATED}


def killed(monkeypatch, number, do):
    """Do something that is cut off in its write of this number; whether it came so far."""
    seen = []

    def sync(path):
        seen.append(path)
        if len(seen) == number:
            raise KilledError

    with monkeypatch.context() as patch:
        patch.setattr(output, "sync", sync)
        try:
            assert do() == 0
        except KilledError:
            return True
    return False


def test_a_run_that_was_cut_off_at_any_write_ends_with_the_same_bytes(
    words, tmp_path, monkeypatch, capsys
):
    assert run(words, tmp_path / "whole") == 0
    wanted = left(tmp_path / "whole")
    for number in (1, 3, 8):
        out = tmp_path / f"cut{number}"
        if not killed(monkeypatch, number, lambda out=out: run(words, out)):
            break
        assert run(words, out, "--resume") == 0, (number, capsys.readouterr().err)
        assert left(out) == wanted, number


def test_a_finished_run_says_so_and_stays(words, tmp_path, capsys):
    out = tmp_path / "out"
    assert run(words, out, "--resume") == 0
    before = {path: path.read_bytes() for path in out.rglob("*") if path.is_file()}
    capsys.readouterr()
    assert main([str(word) for word in [*words, "--out", out, "--resume"]]) == 0
    said = capsys.readouterr().err
    assert str(out) in said and ("finished" in said or "complete" in said)
    assert {path: path.read_bytes() for path in out.rglob("*") if path.is_file()} == before


def test_another_run_is_neither_gone_on_with_nor_lost(scene, tmp_path, capsys):
    words, out = ["render", scene, "--frames", 1, "--size", 8, 8], tmp_path / "out"
    assert run(words, out) == 0
    before = (out / "config.json").read_bytes()
    assert run(words, out, "--resume", "--fov", 30) == INPUT
    assert "fov" in capsys.readouterr().err
    assert run(words, out, "--resume", "--overwrite") == INPUT
    assert (out / "config.json").read_bytes() == before


@pytest.mark.full
def test_a_plan_that_is_finished_says_so(tmp_path, capsys):
    words, out = ["plan", "--views", 2, "--band", 0.03], tmp_path / "out"
    assert run(words, out) == 0
    assert run(words, out, "--resume") == 0
    assert str(out) in capsys.readouterr().err


def test_a_run_whose_input_has_changed_is_not_finished(scene, tmp_path, capsys):
    copy, out = tmp_path / "copy.ply", tmp_path / "out"
    copy.write_bytes(scene.read_bytes())
    words = ["render", copy, "--frames", 1, "--size", 8, 8]
    assert run(words, out) == 0
    later = (out / "config.json").stat().st_mtime_ns + 1_000_000
    os.utime(copy, ns=(later, later))
    assert run(words, out, "--resume") == INPUT
    assert "copy.ply" in capsys.readouterr().err


def test_frames_that_are_there_are_not_drawn_again(scene, tmp_path, monkeypatch):
    from rift_cl.splat.renderer import Renderer

    words, out = ["render", scene, "--frames", 3, "--size", 8, 8], tmp_path / "out"
    assert run(words, out) == 0
    record = json.loads((out / "config.json").read_text())
    unfinished = {"job": "render", "complete": False, "cleared": True, "asked": record["asked"]}
    (out / "config.json").write_text(json.dumps(unfinished))
    (out / "frames" / "0001.png").unlink()
    drawn, picture = [], Renderer.picture
    monkeypatch.setattr(
        Renderer, "picture", lambda self, *a, **k: (drawn.append(1), picture(self, *a, **k))[1]
    )
    assert run(words, out, "--resume") == 0
    assert len(drawn) == 1
