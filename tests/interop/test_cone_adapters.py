"""A lone point off every centre is seen where the other package sees it, by its own formula."""

from __future__ import annotations

import math
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from rift_cl.errors import InputError, RiftError, ShapeError
from rift_cl.geometry import Cone, Fan, Grid, Vectors
from rift_cl.interop.astra import from_astra, to_astra
from rift_cl.interop.leap import from_leap, to_leap
from rift_cl.interop.mbirjax import from_mbirjax, to_mbirjax
from rift_cl.interop.rtk import from_rtk, to_rtk
from rift_cl.interop.tigre import from_tigre, to_tigre
from rift_cl.interop.tomosipo import from_tomosipo, to_tomosipo

ROWS, BINS, R, S = 14, 20, 60.0, 150.0
PITCH = (0.7, 0.5)
ANGLES = np.array([0.3, 1.1, 2.9, 5.0])
POINT = np.array([4.0, -3.0, 2.5])
CONE = Cone(ANGLES, ROWS, BINS, PITCH, R, S, (6.1, 10.4))
GRID = Grid((8, 9, 10), 0.5, (1.0, 2.0, 3.0))


def seen(scan: Cone | Vectors, view: int = 1, point: np.ndarray = POINT) -> tuple[float, float]:
    """Row and bin, counted from the first."""
    v = scan.vectors() if isinstance(scan, Cone) else scan
    lines = np.stack([v.across[view], v.down[view], v.source[view] - point], axis=1)
    k, i, _ = np.linalg.solve(lines, v.source[view] - v.middle[view])
    return i + (v.rows - 1) / 2, k + (v.bins - 1) / 2


def tilted() -> Vectors:
    """A scan on no circle."""
    v = CONE.vectors()
    turn = np.array([[1, 0, 0], [0, math.cos(0.1), -math.sin(0.1)], [0, math.sin(0.1), 0.995]])
    turn[2, 2] = math.cos(0.1)
    parts = [part @ turn.T for part in (v.source, v.middle, v.across, v.down)]
    return Vectors(*parts, ROWS, BINS)


def same(one: Any, other: Cone) -> None:
    assert isinstance(one, Cone)
    assert one.center == pytest.approx(other.center) and one.pitch == pytest.approx(other.pitch)
    assert seen(one) == pytest.approx(seen(other), abs=1e-5)


def test_leap() -> None:
    """Its formula: u = (x . perp + tau) / (R - x . theta), with theta a quarter of a turn early."""
    phi = math.degrees(1.1)
    phis = np.array([10.0, phi])
    scan = from_leap(2, ROWS, BINS, *PITCH, 6.1, 10.4, phis, R, S, 0.8)
    turn = math.radians(phi) - math.pi / 2
    theta = np.array([math.cos(turn), math.sin(turn), 0])
    perp = np.array([-math.sin(turn), math.cos(turn), 0])
    depth = R - POINT @ theta
    u, v = (POINT @ perp + 0.8) / depth, POINT[2] / depth
    assert seen(scan) == pytest.approx((6.1 + v * S / 0.7, 10.4 + u * S / 0.5))
    kind, arguments = to_leap(CONE)
    assert kind == "conebeam"
    same(from_leap(**arguments), CONE)
    kind, arguments = to_leap(tilted())
    assert kind == "modularbeam"
    assert seen(from_leap(**arguments)) == pytest.approx(seen(tilted()), abs=1e-4)
    with pytest.raises(InputError, match="helicalPitch"):
        from_leap(2, ROWS, BINS, *PITCH, 6.1, 10.4, phis, R, S, 0.0, 3.0)
    with pytest.raises(ShapeError, match="phis"):
        from_leap(5, ROWS, BINS, *PITCH, 6.1, 10.4, phis, R, S)


