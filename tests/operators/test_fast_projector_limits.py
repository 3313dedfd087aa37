"""The fast projector in chunks, within the memory it says, and with settings that cannot be."""

from __future__ import annotations

import numpy as np
import pytest

import rift_cl as rift
from rift_cl import Grid, Parallel
from rift_cl.errors import InputError, ResourceLimitError
from rift_cl.operators import LinearOperator
from rift_cl.operators.projector.parallel.fast_projector import FastProjector


@pytest.mark.full
def test_any_budget_gives_the_same_bits(device, monkeypatch):
    grid, scan = Grid((9, 14, 21)), Parallel(np.linspace(0, 3, 40), bins=27)
    A = FastProjector(grid, scan, device=device)
    x = np.random.default_rng(1).standard_normal(A.domain).astype(np.float32)
    y = np.random.default_rng(2).standard_normal(A.range).astype(np.float32)
    whole = A(x), A.T(y)
    chunks = []
    apply_chunk = LinearOperator._apply_chunk

    def counted(self, *arguments, **how):
        chunks.append(self)
        apply_chunk(self, *arguments, **how)

    monkeypatch.setattr(LinearOperator, "_apply_chunk", counted)
    budget = A.scratch + (x.nbytes + y.nbytes) // 3
    monkeypatch.setattr(rift.Device, "budget", budget)
    assert np.array_equal(A(x), whole[0])
    assert np.array_equal(A.T(y), whole[1])
    assert len(chunks) >= 6
    monkeypatch.setattr(rift.Device, "budget", A.scratch)
    with pytest.raises(ResourceLimitError, match="one slice needs"):
        A(x)


def test_scratch_is_what_is_taken(device):
    """No step may hold more than was counted beforehand."""
    A = FastProjector(Grid((200, 180)), Parallel(np.linspace(0, 3, 300), bins=280), device=device)
    taken, empty = [0], device.empty
    x, y = device.zeros(A.domain), device.zeros(A.range)
    A.prepare()
    pool = device._open().pool
    before = pool.active_bytes

    def counted(*arguments):
        array = empty(*arguments)
        taken.append(pool.active_bytes - before)
        return array

    device.empty = counted
    try:
        A._apply(x, y)
        A._apply_adjoint(y, x)
    finally:
        del device.empty
    assert 0 < max(taken) <= 1.2 * (A.scratch - A._tables.nbytes)


@pytest.mark.parametrize("error", [0, -1, 1, np.nan, "fine", None, 1e-9])
def test_an_error_that_cannot_be_is_refused(device, error):
    with pytest.raises(InputError, match="error is"):
        FastProjector(Grid((8, 8)), Parallel([0.0], 12), error, device=device)


def test_bins_that_are_far_too_fine_are_refused(device):
    with pytest.raises(InputError, match="FastProjector wants bins"):
        FastProjector(Grid((8, 8)), Parallel([0.0], 12, pitch=1e-4), device=device)


@pytest.mark.parametrize("lobes", [-1, 0.5, 9, "1", None])
def test_lobes_that_cannot_be_are_refused(device, lobes):
    with pytest.raises(InputError, match="lobes is"):
        FastProjector(Grid((8, 8)), Parallel([0.0], 12), lobes=lobes, device=device)
