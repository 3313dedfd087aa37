"""A scan is another one once its content changed, even where its time and size did not."""

import os

import h5py
import numpy as np
import pytest

from rift_cl.commands.fit.inputs import scan_inputs
from rift_cl.commands.inputs.scan_identity import WatchedScan
from rift_cl.commands.inputs.scan_input import ScanInput
from rift_cl.commands.run_folder.run_inputs import input_contents
from rift_cl.io import file_content, open_scan
from rift_cl.io.file_content import Content


@pytest.fixture
def stored(tmp_path):
    """Stores projections in one file, whose time is always the same."""

    def store(projections):
        path = tmp_path / "a.h5"
        with h5py.File(path, "w") as file:
            file["exchange/data"] = np.asarray(projections, np.float32)
            file["exchange/theta"] = np.arange(len(projections)) * 180 / len(projections)
        os.utime(path, ns=(10**18, 10**18))
        return WatchedScan(open_scan(path, kind="attenuation")).identity()

    return store


def test_the_same_content_is_the_same_scan(stored):
    values = np.random.default_rng(0).random((12, 2, 16))
    assert stored(values) == stored(values)


def test_other_content_of_the_same_size_and_time_is_another_scan(stored):
    values = np.random.default_rng(0).random((12, 2, 16))
    assert stored(values) != stored(values[::-1])


def test_another_number_of_rows_at_the_same_time_is_another_scan(stored):
    values = np.zeros((12, 2, 16))
    assert stored(values) != stored(np.zeros((12, 3, 16)))


def test_a_large_file_that_changed_anywhere_wide_is_another_scan(stored):
    values = np.zeros((40, 64, 512))
    changed = values.copy()
    changed[17:21] = 1
    assert stored(values) != stored(changed)


def test_a_sampled_scan_is_known_by_its_times_where_it_is(tmp_path, monkeypatch):
    """Of a large one a change may lie between the blocks that are read."""
    monkeypatch.setattr(file_content, "_WHOLE", 1000)
    path, copy = tmp_path / "a.npy", tmp_path / "b.npy"
    for each in (path, copy):
        np.save(each, np.zeros((12, 2, 16), np.float32))
    os.utime(copy, ns=(10**18, 10**18))
    before = Content.of([path], path)
    assert before.times and before.is_same(Content.of([copy], copy))
    os.utime(path, ns=(10**18, 10**18))
    assert not before.is_same(Content.of([path], path))


@pytest.mark.parametrize("whole", [True, False])
def test_each_of_many_files_counts(tmp_path, monkeypatch, whole):
    monkeypatch.setattr(file_content, "_WHOLE", 1 << 27 if whole else 0)
    files = [tmp_path / f"{number}.raw" for number in range(300)]
    for file in files:
        file.write_bytes(bytes(64))
    before = Content.of(files, tmp_path)
    files[299].write_bytes(bytes(63) + b"1")
    assert Content.of(files, tmp_path).words != before.words


def master(folder, kind):
    """An HDF5 file whose projections lie in another, two links away; and that one."""
    values = np.random.default_rng(0).random((12, 2, 16)).astype(np.float32)
    data = folder / "data.h5"
    with h5py.File(folder / "scan.h5", "w") as file:
        file["exchange/theta"] = np.arange(12) * 15.0
        if kind == "raw":
            data = folder / "data.raw"
            values.tofile(data)
            whole = [(str(data), 0, h5py.h5f.UNLIMITED)]
            file.create_dataset("exchange/data", values.shape, "f4", external=whole)
            return folder / "scan.h5", data
        middle = h5py.ExternalLink("middle.h5", "/entry") if kind == "linked" else None
        if middle is not None:
            file["exchange/data"] = middle
        else:
            layout = h5py.VirtualLayout(values.shape, "f4")
            layout[:] = h5py.VirtualSource("middle.h5", "entry", values.shape)
            file.create_virtual_dataset("exchange/data", layout)
    with h5py.File(folder / "middle.h5", "w") as file:
        layout = h5py.VirtualLayout(values.shape, "f4")
        layout[:] = h5py.VirtualSource("data.h5", "entry", values.shape)
        file.create_virtual_dataset("entry", layout)
        # Nothing that is missing or round in circles hinders.
        file["gone"], file["back"] = h5py.ExternalLink("gone.h5", "/"), h5py.SoftLink("/back")
    with h5py.File(data, "w") as file:
        file["entry"] = values
    return folder / "scan.h5", data


@pytest.mark.each
@pytest.mark.parametrize("kind", ["virtual", "linked", "raw"])
def test_data_in_other_files_than_the_scans_own_count(tmp_path, kind):
    """For reconstructions, fits, and the runs of other commands and of sweeps."""
    path, data = master(tmp_path, kind)
    out = tmp_path / "out"

    def told():
        scan = open_scan(path, kind="attenuation")
        return (
            WatchedScan(scan).identity()["scan"]["words"],
            [each.digest for each in scan_inputs(ScanInput(path), scan.files, out)],
            input_contents(ScanInput(path), out)["scan"]["words"],
        )

    before = told()
    assert told() == before
    # Its last number, of the same size.
    content = data.read_bytes()
    with h5py.File(path) as file:
        last = file["exchange/data"][-1, -1, -1].tobytes()
    at = content.rindex(last)
    data.write_bytes(content[:at] + bytes(4) + content[at + 4 :])
    assert all(one != other for one, other in zip(told(), before, strict=True))
