"""Where a fit looks for photographs and masks: by their names, and never where it may not."""

from __future__ import annotations

import json
import shutil

import capture_files as made
import numpy as np
import pytest

from rift_cl.commands.analyze.input import open_sampled
from rift_cl.commands.analyze.settings import AnalyzeSettings
from rift_cl.commands.cameras.fit_cameras import open_fit_cameras
from rift_cl.commands.cameras.photograph_place import kept_places
from rift_cl.commands.cli import main
from rift_cl.io import write_png
from rift_cl.io.captures.capture import open_capture
from rift_cl.io.json_fields import Fields
from rift_cl.io.output import write_json

FIT = ("--steps", "1", "--splats", "9", "--hold-out", "3", "--checkpoint-every", "0")
SIZE = (32, 48)


def run(command, *words):
    return main([command, *map(str, words), "--quiet"])


@pytest.fixture(scope="module")
def masked(tmp_path_factory):
    """A fit of COLMAP's model, with masks beside its images."""
    home = tmp_path_factory.mktemp("masked")
    with pytest.MonkeyPatch.context() as larger:
        larger.setattr(made, "WIDTH", SIZE[1])
        larger.setattr(made, "HEIGHT", SIZE[0])
        made.colmap_text(home / "there" / "sparse" / "0", ("PINHOLE", [60, 60, 24, 16]))
    codes = np.random.default_rng(0).integers(0, 256, (*SIZE, 3)).astype(np.uint8)
    for name in made.NAMES:
        for file in (f"images/{name}", f"masks/{name}.png"):
            (home / "there" / file).parent.mkdir(parents=True, exist_ok=True)
            white = np.full((*SIZE, 1), 255, np.uint8)
            write_png(home / "there" / file, white if file.startswith("masks") else codes)
    assert run("fit", home / "there", "--out", home / "fit", *FIT) == 0
    return home


@pytest.mark.full
def test_a_fit_of_masked_photographs_serves_as_a_capture(masked, tmp_path):
    assert len(open_capture(masked / "fit", photographs=False).views) == len(made.NAMES)
    assert open_sampled(AnalyzeSettings(masked / "fit", out=tmp_path / "a")).views == 3
    for words in (("--path", masked / "fit"), ("--capture", masked / "fit", "--frames", 2)):
        out = tmp_path / words[0].strip("-")
        assert run("render", masked / "fit", "--out", out, *words, "--size", 16, 12) == 0


def test_the_masks_of_a_fit_are_those_of_its_photographs(masked, tmp_path):
    expected = [view.mask for view in open_capture(masked / "there").views]
    for words in ({}, {"photographs": masked / "there"}, {"photographs": masked / "there/images"}):
        cameras = open_fit_cameras(masked / "fit", **words)
        assert [view.mask for view in cameras.views] == expected and None not in expected
    again = ("--photographs", masked / "there" / "images", "--out", tmp_path / "scores")
    assert run("eval", masked / "fit", *again) == 0


def test_photographs_with_masks_may_be_put_into_the_fit(masked, tmp_path):
    shutil.copytree(masked / "fit", tmp_path / "fit")
    shutil.copytree(masked / "there", tmp_path / "fit" / "photographs")
    config = json.loads((tmp_path / "fit" / "config.json").read_text())
    config["photographs"] |= {"folder": str(tmp_path / "gone"), "from_fit": "../gone"}
    write_json(tmp_path / "fit" / "config.json", config)
    own = tmp_path / "fit" / "photographs"
    for view in open_fit_cameras(tmp_path / "fit").views:
        assert view.mask == own / "masks" / f"{view.name}.png" and view.mask.is_file()


@pytest.mark.full
@pytest.mark.parametrize("place", [{"folder": "x" * 5000}, {"below": "x" * 5000}])
def test_a_fit_whose_photographs_cannot_be_reached_is_opened_without(masked, tmp_path, place):
    """As a folder of another user is, whose name is too long here to be asked for."""
    shutil.copytree(masked / "fit", tmp_path / "fit")
    config = json.loads((tmp_path / "fit" / "config.json").read_text())
    config["photographs"] |= {"from_fit": "../gone"} | place
    write_json(tmp_path / "fit" / "config.json", config)
    cameras = open_fit_cameras(tmp_path / "fit")
    assert len(cameras.views) == len(made.NAMES)
    assert not any(view.image.exists() for view in cameras.views)
    small = ("--frames", 2, "--size", 16, 12)
    assert run("render", tmp_path / "fit", "--out", tmp_path / "film", *small) == 0


def test_a_link_in_a_fit_leads_to_no_photographs_elsewhere(masked, tmp_path):
    shutil.copytree(masked / "fit", tmp_path / "fit")
    (tmp_path / "fit" / "photographs").symlink_to(masked / "there")
    config = json.loads((tmp_path / "fit" / "config.json").read_text())
    config["photographs"] |= {"folder": "gone", "from_fit": "../gone"}
    write_json(tmp_path / "fit" / "config.json", config)
    assert not any(view.image.exists() for view in open_fit_cameras(tmp_path / "fit").views)


@pytest.mark.parametrize("way", ["\\\\host\\share\\private", "//host/share/private"])
def test_no_other_machine_is_asked_for_photographs(tmp_path, way):
    """Windows would tell it who asks."""
    config = Fields("config.json", {"photographs": {"folder": way, "from_fit": way}})
    assert not list(kept_places(config, tmp_path))


def test_a_folder_of_photographs_that_no_path_leads_to_is_named(masked, tmp_path, capsys):
    far = ("--photographs", "x" * 5000, "--out", tmp_path / "scores")
    assert run("eval", masked / "fit", *far) == 3
    error = capsys.readouterr().err
    assert (
        "the folder of photographs cannot be read (" in error and not (tmp_path / "scores").exists()
    )
