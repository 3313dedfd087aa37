"""Helices are inverted exactly: densities do not fall off with the cone's angle.

As in ``test_fdk``, levels are means over a uniform ball, whose exact line integrals, averaged over
the bins, are the data.
"""

from __future__ import annotations

from dataclasses import replace
from functools import partial

import numpy as np
import pytest
from averaged_rays import averaged_on
from limited_devices import assert_same, limited, normal

import rift_cl as rift
from rift_cl import Cone, Grid, Projector, fbp, phantom
from rift_cl.errors import InputError
from rift_cl.reconstruct import FDK, Katsevich

pytestmark = pytest.mark.once

N = 32
GRID = Grid((N, N, N))
BALL = phantom.Ellipsoid.ball(0.35 * N, 1.7)
AWAY = np.arange(N) - (N - 1) / 2
RADIUS = np.sqrt(AWAY[:, None, None] ** 2 + AWAY[:, None] ** 2 + AWAY**2)
averaged = partial(averaged_on, GRID)


def helix(rise=24.0, distance=3.0, magnification=1.5, share=1.0, per_turn=72, **changes):
    """A scan that has all views of the grid's slices, with bins of a share of a voxel."""
    to_axis = distance * N
    to_detector = to_axis * magnification
    bins = round(N / share)
    pitch = 2.04 * to_detector * np.tan(np.arcsin(0.5 / distance)) / bins
    views = round(per_turn * (N + 1.6 * abs(rise)) / abs(rise))
    angles = (np.arange(views) - (views - 1) / 2) * 2 * np.pi / per_turn
    heights = rise * angles / (2 * np.pi)
    lengths = to_axis, to_detector
    return Cone(angles, bins, bins, pitch, *lengths, heights=heights, **changes)


def level(device, scan):
    """The mean over the ball short of its surface, over its density."""
    volume = fbp(Projector(GRID, scan, device=device), averaged([BALL], scan))
    return float(volume[RADIUS < 0.28 * N].mean() / BALL.value)


CASES = {
    "flat": {},
    "curved": {"curved": True},
    "falling": {"rise": -24.0},
    "wide": {"distance": 1.3},
    "wide and curved": {"distance": 1.3, "curved": True, "rise": 16.0},
    "steep": {"rise": 34.0},
    "shallow": {"rise": 9.0},
    "magnified": {"magnification": 15.0},
    "fine bins": {"share": 0.5},
    "coarse bins": {"share": 1.3},
}


@pytest.mark.parametrize(
    "case",
    [
        pytest.param(name, marks=() if name in ("flat", "wide and curved") else pytest.mark.full)
        for name in CASES
    ],
)
def test_a_whole_ball_has_its_density(device, case):
    assert level(device, helix(**CASES[case])) == pytest.approx(1, abs=1e-3)


@pytest.mark.full
def test_no_density_is_lost_that_a_circle_loses(device):
    scan = helix(distance=1.35)
    circle = replace(scan, angles=np.arange(72) * 2 * np.pi / 72, heights=np.zeros(72))
    assert level(device, circle) < 0.99
    assert level(device, scan) == pytest.approx(1, abs=1e-3)


def test_views_may_come_in_any_order_and_turns_count_by_heights(device):
    scan = helix()
    y = averaged([BALL], scan, 1)
    mixed = np.random.default_rng(0).permutation(scan.views)
    angles = np.mod(scan.angles, 2 * np.pi)[mixed]
    other = replace(scan, angles=angles, heights=scan.heights[mixed])
    there, here = (
        fbp(Projector(GRID, s, device=device), d) for s, d in ((scan, y), (other, y[mixed]))
    )
    np.testing.assert_allclose(here, there, atol=1e-4)


def test_vectors_of_a_helix_are_reconstructed_as_their_cone(device):
    scan = helix(per_turn=36)
    y = averaged([BALL], scan, 1)
    there = fbp(Projector(GRID, scan, device=device), y)
    here = fbp(Projector(GRID, scan.vectors(), device=device), y)
    np.testing.assert_allclose(here, there, atol=1e-4)
    with pytest.raises(InputError, match="heights"):
        FDK(Projector(GRID, scan.vectors(), device=device))


