"""What scanners and packages write of source and detector becomes a cone, or is refused."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pytest
import scan_files
import scanner_files as made

from rift_cl.errors import FileFormatError, InputError, PathEscapeError, RiftError, ShapeError
from rift_cl.geometry import Cone, Fan, Vectors
from rift_cl.geometry.rtk_views import RtkView, rtk_of_vectors, vectors_of_rtk
from rift_cl.io import ScanFile, open_scan
from rift_cl.io.scans.beam import Beam
from rift_cl.io.scans.beam_file import read_beam

POINT = np.array([3.0, -2.0, 1.5])
LENGTHS = "unit: mm\nsource_to_axis: 50\nsource_to_detector: 200\npitch: [0.25, 0.2]"


def seen(scan: Cone | Vectors, point: np.ndarray, view: int) -> tuple[float, float]:
    """Row and bin at which a point is seen."""
    v = scan.vectors() if isinstance(scan, Cone) else scan
    across, down, source = v.across[view], v.down[view], v.source[view]
    lines = np.stack([across, down, source - point], axis=1)
    k, i, _ = np.linalg.solve(lines, source - v.middle[view])
    return i + (v.rows - 1) / 2, k + (v.bins - 1) / 2


def cone_of(scan: ScanFile) -> Cone:
    assert isinstance(scan.cone, Cone)
    return scan.cone


def test_nikon_is_what_cil_reads(tmp_path: Path) -> None:
    """A point seen through CIL's numbers (its NikonDataReader), in its upright coordinates."""
    path = made.nikon(tmp_path, top=0.3, bottom=0.3)
    for name in (path, tmp_path):
        scan = open_scan(name)
        assert (scan.shape, scan.kind, scan.unit) == ((12, 6, 10), "counts", "mm")
    cone = cone_of(scan)
    assert (cone.source_to_axis, cone.source_to_detector, cone.pitch) == (50, 200, (0.25, 0.2))
    assert scan.incident is not None and scan.incident[0] == 60000
    theta = np.deg2rad(-30 * 5 - 3 + 180)
    turn = np.array([[math.cos(theta), -math.sin(theta)], [math.sin(theta), math.cos(theta)]])
    x, y = turn @ [-POINT[0], POINT[1]]
    axis = -0.3 * 50 / 200
    u, v = 200 * (x + axis) / (y + 50), 200 * -POINT[2] / (y + 50)
    row, bin = seen(cone, turned(POINT, math.pi - math.atan2(axis, 50)), 5)
    assert row == pytest.approx(2.5 - v / 0.25, abs=0.02)
    assert bin == pytest.approx(4.5 - u / 0.2, abs=0.02)


def test_nikon_stage_aside_is_told_where_it_bends_the_rows(tmp_path: Path) -> None:
    path = made.nikon(tmp_path)
    text = path.read_text()
    told = {}
    for offset in (0, 5, 15):
        path.write_text(text.replace("[Xrays]", f"ObjectOffsetX={offset}\n[Xrays]"))
        told[offset] = [note for note in read_beam(path).notes if "ObjectOffsetX" in note]
    assert not told[0] and not told[5]
    # Angles between the ray to an end of the row and the one through the axis: as they are from the
    # foot in the middle, and as they are seen on a detector that stands across the latter.
    toward = math.atan2(15, 50)
    bend = max(
        abs(200 * math.tan(math.atan2(end, 200) - toward) - (end - 15 * 200 / 50)) / 0.2
        for end in (-1, 1)
    )
    assert bend > 0.4 and f"up to {bend:.2g} bins off" in told[15][0]


def turned(point: np.ndarray, angle: float) -> np.ndarray:
    """A point turned about z: between two zeros of the angle, and to the axis beside the beam."""
    cosine, sine = math.cos(angle), math.sin(angle)
    return np.array([[cosine, -sine, 0], [sine, cosine, 0], [0, 0, 1]]) @ point


def test_nikon_axis_that_leans(tmp_path: Path) -> None:
    file = open_scan(made.nikon(tmp_path, top=-0.2, bottom=0.2))
    scan = file.geometry
    assert isinstance(file.cone, Cone) and file.lean == pytest.approx(math.atan(0.4 / 1.5))
    assert isinstance(scan, Vectors)
    rows = []
    for z in (-0.15, 0.15):
        row, bin = seen(scan, np.array([0, 0, z]), 3)
        rows.append((row, bin))
    slope = (rows[1][1] - rows[0][1]) * 0.2 / ((rows[1][0] - rows[0][0]) * 0.25)
    assert slope == pytest.approx(0.4 / 1.5, rel=1e-3)


