"""``rift reconstruct --cluster`` of cone beams: slabs from their rows, to the same bits."""

import json
from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from killed_worker import kill_one

from rift_cl.commands.reconstruct.choice import reconstruction_of
from rift_cl.commands.reconstruct.settings import ReconstructSettings
from rift_cl.commands.reconstruct.spread import make_slices
from rift_cl.errors import InputError, OutputError, StoppedError
from rift_cl.geometry import Cone, Grid
from rift_cl.geometry.seen_grid import rows_seen, seen_grid
from rift_cl.io import read_volume
from rift_cl.operators import Projector
from rift_cl.phantom import Ellipsoid, project
from rift_cl.reconstruct.direct.filtered_backprojection import (
    filtered_backprojection,
    unfiltered_backprojection,
)

WANTED = "Dask is not installed (pip install dask distributed)"
ROWS, R, S = 40, 60.0, 120.0


@pytest.fixture(scope="module")
def scan(tmp_path_factory):
    """Counts of a ball, with a dead pixel and zingers."""
    angles = 2 * np.pi * np.arange(30) / 30
    cone = Cone(angles, ROWS, 20, 2.0, R, S, center=(19.0, 9.7))
    rng = np.random.default_rng(4)
    lines = project([Ellipsoid.ball(6.0, 0.02, (0.5, 1.0, -2.0))], Grid((2, 2, 2)), cone)
    counts = rng.poisson(900 * np.exp(-lines)).astype(np.float32)
    counts[3, 21, 8] = 5000
    flats = np.full((2, ROWS, 20), 1000, np.float32)
    flats[:, 15, 7] = 0
    path = tmp_path_factory.mktemp("cones") / "scan.npz"
    lengths = {"source_to_axis": R, "source_to_detector": S, "pitch": 2.0, "row_center": 19.0}
    np.savez(path, projections=counts, flats=flats, darks=0 * flats, angles=angles, **lengths)
    return path


def settings(scan, out, **options):
    return ReconstructSettings(scan, out=out, unit="mm", **options)


def made(job):
    for _ in job.run():
        pass
    return read_volume(job.settings.out / "slices"), job.metrics


def begin(given):
    """What a command does before it hands out slices."""
    begun = reconstruction_of(given)
    begun._locate()
    begun.folder.make()
    begun.kept.begin(begun._facts())
    return begun.kept


@pytest.mark.parametrize(
    ("make", "change"),
    [
        (filtered_backprojection, {}),
        pytest.param(filtered_backprojection, {"curved": True}, marks=pytest.mark.full),
        pytest.param(filtered_backprojection, {"pitch": (0.7, 2.0)}, marks=pytest.mark.full),
        (unfiltered_backprojection, {"heights": np.arange(11) * 0.5}),
    ],
)
def test_slabs_from_their_rows_are_those_of_the_whole(make, change):
    given = {"pitch": 2.0, **change}
    cone = Cone(
        2 * np.pi * np.arange(11) / 11, 48, 20, source_to_axis=R, source_to_detector=S, **given
    )
    grid = seen_grid(cone)
    y = np.random.default_rng(1).normal(size=(11, 48, 20)).astype(np.float32)
    formula = make(Projector(grid, cone))
    parts, fewest = [], 48
    for first in range(0, grid.shape[0], formula.block):
        z = first, min(first + formula.block, grid.shape[0])
        middle = grid.center[0] + (sum(z) - grid.shape[0]) / 2 * grid.spacing[0]
        part = Grid((z[1] - z[0], *grid.shape[1:]), grid.spacing, (middle, *grid.center[1:]))
        rows = rows_seen(cone, part)
        fewest = min(fewest, rows[1] - rows[0])
        parts += formula.slabs(y[:, slice(*rows)], 1 << 30, z, rows)
    assert fewest < 40
    assert np.concatenate(parts).tobytes() == formula(y).tobytes()


def test_what_was_mended_is_counted_once_however_rows_are_cut(scan, tmp_path):
    """Zingers are told by the rows above and below, which are read twice."""
    clean = reconstruction_of(settings(scan, tmp_path / "out", zingers=9.0)).source.clean
    found = []
    for edges in ([0, ROWS], [0, 14, 15, 16, 21, 22, ROWS]):
        clean.zingers = 0
        parts = [clean.read(*rows) for rows in pairwise(edges)]
        counts = [sum(part.dead for part in parts), sum(part.starved for part in parts)]
        found.append([*counts, clean.zingers])
    assert found[0] == found[1] and found[0][0] == 1 and found[0][2] > 0


