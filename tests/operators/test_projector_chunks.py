"""Work that is cut to fit a memory budget, or repeated, or run elsewhere, gives the same bits."""

from __future__ import annotations

import dataclasses
import hashlib
import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

import rift_cl as rift
from rift_cl.errors import ResourceLimitError
from rift_cl.operators import LinearOperator, ViewFilter
from rift_cl.operators.projector.parallel import phase_projector as projector
from rift_cl.operators.projector.parallel.phase_projector import PhaseProjector
from rift_cl.reconstruct import FilteredBackprojection


def volume(device):
    grid = rift.Grid((33, 14, 21))
    scan = rift.Parallel(np.linspace(0, np.pi, 40, endpoint=False), bins=27)
    A = rift.Projector(grid, scan, device=device)
    random = np.random.default_rng(1)
    x = random.standard_normal(A.domain).astype(np.float32)
    y = random.standard_normal(A.range).astype(np.float32)
    return A, x, y


def counted(monkeypatch):
    """Record how many chunks operators cut their work into."""
    chunks = []
    whole = LinearOperator._apply_chunk

    def apply_chunk(self, *arguments, **how):
        chunks.append(self)
        whole(self, *arguments, **how)

    monkeypatch.setattr(LinearOperator, "_apply_chunk", apply_chunk)
    return chunks


@pytest.mark.parametrize("share", [2, 4, 8, 16])
def test_any_budget_gives_the_same_bits(device, monkeypatch, share):
    A, x, y = volume(device)
    fbp = FilteredBackprojection(A)
    operators = ((A, x), (A.T, y), (fbp, y), (fbp.T, x), (-3 * A, x))
    whole = [B(argument) for B, argument in operators]
    # Scratch has a floor that is far above so small a volume: only what is cut counts here.
    monkeypatch.setattr(PhaseProjector, "scratch", 0)
    monkeypatch.setattr(rift.Device, "budget", (x.nbytes + y.nbytes) // share)
    chunks = counted(monkeypatch)
    for (B, argument), expected in zip(operators, whole, strict=True):
        chunks.clear()
        assert np.array_equal(B(argument), expected)
        assert len(chunks) >= share


def test_filtering_in_chunks_gives_the_same_bits(device, monkeypatch):
    scan = rift.Parallel(np.arange(7.0), bins=30)
    F = ViewFilter(scan, rift.Ramp(), rows=13, gains=np.arange(7), device=device)
    y = np.random.default_rng(2).standard_normal(F.domain).astype(np.float32)
    whole = F(y)
    monkeypatch.setattr(rift.Device, "budget", 2 * y.nbytes // 5)
    chunks = counted(monkeypatch)
    assert np.array_equal(F(y), whole)
    assert len(chunks) >= 5


def test_more_views_than_one_run_of_tables(device, monkeypatch):
    A, x, y = volume(device)
    whole = A(x), A.T(y)
    monkeypatch.setattr(projector, "_TABLE_BYTES", {"cpu": 1, "gpu": 1})
    monkeypatch.setattr(projector, "_FEWEST_VIEWS", 3)
    assert np.array_equal(A(x), whole[0])
    assert np.array_equal(A.T(y), whole[1])


@pytest.mark.parametrize("footprint", ["strip", "joseph"])
@pytest.mark.parametrize("shape", [(130, 290), (3, 40, 70)])
def test_columns_that_a_gpus_items_share(device, monkeypatch, shape, footprint):
    """Items of wide images take several columns each; on a CPU nothing changes."""
    scan = rift.Parallel(np.linspace(0, np.pi, 37, endpoint=False) + 0.1, bins=330)
    plain = PhaseProjector(rift.Grid(shape), scan, footprint, device)
    monkeypatch.setattr(projector, "_GPU_WIDE", 1)
    shared = PhaseProjector(rift.Grid(shape), scan, footprint, device)
    assert device.traits.is_cpu or shared._segment > plain._segment
    random = np.random.default_rng(4)
    x = random.standard_normal(plain.domain).astype(np.float32)
    y = random.standard_normal(plain.range).astype(np.float32)
    np.testing.assert_allclose(shared(x), plain(x), rtol=0, atol=3e-6 * np.abs(plain(x)).max())
    assert np.array_equal(shared.T(y), plain.T(y))
    assert rift.dot_test(shared) < 1e-6
    whole = shared(x), shared.T(y)
    monkeypatch.setattr(projector, "_TABLE_BYTES", {"cpu": 1, "gpu": 1})
    monkeypatch.setattr(projector, "_FEWEST_VIEWS", 3)
    in_runs = PhaseProjector(rift.Grid(shape), scan, footprint, device)
    assert np.array_equal(in_runs(x), whole[0])
    assert np.array_equal(in_runs.T(y), whole[1])


def test_a_budget_too_small_for_one_slice_is_refused():
    A, x, _ = volume(rift.open_device(memory=200))
    with pytest.raises(ResourceLimitError, match=r"part of a slice .*200 B"):
        A(x)


def digest(device: rift.Device) -> str:
    """A hash of everything that a volume's operators give."""
    A, x, y = volume(device)
    results = (A(x), A.T(y), rift.fbp(A, y, "hann"), (A.T @ A + A.T @ (2 * A))(x))
    return hashlib.sha256(b"".join(r.tobytes() for r in results)).hexdigest()


def test_two_runs_give_the_same_bits(device):
    assert digest(device) == digest(device)


@pytest.mark.full
@pytest.mark.parametrize("threads", [1, 2])
def test_another_process_gives_the_same_bits(device, threads):
    """Whatever its number of threads, which PoCL lets us choose."""
    kind = "cpu" if device.traits.is_cpu else "gpu"
    environment = {
        **os.environ,
        "PYTHONPATH": str(Path(rift.__file__).parents[1]),
        "POCL_MAX_PTHREAD_COUNT": str(threads),
    }
    command = [sys.executable, __file__, device.selector, kind]
    run = subprocess.run(command, env=environment, capture_output=True, text=True, check=False)
    assert run.returncode == 0, run.stderr
    found, units = run.stdout.split()
    assert found == digest(device)
    if device.traits.pocl and threads == 1:
        assert units == "1"


def main(selector: str, kind: str) -> str:
    device = rift.open_device(selector)
    traits = dataclasses.replace(device.traits, is_cpu=kind == "cpu")
    device = rift.Device(device._handle, selector, traits=traits)
    return f"{digest(device)} {traits.compute_units}"


if __name__ == "__main__":
    print(main(*sys.argv[1:]))
