"""A fit that is broken off, or killed, and taken up again: the same splats to the bit.

And one that is finished and trained on with more steps, which its report tells.
"""

from __future__ import annotations

import hashlib
import json
import shutil
import subprocess
import sys
import time

import numpy as np
import pytest
from PIL import Image

from rift_cl.commands.cli import main
from rift_cl.commands.fit_photos.job import Fit
from rift_cl.commands.fit_photos.settings import FitPhotosSettings
from rift_cl.errors import StoppedError
from rift_cl.io.checkpoint import newest_checkpoint

# Little of everything that has a state: both strategies, homogenisation, refinement, the band.
VARIANTS = {
    "mcmc": {"homogenise": 0.5, "homogenise_by": "coverage", "band_limit": "coverage"},
    "default": {"strategy": "default", "refine_poses": True, "refine_exposures": True},
}


def settings(capture, out, **more):
    given = {"steps": 100, "splats": 200, "hold_out": 4, "checkpoint_every": 20}
    return FitPhotosSettings.of(capture, out, **(given | more))


def fit(capture, out, *more):
    arguments = ["fit", str(capture), "--out", str(out), "--steps", "60", "--splats", "200"]
    return main([*arguments, "--hold-out", "4", "--quiet", *more])


def digest(folder):
    return hashlib.sha256((folder / "scene.ply").read_bytes()).hexdigest()


def contents(folder):
    """A digest of every file."""
    files = [path for path in sorted(folder.rglob("*")) if path.is_file()]
    return {path.name: hashlib.sha256(path.read_bytes()).hexdigest() for path in files}


def newest(folder):
    return max((path.name for path in (folder / "checkpoints").glob("step-*.npz")), default="")


def broken_off(given, after):
    """Run a fit until a step, as Ctrl-C would break it off."""
    job = Fit(given)
    with pytest.raises(StoppedError, match="rift fit photos") as caught:
        for report in job.run():
            if report.done >= after:
                job.stop()
    return str(caught.value)


@pytest.mark.full
def test_the_config_of_a_fit_that_was_broken_off_goes_on_with_it(capture, tmp_path, capsys):
    """It says what was asked for; what was decided is in the checkpoint."""
    whole, cut = tmp_path / "whole", tmp_path / "cut"
    given = {"seed": 3, "downscale": 2}
    list(Fit(settings(capture, whole, **given)).run())
    broken_off(settings(capture, cut, **given), 25)
    config = ["--config", str(cut / "config.json")]
    assert main(["fit", *config, "--resume", "--quiet"]) == 0
    assert digest(cut) == digest(whole)
    # It begins another as well, in a folder that is named.
    again = tmp_path / "again"
    broken_off(settings(capture, tmp_path / "other", **given), 25)
    config = ["--config", str(tmp_path / "other" / "config.json")]
    assert main(["fit", *config, "--out", str(again), "--quiet"]) == 0
    assert digest(again) == digest(whole)


@pytest.mark.full
@pytest.mark.parametrize("variant", VARIANTS)
def test_a_fit_that_was_broken_off_goes_on_to_the_same_bits(capture, tmp_path, variant):
    more = VARIANTS[variant]
    whole, cut = tmp_path / "whole", tmp_path / "cut"
    list(Fit(settings(capture, whole, **more)).run())
    broken_off(settings(capture, cut, **more), 25)
    assert not (cut / "scene.ply").exists()
    words = broken_off(settings(capture, cut, resume=True, **more), 50)
    assert "after step 5" in words and words.endswith("--resume")
    job = Fit(settings(capture, cut, resume=True, **more))
    done = [report.done for report in job.run() if report.what == "steps"]
    assert done[0] > 50
    assert digest(cut) == digest(whole)
    other = Fit(settings(capture, whole, resume=True, **more))
    list(other.run())
    assert [step for step, _ in job.losses] == [step for step, _ in other.losses]
    assert digest(whole) == digest(cut)


@pytest.mark.full
def test_other_settings_cannot_go_on(capture, tmp_path, capsys):
    broken_off(settings(capture, tmp_path / "fit"), 25)
    before = contents(tmp_path / "fit")
    for name, value, words in (("seed", 8, "0, now it is 8"), ("hold-out", 3, "4, now it is 3")):
        other = ("--resume", "--steps", "100", f"--{name}", str(value))
        assert fit(capture, tmp_path / "fit", *other) == 3
        assert f"had {name.replace('-', '_')} {words}" in capsys.readouterr().err
        assert contents(tmp_path / "fit") == before