def test_tigre() -> None:
    """Its steps: source on the x axis, offsets, a turn by alpha, COR along the bins."""
    geo = SimpleNamespace(
        mode="cone",
        DSO=R,
        DSD=S,
        nDetector=np.array([ROWS, BINS]),
        dDetector=np.array(PITCH),
        offDetector=np.array([0.9, -1.2]),
        nVoxel=np.array(GRID.shape),
        dVoxel=np.array(GRID.spacing),
        offOrigin=np.array(GRID.center),
        COR=0.8,
    )
    grid, scan = from_tigre(geo, [0.2, 1.1])
    assert grid == GRID
    c, s = math.cos(1.1), math.sin(1.1)
    x, y = c * POINT[0] + s * POINT[1], -s * POINT[0] + c * POINT[1]
    u, v = S * (y - 0.8) / (R - x), S * POINT[2] / (R - x)
    row, bin = (v - 0.9) / 0.7 + (ROWS - 1) / 2, (u + 1.2) / 0.5 + (BINS - 1) / 2
    assert seen(scan) == pytest.approx((row, bin))
    attributes, angles = to_tigre(GRID, CONE)
    back, cone = from_tigre(attributes, angles)
    assert back == GRID
    same(cone, CONE)
    with pytest.raises(InputError, match="rotDetector"):
        from_tigre({**attributes, "rotDetector": [0.1, 0, 0]}, angles)
    with pytest.raises(InputError, match="DSO"):
        from_tigre({"nDetector": [2, 2], "dDetector": [1, 1], "nVoxel": 3, "dVoxel": 1}, angles)
    with pytest.raises(InputError, match="circle"):
        to_tigre(GRID, tilted())  # type: ignore[arg-type]


def test_mbirjax() -> None:
    """Its formulas: x turned by the angle, magnified by the depth along y, y against ours."""
    scan = from_mbirjax(
        (4, ROWS, BINS),
        ANGLES,
        S,
        R,
        delta_det_channel=0.5,
        delta_det_row=0.7,
        det_channel_offset=1.3,
        det_row_offset=-0.4,
        helical_z_shifts=[0, 0.6, 1, 2],
    )
    c, s = math.cos(1.1), math.sin(1.1)
    x, y, z = POINT[0], -POINT[1], POINT[2] - 0.6
    x, y = c * x - s * y, s * x + c * y
    magnified = 1 / (R / S - y / S)
    channel = (magnified * x + 1.3) / 0.5 + (BINS - 1) / 2
    assert seen(scan) == pytest.approx(((magnified * z - 0.4) / 0.7 + (ROWS - 1) / 2, channel))
    arguments, parameters = to_mbirjax(CONE)
    same(from_mbirjax(**arguments, **parameters), CONE)
    with pytest.raises(InputError, match="wanted a Cone"):
        to_mbirjax(tilted())  # type: ignore[arg-type]


def test_rtk() -> None:
    """Its matrix without tilts: u / -SDD is the point beside the source over that before it."""
    scan = from_rtk([(R, S, math.degrees(1.1), 0.9, -0.3)], ROWS, BINS, PITCH)
    x, y, z = POINT[0], POINT[2], -POINT[1]
    c, s = math.cos(1.1), math.sin(1.1)
    beside, before = c * x - s * z, s * x + c * z - R
    u, v = -S * beside / before - 0.9, -S * y / before + 0.3
    expected = v / 0.7 + (ROWS - 1) / 2, u / 0.5 + (BINS - 1) / 2
    assert seen(scan, 0) == pytest.approx(expected)
    views, pitch = to_rtk(CONE)
    same(from_rtk(views, ROWS, BINS, pitch), CONE)
    views, pitch = to_rtk(tilted())
    assert seen(from_rtk(views, ROWS, BINS, pitch)) == pytest.approx(seen(tilted()))
    with pytest.raises(InputError, match="no view"):
        from_rtk([], ROWS, BINS, 1.0)


