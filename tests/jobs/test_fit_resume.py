"""A fit that is broken off, or killed, and taken up again: the same splats to the bit."""

from __future__ import annotations

import hashlib
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest

from rift_cl.cli import main
from rift_cl.errors import StoppedError
from rift_cl.jobs.fit import Fit
from rift_cl.jobs.fit_settings import FitSettings

# Little of everything that has a state: both strategies, homogenisation, refinement, the band.
VARIANTS = {
    "mcmc": {"homogenise": 0.5, "homogenise_by": "coverage", "band_limit": "coverage"},
    "default": {"strategy": "default", "refine_poses": True, "refine_exposures": True},
}


def settings(capture, out, **more):
    given = {"steps": 150, "splats": 200, "hold_out": 4, "checkpoint_every": 25}
    return FitSettings(capture, out, **(given | more))


def fit(capture, out, *more):
    arguments = ["fit", str(capture), "--out", str(out), "--steps", "60", "--splats", "200"]
    return main([*arguments, "--hold-out", "4", "--quiet", *more])


def digest(folder):
    return hashlib.sha256((folder / "scene.ply").read_bytes()).hexdigest()


def newest(folder):
    return max((path.name for path in (folder / "checkpoints").glob("step-*.npz")), default="")


def broken_off(given, after):
    """Run a fit until a step, as Ctrl-C would break it off."""
    job = Fit(given)
    with pytest.raises(StoppedError, match="to go on: rift fit") as caught:
        for report in job.run():
            if report.done >= after:
                job.stop()
    return str(caught.value)


@pytest.mark.parametrize("variant", VARIANTS)
def test_a_fit_that_was_broken_off_goes_on_to_the_same_bits(capture, tmp_path, variant):
    more = VARIANTS[variant]
    whole, cut = tmp_path / "whole", tmp_path / "cut"
    list(Fit(settings(capture, whole, **more)).run())
    broken_off(settings(capture, cut, **more), 50)
    assert not (cut / "scene.ply").exists()
    words = broken_off(settings(capture, cut, resume=True, **more), 100)
    assert "after step 10" in words and words.endswith("--resume")
    job = Fit(settings(capture, cut, resume=True, **more))
    done = [report.done for report in job.run() if report.what == "steps"]
    assert done[0] > 100
    assert digest(cut) == digest(whole)
    other = Fit(settings(capture, whole, resume=True, **more))
    list(other.run())
    assert [step for step, _ in job.losses] == [step for step, _ in other.losses]
    assert digest(whole) == digest(cut)


def test_other_settings_cannot_go_on(capture, tmp_path, capsys):
    broken_off(settings(capture, tmp_path / "fit"), 25)
    status = fit(capture, tmp_path / "fit", "--resume", "--steps", "150", "--seed", "8")
    assert status == 3
    assert "had seed 0, now it is 8" in capsys.readouterr().err


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


def test_one_that_is_killed_goes_on_to_the_same_bits(capture, tmp_path):
    """Killed without a warning, at moments drawn by chance; tools/stress_kills.py does it often."""
    whole, cut = tmp_path / "whole", tmp_path / "cut"
    list(Fit(settings(capture, whole, steps=250)).run())
    random = np.random.default_rng(0)
    command = [sys.executable, "-m", "rift_cl.cli", "fit", str(capture), "--out", str(cut)]
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


def test_fits_from_before_there_was_a_choice_go_on():
    """They say of the band's limit whether there is one, and nothing of the weight."""
    for limit, before in ((None, False), ("pixels", True), ("coverage", "coverage")):
        found = settings(Path("capture"), Path("out"), band_limit=limit).decisive()
        assert found["band_limit"] == before and "homogenise_by" not in found
    found = settings(Path("capture"), Path("out"), homogenise_by="coverage").decisive()
    assert found["homogenise_by"] == "coverage"


def test_few_photographs_are_fitted_without_the_ramp_unless_it_is_asked_for(capture, tmp_path):
    found = {}
    for name, homogenise in (("none", None), ("zero", 0.0), ("half", 0.5)):
        given = settings(capture, tmp_path / name, steps=20, homogenise=homogenise)
        list(Fit(given).run())
        found[name] = digest(tmp_path / name)
    assert found["none"] == found["zero"] != found["half"]
    assert [settings(capture, tmp_path).exponent_for(views) for views in (39, 40)] == [0.0, 0.5]
    for more in ({"homogenise": 0.3}, {"homogenise_by": "coverage"}):
        assert settings(capture, tmp_path, **more).exponent_for(8) > 0
