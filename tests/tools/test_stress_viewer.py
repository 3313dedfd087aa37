"""Strangers see nothing of the viewer, and nothing that a page sends ends it or makes it talk."""

from __future__ import annotations

import pytest

pytest.importorskip("viser", reason="viser is not installed")


def test_some_hostile_messages_and_every_stranger(tool, capsys):
    stress = tool("stress_viewer")
    assert stress.main(stress.Options(messages=100, seconds=120)) == 0, capsys.readouterr().out
    assert capsys.readouterr().out.splitlines()[-1].startswith("100 messages of ")


def test_messages_are_repeatable_and_of_every_sort(tool):
    messages = tool("stress.hostile_messages")
    known = messages.kinds()
    assert "image_width" in known["ViewerCameraMessage"]
    # So many that each of some hundred kinds is among them, whatever release of viser names them.
    sent = [messages.hostile(known, ["a panel"], 0, number) for number in range(3000)]
    assert sent[:50] == [messages.hostile(known, ["a panel"], 0, number) for number in range(50)]
    assert sent[:50] != [messages.hostile(known, ["a panel"], 1, number) for number in range(50)]
    for part in (b"ViewerCameraMessage", b"GuiUpdateMessage", b"a panel", b"GetRenderResponse"):
        assert any(part in each for each in sent if isinstance(each, bytes))
    assert any(isinstance(each, str) for each in sent)
