"""``--resume`` of every command: a run that was cut off at any write ends with the same bytes."""

import json
import os

import numpy as np
import pytest

import rift_cl
from rift_cl.commands.cli import main
from rift_cl.commands.plan.settings import PlanSettings
from rift_cl.commands.reconstruct.kept_slabs import SlabFolder
from rift_cl.commands.reconstruct.settings import ReconstructSettings
from rift_cl.commands.run_folder import run_folder
from rift_cl.commands.run_folder.run_folder import RunFolder
from rift_cl.commands.run_folder.saved_settings import saved_settings
from rift_cl.errors import CheckpointError, InputError, OutputError
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
    return words_of(request.param, request)


def words_of(name, request):
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


@pytest.mark.full
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
    words, out = ["plan", "--views", 2, "--mode", "volume", "--band", 0.02], tmp_path / "out"
    assert run(words, out) == 0
    assert run(words, out, "--resume") == 0
    assert str(out) in capsys.readouterr().err


def test_a_run_whose_input_has_changed_is_not_finished(scene, tmp_path, monkeypatch, capsys):
    copy, out = tmp_path / "copy.ply", tmp_path / "out"
    copy.write_bytes(scene.read_bytes())
    words = ["render", copy, "--frames", 1, "--size", 8, 8]
    assert run(words, out) == 0
    written = copy.read_bytes()
    # Of the same size and time, as copying tools leave it.
    replace_content(copy, written[:-1] + bytes([written[-1] ^ 1]))
    assert run(words, out, "--resume") == INPUT
    assert "copy.ply, which was changed since" in capsys.readouterr().err
    replace_content(copy, written)
    os.utime(copy, ns=(10**18, 10**18))
    monkeypatch.chdir(tmp_path)
    assert run(["render", "copy.ply", *words[2:]], out, "--resume") == 0
    copy.rename(tmp_path / "moved.ply")
    assert run(["render", "moved.ply", *words[2:]], out, "--resume") == 0


def replace_content(path, content):
    """Another file of the same time in the place of one."""
    state = path.stat()
    path.write_bytes(content)
    os.utime(path, ns=(state.st_atime_ns, state.st_mtime_ns))


def test_an_input_that_changes_during_the_run_is_told(scene, tmp_path, monkeypatch, capsys):
    from rift_cl.commands.render.job import Render

    copy, out, finish = tmp_path / "copy.ply", tmp_path / "out", Render._finish
    copy.write_bytes(scene.read_bytes())

    def late(*given):
        copy.write_bytes(scene.read_bytes() + b" ")
        finish(*given)

    words = ["render", copy, "--frames", 1, "--size", 8, 8]
    with monkeypatch.context() as patch:
        patch.setattr(Render, "_finish", late)
        assert run(words, out) == 0
    assert run(words, out, "--resume") == INPUT
    assert "copy.ply" in capsys.readouterr().err


def test_files_that_are_named_by_texts_and_in_folders_are_inputs(tmp_path):
    (tmp_path / "flats").mkdir()
    files = [tmp_path / "angles.txt", tmp_path / "flats" / "0.tif"]
    for file in files:
        file.write_text("1")
    out = tmp_path / "flats" / "out"
    scan = {"flats": str(tmp_path / "flats"), "darks": "exchange/dark"}
    settings = ReconstructSettings(tmp_path / "scan", theta=str(files[0]), out=out, **scan)
    RunFolder(out, "reconstruct", settings=settings).make()
    assert difference_of(settings) is None
    for file in files:
        file.write_text("2")
        assert "was changed" in difference_of(settings)
        file.write_text("1")


def difference_of(settings):
    return RunFolder(settings.out, "reconstruct", settings=settings, resume=True)._other


@pytest.mark.parametrize("name", ["render", "reconstruct"])
def test_a_run_of_another_version_is_not_gone_on_with(name, request, tmp_path, capsys):
    words, out = words_of(name, request), tmp_path / "out"
    assert run(words, out) == 0
    text = (out / "config.json").read_text()
    (out / "config.json").write_text(text.replace(rift_cl.__version__, "0.0.1"))
    assert run(words, out, "--resume") == INPUT
    assert "0.0.1" in capsys.readouterr().err


def test_a_run_killed_in_its_last_write_keeps_its_frames(scene, tmp_path, monkeypatch):
    words, out = ["render", scene, "--frames", 2, "--size", 8, 8], tmp_path / "out"
    write = run_folder.write_json

    def killed(path, value):
        if value.get("complete"):
            raise KilledError
        write(path, value)

    with monkeypatch.context() as patch:
        patch.setattr(run_folder, "write_json", killed)
        with pytest.raises(KilledError):
            run(words, out)
    frames = {path: path.stat().st_mtime_ns for path in (out / "frames").iterdir()}
    assert run(words, out, "--resume") == 0
    assert {path: path.stat().st_mtime_ns for path in frames} == frames


@pytest.mark.parametrize("name", ["film.webm", "slices.TIF", "brain.nii.gz"])
def test_a_folder_that_is_called_as_a_file_is_refused(tmp_path, name):
    with pytest.raises(OutputError, match=f"{name}: ends as a file .* --out {name[:4]}"):
        RunFolder(tmp_path / name, "render")
    assert not [*tmp_path.iterdir()]
    # One that is there, and a name with another point, are folders.
    (tmp_path / name).mkdir()
    RunFolder(tmp_path / name, "render")
    RunFolder(tmp_path / "ball_0.5", "render")


@pytest.mark.parametrize("content", [b"[" * 200_000, b'{"job": 1'])
def test_a_forged_record_holds_no_run(tmp_path, content):
    config = tmp_path / "config.json"
    config.write_bytes(content)
    with pytest.raises(OutputError, match="other things"):
        RunFolder(tmp_path, "render", overwrite=True)
    with pytest.raises(InputError, match=r"config\.json"):
        saved_settings(config, "reconstruct", ReconstructSettings)
    (tmp_path / "run.json").write_bytes(content)
    with pytest.raises(CheckpointError, match=r"run\.json"):
        SlabFolder(tmp_path, (1, 1, 1)).axis()


def test_a_saved_value_out_of_its_range_is_told_with_its_file(tmp_path):
    config = tmp_path / "config.json"
    config.write_text(json.dumps({"job": "plan", "settings": {"elevation": [40, -10]}}))
    with pytest.raises(InputError, match=r"config\.json: 'rift plan': --elevation is 40 -10"):
        saved_settings(config, "plan", PlanSettings)


def test_frames_that_are_there_are_not_drawn_again(scene, tmp_path, monkeypatch):
    from rift_cl.splat.renderer import Renderer

    words, out = ["render", scene, "--frames", 3, "--size", 8, 8], tmp_path / "out"
    assert run(words, out) == 0
    record = json.loads((out / "config.json").read_text())
    (out / "config.json").write_text(json.dumps({**record, "complete": False, "cleared": True}))
    (out / "frames" / "0001.png").unlink()
    drawn, picture = [], Renderer.picture
    monkeypatch.setattr(
        Renderer, "picture", lambda self, *a, **k: (drawn.append(1), picture(self, *a, **k))[1]
    )
    assert run(words, out, "--resume") == 0
    assert len(drawn) == 1
