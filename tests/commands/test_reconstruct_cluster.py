"""``rift reconstruct --cluster``: other processes make the slices, to the same bits."""

import json
import signal

import numpy as np
import pytest
from killed_worker import kill_one

from rift_cl.commands.reconstruct.job import Reconstruction
from rift_cl.commands.reconstruct.kept_slabs import SlabFolder
from rift_cl.commands.reconstruct.settings import ReconstructSettings
from rift_cl.commands.reconstruct.spread import make_slices
from rift_cl.errors import CheckpointError, InputError
from rift_cl.io import read_volume

WANTED = "Dask is not installed (pip install dask distributed)"

ROWS = 12


@pytest.fixture(scope="module")
def scan(tmp_path_factory):
    """Counts, so that stripes are removed and dead pixels counted."""
    path = tmp_path_factory.mktemp("cluster") / "scan.npz"
    rng = np.random.default_rng(3)
    counts = rng.integers(200, 900, (40, ROWS, 32)).astype(np.float32)
    flats = np.full((2, ROWS, 32), 1000, np.float32)
    flats[:, 5, 7] = 0
    np.savez(path, projections=counts, flats=flats, darks=0 * flats, angles=np.arange(40) * 4.5)
    return path


def settings(scan, out, **options):
    return ReconstructSettings(scan, out=out, center=15.5, angle_unit="degrees", **options)


def made(job):
    for _ in job.run():
        pass
    return read_volume(job.settings.out / "slices"), job.metrics


@pytest.mark.full
def test_a_killed_worker_changes_no_bit(scan, tmp_path, monkeypatch):
    pytest.importorskip("distributed", reason=WANTED)
    begun = kill_one(monkeypatch, after=3)
    monkeypatch.chdir(scan.parent)
    job = Reconstruction(settings(scan.relative_to(scan.parent), tmp_path / "a", cluster="local:2"))
    told = []
    job.announce = told.append
    volume, figures = made(job)
    assert len(begun) >= 6 and any("2 workers of tcp://127.0.0.1:" in line for line in told)
    alone, wanted = made(Reconstruction(settings(scan, tmp_path / "b")))
    assert volume.tobytes() == alone.tobytes()
    assert wanted["dead_pixels"] > 0
    for name in ("dead_pixels", "starved_samples", "mean"):
        assert figures[name] == wanted[name]
    assert figures["workers"] >= 1
    assert not (tmp_path / "a" / "slabs").exists()


@pytest.mark.full
def test_a_worker_that_hangs_changes_no_bit(scan, tmp_path, monkeypatch):
    """Stopped, as one is whose device does not answer: its slices go to others, after a while."""
    pytest.importorskip("distributed", reason=WANTED)
    kill_one(monkeypatch, after=3, by=signal.SIGSTOP)
    job = Reconstruction(settings(scan, tmp_path / "a", cluster="local:2", part_timeout=30.0))
    volume, figures = made(job)
    assert volume.tobytes() == made(Reconstruction(settings(scan, tmp_path / "b")))[0].tobytes()
    assert figures["workers"] >= 1


@pytest.mark.full
def test_a_run_goes_on_with_a_part_that_a_worker_made(scan, tmp_path, monkeypatch):
    """The function of a worker, here; then the rest without a cluster."""
    out = tmp_path / "out"
    begun = Reconstruction(settings(scan, out))
    begun._settle()
    begun.folder.make()
    begun.kept.begin(begun._facts())
    receipt = make_slices(settings(scan, out, resume=True), begun.kept.mark(), 2, 7)
    assert receipt.figures["dead_pixels"] > 0 and receipt.device
    assert begun.kept.missing() == [slice(0, 2), slice(7, ROWS)]
    volume, _ = made(Reconstruction(settings(scan, out, resume=True)))
    assert volume.tobytes() == made(Reconstruction(settings(scan, tmp_path / "b")))[0].tobytes()


@pytest.mark.full
def test_a_worker_tells_which_weights_it_chose(scan, tmp_path):
    tv = {"method": "tv", "steps": 2}
    _, token = begin_anew(settings(scan, tmp_path / "out", **tv))
    receipt = make_slices(settings(scan, tmp_path / "out", resume=True, **tv), token, 2, 4)
    assert sorted(receipt.weights) == sorted(receipt.residuals) == [2, 3]
    job = Reconstruction(settings(scan, tmp_path / "b", **tv))
    job.take(receipt)
    assert job.inversion.figures()["weight"] == pytest.approx(sum(receipt.weights.values()) / 2)


@pytest.mark.full
def test_a_worker_leaves_doubts_to_the_process_that_began_the_run(scan, tmp_path, monkeypatch):
    """They take as long as the search for the axis."""
    kept, token = begin_anew(settings(scan, tmp_path / "out"))

    def search(*_):
        raise AssertionError("the axis is given")

    monkeypatch.setattr("rift_cl.commands.inputs.told_axis.find_axis", search)
    make_slices(settings(scan, tmp_path / "out", resume=True), token, 2, 4)
    assert kept.missing() == [slice(0, 2), slice(4, ROWS)]


