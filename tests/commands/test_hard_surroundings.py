"""Folders, variables and terminals as they come: each ends in a sentence or does no harm."""

from __future__ import annotations



from rift_cl.commands.cli import main

OUTPUT = 5


def test_an_output_that_is_links_in_a_circle_is_told(scan, tmp_path, capsys):
    (tmp_path / "a").symlink_to(tmp_path / "b")
    (tmp_path / "b").symlink_to(tmp_path / "a")
    words = ["reconstruct", str(scan.counts), "--center", "45", "--out", str(tmp_path / "a")]
    assert main(words) == OUTPUT
    assert f"{tmp_path / 'a'}: cannot be written" in capsys.readouterr().err