def test_nikon_angles_beside(tmp_path: Path) -> None:
    path = made.nikon(tmp_path)
    lines = "".join(f"{k + 1}\t{31.0 * k:.3f}\t0.0\n" for k in range(12))
    (tmp_path / "_ctdata.txt").write_text(f"header\nProjection\tAngle\tTime\n{lines}")
    scan = open_scan(path)
    np.testing.assert_allclose(np.rad2deg(scan.angles), -31.0 * np.arange(12), atol=1e-9)
    assert "_ctdata.txt" in " ".join(scan.notes)
    assert np.rad2deg(open_scan(path, theta="0:360").angles[1]) == pytest.approx(30)


def test_an_image_too_many_is_to_be_taken_away(tmp_path: Path) -> None:
    with pytest.raises(ShapeError, match=r"11 projections .* found: 12\. Take away"):
        open_scan(made.nikon(tmp_path, views=11))


def test_one_image_of_a_symmetric_sample(tmp_path: Path) -> None:
    """A radiograph whose text names more: refused, or repeated where a person says so."""
    path = made.nikon(tmp_path, views=3142)
    for image in sorted(tmp_path.glob("*.tif"))[1:]:
        image.unlink()
    with pytest.raises(ShapeError, match="3142"):
        open_scan(path)
    scan = open_scan(path, repeat=36)
    assert scan.shape == (36, 6, 10) and np.rad2deg(scan.angles[1]) == pytest.approx(10)
    rows = scan.read(2, 4).projections
    np.testing.assert_array_equal(rows, np.broadcast_to(made.counts()[0, 2:4], rows.shape))
    with pytest.raises(InputError, match="--repeat"):
        open_scan(made.nikon(tmp_path / "more"), repeat=36)


def test_a_beam_that_the_scanner_states_needs_no_flats_from_elsewhere(tmp_path: Path) -> None:
    path = made.skyscan(tmp_path / "scan")
    made.write_series(tmp_path / "flats", "f{}.tif", np.full((2, made.ROWS, made.BINS), 9000, "u2"))
    assert open_scan(path).read(0, 1).flats is None
    assert not any("outside" in note for note in open_scan(path).notes)


def test_skyscan(tmp_path: Path) -> None:
    scan = open_scan(made.skyscan(tmp_path))
    cone = cone_of(scan)
    assert cone.center == (2, 4.5) and cone.pitch == pytest.approx((0.05, 0.05))
    assert scan.incident is not None and scan.incident[0] == 58000
    assert np.rad2deg(cone.angles[1]) == pytest.approx(30)
    other = cone_of(open_scan(tmp_path, reversed=True))
    np.testing.assert_array_equal(other.angles, -cone.angles)


def test_npz_distances(tmp_path: Path) -> None:
    angles = np.deg2rad(30.0 * np.arange(12))
    arrays = {"projections": np.zeros((12, 6, 10), "f4"), "angles": angles}
    np.savez(tmp_path / "a.npz", **arrays, sid=50.0, sdd=200.0, du=0.2, dv=0.25)
    cone = cone_of(open_scan(tmp_path / "a.npz"))
    assert cone.pitch == (0.25, 0.2) and cone.magnification == 4
    for curved in (1, 0):
        np.savez(tmp_path / "a.npz", **arrays, sid=50.0, sdd=200.0, pitch=0.2, curved=curved)
        assert cone_of(open_scan(tmp_path / "a.npz")).curved is bool(curved)
    np.savez(tmp_path / "a.npz", **arrays, sid=50.0, sdd=200.0, pitch=0.2, curved=300.0)
    with pytest.raises(InputError, match="'curved' is 300"):
        open_scan(tmp_path / "a.npz")
    np.savez(tmp_path / "b.npz", **arrays, sid=50.0, sdd=200.0)
    with pytest.raises(InputError, match=r"no pitch.*--geometry"):
        open_scan(tmp_path / "b.npz")
    np.savez(tmp_path / "c.npz", **arrays, sdd=200.0)
    assert open_scan(tmp_path / "c.npz").cone is None
    flat = {"sinogram": np.zeros((12, 10), "f4"), "angles": angles}
    np.savez(tmp_path / "d.npz", **flat, sid=50.0, sdd=200.0, pitch=0.2)
    fan = open_scan(tmp_path / "d.npz").geometry
    assert isinstance(fan, Fan) and fan.source_to_axis == 50


