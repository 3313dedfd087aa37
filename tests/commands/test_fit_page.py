"""The page that a fit leaves beside its report, and that nothing about it ends a fit."""

from __future__ import annotations

import sys

import pytest

from rift_cl.commands.cli import main


def fit(capture, out, *more) -> int:
    size = ("--splats", "200", "--steps", "20", "--quiet", "--overwrite")
    return main(["fit", str(capture), "--out", str(out), *size, *more])


def test_a_fit_leaves_the_page_that_export_makes(capture, tmp_path):
    pytest.importorskip("viser")
    out = tmp_path / "fit"
    assert fit(capture, out) == 0
    page = out / "scene.html"
    assert 'href="scene.html"' in (out / "report.html").read_text(encoding="utf-8")
    again = tmp_path / "again.html"
    assert main(["export", str(out), "--out", str(again), "--quiet"]) == 0
    assert len(again.read_bytes()) == pytest.approx(len(page.read_bytes()), rel=1e-3)
    assert str(tmp_path).encode() not in page.read_bytes()


@pytest.mark.full
def test_without_viser_and_with_a_viser_that_fails_there_is_no_page(
    capture, tmp_path, monkeypatch, capsys
):
    out = tmp_path / "fit"
    assert fit(capture, out) == 0

    def broken(*_, **__):
        raise RuntimeError("no sockets here")

    monkeypatch.setattr("rift_cl.commands.export.fit_page.web_page", broken)
    if "viser" in sys.modules:
        assert fit(capture, out) == 0
        assert "no sockets here" in capsys.readouterr().err
    monkeypatch.setattr("rift_cl.commands.export.fit_page.find_spec", lambda name: None)
    assert fit(capture, out) == 0
    assert not (out / "scene.html").exists()
    assert "scene.html" not in (out / "report.html").read_text(encoding="utf-8")
