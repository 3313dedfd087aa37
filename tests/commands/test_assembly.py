"""A volume that is put together while its slabs come: in any order, and by whoever went before."""

import threading
from types import SimpleNamespace

import numpy as np
import pytest

from rift_cl.commands.reconstruct.assembly import Assembly
from rift_cl.commands.reconstruct.job import Reconstruction
from rift_cl.commands.reconstruct.kept_slabs import SlabFolder
from rift_cl.commands.reconstruct.overlap import Behind
from rift_cl.commands.reconstruct.report import Preview
from rift_cl.commands.reconstruct.settings import ReconstructSettings
from rift_cl.commands.reconstruct.slice_window import cut_evenly
from rift_cl.commands.reconstruct.spread import _runs, spread
from rift_cl.errors import OutputError
from rift_cl.io import open_volume, read_volume

SHAPE = (70, 3, 300)
VOLUME = np.random.default_rng(7).standard_normal(SHAPE).astype(np.float32)
SLABS = [(0, 16), (16, 32), (32, 48), (48, 64), (64, 70)]


def folder_of(path):
    kept = SlabFolder(path / "slabs", SHAPE)
    kept.begin({})
    return kept


def opener(path):
    return lambda: open_volume(path / "volume.zarr", SHAPE, format="zarr", spacing=1.0)


def contents(store):
    return {p.relative_to(store): p.read_bytes() for p in store.rglob("*") if p.is_file()}


@pytest.fixture(scope="module")
def whole(tmp_path_factory):
    """What a store holds that was written at once."""
    path = tmp_path_factory.mktemp("whole")
    with opener(path)() as volume:
        volume.write(0, VOLUME)
    return contents(path / "volume.zarr")


def keep(assembly, slabs):
    for first, stop in slabs:
        assembly.keep(first, VOLUME[first:stop])


@pytest.mark.parametrize("order", [(0, 1, 2, 3, 4), (4, 2, 0, 3, 1)])
def test_slabs_in_any_order_make_the_same_bytes(tmp_path, whole, order):
    preview, one = Preview(SHAPE[0]), Preview(SHAPE[0])
    with Assembly(folder_of(tmp_path), opener(tmp_path), preview.take) as assembly:
        keep(assembly, [SLABS[number] for number in order])
        assembly.complete()
        # No name before all that belongs to it is there.
        assert not (tmp_path / "volume.zarr").exists()
    assert contents(tmp_path / "volume.zarr") == whole
    one.take(0, VOLUME)
    assert preview.statistics() == one.statistics()
    assert [a.tobytes() for a in preview.images] == [a.tobytes() for a in one.images]
    assert {n: plane.tobytes() for n, plane in preview.planes.items()} == {
        n: plane.tobytes() for n, plane in one.planes.items()
    }


def test_copies_are_made_as_slices_come(tmp_path):
    """Sixteen slices of a copy of every second, once thirty-two of the volume are there."""
    with opener(tmp_path)() as volume:
        parts = tmp_path / "volume.zarr.part" / "1"
        for first, stop in ((0, 16), (16, 31), (32, 48)):
            volume.write(first, VOLUME[first:stop])
            assert not (parts / "0").exists()
        volume.write(31, VOLUME[31:32])
        assert (parts / "0").is_dir() and not (parts / "1").exists()
        volume.write(48, VOLUME[48:])
        assert sorted(p.name for p in parts.iterdir() if p.is_dir()) == ["0", "1", "2"]
        header = (tmp_path / "volume.zarr.part" / ".zattrs").read_text(encoding="utf-8")
        assert '"complete": false' in header


def test_what_others_keep_is_taken_once(tmp_path, whole):
    """Two workers made some of the same slices, and a third process goes on."""
    kept, taken = folder_of(tmp_path), []
    look = lambda start, slab: taken.extend(range(start, start + len(slab)))  # noqa: E731
    with Assembly(kept, opener(tmp_path), look) as assembly:
        for first, stop in ((8, 20), (12, 30)):
            kept.save(first, VOLUME[first:stop])
            assembly.catch_up()
        keep(assembly, [(0, 16), (28, 70)])
        assembly.complete()
    assert sorted(set(taken)) == list(range(SHAPE[0]))
    assert contents(tmp_path / "volume.zarr") == whole


