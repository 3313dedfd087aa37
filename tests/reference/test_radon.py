"""The exact transform against its definition, written out pixel by pixel and bin by bin.

For Joseph's footprint that is the interpolation along a ray, for strips the area of a polygon; both
are compared with ASTRA's projectors, too, where that is installed.
"""

from __future__ import annotations

import math

import numpy as np
import pytest

from rift_cl.geometry import Grid, Parallel
from rift_cl.reference import radon, radon_matrix

SCENES = [
    (Grid((4, 3)), Parallel([0, 0.4, 2.5, -1.2, np.pi / 2], bins=7)),
    (Grid((3, 5), spacing=(0.5, 1.7), center=(2, -1)), Parallel([0.3, 1.4], 9, 0.8, center=2.2)),
    (Grid((2, 2)), Parallel([0.1, 1.0], bins=60, pitch=0.05)),
    (Grid((5, 4)), Parallel([0.1, 1.0], bins=3, pitch=11)),
    (Grid((1, 1)), Parallel([0.7], bins=1)),
]
SQUARE = [
    (Grid((12, 12)), Parallel(np.linspace(0.1, 3, 9), bins=19)),
    (Grid((10, 15), center=(2, -1.5)), Parallel(np.linspace(0.1, 3, 9), 31, 0.7)),
    (Grid((10, 15), spacing=0.8), Parallel(np.linspace(-4, 4, 9), 13, 1.9)),
    (Grid((10, 15)), Parallel([0, np.pi / 4, np.pi / 2, 3 * np.pi / 4], bins=23)),
]


def weight(grid, scan, angle, bin, y, x):
    (dy, dx), cosine, sine = grid.spacing, math.cos(angle), math.sin(angle)
    shadow = max(abs(dx * cosine), abs(dy * sine)) / scan.pitch
    h = max(1.0, shadow)
    t = (x * cosine + y * sine) / scan.pitch + scan.center
    return dx * dy / (h * scan.pitch) * max(0.0, 1 - abs(t - bin) / h)


def interpolated(grid, scan, angle, bin, y, x):
    """What a ray takes from a pixel between whose row (or column) and the next it runs."""
    (dy, dx), c, s = grid.spacing, math.cos(angle), math.sin(angle)
    t = (bin - scan.center) * scan.pitch
    if abs(dx * c) >= abs(dy * s):
        return dy / abs(c) * max(0.0, 1 - abs((t - y * s) / c - x) / dx)
    return dx / abs(s) * max(0.0, 1 - abs((t - x * c) / s - y) / dy)


def shared_area(grid, scan, angle, bin, y, x):
    """The area of a pixel cut off before one side of a bin, less that before the other."""
    (dy, dx), c, s = grid.spacing, math.cos(angle), math.sin(angle)
    sides = ((1, 1), (-1, 1), (-1, -1), (1, -1))
    corners = np.array([(x + u * dx / 2, y + v * dy / 2) for u, v in sides])

    def before(place):
        inside = place - corners @ (c, s)
        kept = []
        for n in range(4):
            if inside[n] >= 0:
                kept.append(corners[n])
            if inside[n] * inside[n - 3] < 0:
                share = inside[n] / (inside[n] - inside[n - 3])
                kept.append(corners[n] + share * (corners[n - 3] - corners[n]))
        u, v = np.array(kept).reshape(-1, 2).T
        return abs(u @ np.roll(v, 1) - v @ np.roll(u, 1)) / 2

    edge = (bin - scan.center - 0.5) * scan.pitch
    return (before(edge + scan.pitch) - before(edge)) / scan.pitch


DEFINITIONS = {"linear": weight, "joseph": interpolated, "strip": shared_area}


@pytest.mark.parametrize("footprint", DEFINITIONS)
@pytest.mark.parametrize(("grid", "scan"), SCENES)
def test_the_matrix_is_the_definition(grid, scan, footprint):
    expected = [
        [
            DEFINITIONS[footprint](grid, scan, angle, bin, y, x)
            for y in grid.coordinates(0)
            for x in grid.coordinates(1)
        ]
        for angle in scan.angles
        for bin in range(scan.bins)
    ]
    matrix = radon_matrix(grid, scan, footprint)
    np.testing.assert_allclose(matrix.toarray(), expected, atol=1e-13)


@pytest.mark.parametrize(("footprint", "theirs"), [("joseph", "linear"), ("strip", "strip")])
@pytest.mark.parametrize(("grid", "scan"), SQUARE)
def test_the_matrix_is_that_of_astra(grid, scan, footprint, theirs):
    """Its y grows upwards, which turns the sign of angles."""
    astra = pytest.importorskip("astra")
    (ny, nx), (dy, dx), (y, x) = grid.shape, grid.spacing, grid.center
    sides = (x - nx * dx / 2, x + nx * dx / 2, -y - ny * dy / 2, -y + ny * dy / 2)
    image = astra.create_vol_geom(ny, nx, *sides)
    views = astra.create_proj_geom("parallel", scan.pitch, scan.bins, -scan.angles)
    projector = astra.create_projector(theirs, views, image)
    matrix = astra.matrix.get(astra.projector.matrix(projector))
    # It computes in float32.
    found = radon_matrix(grid, scan, footprint).toarray()
    assert np.linalg.norm(found - matrix.toarray()) <= 1e-5 * np.linalg.norm(found)


def test_every_view_holds_the_whole_mass():
    """The weights of a pixel's bins add up to dx dy / pitch where a hat is one bin wide."""
    grid, pitch = Grid((9, 8), spacing=(0.6, 0.7)), 0.8
    matrix = radon_matrix(grid, Parallel(np.linspace(0, 3, 7), 25, pitch))
    np.testing.assert_allclose(matrix.sum(axis=0), np.full((1, 72), 7 * 0.42 / pitch), rtol=1e-12)


def test_a_blob_is_projected_to_its_line_integrals():
    """In wide bins, whose hats widen a Gaussian by pitch^2 / 6 in variance."""
    grid, scan = Grid((60, 60), spacing=0.5), Parallel([0.2, 0.7, 1.3, 2.4], bins=41, pitch=1.5)
    y, x = grid.coordinates(0)[:, None], grid.coordinates(1)
    blob = 1.3 * np.exp(-((x - 1) ** 2 + (y + 2) ** 2) / (2 * 3.0**2))
    t = scan.coordinates() - np.array([[np.cos(a) - 2 * np.sin(a)] for a in scan.angles])
    variance = 3.0**2 + 1.5**2 / 6
    expected = 1.3 * 2 * np.pi * 3.0**2 * np.exp(-(t**2) / 2 / variance)
    expected /= np.sqrt(2 * np.pi * variance)
    np.testing.assert_allclose(radon(grid, scan, "linear").project(blob), expected, atol=0.01)


def test_a_volume_is_its_slices():
    grid, scan = Grid((3, 5, 4)), Parallel([0.1, 0.9], bins=8)
    A, one = radon(grid, scan), radon(grid.slice(), scan)
    random = np.random.default_rng(1)
    x, y = random.standard_normal((3, 5, 4)), random.standard_normal((2, 3, 8))
    for k in range(3):
        np.testing.assert_allclose(A.project(x)[:, k], one.project(x[k]))
        np.testing.assert_allclose(A.backproject(y)[k], one.backproject(y[:, k]))
    assert np.vdot(A.project(x), y) == pytest.approx(np.vdot(x, A.backproject(y)))