@pytest.mark.parametrize(("source", "far"), [(-0.05, False), (-50.0, True)])
def test_nxtomo_distances(tmp_path: Path, source: float, far: bool) -> None:
    path = tmp_path / "a.nxs"
    scan_files.nxtomo(path)
    with h5py.File(path, "a") as file:
        entry = file["entry1/tomo_entry/instrument"]
        for name, value in (("source/distance", source), ("detector/distance", 0.15)):
            entry[name] = value
            entry[name].attrs["units"] = "m"
    scan = open_scan(path, angle_unit="degrees")
    if far:
        assert scan.cone is None and "parallel" in " ".join(scan.notes)
        return
    cone = cone_of(scan)
    assert cone.source_to_axis == pytest.approx(50e3) and cone.pitch == (3.5, 3.5)
    assert cone.source_to_detector == pytest.approx(200e3) and scan.unit == "um"


def test_our_own_file(tmp_path: Path) -> None:
    more = "center: [2, 4]\nangles: 0:360\ncurved: true\nheights: [0,1,2,3,4,5,\n  6,7,8,9,10,11]"
    path = made.described(tmp_path, f"# a comment\n{LENGTHS}\n{more}")
    cone = cone_of(open_scan(path, kind="counts", flats="mean"))
    assert cone.center == (2, 4) and cone.curved and cone.heights[11] == 11
    listed = path.read_text().replace("[2, 4]", "\n- 2\n- 4")
    path.write_text(listed)
    assert cone_of(open_scan(path, kind="counts", flats="mean")) == cone
    named = open_scan(tmp_path / "images", geometry=path, kind="counts", flats="mean")
    assert cone_of(named) == cone


@pytest.mark.parametrize(
    ("line", "error", "words"),
    [
        ("pitsch: 1", FileFormatError, "'pitsch' is not known"),
        ("center: [1]", FileFormatError, r"center .*row, bin"),
        ("curved: 3", FileFormatError, "curved"),
        ("unit mm", FileFormatError, "line"),
        ("white: 10:50", FileFormatError, "white is '10:50'"),
        ("white: &w 3\nlean: *w", FileFormatError, "refers to another"),
        ("angles: other.txt", InputError, "other.txt"),
        ("heights: [1, x]", FileFormatError, "heights"),
        ("heights: [1, 2]", ShapeError, "heights"),
        ("source_to_axis: 300", InputError, "axis stands before|swapped"),
        ("pitch: 200", InputError, "units of length"),
        ("source_to_axis: -3", InputError, "positive"),
        ("center: [2, 400]", InputError, "off the detector"),
        ("projections: ../elsewhere", PathEscapeError, "outside"),
        ("geometry: ../../geometry.xml", PathEscapeError, "outside"),
    ],
)
def test_what_our_own_file_may_not_say(
    tmp_path: Path, line: str, error: type[RiftError], words: str
) -> None:
    path = made.described(tmp_path, f"{LENGTHS}\nangles: 0:360\n{line}")
    with pytest.raises(error, match=words):
        open_scan(path, kind="counts", flats="mean")


def test_a_pixel_without_size(tmp_path: Path) -> None:
    path = made.nikon(tmp_path)
    path.write_text(path.read_text().replace("SizeX=0.2", "SizeX=0"))
    with pytest.raises(FileFormatError, match="a pixel of 0 is no size"):
        open_scan(path)


def test_a_named_geometry_says_all_but_the_pitch(tmp_path: Path) -> None:
    path = made.described(tmp_path, "geometry: rtk.xml\npitch: [0.25, 0.2]\nwhite: 60000")
    (tmp_path / "rtk.xml").write_text("")
    with pytest.raises(FileFormatError, match="white does not go with geometry"):
        open_scan(path)


@pytest.mark.parametrize(
    ("fields", "error", "words"),
    [
        ({"views": 3142}, ShapeError, r"3142 projections .* images found: 12.*--theta"),
        ({"rows": 10, "bins": 6}, ShapeError, "rows and bins are swapped"),
        ({"rows": 7}, ShapeError, "another scan"),
        ({"bins": "x"}, FileFormatError, "DetectorPixelsX"),
    ],
)
def test_what_a_scanner_may_not_say(
    tmp_path: Path, fields: dict[str, object], error: type[RiftError], words: str
) -> None:
    path = made.nikon(tmp_path, **fields)
    with pytest.raises(error, match=words):
        open_scan(path)


def vectors_of(cone: Cone) -> np.ndarray:
    v = cone.vectors()
    return np.concatenate([v.source, v.middle, v.across, v.down], axis=1)