def test_what_a_killed_process_left_of_the_volume_is_not_gone_on_with(tmp_path, whole):
    """Its slabs are: they appeared whole or not at all."""
    kept = folder_of(tmp_path)
    killed = Assembly(kept, opener(tmp_path))
    killed.__enter__()
    keep(killed, SLABS[:3])
    torn = next(p for p in (tmp_path / "volume.zarr.part" / "0").rglob("0") if p.is_file())
    torn.write_bytes(torn.read_bytes()[:7])
    with Assembly(kept, opener(tmp_path)) as assembly:
        keep(assembly, SLABS[3:])
        assembly.complete()
    assert contents(tmp_path / "volume.zarr") == whole


def test_a_volume_that_is_broken_off_leaves_its_slabs_alone(tmp_path):
    kept = folder_of(tmp_path)
    with pytest.raises(KeyboardInterrupt), Assembly(kept, opener(tmp_path)) as assembly:
        keep(assembly, SLABS[:2])
        raise KeyboardInterrupt
    assert [path.name for path in tmp_path.iterdir()] == ["slabs"] and kept.done == 32
    with pytest.raises(OutputError, match="38 of 70 slices"), Assembly(kept, opener(tmp_path)) as a:
        a.complete()


def test_a_volume_whose_integers_are_not_known_waits(tmp_path):
    kept, taken = folder_of(tmp_path), []
    look = lambda start, slab: taken.append(start)  # noqa: E731
    with Assembly(kept, opener(tmp_path), look, waits=True) as assembly:
        keep(assembly, SLABS)
        assert not taken and not (tmp_path / "volume.zarr.part").exists()
        with pytest.raises(OutputError, match="not open"):
            assembly.take(0, VOLUME)
        assembly.complete()
    assert taken == [first for first, _ in SLABS]
    assert read_volume(tmp_path / "volume.zarr").tobytes() == VOLUME.tobytes()


def test_an_offer_is_taken_when_nothing_is_under_way():
    begun, go_on, done = threading.Event(), threading.Event(), []

    def work():
        begun.set()
        go_on.wait()
        done.append("work")

    with Behind() as behind:
        behind.offer(work)
        begun.wait()
        behind.offer(done.append, "declined")
        go_on.set()
        behind.wait()
        behind.offer(done.append, "taken")
    assert done == ["work", "taken"]


def test_runs_are_cut_where_chunks_are():
    assert cut_evenly(slice(5, 40), 16) == [slice(5, 16), slice(16, 32), slice(32, 40)]
    assert cut_evenly(slice(16, 32), 16) == [slice(16, 32)]
    assert cut_evenly(slice(3, 5), 16) == [slice(3, 5)]
    # Of many slices tasks are whole chunks; of few each worker has some.
    assert {run.start % 16 for run in _runs([slice(0, 1000)], 5, 1)} == {0}
    assert len(list(_runs([slice(0, 12)], 2, 1))) == 6
    # Blocks of a formula's own are whole as well.
    assert {run.start % 48 for run in _runs([slice(0, 1000)], 5, 24)} == {0}


def test_the_volume_grows_while_workers_go_on(tmp_path, monkeypatch):
    """Each task of these waits until what the one before it made is in the volume."""
    path, rows = tmp_path / "scan.npz", 6
    counts = np.random.default_rng(3).uniform(0.2, 0.9, (20, rows, 16)).astype(np.float32)
    np.savez(path, projections=counts, angles=np.arange(20) * 9.0)
    options = {"center": 7.5, "angle_unit": "degrees", "kind": "attenuation"}
    given = ReconstructSettings(path, out=tmp_path / "out", cluster="local:1", **options)
    job = Reconstruction(given)
    job._settle()
    job.folder.make()
    job.kept.begin(job._facts(), job.inversion.projection)
    taken = threading.Semaphore(0)

    def each(function, tasks):
        for task in tasks:
            yield task, function(*task.arguments)
            while not taken.acquire(blocking=False):
                yield None

    class OneWorker:
        sentence, lost = "one", 0

        def __len__(self):
            return 1

    workers = OneWorker()
    workers.each, workers.wait, workers.check = each, lambda: None, lambda paths: None
    begun = SimpleNamespace(get=lambda: workers, leave=lambda: None)
    monkeypatch.setattr(job, "_show_once", lambda start, slab: taken.release())
    with job._assembly() as assembly:
        assert [report.done for report in spread(job, begun, assembly)][-1] == rows
        assembly.complete()
    alone = Reconstruction(ReconstructSettings(path, out=tmp_path / "alone", **options))
    list(alone.run())
    volumes = [read_volume(tmp_path / name / "slices") for name in ("out", "alone")]
    assert volumes[0].tobytes() == volumes[1].tobytes()
