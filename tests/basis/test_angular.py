"""Angular bases: against their definitions, and the laws that hold for all of them."""

from __future__ import annotations

from math import factorial, pi

import numpy as np
import pytest
from scipy.special import eval_genlaguerre, eval_hermite

from rift_cl.basis.angular import (
    AnisotropicSphericalGaussians,
    HGLobe,
    LGLobe,
    SphericalGaussians,
    SphericalHarmonics,
    angular_basis,
)
from rift_cl.reference.splat_projection import spherical_harmonics

LOBES = [("hg", 36), ("lg", 36), ("hg", 1), ("lg", 9), ("sg", 5), ("asg", 4)]
CONSTANT = 0.28209479177387814


def unit(values):
    return values / np.linalg.norm(values, axis=-1, keepdims=True)


def random_directions(count, seed=0):
    return unit(np.random.default_rng(seed).standard_normal((count, 3)))


def random_geometry(basis, count, seed=1, widths=(0.2, 0.9)):
    """Frames of any length, widths or sharpness of all sizes."""
    random = np.random.default_rng(seed)
    geometry = random.standard_normal((count, basis.n_geometry))
    if basis.name in ("hg", "lg"):
        geometry[:, 4:] = np.log(random.uniform(*widths, (count, basis.n_geometry - 4)))
    return geometry


def local(geometry, directions):
    """(d . t, d . b, d . a) by Hamilton's product: q* d q."""
    w, v = geometry[..., :1], geometry[..., 1:4]
    length = np.linalg.norm(geometry[..., :4], axis=-1, keepdims=True)
    w, v = w / length, -v / length
    first = np.cross(v, directions)
    return directions + 2 * (w * first + np.cross(v, first))


def chart(geometry, directions, widths):
    p = local(geometry, directions)
    angle = np.arctan2(np.hypot(p[:, 0], p[:, 1]), p[:, 2])
    turn = np.arctan2(p[:, 1], p[:, 0])
    rho = 2 * np.sin(angle / 2)
    return rho * np.cos(turn) / widths[:, 0], rho * np.sin(turn) / widths[:, -1]


def test_harmonics_are_those_of_the_reference():
    directions = random_directions(50)
    found = SphericalHarmonics(4).functions(None, 3 * directions)
    np.testing.assert_allclose(found, spherical_harmonics(directions, 4), atol=2e-14)


def test_hermite_modes_are_scipys_on_the_chart():
    geometry, directions = random_geometry(HGLobe(36), 40), random_directions(40)
    x, y = chart(geometry, directions, np.exp(geometry[:, 4:]))

    def h(n, x):
        norm = 2.0**n * factorial(n) * np.sqrt(pi)
        return eval_hermite(n, x) * np.exp(-x * x / 2) / np.sqrt(norm)

    wanted = [h(n - j, x) * h(j, y) for n in range(8) for j in range(n + 1)][:35]
    found = HGLobe(36).functions(geometry, directions)[:, 1:]
    np.testing.assert_allclose(found, np.stack(wanted, 1), atol=1e-13)


def test_laguerre_modes_are_scipys_on_the_chart():
    geometry, directions = random_geometry(LGLobe(36), 40), random_directions(40)
    x, y = chart(geometry, directions, np.exp(geometry[:, 4:]))
    r, phi = np.hypot(x, y), np.arctan2(y, x)
    wanted = []
    for order in range(8):
        for turns in range(order, -1, -2):
            p = (order - turns) // 2
            norm = np.sqrt(factorial(p) / (pi * factorial(p + turns)))
            radial = (-1) ** p * norm * r**turns * eval_genlaguerre(p, turns, r * r)
            wanted.append(radial * np.exp(-r * r / 2))
            if turns:
                wanted[-1:] = [np.sqrt(2) * wanted[-1] * f(turns * phi) for f in (np.cos, np.sin)]
    found = LGLobe(36).functions(geometry, directions)[:, 1:]
    np.testing.assert_allclose(found, np.stack(wanted[:35], 1), atol=1e-13)