@pytest.mark.full
def test_a_fit_goes_on_with_what_it_began_with_alone(capture, tmp_path, capsys):
    """Photographs and cameras by their contents: a copy with other times is the same."""
    given = {"steps": 100, "splats": 200, "hold_out": 4}
    moved, fitted = tmp_path / "capture", tmp_path / "fit"
    shutil.copytree(capture, moved)
    poses = moved / "transforms.json"
    photograph = moved / "2.png"
    broken_off(settings(moved, fitted, **given), 25)
    before = contents(fitted)
    for file, spoilt, words in (
        (photograph, _inverted, photograph.name),
        (poses, _with_a_camera_moved, "the camera of"),
    ):
        kept = file.read_bytes()
        spoilt(file)
        assert fit(moved, fitted, "--resume", "--steps", "100") == 3
        assert words in (said := capsys.readouterr().err) and "was changed" in said
        assert contents(fitted).items() <= before.items()
        file.write_bytes(kept)
    assert fit(moved, fitted, "--resume", "--steps", "100") == 0
    list(Fit(settings(capture, tmp_path / "whole", **given)).run())
    assert digest(fitted) == digest(tmp_path / "whole")


def _inverted(photograph):
    pixels = np.asarray(Image.open(photograph).convert("RGB"))
    Image.fromarray(255 - pixels).save(photograph)


def _with_a_camera_moved(poses):
    record = json.loads(poses.read_text())
    record["frames"][1]["transform_matrix"][0][3] += 0.3
    poses.write_text(json.dumps(record))


@pytest.mark.full
def test_resuming_what_never_began_begins(capture, tmp_path):
    assert fit(capture, tmp_path / "fit", "--resume") == 0
    assert fit(capture, tmp_path / "other") == 0
    assert digest(tmp_path / "fit") == digest(tmp_path / "other")


def test_an_earlier_fit_is_neither_resumed_nor_lost_by_itself(capture, tmp_path, capsys):
    broken_off(settings(capture, tmp_path / "fit"), 25)
    assert fit(capture, tmp_path / "fit") == 5
    assert "--overwrite" in capsys.readouterr().err
    assert list((tmp_path / "fit" / "checkpoints").glob("*.npz"))
    assert fit(capture, tmp_path / "fit", "--resume", "--overwrite") == 3


@pytest.mark.full
def test_one_that_is_killed_goes_on_to_the_same_bits(capture, tmp_path):
    """Killed without a warning, at moments drawn by chance; tools/stress_kills.py does it often."""
    whole, cut = tmp_path / "whole", tmp_path / "cut"
    list(Fit(settings(capture, whole, steps=250)).run())
    random = np.random.default_rng(0)
    command = [sys.executable, "-m", "rift_cl.commands.cli", "fit", str(capture), "--out", str(cut)]
    command += ["--steps", "250", "--splats", "200", "--hold-out", "4", "--checkpoint-every", "25"]
    for _ in range(2):
        process = subprocess.Popen([*command, "--resume"], stdout=subprocess.DEVNULL)
        before = newest(cut)
        while newest(cut) == before and process.poll() is None:
            time.sleep(0.002)
        time.sleep(random.uniform(0, 0.05))
        process.kill()
        process.wait()
        assert not (cut / "scene.ply").exists(), "it was through before it could be killed"
    assert subprocess.run([*command, "--resume", "--quiet"], check=False).returncode == 0
    assert digest(cut) == digest(whole)


@pytest.mark.full
def test_few_photographs_are_fitted_without_the_ramp_unless_it_is_asked_for(capture, tmp_path):
    found = {}
    for name, homogenise in (("none", None), ("zero", 0.0), ("half", 0.5)):
        given = settings(capture, tmp_path / name, steps=20, homogenise=homogenise)
        list(Fit(given).run())
        found[name] = digest(tmp_path / name)
    assert found["none"] == found["zero"] != found["half"]
    asked = settings(capture, tmp_path)
    found = [asked.decided(views).training.homogenisation.exponent for views in (39, 40)]
    assert found == [0.0, 0.5]
    for more in ({"homogenise": 0.3}, {"homogenise_by": "coverage"}):
        assert settings(capture, tmp_path, **more).decided(8).training.homogenisation.exponent > 0


def run(given):
    job = Fit(given)
    reports = [report.done for report in job.run() if report.what == "steps"]
    return job, reports


def metrics_of(folder):
    return json.loads((folder / "metrics.json").read_text())