def test_tomosipo() -> None:
    """Vectors in the order z, y, x."""
    for scan in (CONE, tilted()):
        arguments = to_tomosipo(scan)
        shape = arguments.pop("shape")
        assert arguments["src_pos"][1, ::-1] == pytest.approx(
            (scan.vectors() if isinstance(scan, Cone) else scan).source[1]
        )
        source, middle, across, down = (
            arguments[name][1, ::-1] for name in ("src_pos", "det_pos", "det_u", "det_v")
        )
        bin, row, _ = np.linalg.solve(
            np.stack([across, down, source - POINT], axis=1), source - middle
        )
        found = row + (shape[0] - 1) / 2, bin + (shape[1] - 1) / 2
        assert found == pytest.approx(seen(scan))
        back = from_tomosipo(SimpleNamespace(det_shape=shape, **arguments))
        assert type(back) is type(scan) and seen(back) == pytest.approx(seen(scan))
    with pytest.raises(InputError, match="src_pos"):
        from_tomosipo(3)


@pytest.mark.parametrize("scan", [CONE, tilted(), Cone(ANGLES, ROWS, BINS, PITCH, R, S)])
def test_astra_there_and_back(scan: Cone | Vectors) -> None:
    grid, back = from_astra(*to_astra(GRID, scan)[:2])
    assert grid == GRID and type(back) is type(scan)
    assert seen(back) == pytest.approx(seen(scan))  # type: ignore[arg-type]


def test_astra_knows_the_same_vectors() -> None:
    astra = pytest.importorskip("astra")
    cone = Cone(ANGLES, ROWS, BINS, PITCH, R, S)
    geometry, _ = to_astra(GRID, cone)
    made = astra.create_proj_geom("cone", 0.5, 0.7, ROWS, BINS, ANGLES, R, S - R)
    vectors = astra.geom_2vec(made)["Vectors"]
    assert geometry["type"] == "cone"
    own = to_astra(GRID, cone.vectors())[0]["Vectors"]
    np.testing.assert_allclose(own, vectors, atol=1e-9)


@pytest.mark.parametrize("center", [9.5, 10.4])
def test_astra_sees_a_fans_point_upside_down(center: float) -> None:
    """One pixel projected by ASTRA is where a fan of ours sees that of the turned image."""
    astra = pytest.importorskip("astra")
    fan = Fan(ANGLES, BINS, 0.5, R, S, center)
    grid = Grid((9, 10), 0.5, (0.4, -0.3))
    proj_geom, vol_geom = to_astra(grid, fan)
    image = np.zeros(grid.shape, np.float32)
    image[6, 7] = 1
    vol_geom = {**astra.create_vol_geom(9, 10), **vol_geom}
    projector = astra.create_projector("line_fanflat", proj_geom, vol_geom)
    handle, found = astra.create_sino(image[::-1].copy(), projector)
    astra.data2d.delete(handle)
    astra.projector.delete(projector)
    point = np.array([grid.coordinates(1)[7], grid.coordinates(0)[6], 0])
    bins = np.arange(BINS)
    for view in range(len(ANGLES)):
        a = ANGLES[view]
        depth = R - point[0] * math.sin(a) + point[1] * math.cos(a)
        u = S * (point[0] * math.cos(a) + point[1] * math.sin(a)) / depth
        assert (found[view] @ bins) / found[view].sum() == pytest.approx(center + u / 0.5, abs=0.3)
    back = from_astra(proj_geom, vol_geom)
    assert back[0].center == pytest.approx(grid.center) and isinstance(back[1], Fan)
    assert back[1].center == pytest.approx(center) and back[1].pitch == pytest.approx(0.5)


@pytest.mark.parametrize(
    ("changes", "error"),
    [
        ({"DistanceOriginSource": None}, InputError),
        ({"DetectorSpacingX": -1.0}, RiftError),
        ({"ProjectionAngles": [[1.0]]}, ShapeError),
        ({"type": "cyl_cone_vec"}, InputError),
    ],
)
def test_what_astra_may_not_say(changes: dict[str, Any], error: type[RiftError]) -> None:
    proj_geom, vol_geom = to_astra(GRID, Cone(ANGLES, ROWS, BINS, PITCH, R, S))
    with pytest.raises(error):
        from_astra({**proj_geom, **changes}, vol_geom)