def test_spherical_gaussians_are_their_definitions():
    isotropic, directions = SphericalGaussians(3), random_directions(30)
    geometry = random_geometry(isotropic, 30)
    lobes = geometry.reshape(30, 3, 4)
    cosines = np.einsum("nki,ni->nk", unit(lobes[..., :3]), directions)
    wanted = np.exp(np.exp(lobes[..., 3]) * (cosines - 1))
    np.testing.assert_allclose(isotropic.functions(geometry, directions)[:, 1:], wanted, atol=1e-14)
    anisotropic = AnisotropicSphericalGaussians(3)
    lobes = random_geometry(anisotropic, 30).reshape(30, 3, 6)
    p = local(lobes, directions[:, None, :])
    wanted = np.maximum(p[..., 2], 0) * np.exp(-(np.exp(lobes[..., 4:]) * p[..., :2] ** 2).sum(-1))
    found = anisotropic.functions(lobes.reshape(30, 18), directions)[:, 1:]
    np.testing.assert_allclose(found, wanted, atol=1e-14)


@pytest.mark.parametrize("kind, count", [*LOBES, ("sh", 16)])
def test_first_function_is_the_same_constant_for_all(kind, count):
    basis = angular_basis(kind, count)
    assert (basis.name, basis.n_linear) == (kind, count)
    found = basis.functions(random_geometry(basis, 20), random_directions(20))
    assert found.shape == (20, count)
    np.testing.assert_allclose(found[:, 0], CONSTANT, rtol=1e-15)


@pytest.mark.parametrize("kind", [HGLobe, LGLobe])
def test_modes_are_orthonormal_on_the_chart(kind):
    """The map keeps areas, so products of narrow modes integrate over the sphere to w1 w2 or 0."""
    basis = kind(36)
    z, weights = np.polynomial.legendre.leggauss(120)
    azimuth = np.linspace(0, 2 * pi, 128, endpoint=False)
    z, azimuth = (a.ravel() for a in np.meshgrid(z, azimuth, indexing="ij"))
    ring = np.sqrt((1 - z) * (1 + z))
    points = np.stack([ring * np.cos(azimuth), ring * np.sin(azimuth), z], 1)
    widths = np.array([0.2, 0.25])[: basis.n_geometry - 4]
    geometry = np.array([1.0, 0, 0, 0, *np.log(widths)])
    values = basis.functions(geometry, points)[:, 1:]
    gram = (values * np.repeat(weights, 128)[:, None] * 2 * pi / 128).T @ values
    np.testing.assert_allclose(gram / (widths[0] * widths[-1]), np.eye(35), atol=1e-11)


@pytest.mark.parametrize("kind, count", LOBES)
def test_turning_frame_and_direction_together_changes_nothing(kind, count):
    basis, directions = angular_basis(kind, count), random_directions(20)
    geometry = random_geometry(basis, 20)
    turn = unit(np.array([0.3, -0.5, 0.7, 0.4]))
    numbers = {"hg": basis.n_geometry, "lg": basis.n_geometry, "sg": 4, "asg": 6}[kind]
    turned = geometry.reshape(20, -1, numbers).copy()
    if kind == "sg":
        turned[..., :3] = turned_by(turn, turned[..., :3])
    else:
        turned[..., :4] = product(turn, turned[..., :4])
    found = basis.functions(turned.reshape(20, -1), turned_by(turn, directions))
    np.testing.assert_allclose(found, basis.functions(geometry, directions), atol=1e-12)


def product(p, q):
    """Hamilton's product of quaternions (w, x, y, z)."""
    w = p[..., :1] * q[..., :1] - (p[..., 1:] * q[..., 1:]).sum(-1, keepdims=True)
    v = p[..., :1] * q[..., 1:] + q[..., :1] * p[..., 1:] + np.cross(p[..., 1:], q[..., 1:])
    return np.concatenate([w, v], -1)


def turned_by(q, vectors):
    return local(q * np.array([1, -1, -1, -1]), vectors)


