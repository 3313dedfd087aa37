"""Filtered backprojection of fans: the densities, weights and refusals of a cone's middle plane."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import rift_cl as rift
from rift_cl import Fan, Grid, Projector, backproject, fbp, phantom
from rift_cl.errors import InputError
from rift_cl.reconstruct import FDK

pytestmark = pytest.mark.once

N = 64
GRID = Grid((N, N))
FULL = np.arange(120) * 2 * np.pi / 120
DISC = phantom.Ellipsoid.ball(0.33 * N, 1.7)
AWAY = np.arange(N) - (N - 1) / 2
RADIUS = np.hypot(AWAY[:, None], AWAY)


def fan(angles=FULL, magnification=1.5, distance=3.0, share=1.0, **changes):
    """A scan whose detector just sees the circle in the grid, with bins of a share of a pixel."""
    to_axis = distance * N
    to_detector = to_axis * magnification
    width = 2.04 * to_detector * np.tan(np.arcsin(0.5 / distance))
    bins = round(N / share)
    return Fan(angles, bins, width / bins, to_axis, to_detector, **changes)


def averaged(parts, scan, factor=5):
    """Line integrals averaged over bins, as a detector measures them."""
    center = (scan.center + 0.5) * factor - 0.5
    fine = replace(scan, bins=scan.bins * factor, pitch=scan.pitch / factor, center=center)
    return phantom.project(parts, GRID, fine).reshape(scan.views, scan.bins, factor).mean(2)


@pytest.mark.parametrize("curved", [False, True], ids=["flat", "curved"])
@pytest.mark.parametrize("magnification", [1.2, 3.0, 15.0])
@pytest.mark.parametrize("share", [1.0, 0.5])
@pytest.mark.parametrize("distance", [3.0, 1.2])
def test_a_disc_has_its_density(device, distance, share, magnification, curved):
    scan = fan(magnification=magnification, distance=distance, share=share, curved=curved)
    image = fbp(Projector(GRID, scan, device=device), averaged([DISC], scan))
    assert image[RADIUS < 0.28 * N].mean() / DISC.value == pytest.approx(1, abs=1e-3)


HEAD = phantom.head(GRID)
IMAGE = phantom.render(HEAD, GRID)


def quality(device, scan, data_scan=None):
    """PSNR of the head, in dB."""
    y = phantom.project(HEAD, GRID, scan if data_scan is None else data_scan)
    image = fbp(Projector(GRID, scan, device=device), y)
    return -10 * np.log10(np.mean((image - IMAGE)[RADIUS < 0.48 * N].astype(float) ** 2))


def test_short_scans_and_detectors_to_one_side_are_nearly_a_full_turn(device):
    whole = quality(device, fan())
    span = np.pi + 2.2 * np.arcsin(0.5 / 3)
    short = fan(0.3 + np.arange(80) * span / 80)
    assert quality(device, short) > whole - 1.5
    assert quality(device, fan(short.angles[::-1])) == pytest.approx(quality(device, short))
    assert quality(device, fan(-short.angles), short) < whole - 4
    cut = replace(fan(), bins=46, center=13.5)
    assert quality(device, cut) > whole - 0.5


def test_a_fan_has_an_adjoint_and_a_sentence(device):
    F = FDK(Projector(GRID, replace(fan(FULL[::4]), bins=46, center=13.5), device=device))
    assert rift.dot_test(F) < 2e-7
    assert "Wang" in repr(F)


@pytest.mark.full
def test_backprojection_alone_has_the_unit_of_a_parallel_one(device):
    far, near = fan(distance=20.0), [phantom.Ellipsoid.ball(0.2 * N)]
    parallel = rift.Parallel(FULL, far.bins, far.pitch / far.magnification)
    there, here = (
        backproject(Projector(GRID, scan, device=device), phantom.project(near, GRID, scan))
        for scan in (far, parallel)
    )
    assert there[32, 32] == pytest.approx(here[32, 32], rel=0.01)


def test_half_a_turn_is_refused_with_the_methods_that_take_it(device):
    with pytest.raises(InputError, match=r"half a turn.*cgls"):
        FDK(Projector(GRID, fan(FULL[:60]), device=device))
