"""The tools of fans and vectors print what they say: tilts that are known cost next to nothing."""

import re

import pytest


def numbers(text):
    return [float(value) for value in re.findall(r"([\d.]+) dB", text)]


def test_known_tilts_cost_little(tool, monkeypatch, capsys):
    tilts = tool("check_tilts")
    arguments = ["--size", "32", "--views", "30", "--steps", "8", "--tilts", "0", "2"]
    monkeypatch.setattr("sys.argv", ["check_tilts.py", *arguments])
    tilts.main()
    upright, known, ignored = numbers(capsys.readouterr().out)
    assert known > upright - 0.6
    assert ignored < known - 1


def test_fans_are_as_true_as_the_peer_s(tool, monkeypatch, capsys):
    pytest.importorskip("astra")
    monkeypatch.setattr(
        "sys.argv", ["bench_fan.py", "--size", "48", "--views", "30", "--runs", "1"]
    )
    tool("bench_fan").main()
    ours, peer = map(float, re.findall(r" (0\.\d+)", capsys.readouterr().out)[:2])
    assert ours == pytest.approx(peer, rel=0.05)
