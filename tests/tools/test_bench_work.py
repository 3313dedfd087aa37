"""The work that the benchmark counts is the work that the kernels are given.

Arrays of the launches say what a kernel may read and write at most; tables of the projector say how
many entries and hats there are; what a transform of a power of two takes is in the textbooks.
"""

from __future__ import annotations

import importlib
import math
from collections import defaultdict
from pathlib import Path
from unittest import mock

import numpy as np
import pytest

import rift_cl as rift
from rift_cl.cl.host_arrays import is_device_array
from rift_cl.operators.projector.footprint import FOOTPRINTS
from rift_cl.operators.projector.parallel.phase_table import PHASES, phase_table

# Compulsory bytes over the bytes of the arrays that were handed over. Not all of an array need be
# touched (tables are as wide as the widest view's), and what changes in place is moved twice.
LEAST, MOST = 0.25, 2.0
# Kernels that pass over whole arrays, sample by sample.
WHOLE = ("axpby", "multiply", "clip_negative", "dot_product", "tv_magnitude")


@pytest.fixture
def tool(monkeypatch):
    """Import a module as the script does."""
    monkeypatch.syspath_prepend(Path(__file__).parents[2] / "tools")
    return importlib.import_module


def launched(device, run):
    """The arrays of every launch of an operation, by kernel."""
    plain, found = device.launch, defaultdict(list)

    def launch(kernel, work, /, **given):
        # Blocks that stay in a core's caches, the only arrays of five axes, are nothing handed.
        arrays = [each for each in given.values() if is_device_array(each) and each.ndim < 5]
        found[kernel].append({array.base_data.int_ptr: array for array in arrays}.values())
        plain(kernel, work, **given)

    with mock.patch.object(device, "launch", launch):
        run()
    return found


def test_counted_work_is_that_of_the_arrays(tool):
    device, case = rift.default_device(), tool("bench.case").Case(32, 24)
    tasks = tool("bench.projections").projection_tasks(device, case)
    for group in tool("bench.groups").groups(device, case):
        # Work on splats is counted in pairs of a splat and a tile, which no array's size tells;
        # the tables of cones are padded to whole blocks, which are most of them at this size.
        if not group.name.startswith(("splats", "beams")):
            tasks += group.tasks()
    checked = set()
    for task in tasks:
        for kernel, launches in launched(device, task.run).items():
            cost, where = task.costs[kernel], (task.operation, kernel)
            handed = sum(array.nbytes for arrays in launches for array in arrays)
            assert LEAST < cost.bytes(task.case) / handed <= MOST, where
            if kernel in WHOLE:
                sizes = sum(max(array.size for array in arrays) for arrays in launches)
                assert cost.units(task.case) == sizes, where
            checked.add(kernel)
    assert checked.issuperset(WHOLE) and checked.issuperset(
        ["rows_filter_cpu", "backproject_spline"]
    )


def test_kernel_that_nothing_launches_is_noticed(tool):
    costs = tool("bench.costs")
    costs.check_measured(["radon_project"], ["radon_project", "plane_split"])
    with pytest.raises(costs.CoverageError, match="plane_split"):
        costs.check_measured(["radon_project", "plane_split"], ["radon_project"])


@pytest.mark.parametrize("footprint", FOOTPRINTS)
def test_counted_entries_and_hats_are_those_of_the_tables(tool, footprint):
    case = tool("bench.case").Case(96, 50, footprint=footprint)
    used = hats = 0
    for along_x in (True, False):
        table = phase_table(case.plane, case.scan, footprint, along_x=along_x, segment=1)
        for (_, columns), geometry, shape in zip(
            table.views, table.geometry, table.footprints.records, strict=True
        ):
            # The table rounds up to whole columns and adds two for the overhang.
            count = PHASES * int(columns - 2)
            origin, step = geometry[2:] / 2.0**32
            places = origin + step * np.arange(count) / PHASES
            distances = np.abs(places[:, None] - np.arange(-4, case.bins + 4))
            used, hats = used + count, hats + np.count_nonzero(distances < _support(shape))
    projections = tool("bench.projections")
    assert projections.entries(case) == pytest.approx(used, rel=0.01)
    assert projections.hats(case) == pytest.approx(hats, rel=0.01)


def _support(record):
    """The half-width of a footprint that a kernel is given."""
    return record[0]


@pytest.mark.parametrize("power", [2, 4, 6])
def test_transforms_of_powers_of_eight_take_what_is_known(tool, power):
    work, n = tool("bench.transform_work"), 8**power
    assert work.transform_flops(n) == pytest.approx(49 / 12 * n * math.log2(n))
    assert work.transform_bytes(n, 8) == 4 * 8 * n * power


def test_a_transform_of_two_is_a_sum_and_a_difference_and_a_turn(tool):
    assert tool("bench.transform_work").transform_flops(2) == 10
    assert tool("bench.transform_work").radices(96) == [8, 4, 3]