def test_coarse_vectors_of_several_turns_have_a_unit_of_angles(tmp_path: Path) -> None:
    """Their angles follow from places, whatever they span."""
    steps = np.arange(60)
    cone = Cone(steps * np.pi / 10, 6, 10, 0.5, 50, 100, heights=steps / 6 - 5)
    np.savetxt(tmp_path / "vectors.txt", vectors_of(cone))
    np.save(tmp_path / "scan.npy", np.ones((60, 6, 10), np.float32))
    for unit in (None, "degrees"):
        scan = open_scan(
            tmp_path / "scan.npy",
            geometry=tmp_path / "vectors.txt",
            kind="attenuation",
            angle_unit=unit,
        )
        np.testing.assert_allclose(scan.angles, cone.angles, atol=1e-9)


@pytest.mark.parametrize("suffix", [".npy", ".geom", ".txt"])
def test_astra_vectors(tmp_path: Path, suffix: str) -> None:
    cone = Cone(np.deg2rad(30.0 * np.arange(12)), 6, 10, (0.25, 0.2), 50, 200, (2, 4.2))
    path = tmp_path / f"scan{suffix}"
    if suffix == ".npy":
        np.save(path, vectors_of(cone))
    else:
        np.savetxt(path, vectors_of(cone))
    made.nikon(tmp_path / "images")
    options = {"kind": "counts", "flats": "mean"}
    read = cone_of(open_scan(tmp_path / "images", geometry=path, **options))
    assert read.center == pytest.approx(cone.center) and read.pitch == pytest.approx(cone.pitch)
    np.testing.assert_allclose(np.cos(read.angles - cone.angles), 1)
    wrong = vectors_of(cone)
    wrong[3, 7] = np.nan
    np.savetxt(tmp_path / "wrong.txt", wrong)
    with pytest.raises(RiftError, match="view 3"):
        open_scan(tmp_path / "images", geometry=tmp_path / "wrong.txt", **options)
    np.savetxt(tmp_path / "few.txt", vectors_of(cone)[:5])
    with pytest.raises(ShapeError, match=r"5 .*12|12 .* 5"):
        open_scan(tmp_path / "images", geometry=tmp_path / "few.txt", **options)


@pytest.mark.parametrize(
    ("lengths", "unit"),
    [
        ({"unit": "mm", "pitch": 0.2}, "mm"),
        ({"unit": "mm"}, "mm"),
        ({"unit": "um", "pitch": 200.0}, ""),
        ({}, ""),
    ],
)
def test_vectors_are_in_the_unit_of_the_scan(
    tmp_path: Path, lengths: dict[str, Any], unit: str
) -> None:
    """A pitch that is another is in another unit."""
    cone = Cone(np.deg2rad(30.0 * np.arange(12)), 6, 10, 0.2, 50, 200)
    np.savetxt(tmp_path / "vectors.txt", vectors_of(cone))
    np.savez(tmp_path / "scan.npz", projections=np.ones((12, 6, 10)), **lengths)
    given = {"geometry": tmp_path / "vectors.txt", "kind": "attenuation"}
    assert open_scan(tmp_path / "scan.npz", **given).unit == unit


def test_rtk(tmp_path: Path) -> None:
    """A point through RTK's matrix as its documentation multiplies it, all nine numbers."""
    view = RtkView(40.0, 7.0, -5.0, 50.0, 200.0, 1.0, -2.0, 3.0, 4.0)
    found = Vectors(*vectors_of_rtk([view], (0.25, 0.2)), 6, 10)
    (back,), pitch = rtk_of_vectors(found)
    assert back == pytest.approx(view) and pitch == pytest.approx((0.25, 0.2))
    fixed = np.array([POINT[0], POINT[2], -POINT[1], 1])
    u, v, w = rtk_matrix(view) @ fixed
    row, bin = seen(found, POINT, 0)
    assert (bin - 4.5) * 0.2 == pytest.approx(u / w) and (row - 2.5) * 0.25 == pytest.approx(v / w)
    made.described(tmp_path, "geometry: rtk.xml\npitch: [0.25, 0.2]\nunit: mm")
    body = "".join(
        f"<Projection><GantryAngle>{30 * k}</GantryAngle></Projection>" for k in range(12)
    )
    common = (
        "<SourceToIsocenterDistance>50</SourceToIsocenterDistance>"
        "<SourceToDetectorDistance>200</SourceToDetectorDistance>"
    )
    root = "RTKThreeDCircularGeometry"
    (tmp_path / "rtk.xml").write_text(f'<{root} version="3">{common}{body}</{root}>')
    cone = cone_of(open_scan(tmp_path / "geometry.yaml", kind="counts", flats="mean"))
    np.testing.assert_allclose(np.rad2deg(cone.angles), 30.0 * np.arange(12), atol=1e-9)
    assert cone.magnification == pytest.approx(4)
    with pytest.raises(InputError, match=r"how large a pixel"):
        open_scan(tmp_path / "images", geometry=tmp_path / "rtk.xml", kind="counts")