@pytest.mark.full
@pytest.mark.parametrize("more", [{}, VARIANTS["default"]], ids=["mcmc", "default"])
def test_a_finished_fit_is_trained_on_to_the_same_bits(capture, tmp_path, more):
    found = []
    for name in ("once", "again"):
        out = tmp_path / name
        run(settings(capture, out, steps=50, **more))
        before = digest(out)
        _, reports = run(settings(capture, out, steps=100, resume=True, **more))
        assert reports[0] > 50 and reports[-1] == 100
        assert digest(out) != before
        found.append(digest(out))
    assert found[0] == found[1]
    assert metrics_of(tmp_path / "once")["history"] == [[50, 50], [100, 100]]
    page = (tmp_path / "once" / "report.html").read_text()
    assert "to step 50 by the schedules of a fit of 50, then to step 100" in page
    state, _ = newest_checkpoint(tmp_path / "once" / "checkpoints")
    assert state.step == 100
    assert bool(more) == any(name.startswith("poses.") for name in state.arrays)


@pytest.mark.full
def test_the_second_part_may_be_broken_off_as_well(capture, tmp_path):
    whole, cut = tmp_path / "whole", tmp_path / "cut"
    for out in (whole, cut):
        run(settings(capture, out, steps=50))
    run(settings(capture, whole, steps=125, resume=True))
    first = digest(cut)
    broken_off(settings(capture, cut, steps=125, resume=True), 75)
    assert digest(cut) == first, "what was finished stays until there is something better"
    run(settings(capture, cut, steps=125, resume=True))
    assert digest(cut) == digest(whole)
    assert metrics_of(cut)["history"] == [[50, 50], [125, 125]]


@pytest.mark.full
def test_a_fit_that_was_broken_off_may_become_longer(capture, tmp_path):
    broken_off(settings(capture, tmp_path / "fit", steps=100), 50)
    job, _ = run(settings(capture, tmp_path / "fit", steps=125, resume=True))
    (until, of), last = job.metrics["history"]
    assert 50 <= until < 100 and of == 100 and last == (125, 125)


@pytest.mark.full
def test_fewer_steps_and_no_checkpoints_are_told(capture, tmp_path, capsys):
    out = tmp_path / "fit"
    assert fit(capture, out) == 0
    before = contents(out)
    assert fit(capture, out, "--resume", "--steps", "50") == 3
    assert "has 60 steps, --steps is 50" in capsys.readouterr().err
    assert contents(out) == before
    assert fit(capture, out, "--overwrite", "--checkpoint-every", "0") == 0
    before = contents(out)
    assert fit(capture, out, "--resume", "--steps", "90", "--hold-out", "3") == 3
    assert "kept no checkpoint" in capsys.readouterr().err
    assert contents(out) == before


def test_the_report_says_what_was_decided_and_folds_defaults_away(capture, tmp_path):
    run(settings(capture, tmp_path / "fit", steps=25))
    page = (tmp_path / "fit" / "report.html").read_text()
    assert "was off: with 6 photographs, fewer than 40" in page
    config = json.loads((tmp_path / "fit" / "config.json").read_text())
    assert (
        config["settings"]["training"]["homogenisation"]["exponent"] == 0.0
        and "homogenise" not in config["asked"]
    )
    table = page[page.index(">Settings<") : page.index("settings at their defaults")]
    assert '>homogenise</th><td class="number">' not in table
    assert ">homogenise</th><td>0</td><td>decided</td>" in table
    assert "<details>" in table and ">eps2d<" not in table
    run(settings(capture, tmp_path / "asked", steps=25, homogenise=0.5))
    page = (tmp_path / "asked" / "report.html").read_text()
    assert "was off" not in page
    assert ">homogenise</th><td>0.5</td><td>asked for</td>" in page


@pytest.mark.full
def test_a_config_repeats_a_fit_and_trains_it_on(capture, tmp_path, capsys):
    out, again = tmp_path / "fit", tmp_path / "again"
    assert fit(capture, out, "--strategy.absgrad", "--strategy", "default") == 0
    config = str(out / "config.json")
    assert main(["fit", "--config", config, "--out", str(again), "--quiet"]) == 0
    assert digest(again) == digest(out)
    # What was decided then is now said, and is the same.
    assert main(["fit", "--config", config, "--resume", "--steps", "80", "--quiet"]) == 0
    assert metrics_of(out)["history"] == [[60, 60], [80, 80]]
    more = ["--strategy.absgrad", "--strategy", "default", "--resume", "--steps", "90"]
    assert fit(capture, out, *more) == 0, "as it was asked for at first, it goes on as well"
    more = ["--homogenise", "0.5", "--resume", "--steps", "100"]
    assert main(["fit", "--config", config, *more]) == 3
    assert "had homogenise None, now it is 0.5" in capsys.readouterr().err