@pytest.mark.full
def test_the_head_is_as_sharp_as_from_a_circle(device):
    scan = helix(per_turn=90)
    circle = replace(scan, angles=np.arange(90) * 2 * np.pi / 90, heights=np.zeros(90))
    head = phantom.head(GRID)
    truth = phantom.render(head, GRID)

    def quality(scan):
        volume = fbp(Projector(GRID, scan, device=device), averaged(head, scan, 2))
        return -10 * np.log10(np.mean((volume - truth)[RADIUS < 0.48 * N] ** 2))

    assert quality(scan) > quality(circle) - 0.3


@pytest.mark.parametrize("curved", [False, True], ids=["flat", "curved"])
def test_it_is_linear_and_has_an_adjoint(device, curved):
    K = Katsevich(Projector(GRID, helix(per_turn=36, curved=curved), device=device), "hann")
    assert rift.dot_test(K) < 1e-6
    y = np.random.default_rng(1).standard_normal(K.domain).astype(np.float32)
    there = K(y)
    np.testing.assert_allclose(device.get(K(device.array(y))), there, atol=1e-6 * np.ptp(there))


def test_slices_that_have_all_views_are_told(device):
    scan = helix()
    tall = Grid((3 * N, N, N))
    volume = Katsevich(Projector(tall, scan, device=device))
    first, stop = volume.slices
    assert 0 < first <= N
    assert first + stop == 3 * N
    assert f"slices {first} to {stop - 1} of {3 * N}" in volume.sentence
    cylinder = [phantom.Ellipsoid((0, 0, 0), (1e4, 0.35 * N, 0.35 * N), 0.0, 1.0)]
    across = np.hypot(AWAY[:, None], AWAY) < 0.28 * N
    y = phantom.project(cylinder, GRID, scan)
    levels = volume(y)[:, across].mean(axis=1)
    np.testing.assert_allclose(levels[first:stop], 1, atol=5e-3)
    assert levels[0] < 0.9


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"rise": 80.0}, "heights rise by 80 in a turn.*cgls"),
        ({"heights": "steps"}, "off a helix.*cgls"),
        ({"angles": "uneven"}, "even steps.*cgls"),
        ({"heights": "short"}, "no slice of the grid.*cgls"),
    ],
    ids=["steep", "steps", "uneven", "short"],
)
def test_what_a_helix_does_not_allow_is_refused_with_the_methods_that_do(device, changes, words):
    scan = helix(rise=changes.get("rise", 24.0))
    if changes.get("heights") == "steps":
        scan = replace(scan, heights=np.round(scan.heights / 12) * 12)
    elif changes.get("heights") == "short":
        scan = replace(scan, angles=scan.angles[:50], heights=scan.heights[:50])
    elif "angles" in changes:
        scan = replace(scan, angles=scan.angles + 0.1 * np.sin(7 * np.arange(scan.views)))
    with pytest.raises(InputError, match=words):
        fbp(Projector(GRID, scan, device=device), np.zeros(1))


def test_filters_that_are_no_window_and_compensation_are_refused(device):
    A = Projector(GRID, helix(per_turn=36), device=device)
    with pytest.raises(InputError, match="window"):
        Katsevich(A, "high-pass")
    with pytest.raises(InputError, match="compensate"):
        fbp(A, np.zeros(1), compensate="uniform")


def test_the_adjoint_takes_parts(device):
    scan = helix(per_turn=24)
    whole = Katsevich(Projector(GRID, scan, device=device))
    need, _ = whole._A._need(N, scan.views // 2, sparing=True)
    parted = Katsevich(Projector(GRID, scan, device=limited(device, need)))
    assert len(list(parted._A._chunks(need))) >= 2
    volume = normal(*GRID.shape)
    assert_same([parted.T(volume)], [whole.T(volume)])