def rtk_matrix(view: RtkView) -> np.ndarray:
    g, o, i = np.deg2rad([-view.gantry, -view.out_of_plane, -view.in_plane])
    about = np.eye(4), np.eye(4), np.eye(4)
    about[0][:2, :2] = [[np.cos(i), -np.sin(i)], [np.sin(i), np.cos(i)]]
    about[1][1:3, 1:3] = [[np.cos(o), -np.sin(o)], [np.sin(o), np.cos(o)]]
    about[2][0, [0, 2]], about[2][2, [0, 2]] = [np.cos(g), np.sin(g)], [-np.sin(g), np.cos(g)]
    shift, source = np.eye(3), np.eye(4)
    shift[:2, 2] = view.source_x - view.detector_x, view.source_y - view.detector_y
    source[:2, 3] = -view.source_x, -view.source_y
    magnify = np.diag([-view.to_detector, -view.to_detector, 1.0])
    magnify = np.concatenate([magnify, [[0], [0], [-view.to_axis]]], axis=1)
    return shift @ magnify @ source @ about[0] @ about[1] @ about[2]


def test_zeiss(shared_data: Path, tmp_path: Path) -> None:
    path = shared_data / "txrm" / "chip.txrm"
    if not path.exists():
        pytest.skip("no real data")
    with pytest.raises(InputError, match="--flats"):
        open_scan(path)
    scan = open_scan(path, flats="mean")
    assert scan.shape == (7, 256, 256) and scan.cone is None and scan.unit == "um"
    assert np.rad2deg(scan.angles[[0, -1]]) == pytest.approx([-45, 45], abs=0.1)
    assert any("1.3 bins and 0.25 rows" in note for note in scan.notes)
    rows = scan.read(100, 102).projections
    assert rows.shape == (7, 2, 256) and 20 < rows.mean() < 400
    (tmp_path / "cone.yaml").write_text(f"{LENGTHS}\n")
    assert cone_of(open_scan(path, flats="mean", geometry=tmp_path / "cone.yaml")).rows == 256


def test_the_walnut(shared_data: Path) -> None:
    path = shared_data / "walnut" / "walnut_cone.npz"
    if not path.exists():
        pytest.skip("no real data")
    cone = cone_of(open_scan(path))
    assert (cone.views, cone.rows, cone.bins) == (241, 256, 256)
    assert cone.magnification == pytest.approx(2.6286, abs=1e-4)


@pytest.mark.parametrize("text", [".15", "+.15", "0.15", "15.e-2", "[.15, +0.15]", "[1.5e-1, .15]"])
def test_numbers_as_yaml_has_them(tmp_path: Path, text: str) -> None:
    path = tmp_path / "geometry.yaml"
    path.write_text(f"source_to_axis: +50.\nsource_to_detector: 200\npitch: {text}\n")
    beam = read_beam(path)
    assert isinstance(beam, Beam)
    assert beam.pitch == pytest.approx((0.15, 0.15)) and beam.source_to_axis == 50
    for wrong in (".", "+", "+.e1", "1_0"):
        path.write_text(f"source_to_axis: 50\nsource_to_detector: 200\npitch: {wrong}\n")
        with pytest.raises(InputError, match="pitch"):
            read_beam(path)


@pytest.mark.parametrize(
    ("lengths", "found"),
    [
        ("source_to_detector: 200\nmagnification: 4", (50, 200)),
        ("source_to_axis: 50\nmagnification: 4", (50, 200)),
        ("source_to_axis: 50\nsource_to_detector: 200\nmagnification: 4", (50, 200)),
        ("source_to_axis: 50\nsource_to_detector: 200\nmagnification: 2", "magnification"),
        ("source_to_axis: 50\nmagnification: 0.5", "magnification"),
        ("magnification: 4", "source_to_axis"),
    ],
)
def test_a_magnification_in_place_of_a_distance(
    tmp_path: Path, lengths: str, found: tuple[int, int] | str
) -> None:
    (tmp_path / "geometry.yaml").write_text(f"{lengths}\npitch: 0.2\n")
    if isinstance(found, str):
        with pytest.raises(InputError, match=found):
            read_beam(tmp_path / "geometry.yaml")
        return
    beam = read_beam(tmp_path / "geometry.yaml")
    assert isinstance(beam, Beam)
    assert (beam.source_to_axis, beam.source_to_detector) == found
