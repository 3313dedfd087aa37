"""The tools of fans, cones and vectors print what they say: what is true, and what tilts cost."""

import re
import sys

import numpy as np
import pytest


def numbers(text):
    return [float(value) for value in re.findall(r"([\d.]+) dB", text)]


def test_known_tilts_cost_little(tool, monkeypatch, capsys):
    tilts = tool("check_tilts")
    arguments = ["--size", "32", "--views", "30", "--steps", "8", "--tilts", "0", "2"]
    monkeypatch.setattr("sys.argv", ["check_tilts.py", *arguments])
    tilts.main()
    (upright, direct), tilted = np.split(numbers(capsys.readouterr().out), [2])
    for best, (known, ignored) in zip((upright, direct), tilted.reshape(2, 2), strict=True):
        assert known > best - 0.6
        assert ignored < known - 1


def test_levels_are_true_in_the_middle_and_fall_off_with_the_cone(tool, monkeypatch, capsys):
    levels = tool("check_fdk")
    for name, few in {"MAGNIFICATIONS": (3.0,), "PITCHES": (0.75,), "ROLLS": (2.0,)}.items():
        monkeypatch.setattr(levels, name, few)
    monkeypatch.setattr(levels, "HALF_ANGLES", (2.0, 15.0))
    monkeypatch.setattr(levels, "RISES", (1.0,))
    arguments = ["--size", "32", "--views", "40", "--steps", "15"]
    monkeypatch.setattr("sys.argv", ["check_fdk.py", *arguments])
    levels.main()
    said = capsys.readouterr().out
    middle = [float(value) for value in re.findall(r"middle plane.*: ([\d.]+)", said)]
    assert len(middle) == 4
    assert middle == pytest.approx([1] * 4, abs=1e-3)
    (own, beams), _ = re.findall(r"across the ball: ([\d.]+), parallel beams ([\d.]+)", said)
    assert float(own) == pytest.approx(float(beams), abs=3e-4)
    (narrow, _), (wide, solved) = re.findall(r"half-angle.*: ([\d.]+), CGLS ([\d.]+)", said)
    assert float(narrow) == pytest.approx(1, abs=1e-3)
    assert 0.97 < float(wide) < 0.99
    assert float(solved) == pytest.approx(1, abs=0.01)
    helices = [float(value) for value in re.findall(r"helix.*: ([\d.]+)", said)]
    assert helices == pytest.approx([1] * 2, abs=1e-3)
    known, ignored, upright = numbers(said)
    assert min(known, ignored) > upright - 2


def test_fans_are_as_true_as_the_peer_s(tool, monkeypatch, capsys):
    pytest.importorskip("astra")
    monkeypatch.setattr(
        "sys.argv", ["bench_fan.py", "--size", "48", "--views", "30", "--runs", "1"]
    )
    tool("bench_fan").main()
    ours, peer = map(float, re.findall(r" (0\.\d+)", capsys.readouterr().out)[:2])
    assert ours == pytest.approx(peer, rel=0.05)


def test_fans_are_not_timed_without_the_peer(tool, monkeypatch, capsys):
    monkeypatch.setitem(sys.modules, "astra", None)
    monkeypatch.setattr("sys.argv", ["bench_fan.py"])
    with pytest.raises(SystemExit):
        tool("bench_fan").main()
    assert "pip install astra-toolbox" in capsys.readouterr().err


@pytest.mark.full
def test_cones_are_timed_part_by_part_and_left_out_where_memory_is_short(tool, monkeypatch, capsys):
    bench = tool("bench_cone")
    options = bench.Options(sizes=("16x8",), rounds=1)
    bench.main(options)
    said = capsys.readouterr()
    for part in ("filtered backprojection", "forward", "backward", "10 steps of CGLS"):
        assert re.search(rf"{part}, ours: [\d.]+ s, [\d.]+ s of processors", said.err)
        assert part in said.out
    monkeypatch.setattr(bench, "free_host_memory", lambda: 1000)
    bench.main(options)
    said = capsys.readouterr()
    assert "forward, ours: left out, needs " in said.err
    assert "ours" not in said.out


def test_what_both_do_is_compared(tool):
    bench = tool("bench_cone")

    def timed(who, name, seconds):
        part = bench.Part(who, name, lambda: None, lambda: None, 1.0)
        return bench.Timed(part, seconds, seconds / 2, None)

    found = [timed("ours", "forward", 2.0), timed("ours", "CGLS", 1.0)]
    sentence = "forward: 3.0 times by the clock, 3.0 by processors' time"
    assert list(bench._ratios([*found, timed("RTK", "forward", 6.0)])) == [sentence]