@pytest.mark.full
def test_a_part_is_projected_as_the_run_began(scan, tmp_path):
    """By costs these slices take a projector in real space."""
    out = tmp_path / "out"
    begun = Reconstruction(settings(scan, out, error=1e-2))
    begun._settle()
    begun.folder.make()
    asked = Reconstruction(settings(scan, tmp_path / "asked"))
    asked._settle()
    assert asked.inversion.projection == {"footprint": "strip"}
    begun.kept.begin(asked._facts(), begun.inversion.projection)
    make_slices(settings(scan, out, resume=True), begun.kept.mark(), 2, 7)
    ((_, slices),) = begun.kept.slabs()
    alone, _ = made(Reconstruction(settings(scan, tmp_path / "b", error=1e-2)))
    assert slices.tobytes() == alone[2:7].tobytes()
    again = Reconstruction(settings(scan, out, resume=True))
    again._settle()
    assert again.inversion.projection == {"error": 1e-2}


def test_a_forged_projector_is_refused(tmp_path):
    kept = SlabFolder(tmp_path / "slabs", (4, 2, 2))
    kept.begin({}, {"error": 1e-3})
    assert kept.projection() == {"error": 1e-3}
    for forged in ({"error": "x"}, {"device": "y"}):
        kept.begin({}, forged)
        with pytest.raises(CheckpointError, match="projection"):
            kept.projection()


def begin_anew(given):
    """What a command does before it hands out slices, and the token of its run."""
    begun = Reconstruction(given)
    begun._settle()
    begun.folder.make()
    begun.kept.begin(begun._facts())
    return begun.kept, begun.kept.mark()


@pytest.mark.full
def test_a_worker_that_stays_joins_the_later_run_too(scan, tmp_path):
    """Angles that were mended in their file are read again."""
    angles, out = tmp_path / "angles.txt", tmp_path / "out"
    np.savetxt(angles, np.arange(40) * 4.0)
    theirs = settings(scan, out, theta=str(angles), resume=True)
    kept, token = begin_anew(settings(scan, out, theta=str(angles)))
    make_slices(theirs, token, 2, 4)
    np.savetxt(angles, np.arange(40) * 4.5)
    kept, token = begin_anew(settings(scan, out, theta=str(angles), overwrite=True))
    make_slices(theirs, token, 2, 4)
    ((_, slices),) = kept.slabs()
    alone, _ = made(Reconstruction(settings(scan, tmp_path / "b")))
    assert slices.tobytes() == alone[2:4].tobytes()


def test_a_worker_of_an_earlier_run_keeps_nothing_in_the_later_one(tmp_path):
    early, late = (SlabFolder(tmp_path / "slabs", (4, 2, 2)) for _ in range(2))
    early.begin({})
    early.token = early.mark()
    early.save(0, np.zeros((1, 2, 2), np.float32))
    late.begin({})
    late.token = late.mark()
    late.save(0, np.ones((2, 2, 2), np.float32))
    with pytest.raises(CheckpointError, match="begun anew"):
        early.save(0, np.zeros((1, 2, 2), np.float32))
    assert {path.name for path in late.path.iterdir()} == {"run.json", "00000-00002.npy"}
    late.go_on({})


def test_a_slice_that_two_workers_kept_comes_once(tmp_path):
    kept = SlabFolder(tmp_path / "slabs", (9, 2, 2))
    volume = np.arange(36, dtype=np.float32).reshape(9, 2, 2)
    kept.begin({})
    for first, stop in ((0, 4), (0, 2), (2, 3), (3, 7), (7, 9)):
        kept.save(first, volume[first:stop])
    slabs = list(kept.slabs())
    assert [start for start, _ in slabs] == [0, 2, 4, 7]
    assert np.concatenate([slab for _, slab in slabs]).tobytes() == volume.tobytes()
    assert not kept.missing()


@pytest.mark.full
def test_the_option_is_checked_and_not_repeated(scan, tmp_path):
    with pytest.raises(InputError, match="local:N"):
        Reconstruction(settings(scan, tmp_path / "a", cluster="two"))
    for timeout, word in ((-1.0, "positive"), (5.0, "--cluster")):
        with pytest.raises(InputError, match=word):
            Reconstruction(settings(scan, tmp_path / "a", part_timeout=timeout))
    job = Reconstruction(settings(scan, tmp_path / "a", cluster="local:2"))
    assert job.plan()["workers"] == "local:2"
    assert "cluster" not in job._facts()
    made(Reconstruction(settings(scan, tmp_path / "a")))
    assert json.loads((tmp_path / "a" / "config.json").read_text())["complete"]
