"""Slopes of angular bases against finite differences, starts, edges and hostile input."""

from __future__ import annotations

import numpy as np
import pytest

from rift_cl.basis.angular import (
    ANGULAR_BASES,
    HGLobe,
    LGLobe,
    SphericalGaussians,
    SphericalHarmonics,
    angular_basis,
)
from rift_cl.errors import DTypeError, InputError, ShapeError

KINDS = [("sh", 25), ("hg", 36), ("hg", 8), ("lg", 36), ("lg", 8), ("sg", 5), ("asg", 4)]
LOBES = [kind for kind in KINDS if kind[0] != "sh"]


def scene(kind, count, number=12, seed=3):
    """A basis with coefficients (N, L, 2), geometry and directions of any length."""
    random, basis = np.random.default_rng(seed), angular_basis(kind, count)
    geometry = random.standard_normal((number, basis.n_geometry))
    if kind in ("hg", "lg"):
        geometry[:, 4:] = np.log(random.uniform(0.2, 0.9, (number, basis.n_geometry - 4)))
    coeff = random.standard_normal((number, count, 2))
    return basis, coeff, geometry, 2 * random.standard_normal((number, 3))


def differences(function, point, step=1e-5):
    """d function / d last axis of point, which becomes the axis before the last."""
    columns = []
    for k in range(point.shape[-1]):
        shift = np.zeros(point.shape[-1])
        shift[k] = step
        columns.append((function(point + shift) - function(point - shift)) / (2 * step))
    return np.stack(columns, -2)


@pytest.mark.parametrize("kind, count", KINDS)
def test_slopes_are_the_differences(kind, count):
    basis, coeff, geometry, directions = scene(kind, count)
    found = basis.evaluate(coeff, geometry, directions, grad=True)
    np.testing.assert_allclose(found.value, basis.evaluate(coeff, geometry, directions), atol=1e-13)
    wanted = differences(lambda d: basis.evaluate(coeff, geometry, d), directions)
    np.testing.assert_allclose(found.by_directions, wanted, atol=1e-7, rtol=1e-7)
    if basis.n_geometry:
        wanted = differences(lambda g: basis.evaluate(coeff, g, directions), geometry)
        np.testing.assert_allclose(found.by_geometry, wanted, atol=1e-7, rtol=1e-7)
    raised = coeff + np.array([0.5, -1.0])
    gained = found.by_coeff.sum(1)[:, None] * np.array([0.5, -1.0])
    np.testing.assert_allclose(
        basis.evaluate(raised, geometry, directions) - found.value, gained, atol=1e-12
    )


@pytest.mark.parametrize("kind, count", KINDS)
def test_slopes_by_direction_have_no_part_along_it(kind, count):
    basis, coeff, geometry, directions = scene(kind, count)
    slopes = basis.evaluate(coeff, geometry, directions, grad=True).by_directions
    assert np.abs(np.einsum("nic,ni->nc", slopes, directions)).max() < 1e-12


@pytest.mark.parametrize("kind", [HGLobe, LGLobe])
@pytest.mark.parametrize("angle", [0.011, 0.004])
def test_slopes_hold_where_the_modes_fade(kind, angle):
    """The last 0.8 degrees before the antipode are 0.0141 wide."""
    basis = kind(8)
    geometry = np.array([[0.9, 0.1, -0.3, 0.2, -0.1, -0.2][: basis.n_geometry]])
    axis = np.linalg.inv(frame(geometry[0]))[2]
    side = np.cross(axis, [1.0, 0, 0])
    directions = (-axis + angle * side / np.linalg.norm(side))[None]
    coeff = np.random.default_rng(0).standard_normal((1, 8, 1))
    found = basis.evaluate(coeff, geometry, directions, grad=True)
    wanted = differences(lambda d: basis.evaluate(coeff, geometry, d), directions, 1e-6)
    assert np.abs(wanted).max() > 1
    np.testing.assert_allclose(found.by_directions, wanted, rtol=1e-5, atol=1e-4)
    wanted = differences(lambda g: basis.evaluate(coeff, g, directions), geometry, 1e-6)
    np.testing.assert_allclose(found.by_geometry, wanted, rtol=1e-5, atol=1e-4)


def frame(geometry):
    """Columns t, b, a, which the lobe of one wide mode is measured for."""
    w, x, y, z = geometry[:4] / np.linalg.norm(geometry[:4])
    cross = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    return np.eye(3) + 2 * w * cross + 2 * cross @ cross


@pytest.mark.parametrize("kind", [HGLobe, LGLobe])
def test_modes_are_nothing_at_the_antipode_and_nowhere_jump(kind):
    basis = kind(12)
    geometry = np.array([1.0, 0, 0, 0, 0, 0][: basis.n_geometry])
    angles = np.pi - np.geomspace(1e-9, 0.1, 3000)
    directions = np.stack([np.sin(angles), 0 * angles, np.cos(angles)], 1)
    modes = basis.functions(geometry, directions)[:, 1:]
    assert np.abs(modes[0]).max() < 1e-9
    # 2 sin(angle / 2) is 2 at the rim, where the lowest of these modes is exp(-2) of its peak.
    assert np.abs(modes).max() < 0.5 and np.abs(np.diff(modes, axis=0)).max() < 0.02
    assert not basis.functions(geometry, [0, 0, -1.0])[1:].any()