@pytest.mark.parametrize("kind, count", LOBES)
@pytest.mark.parametrize("length", [1e-20, 0.3, -1.0, 1e25])
def test_lengths_of_quaternions_axes_and_directions_do_not_matter(kind, count, length):
    basis, directions = angular_basis(kind, count), random_directions(20)
    geometry = random_geometry(basis, 20)
    numbers = {"hg": basis.n_geometry, "lg": basis.n_geometry, "sg": 4, "asg": 6}[kind]
    longer = geometry.reshape(20, -1, numbers).copy()
    # An axis is not its opposite; a quaternion is.
    longer[..., : 3 if kind == "sg" else 4] *= abs(length) if kind == "sg" else length
    found = basis.functions(longer.reshape(20, -1), abs(length) * directions)
    np.testing.assert_allclose(found, basis.functions(geometry, directions), atol=1e-13)


@pytest.mark.parametrize("count", [2, 4, 7, 11, 16, 22, 29])
def test_whole_orders_of_both_kinds_of_modes_span_the_same(count):
    assert misfit(count) < 1e-12


def test_broken_orders_do_not():
    assert misfit(5) > 1e-3
    assert misfit(9) > 1e-3


def misfit(count):
    """What the Hermite set leaves of the Laguerre one, at equal widths."""
    geometry, directions = random_geometry(LGLobe(count), 1), random_directions(400)
    laguerre = LGLobe(count).functions(geometry, directions)
    hermite = HGLobe(count).functions(geometry[:, [0, 1, 2, 3, 4, 4]], directions)
    return np.abs(hermite @ np.linalg.lstsq(hermite, laguerre, rcond=None)[0] - laguerre).max()


def test_lowest_mode_is_a_spherical_gaussian():
    """exp(-rho^2 / (2 w^2)) with rho^2 = 2 (1 - d . a) is one of sharpness 1 / w^2."""
    directions, log_width = random_directions(50), np.log(0.4)
    mode = LGLobe(2).functions([1, 0, 0, 0, log_width], directions)[:, 1]
    gaussian = SphericalGaussians(1).functions([0, 0, 1, -2 * log_width], directions)[:, 1]
    np.testing.assert_allclose(mode * np.sqrt(pi), gaussian, atol=1e-14)


def test_round_anisotropic_lobes_near_the_isotropic_ones_as_they_narrow():
    gaps = []
    for sharpness in (10.0, 100.0, 1000.0):
        directions = random_directions(20) / np.sqrt(sharpness) + np.array([0, 0, 1])
        isotropic = [0, 0, 1, np.log(sharpness)]
        anisotropic = [1, 0, 0, 0, *[np.log(sharpness / 2)] * 2]
        one = SphericalGaussians(1).functions(isotropic, directions)
        other = AnisotropicSphericalGaussians(1).functions(anisotropic, directions)
        gaps.append(np.abs(one - other).max())
    assert gaps[0] < 0.1 and gaps[1] < gaps[0] / 5 and gaps[2] < gaps[1] / 5


def test_limits_of_sharpness_are_a_constant_and_nothing():
    away = random_directions(50) * np.array([1, 1, 0]) + np.array([0, 0, -0.5])
    broad = SphericalGaussians(1).functions([0, 0, 1, -20.0], away)[:, 1]
    np.testing.assert_allclose(broad, 1, atol=2e-4)
    assert not SphericalGaussians(1).functions([0, 0, 1, 20.0], away)[:, 1].any()
    assert not AnisotropicSphericalGaussians(1).functions([1, 0, 0, 0, 0, 0], away)[:, 1].any()


@pytest.mark.parametrize("degree", range(5))
def test_harmonics_alone_are_those_with_derivatives(degree):
    directions = np.random.default_rng(degree).normal(size=(3, 50, 3))
    directions[0, 0], directions[1, 1], directions[2, 2] = 0, [0, 0, -2], np.nan
    basis = SphericalHarmonics(degree)
    alone, values = basis.functions(None, directions), basis.slopes(None, directions).values
    np.testing.assert_allclose(alone, values, atol=1e-14)
