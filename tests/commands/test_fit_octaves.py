"""``rift fit photos --octaves``: said in the results, repeated by --config, refused plainly."""

from __future__ import annotations

import json

import pytest

from rift_cl.commands.cli import main

FIT = ["--steps", "20", "--splats", "60", "--hold-out", "4", "--quiet"]


@pytest.mark.full
def test_a_fit_says_how_often_its_photographs_were_halved(capture, tmp_path):
    out = tmp_path / "fit"
    halved = ["--octaves", "1", "--octaves.last", "0.3"]
    assert main(["fit", str(capture), "--out", str(out), *FIT, *halved]) == 0
    facts = json.loads((out / "metrics.json").read_text())["octaves"]
    assert facts["halvings"] == 1 and facts["ended"] == [6] and facts["left_out"][0] > 0
    assert "halved once at first" in (out / "report.html").read_text()
    again = tmp_path / "again"
    assert main(["fit", "--config", str(out / "config.json"), "--out", str(again), "--quiet"]) == 0
    assert (again / "scene.ply").read_bytes() == (out / "scene.ply").read_bytes()


@pytest.mark.full
def test_small_photographs_have_their_full_size_by_default(capture, tmp_path):
    out = tmp_path / "fit"
    assert main(["fit", str(capture), "--out", str(out), *FIT]) == 0
    config = json.loads((out / "config.json").read_text())["settings"]["training"]
    assert config["octaves"] == {"count": 0, "last": 0.6}
    assert "octaves" not in json.loads((out / "metrics.json").read_text())


def test_photographs_are_not_halved_to_nothing(capture, tmp_path, capsys):
    out = tmp_path / "fit"
    assert main(["fit", str(capture), "--out", str(out), *FIT, "--octaves", "5"]) == 3
    assert "--octaves is 5, which leaves" in capsys.readouterr().err