@pytest.mark.full
def test_workers_make_the_volume_of_one_process(scan, tmp_path, monkeypatch):
    """One of them is killed."""
    pytest.importorskip("distributed", reason=WANTED)
    begun = kill_one(monkeypatch, after=3)
    job = reconstruction_of(settings(scan, tmp_path / "a", cluster="local:2"))
    volume, figures = made(job)
    alone, wanted = made(reconstruction_of(settings(scan, tmp_path / "b")))
    assert len(begun) >= 5 and volume.tobytes() == alone.tobytes()
    assert wanted["dead_pixels"] == 1
    for name in ("dead_pixels", "starved_samples", "mean"):
        assert figures[name] == wanted[name]
    assert not (tmp_path / "a" / "slabs").exists()


@pytest.mark.full
def test_a_run_goes_on_with_a_slab_that_a_worker_made(scan, tmp_path, monkeypatch):
    """The function of a worker, here; then the rest without a cluster, broken off once."""
    out = tmp_path / "out"
    given = settings(scan, out, dtype="uint16", format="h5", zingers=9.0)
    kept = begin(given)
    receipt = make_slices(replace(given, resume=True), kept.mark(), 8, 24)
    assert receipt.figures["dead_pixels"] == 1 and receipt.zingers > 0
    assert kept.missing() == [slice(0, 8), slice(24, ROWS)]
    with pytest.raises(OutputError, match="--resume"):
        reconstruction_of(given)
    job = reconstruction_of(replace(given, resume=True))
    save = job.kept.save

    def once(start, part):
        save(start, part)
        raise KeyboardInterrupt

    monkeypatch.setattr(job.kept, "save", once)
    with pytest.raises(StoppedError, match="24 of 40 slices are kept"):
        made(job)
    # What a run in another format leaves that is killed.
    (out / "volume.zarr.part").mkdir()
    for _ in (again := reconstruction_of(replace(given, resume=True))).run():
        pass
    assert not (out / "volume.zarr.part").exists()
    alone = reconstruction_of(replace(given, out=tmp_path / "b"))
    for _ in alone.run():
        pass
    volumes = [read_volume(folder / "volume.h5") for folder in (out, tmp_path / "b")]
    assert volumes[0].tobytes() == volumes[1].tobytes() and not again.kept.path.exists()
    axes = [json.loads((f / "config.json").read_text())["axis"] for f in (out, tmp_path / "b")]
    assert axes[0]["center"] == axes[1]["center"]


@pytest.mark.full
def test_slabs_are_as_large_as_the_axis_found_makes_them(tmp_path):
    """About the detector's middle, which the axis is taken for at first, they are smaller."""
    angles = 2 * np.pi * np.arange(60) / 60
    cone = Cone(angles, 20, 28, 2.0, R, S, center=(9.5, 14.6))
    lines = project([Ellipsoid.ball(6.0, 0.02, (0.5, 1.0, -2.0))], Grid((2, 2, 2)), cone)
    lengths = {"source_to_axis": R, "source_to_detector": S, "pitch": 2.0}
    np.savez(tmp_path / "scan.npz", projections=lines, angles=angles, **lengths)
    given = settings(tmp_path / "scan.npz", tmp_path / "a", kind="attenuation")
    shape = reconstruction_of(given).shape
    kept = begin(given)
    make_slices(replace(given, resume=True), kept.mark(), 0, 8)
    ((_, slab),) = kept.slabs()
    assert slab.shape[1] > shape[1]
    volume, _ = made(reconstruction_of(replace(given, resume=True)))
    alone, _ = made(reconstruction_of(replace(given, out=tmp_path / "b")))
    assert volume.tobytes() == alone.tobytes()


def test_what_cannot_be_cut_is_refused(scan, tmp_path):
    with pytest.raises(InputError, match="fbp or backproject"):
        reconstruction_of(settings(scan, tmp_path / "a", cluster="local:2", method="cgls"))