@pytest.mark.parametrize("held, at", [(np.log(0.02), -5.0), (0.0, 0.4), (np.log(0.02), -1e30)])
@pytest.mark.parametrize("kind", [HGLobe, LGLobe])
def test_widths_are_held_and_have_no_slope_beyond(kind, held, at):
    basis, coeff, geometry, _ = scene(kind.name, 8)
    # Near the axis, so that narrow lobes are seen.
    directions = np.stack([frame(g)[:, 2] + 0.02 * frame(g)[:, 0] for g in geometry])
    beyond, edge = geometry.copy(), geometry.copy()
    beyond[:, 4], edge[:, 4] = at, held
    found = basis.evaluate(coeff, beyond, directions, grad=True)
    np.testing.assert_allclose(found.value, basis.evaluate(coeff, edge, directions), rtol=1e-12)
    assert not found.by_geometry[:, 4].any() and np.abs(found.by_geometry[:, :4]).max() > 0.1


@pytest.mark.parametrize("kind, count", LOBES)
@pytest.mark.parametrize("bad", [np.nan, np.inf, -np.inf])
def test_geometry_that_is_no_number_makes_all_functions_none(kind, count, bad):
    basis, _, geometry, directions = scene(kind, count)
    healthy = basis.functions(geometry, directions)
    geometry[4, -1] = bad
    found = basis.functions(geometry, directions)
    assert np.isnan(found[4]).all()
    rest = np.arange(12) != 4
    np.testing.assert_array_equal(found[rest], healthy[rest])


@pytest.mark.parametrize("kind, count", LOBES)
def test_frame_of_no_length_has_no_functions(kind, count):
    basis, _, geometry, directions = scene(kind, count)
    geometry[0, : 3 if kind == "sg" else 4] = 0
    found = basis.functions(geometry, directions)
    assert np.isnan(found[0]).all() and np.isfinite(found[1:]).all()


@pytest.mark.parametrize("kind, count", KINDS)
def test_direction_of_no_length_is_along_z_and_has_no_slope(kind, count):
    basis, coeff, geometry, _ = scene(kind, count)
    found = basis.evaluate(coeff, geometry, np.zeros(3), grad=True)
    np.testing.assert_allclose(found.value, basis.evaluate(coeff, geometry, [0, 0, 1.0]))
    assert not found.by_directions.any()


@pytest.mark.parametrize("kind, count", KINDS)
def test_one_geometry_is_seen_from_many_directions(kind, count):
    basis, coeff, geometry, directions = scene(kind, count)
    found = basis.evaluate(coeff[0], geometry[0], directions.reshape(4, 3, 3), grad=True)
    each = basis.evaluate(coeff[:1], geometry[:1], directions, grad=True)
    for part, wanted in zip(found, each, strict=True):
        np.testing.assert_allclose(part.reshape(wanted.shape), wanted, atol=1e-12)


@pytest.mark.parametrize("kind, count", KINDS)
def test_lobes_begin_along_their_axes_and_apart(kind, count):
    basis = angular_basis(kind, count)
    axes = np.array([[0, 0, 2.0], [0, 0, -1], [0.3, -0.4, 0.5], [0, 0, 0], [1e-9, 0, -1]])
    geometry = basis.start_geometry(axes)
    assert geometry.shape == (5, basis.n_geometry) and np.isfinite(geometry).all()
    if kind == "sh":
        return
    along = basis.functions(geometry, axes)
    beside = basis.functions(geometry, axes + np.array([0.3, 0.2, 0.1]))
    assert (along[:, 1] > beside[:, 1]).all(), "the first lobe's peak is along the axis"
    if kind in ("sg", "asg"):
        assert np.linalg.matrix_rank(basis.functions(geometry[0], np.eye(3)[[0, 1, 2]])) == 3
        gaps = np.diff(np.sort(along[0, 1:]))
        assert (gaps > 1e-4).all(), "no two lobes are alike"


def test_bases_are_found_by_name_and_count():
    assert ANGULAR_BASES.names == ("sh", "hg", "lg", "sg", "asg")
    assert [angular_basis("sh", (k + 1) ** 2).degree for k in range(5)] == [0, 1, 2, 3, 4]
    assert [angular_basis(kind, 8).n_geometry for kind in ANGULAR_BASES.names[1:]] == [6, 5, 28, 42]


@pytest.mark.parametrize(
    "make, message",
    [
        (lambda: angular_basis("zernike", 8), "wanted one of sh, hg, lg, sg, asg"),
        (lambda: angular_basis("sh", 8), "wanted 1, 4, 9, 16 or 25"),
        (lambda: angular_basis("sg", 1), "functions is 1"),
        (lambda: SphericalHarmonics(5), "degree is 5"),
        (lambda: HGLobe(0), "modes is 0"),
        (lambda: LGLobe(37), "modes is 37"),
        (lambda: LGLobe(True), "modes is True"),
        (lambda: HGLobe(2.5), "modes is 2.5"),
        (lambda: SphericalGaussians(36), "lobes is 36"),
    ],
)
def test_numbers_of_functions_that_do_not_exist_are_refused(make, message):
    with pytest.raises(InputError, match=message):
        make()


@pytest.mark.parametrize("kind, count", LOBES)
def test_arrays_that_do_not_fit_are_refused(kind, count):
    basis, coeff, geometry, directions = scene(kind, count)
    with pytest.raises(ShapeError, match=rf"coeff has shape .*{count}, C"):
        basis.evaluate(coeff[:, 1:], geometry, directions)
    with pytest.raises(ShapeError, match=rf"geometry .*{basis.n_geometry}\)"):
        basis.evaluate(coeff, geometry[:, 1:], directions)
    with pytest.raises(ShapeError, match=r"directions .*, wanted \(..., 3\)"):
        basis.functions(geometry, directions[:, :2])
    with pytest.raises(DTypeError, match="wanted real numbers"):
        basis.functions(geometry.astype(complex), directions)
