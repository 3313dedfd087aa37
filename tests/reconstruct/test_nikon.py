"""A real radiograph of a Nikon scanner, of a sample that is symmetric about the axis.

One view is then all of them, and what is in the plane of the orbit follows from its row alone: a
ray that passes the axis at the distance t crosses rings of constant density, whose chords make a
triangular system (onion peeling: Dasch, Appl. Opt. 31, 1146, 1992). Nothing of it is ours.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from rift_cl import Cone, Grid, Projector, fbp
from rift_cl.io import open_scan

pytestmark = [pytest.mark.once, pytest.mark.full]

_BLOCK, _VIEWS = 8, 180


@pytest.fixture(scope="module")
def radiograph(shared_data):
    """Line integrals of the 8 rows of blocks about the orbit, and the scan; lengths in mm."""
    path = shared_data / "nikon" / "radiogram.xtekct"
    if not path.is_file():
        pytest.skip(f"no real data: {path} is absent")
    file = open_scan(path, repeat=2)
    scan = file.geometry
    assert isinstance(scan, Cone)
    count, bins = 8, scan.bins // _BLOCK
    first = scan.rows // 2 - count * _BLOCK // 2
    counts = file.read(first, first + count * _BLOCK).projections[0, :, : bins * _BLOCK]
    mean = counts.reshape(count, _BLOCK, bins, _BLOCK).mean((1, 3), dtype=float)
    integrals = -np.log(mean / np.median(mean[:, [0, 1, -2, -1]]))
    seen = replace(
        scan,
        angles=np.arange(_VIEWS) * 2 * np.pi / _VIEWS + 0.01,
        heights=None,
        rows=count,
        bins=bins,
        pitch=tuple(length * _BLOCK for length in scan.pitch),
        center=((count - 1) / 2, middle_of(integrals)),
    )
    return integrals.astype(np.float32), seen


def middle_of(integrals):
    """The bin about which rows are symmetric, by their mirror images."""
    profile = integrals.mean(axis=0)
    bins = np.arange(len(profile))
    places = np.arange(len(profile) / 2 - 8, len(profile) / 2 + 8, 0.05)
    off = [np.square(profile - np.interp(2 * c - bins, bins, profile)).sum() for c in places]
    return float(places[np.argmin(off)])


def peeled(integrals, t, step):
    """Densities of rings of so wide a step, by least squares over both sides of a row."""
    edges = np.arange(0, np.abs(t).max() + step, step)
    chords = np.sqrt(np.maximum(edges[None, 1:] ** 2 - t[:, None] ** 2, 0))
    inner = np.sqrt(np.maximum(edges[None, :-1] ** 2 - t[:, None] ** 2, 0))
    return edges, np.linalg.lstsq(2 * (chords - inner), integrals, rcond=None)[0]


def test_density_is_right_in_absolute_terms_along_a_radius(device, radiograph):
    integrals, scan = radiograph
    t = scan.source_to_axis * np.sin(scan.fan_angles())
    middle = integrals[3:5].mean(axis=0)
    spacing = scan.pitch[1] / scan.magnification
    edges, expected = peeled(middle, t, 4 * spacing)
    grid = Grid((2, scan.bins, scan.bins), spacing)
    views = np.broadcast_to(integrals, (scan.views, *integrals.shape))
    volume = fbp(Projector(grid, scan, device=device), np.ascontiguousarray(views)).mean(axis=0)
    y, x = (grid.coordinates(axis) for axis in (1, 2))
    ring = np.digitize(np.hypot(y[:, None], x), edges) - 1
    found = np.array([volume[ring == n].mean(dtype=float) for n in range(len(expected))])
    # 0.027 per mm, then a denser rim that is narrower than a ring, little beside it, and air.
    assert expected[:4] == pytest.approx(0.027, rel=0.03)
    np.testing.assert_allclose(found[:4], expected[:4], rtol=0.015)
    assert found[:4].mean() == pytest.approx(expected[:4].mean(), rel=5e-3)
    np.testing.assert_allclose(found[8:], expected[8:], atol=1e-3)
    assert np.abs(found[-10:]).max() < 0.01 * found[0]
