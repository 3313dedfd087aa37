"""A disk that is full from some write on loses nothing, and the tool would tell if it did."""

from __future__ import annotations

import dataclasses

import pytest


@pytest.mark.full
def test_a_full_disk_loses_nothing_and_what_is_lost_is_noticed(tool, tmp_path):
    stress = tool("stress_disk")
    peace = stress._in_peace(stress.short_commands(tmp_path)["analyze"], tmp_path / "peace")
    assert peace.writes > 2
    assert stress._fault(peace, tmp_path / "full", peace.writes // 2) == ""
    other = dataclasses.replace(peace, left={**peace.left, "views.csv": b""})
    assert stress._fault(other, tmp_path / "other", -1).startswith("status 0")
