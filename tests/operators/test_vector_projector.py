"""The projector of vectors: that of cones where it should be, line integrals wherever rays run.

Detectors that stand upright have their pixels read as they are, so that ``Cone.vectors()`` gives
the cone's data to rounding.
"""

from __future__ import annotations

import dataclasses
import pickle

import numpy as np
import pytest

from rift_cl import Cone, Grid, Projector, Vectors, dot_test, phantom
from rift_cl.errors import InputError
from rift_cl.operators.projector.cone.vector_projector import VectorProjector

TURN = np.linspace(0, 2 * np.pi, 7, endpoint=False) + 0.1


def relative(value, truth):
    return np.linalg.norm(value - truth) / max(np.linalg.norm(truth), 1e-30)


def turns(rms, views, seed=0):
    """Rotations about random axes, (views, 3, 3)."""
    found = []
    for x, y, z in np.deg2rad(rms) * np.random.default_rng(seed).standard_normal((views, 3)):
        half = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]]) / 2
        found.append(np.linalg.solve(np.eye(3) - half, np.eye(3) + half))
    return np.array(found)


def tilted(scan, rms, seed=0):
    """The scan with detectors tilted about all axes by so many degrees, and shifted."""
    random, turn = np.random.default_rng(seed), turns(rms, scan.views, seed)
    across, down = (np.einsum("nij,nj->ni", turn, v) for v in (scan.across, scan.down))
    shifts = random.standard_normal((2, scan.views, 3))
    return changed(
        scan,
        across=across,
        down=down,
        middle=scan.middle + shifts[0],
        source=scan.source + shifts[1],
    )


def changed(scan, **changes):
    names = [field.name for field in dataclasses.fields(scan)]
    return Vectors(**{name: getattr(scan, name) for name in names} | changes)


def circle(n, angles=TURN, **changes):
    return Cone(angles, n + 4, n + 6, 1.6, 3.0 * n, 4.5 * n, **changes)


def lying(n, views=6):
    """Laminography: sources on a circle below the volume, detectors flat above it."""
    angles = np.linspace(0, 2 * np.pi, views, endpoint=False)
    ring = np.stack([np.cos(angles), np.sin(angles), np.full(views, -2.0)], axis=1)
    steps = np.broadcast_to(1.6 * np.eye(3)[:, None], (3, views, 3))
    return Vectors(1.5 * n * ring, -0.7 * n * ring, steps[0], steps[1], n + 12, n + 16)


def exchanged(scan):
    """The scan with y and z exchanged."""
    names = "source", "middle", "across", "down"
    return changed(scan, **{name: getattr(scan, name)[:, [0, 2, 1]] for name in names})


def joined(first, second):
    names = "source", "middle", "across", "down"
    both = {name: np.concatenate([getattr(s, name) for s in (first, second)]) for name in names}
    return Vectors(**both, rows=first.rows, bins=first.bins)


@pytest.mark.parametrize("changes", [{}, {"heights": np.arange(7) - 3.0, "center": (9.3, 12.1)}])
def test_a_cone_s_vectors_see_what_the_cone_sees(device, changes):
    grid = Grid((16, 17, 18), (1.0, 1.1, 0.9), (0.5, -1.0, 2.0))
    cone = circle(18, **changes)
    A, B = Projector(grid, cone, device=device), Projector(grid, cone.vectors(), device=device)
    assert isinstance(B, VectorProjector)
    random = np.random.default_rng(1)
    x, y = random.standard_normal(A.domain), random.standard_normal(A.range)
    assert relative(B(x), A(x)) <= 2e-5
    assert relative(B.T(y), A.T(y)) <= 2e-5


@pytest.mark.parametrize("rms", [0, 2, 8])
def test_line_integrals_are_true(device, rms):
    grid, n = Grid((32, 32, 32)), 32
    balls = [phantom.Ellipsoid.ball(12)]
    scan = tilted(circle(n).vectors(), rms)
    seen = Projector(grid, scan, device=device)(phantom.render(balls, grid))
    assert relative(seen, phantom.project(balls, grid, scan)) <= 0.05


@pytest.mark.parametrize("rms", [0, 5])
def test_line_integrals_along_z_are_true(device, rms):
    grid, n = Grid((20, 32, 32)), 32
    balls = [phantom.Ellipsoid.ball(9)]
    scan = tilted(lying(n), rms)
    seen = Projector(grid, scan, device=device)(phantom.render(balls, grid))
    assert relative(seen, phantom.project(balls, grid, scan)) <= 0.06


@pytest.mark.parametrize("name", ["tilted", "lying", "both"])
def test_the_pair_is_matched(device, name):
    across, along = tilted(circle(40).vectors(), 4), tilted(lying(40, 5), 4)
    scan = {
        "tilted": across,
        "lying": along,
        "both": joined(across, changed(along, rows=across.rows, bins=across.bins)),
    }[name]
    A = Projector(Grid((36, 38, 40)), scan, device=device)
    assert dot_test(A, seed=2) <= 1e-7
    assert dot_test(A.T, seed=3) <= 1e-7


def test_repeats_to_the_bit_and_travels(device):
    grid, scan = Grid((12, 13, 14)), tilted(circle(14).vectors(), 3)
    A = Projector(grid, scan, device=device)
    x = np.random.default_rng(4).standard_normal(A.domain).astype(np.float32)
    y = A(x)
    again = Projector(grid, scan, device=device)
    assert np.array_equal(again(x), y)
    assert np.array_equal(again.T(y), A.T(y))
    copied = pickle.loads(pickle.dumps(A))
    assert (copied.grid, copied.scan, copied.footprint) == (grid, scan, A.footprint)


def test_exchanging_y_and_z_of_volume_and_scan_changes_nothing(device):
    """Of views that look along z the third walk is that of views across, seen from the side."""
    scan = tilted(lying(20), 3)
    x = np.random.default_rng(5).standard_normal((18, 19, 20)).astype(np.float32)
    y = Projector(Grid((18, 19, 20)), scan, device=device)(x)
    moved = np.ascontiguousarray(x.transpose(1, 0, 2))
    other = Projector(Grid((19, 18, 20)), exchanged(scan), device=device)(moved)
    assert np.array_equal(other, y)


def test_a_rolled_detector_has_its_image_turned(device):
    """A quarter turn of the detector in its plane: rows become columns."""
    grid = Grid((16, 16, 16))
    scan = circle(16).vectors()
    rolled = changed(scan, across=-scan.down, down=scan.across, rows=scan.bins, bins=scan.rows)
    ball = phantom.render([phantom.Ellipsoid.ball(5)], grid)
    y = Projector(grid, scan, device=device)(ball)
    turned = Projector(grid, rolled, device=device)(ball)
    assert relative(turned[:, :, ::-1].transpose(0, 2, 1), y) <= 1e-2


@pytest.mark.full
def test_doubles(device):
    A = Projector(Grid((8, 9, 10)), tilted(circle(10).vectors(), 3), device=device, dtype="float64")
    assert dot_test(A) <= 1e-13


def test_what_is_wrong_is_said():
    scan = circle(16).vectors()
    with pytest.raises(InputError, match="volume"):
        Projector(Grid((16, 16)), scan)
    with pytest.raises(InputError, match="source"):
        Projector(Grid((200, 200, 200)), scan)
    with pytest.raises(InputError, match="footprint"):
        Projector(Grid((16, 16, 16)), scan, "gauss")
