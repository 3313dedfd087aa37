"""ASTRA's dictionaries mean here what they mean in ASTRA, and come back as they were."""

from __future__ import annotations

import numpy as np
import pytest

import rift_cl as rift
from rift_cl.errors import InputError, ShapeError
from rift_cl.interop.astra import from_astra, to_astra

pytestmark = pytest.mark.once

ANGLES = np.linspace(-0.4, 3.9, 11)


def window(*sizes, spacing=1.0, at=(0, 0, 0)):
    """What create_vol_geom gives, of rows, columns, slices about a point (x, y, z)."""
    names = dict(zip("YXZ", ("GridRowCount", "GridColCount", "GridSliceCount"), strict=True))
    middles = dict(zip("XYZ", at, strict=True))
    geometry = {names[axis]: n for axis, n in zip("YXZ", sizes, strict=False)}
    option = {}
    for axis, n in zip("YXZ", sizes, strict=False):
        option[f"WindowMin{axis}"] = middles[axis] - n * spacing / 2
        option[f"WindowMax{axis}"] = middles[axis] + n * spacing / 2
    return {"option": option, **geometry}


def parallel(width=1.0, bins=30, angles=ANGLES):
    return {
        "type": "parallel",
        "DetectorWidth": width,
        "DetectorCount": bins,
        "ProjectionAngles": angles,
    }


def parallel3d(rows=3, along=1.0, width=1.0, bins=30):
    return {
        "type": "parallel3d",
        "DetectorSpacingX": width,
        "DetectorSpacingY": along,
        "DetectorRowCount": rows,
        "DetectorColCount": bins,
        "ProjectionAngles": ANGLES,
    }


def vectors(shift=0.0, width=1.0, angles=ANGLES, bins=30):
    """A detector whose middle is moved by ``shift``, as ASTRA's documentation writes it."""
    c, s = np.cos(angles), np.sin(angles)
    columns = [s, -c, shift * c, shift * s, width * c, width * s]
    return {"type": "parallel_vec", "DetectorCount": bins, "Vectors": np.stack(columns, axis=1)}


def blobs(ny=20, nx=26):
    y, x = np.mgrid[:ny, :nx]
    first = np.exp(-((x - 17) ** 2 + (y - 5) ** 2) / 12)
    return (first + 2 * np.exp(-((x - 6) ** 2) / 8 - (y - 12) ** 2 / 20)).astype(np.float32)


CASES = {
    "plain": (parallel(), window(20, 26)),
    "fine bins": (parallel(0.6, 60), window(20, 26)),
    "small pixels": (parallel(0.5, 40), window(20, 26, spacing=0.5)),
    "off centre": (parallel(1, 50), window(20, 26, at=(3, -5, 0))),
    "moved detector": (vectors(2.5), window(20, 26)),
}


@pytest.mark.parametrize("case", CASES)
def test_projections_are_astras_own(case, device):
    astra = pytest.importorskip("astra", reason="the ASTRA toolbox is not installed")
    proj_geom, vol_geom = CASES[case]
    projector = astra.create_projector("linear", proj_geom, vol_geom)
    _, theirs = astra.create_sino(blobs(), projector)
    ours = rift.Projector(*from_astra(proj_geom, vol_geom), "joseph", device=device)(blobs())
    assert np.linalg.norm(ours - theirs) < 1e-3 * np.linalg.norm(theirs)


@pytest.mark.parametrize("case", CASES)
def test_a_geometry_comes_back_as_it_was(case):
    proj_geom, vol_geom = CASES[case]
    again, window_again = to_astra(*from_astra(proj_geom, vol_geom))
    assert again.keys() == proj_geom.keys()
    assert all(np.allclose(again[k], proj_geom[k]) for k in again if k != "type")
    assert again["type"] == proj_geom["type"]
    option, given = window_again.pop("option"), dict(vol_geom)
    assert option == pytest.approx(given.pop("option"))
    assert window_again == given


def test_a_scan_comes_back_as_it_was():
    grid = rift.Grid((20, 26), (0.5, 0.25), (3.0, -1.5))
    scan = rift.Parallel(ANGLES, 33, 0.75)
    assert from_astra(*to_astra(grid, scan)) == (grid, scan)
    volume = rift.Grid((4, 20, 26), (0.5, 0.5, 0.25), (0.0, 3.0, -1.5))
    assert from_astra(*to_astra(volume, scan)) == (volume, scan)


@pytest.mark.parametrize("shape", [(20, 26), (4, 20, 26)])
def test_an_axis_off_the_middle_travels_as_vectors(shape):
    grid = rift.Grid(shape, center=(*(2.5,) * (len(shape) - 2), 3, -1))
    scan = rift.Parallel(ANGLES, 33, 0.75, center=14.2)
    proj_geom, vol_geom = to_astra(grid, scan)
    assert proj_geom["type"].endswith("_vec")
    grid_again, again = from_astra(proj_geom, vol_geom)
    assert (grid_again, again.bins) == (grid, 33)
    assert np.allclose([again.pitch, again.center], [0.75, 14.2])
    assert np.allclose(np.exp(1j * again.angles), np.exp(1j * ANGLES))


