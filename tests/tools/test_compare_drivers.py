"""Families of problems on two drivers: what counts as equal, and a process that dies costs one."""

import shlex
from pathlib import Path

import numpy as np
import pytest


def test_a_family_differs_as_its_worst_array(tool):
    differences = tool("portability.differences")
    wanted = {"a": np.array([3.0, 4.0]), "b": np.array([np.nan, 1])}
    assert differences.worst(wanted, dict(wanted)).relative == 0
    found = differences.worst(wanted, {**wanted, "a": np.array([3.0, 4.5])})
    assert found == (pytest.approx(0.1), "a")
    for broken in ({"a": wanted["a"]}, {**wanted, "a": np.array([3.0, np.inf])}):
        assert differences.worst(wanted, broken).relative == np.inf


def test_families_after_one_that_failed_still_run(tool):
    run_families = tool("portability.family_runs").run_families
    options = {"device": None, "as_gpu": False, "tiny": True, "limit": 250}
    absent, sums = run_families(["absent", "sums"], **options)
    assert absent.arrays is None and "absent" in absent.fault
    assert sums.arrays.keys() == {"sums"} and not sums.fault


def test_a_driver_is_compared_with_what_was_saved(tool, tmp_path, capsys):
    compare = tool("compare_drivers")
    kept = tmp_path / "kept.npz"
    options = {"only": ("sums",), "tiny": True}
    assert compare.main(compare.Options(save=kept, **options)) == 0
    assert compare.main(compare.Options(against=str(kept), **options)) == 0
    assert "=" in capsys.readouterr().out
    with np.load(kept) as file:
        np.savez(kept, **{name: file[name] * 1.01 for name in file.files})
    assert compare.main(compare.Options(against=str(kept), **options)) == 1


def test_the_continuous_check_names_families_that_are_there(tool):
    lines = (Path(__file__).parents[2] / ".ci" / "run").read_text().splitlines()
    (named,) = (shlex.split(line) for line in lines if line.strip().startswith("--only "))
    families = tool("portability.problems").FAMILIES
    assert len(named) > 5 and families.keys() >= set(named[1:])
