"""``rift reconstruct`` of slices that take four times the memory that it may use together.

Cones are in ``test_reconstruct_cone.py``, and every solver in ``test_volumes_solved_in_parts.py``.
"""

import h5py
import numpy as np
import pytest

import rift_cl as rift
from rift_cl.commands.reconstruct.job import Reconstruction
from rift_cl.commands.reconstruct.settings import ReconstructSettings

ROWS, BINS, VIEWS = 400, 128, 4
METHODS = {
    "fbp": {},
    "backproject": {},
    "sirt": {"steps": 1},
    "cgls": {"steps": 1},
    "tv": {"steps": 1, "weight": 0.01},
}


@pytest.fixture(scope="module")
def scan(tmp_path_factory):
    """A square whose density changes from row to row."""
    angles = np.arange(VIEWS) * np.pi / VIEWS
    A = rift.Projector(rift.Grid((BINS, BINS)), rift.Parallel(angles, BINS), footprint="strip")
    row = A(np.pad(np.ones((64, 64), np.float32), 32))
    path = tmp_path_factory.mktemp("memory") / "scan.h5"
    with h5py.File(path, "w") as file:
        file["angles"] = angles
        levels = (1 + 0.3 * np.sin(np.arange(ROWS))).astype(np.float32)
        file["data"] = row[:, None] * levels[:, None]
    return path


@pytest.mark.full
@pytest.mark.once
@pytest.mark.parametrize("method", METHODS)
def test_slices_four_times_the_memory_have_the_same_bits(scan, tmp_path, method):
    common = {"dataset": "data", "theta": "angles", "angle_unit": "radians", "kind": "attenuation"}
    common |= {"center": 63.5, "method": method, "format": "h5", "pad": "off"}
    common |= {"footprint": "strip", **METHODS[method]}
    planned = Reconstruction(ReconstructSettings(scan, out=tmp_path / "none", **common)).inversion
    memory = planned.fixed() + planned.need * 3 // 2
    assert 4 * memory <= 4 * ROWS * BINS * BINS
    whole = rift.reconstruct_scan(scan, tmp_path / "a", **common)
    parts = rift.reconstruct_scan(scan, tmp_path / "b", memory=str(memory), **common)
    assert parts.read().tobytes() == whole.read().tobytes()


@pytest.mark.parametrize(
    ("rows", "fitting", "wanted"), [(390, 16, 16), (24, 20, 16), (390, 12, 8), (12, 12, 12)]
)
def test_a_slab_is_as_many_slices_as_fit_of_a_part_of_the_volume(
    scan, tmp_path, rows, fitting, wanted
):
    common = {"dataset": "data", "theta": "angles", "angle_unit": "radians", "kind": "attenuation"}
    common |= {"center": 63.5, "out": tmp_path / "none", "footprint": "strip", "rows": (0, rows)}
    planned = Reconstruction(ReconstructSettings(scan, **common)).inversion
    memory = planned.fixed() + planned.need * fitting
    job = Reconstruction(ReconstructSettings(scan, memory=str(memory), **common))
    starts = [slab.start for slab in job.slabs]
    assert starts == list(range(0, rows, wanted)) and job.slabs[-1].stop == rows
