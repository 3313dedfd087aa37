"""Damaged scans never end the process, and the tool that says so would notice if they did."""

from __future__ import annotations

import subprocess
import sys
from collections import Counter
from pathlib import Path

import numpy as np
import pytest


@pytest.fixture
def stress(tool):
    return tool("stress_readers")


def test_two_hundred_damaged_files(stress, capsys):
    # A reader may load much before it reads its first file.
    options = stress.Options(files=200, seed=7, seconds=120)
    assert stress.main(options) == 0, capsys.readouterr().out
    printed = capsys.readouterr().out
    total = [int(word) for word in printed.splitlines()[-2].split()[1:]]
    assert "seed 7" in printed and sum(total) == 200
    assert total[0] > 20 and sum(total[1:-3]) > 20, printed


def test_undamaged_files_are_read(stress, tmp_path):
    reader = stress.Reader(memory=6 << 30, seconds=60)
    for name, kind in stress.KINDS.items():
        path = kind.put(tmp_path / name, kind.pack(kind.make()))
        assert reader.read(path, kind.read) == ("read", ""), name
    child = reader._child.pid
    assert reader.read(tmp_path / "gone.h5")[0] == "InputError" and reader._child.pid == child
    reader.close()


def test_damage_is_repeatable_and_damages(stress):
    several = [list(stress.damaged_files(stress.Options(files=40, seed=s))) for s in (1, 1, 2)]
    assert several[0] == several[1] != several[2]
    later = list(stress.damaged_files(stress.Options(files=3, seed=1, first=20)))
    assert later == several[0][20:23]
    intact = {name: kind.pack(kind.make()) for name, kind in stress.KINDS.items()}
    changed = [content != intact[name] for _, name, content in several[0]]
    assert np.mean(changed) > 0.8


@pytest.mark.parametrize(
    ("code", "outcome", "reason"),
    [
        ("import os; input(); os.abort()", "crash", "SIGABRT"),
        ("import sys; input(); sys.exit(3)", "crash", "exit status 3"),
        ("import time; time.sleep(60)", "hang", "not read after 2 s"),
    ],
)
def test_a_crash_and_a_hang_are_noticed(stress, monkeypatch, code, outcome, reason):
    def started(_):
        command = [sys.executable, "-c", code]
        return subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True)

    monkeypatch.setattr(stress.Reader, "_started", started)
    assert stress.Reader(memory=1 << 30, seconds=2).read(Path("x")) == (outcome, reason)


def test_an_error_without_a_name_is_kept_and_fails(stress, monkeypatch, capsys, tmp_path):
    monkeypatch.setattr(stress.Reader, "read", lambda *_: ("unnamed error", "KeyError()"))
    assert stress.main(stress.Options(files=2, keep=tmp_path / "kept")) == 1
    assert "file 1 (TIFF deflate): unnamed error, KeyError()" in capsys.readouterr().out
    assert len(list((tmp_path / "kept").iterdir())) == 2


def test_the_table_adds_up(stress):
    rows = stress.table({"a": Counter(read=2), "b": Counter(crash=1, ShapeError=3)}).splitlines()
    assert rows[0].split() == ["read", "ShapeError", "crash", "hang", "unnamed", "error"]
    assert rows[-1].split() == ["all", "2", "3", "1", "0", "0"]