def test_a_slice_of_a_volume_is_an_image_upside_down():
    grid, scan = from_astra(parallel(), window(20, 26, at=(1, 2, 0)))
    volume, same = from_astra(parallel3d(), window(20, 26, 3, at=(1, 2, 0)))
    assert np.array_equal(scan.angles, -same.angles)
    assert (grid.center, volume.slice().center) == ((-2, 1), (2, 1))
    A, B = (rift.Projector(g, s) for g, s in ((grid, scan), (volume.slice(), same)))
    assert np.linalg.norm(A(blobs()) - B(blobs()[::-1])) < 3e-3 * np.linalg.norm(A(blobs()))


def test_vectors_that_are_turns_are_read_as_angles():
    _, scan = from_astra(vectors(width=0.8), window(20, 26))
    _, turns = from_astra(parallel(0.8), window(20, 26))
    assert np.allclose([scan.pitch, scan.center], [turns.pitch, turns.center])
    assert np.allclose(np.exp(1j * scan.angles), np.exp(1j * turns.angles))


def test_the_other_side_of_a_beam_and_its_length_do_not_matter():
    flipped = vectors(2.0)
    flipped["Vectors"][:, :2] *= -3
    _, scan = from_astra(flipped, window(20, 26))
    _, same = from_astra(vectors(2.0), window(20, 26))
    assert np.allclose(scan.angles, same.angles)
    assert np.isclose(scan.center, same.center)


def test_an_oblique_detector_has_the_pitch_that_its_rays_see():
    oblique = vectors()
    oblique["Vectors"][:, 4:] += oblique["Vectors"][:, :2]
    _, scan = from_astra(oblique, window(20, 26))
    assert np.isclose(scan.pitch, 1)


def test_a_window_that_is_left_out_is_in_pixels():
    grid, _ = from_astra(parallel(), {"GridRowCount": 20, "GridColCount": 26})
    assert grid == rift.Grid((20, 26))


def changed(geometry, **changes):
    return {**geometry, **changes}


def uneven(column, by):
    geometry = vectors()
    geometry["Vectors"][3, column] += by
    return geometry


FLAT, DEEP = window(20, 26), window(20, 26, 3)
BAD = {
    "cylinder": (changed(parallel(), type="cyl_cone_vec"), FLAT, InputError, "no other has"),
    "cone": (changed(parallel3d(), type="cone_vec"), DEEP, InputError, "no 'Vectors'"),
    "no type": ({}, FLAT, InputError, r"no 'type': make it with astra.create_proj_geom"),
    "an id": (5, FLAT, InputError, "proj_geom is a int, wanted a dictionary"),
    "no window": (parallel(), None, InputError, "vol_geom is a NoneType"),
    "option": (parallel(), changed(FLAT, option=[1]), InputError, "option of vol_geom is a list"),
    "no rows": (parallel(), {"GridColCount": 5}, InputError, "vol_geom has no 'GridRowCount'"),
    "inside out": (
        *(parallel(), changed(FLAT, option={"WindowMinX": 9, "WindowMaxX": 1})),
        *(InputError, "window along X"),
    ),
    "NaN": (
        *(parallel(), changed(FLAT, option={"WindowMaxY": float("nan")})),
        *(InputError, "window along Y"),
    ),
    "flat": (parallel3d(), FLAT, ShapeError, "'parallel3d' and vol_geom of 2 dim"),
    "deep": (parallel(), DEEP, ShapeError, "vol_geom of 3 dimensions, wanted 2"),
    "bins": (changed(parallel(), DetectorCount=2.5), FLAT, InputError, "DetectorCount is 2.5"),
    "width": (parallel(-1), FLAT, InputError, "DetectorWidth is -1, wanted a positive"),
    "no angles": (parallel(angles=[]), FLAT, ShapeError, "angles is empty"),
    "text": (parallel(angles=["a"]), FLAT, InputError, "radians"),
    "vectors": (changed(vectors(), Vectors=np.ones((3, 5))), FLAT, ShapeError, r"\(angles, 6\)"),
    "ragged": (changed(vectors(), Vectors=[[1], [1, 2]]), FLAT, ShapeError, "Vectors must be"),
    "endless": (uneven(2, np.inf), FLAT, InputError, "NaN or infinity"),
    "no ray": (changed(vectors(), Vectors=np.zeros((2, 6))), FLAT, InputError, "no direction"),
    "along the ray": (
        *(changed(vectors(), Vectors=[[1, 0, 0, 0, 1, 0]]), FLAT),
        *(InputError, "no pitch"),
    ),
    "jitter": (uneven(2, 0.5), FLAT, InputError, "no axis in common"),
    "zoom": (uneven(4, 0.5), FLAT, InputError, "no pitch and no axis in common"),
    "rows": (parallel3d(4), DEEP, InputError, "the 4 rows.*the 3 slices"),
    "spread rows": (parallel3d(along=2.0), DEEP, InputError, "rows of its detector"),
    "lifted": (parallel3d(), window(20, 26, 3, at=(0, 0, 1)), InputError, "about z = 1"),
}


@pytest.mark.parametrize("case", BAD)
def test_what_has_no_counterpart_is_named(case):
    proj_geom, vol_geom, error, words = BAD[case]
    with pytest.raises(error, match=words):
        from_astra(proj_geom, vol_geom)


@pytest.mark.parametrize("column", [2, 8, 9])
def test_rays_that_leave_their_slice_are_refused(column):
    proj_geom, vol_geom = to_astra(rift.Grid((3, 8, 8)), rift.Parallel(ANGLES, 9, center=3))
    proj_geom["Vectors"][:, column] += 0.1
    with pytest.raises(InputError, match="rays lie"):
        from_astra(proj_geom, vol_geom)
