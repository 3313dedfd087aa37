"""What directions in space stand for: the laws of the plane, on the sphere."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from rift_cl.errors import InputError
from rift_cl.operators.filters.compensation import COMPENSATIONS, Compensation
from rift_cl.operators.filters.compensation_3d import central_planes, radial_lines

pytestmark = pytest.mark.dealt

KINDS = tuple(COMPENSATIONS)
DIAMETER = 20.0
K = np.array([0.0, 0.01, 0.05, 0.1, 0.25, 0.5])
RANDOM = np.random.default_rng(5)
RING = np.stack([np.cos(np.arange(24) * 2.6), np.sin(np.arange(24) * 2.6)], axis=1)

every_kind = pytest.mark.parametrize("kind", KINDS)


def fibonacci(count):
    """Directions that lie evenly on the half-sphere."""
    z = (np.arange(count) + 0.5) / count
    turn = np.arange(count) * np.pi * (3 - np.sqrt(5))
    across = np.sqrt(1 - z * z)
    return np.stack([across * np.cos(turn), across * np.sin(turn), z], axis=1)


def frames(normals, seed=0):
    """Axes of detectors across the directions, turned at random about them."""
    random = np.random.default_rng(seed)
    u = np.cross(normals, random.standard_normal(normals.shape))
    u /= np.linalg.norm(u, axis=1, keepdims=True)
    v = np.cross(normals / np.linalg.norm(normals, axis=1, keepdims=True), u)
    return np.stack([u, v], axis=1)


def normal(count, seed=1):
    return np.random.default_rng(seed).standard_normal((count, 3))


LEANING = normal(40) * (3, 1, 0.6)
FLAT = LEANING[:, 0]
SETS = {
    "even": fibonacci(40),
    "random": normal(40),
    "leaning": LEANING,
    "in one plane": np.stack([np.cos(FLAT), np.sin(FLAT), 0 * FLAT], 1),
    "cone": np.stack([RING[:, 0], RING[:, 1], np.full(24, 0.6)], 1),
    "one": np.array([[0.0, 3, 4]]),
    "the same": np.tile([[0.0, 3, 4]], (9, 1)),
    "two": np.array([[0.0, 3, 4], [1, 0, 0]]),
    "three": np.eye(3),
}
every_set = pytest.mark.parametrize("directions", SETS.values(), ids=SETS)


def along(count=12):
    """Frequencies on a ring of each radius."""
    angles = np.arange(count) * np.pi / count
    return np.concatenate([k * np.stack([np.cos(angles), np.sin(angles)], 1) for k in K])


@every_kind
@every_set
def test_lines_know_the_whole_at_zero_and_no_more_elsewhere(directions, kind):
    shares = radial_lines(directions, K, DIAMETER, kind)
    assert shares.shape == (len(directions), len(K))
    assert (shares > 0).all()
    assert shares[:, 0].sum() == pytest.approx(2 * np.pi)
    assert (shares.sum(0) <= 2 * np.pi + 1e-9).all()


@every_kind
@every_set
def test_planes_know_the_whole_at_zero_and_no_more_elsewhere(directions, kind):
    shares = central_planes(frames(directions), along(), DIAMETER, kind)
    assert (shares > 0).all()
    means = shares.reshape(len(directions), len(K), 12).mean(2).sum(0)
    assert means[0] == pytest.approx(1)
    # Means over 12 points of each ring, against 48 of the total's.
    assert (means <= 1.1).all()


@every_kind
def test_even_lines_have_the_density_of_the_sphere(kind):
    """k^2 times the same part for each, at every frequency."""
    shares = radial_lines(fibonacci(400), K, DIAMETER, kind)
    np.testing.assert_allclose(shares.sum(0), 2 * np.pi, rtol=0.01)
    # But for the seam, where the spiral meets its own opposite.
    off = np.abs(shares * 400 / (2 * np.pi) - 1)
    assert off.mean() < 0.03
    assert (off > 0.25).mean() < 0.01


@every_kind
def test_even_planes_have_the_density_of_the_sphere(kind):
    """2 |k| times the same part for each, as far as the planes resolve the object."""
    k = np.stack([K[:5] * 0.4, 0 * K[:5]], 1)
    shares = central_planes(frames(fibonacci(400)), k, DIAMETER, kind)
    np.testing.assert_allclose(shares.sum(0), 1, rtol=0.03)
    assert (shares.std(0) < 0.12 / 400).all()


@every_kind
def test_many_random_directions_become_the_density(kind):
    """Three times denser about one axis, and yet each sector of the sphere gets its part."""
    directions = normal(1500, 4) * (1, 1, 2)
    units = directions / np.linalg.norm(directions, axis=1, keepdims=True)
    shares = radial_lines(directions, [0.2], DIAMETER, kind)[:, 0]
    near = np.abs(units[:, 2]) > 0.5
    assert near.mean() > 0.65
    assert shares[near].sum() / (2 * np.pi) == pytest.approx(0.5, abs=0.06)


@every_kind
@every_set
def test_turning_space_changes_nothing(directions, kind):
    turn = Rotation.from_rotvec([0.3, -1.2, 2.0]).as_matrix()
    lines = radial_lines(directions, K, DIAMETER, kind)
    turned = radial_lines(directions @ turn.T, K, DIAMETER, kind)
    np.testing.assert_allclose(turned, lines, rtol=1e-5, atol=1e-7)
    axes = frames(directions)
    planes = central_planes(axes, along(4), DIAMETER, kind)
    turned = central_planes(axes @ turn.T, along(4), DIAMETER, kind)
    np.testing.assert_allclose(turned, planes, rtol=1e-5, atol=1e-9)


@every_kind
def test_opposite_directions_are_one_and_share(kind):
    directions = SETS["random"]
    doubled = np.concatenate([directions, -2 * directions])
    single = radial_lines(directions, K, DIAMETER, kind)
    np.testing.assert_allclose(
        radial_lines(doubled, K, DIAMETER, kind), np.tile(single / 2, (2, 1)), rtol=1e-6
    )
    axes = frames(directions)
    # The view from behind: one axis of the detector is turned.
    behind = axes * np.array([1, -1])[None, :, None]
    k = along(4)
    single = central_planes(axes, k, DIAMETER, kind)
    both = central_planes(np.concatenate([axes, behind]), k, DIAMETER, kind)
    np.testing.assert_allclose(both[:40], single / 2, rtol=1e-6)
    again = central_planes(np.concatenate([axes, behind]), k * (1, -1), DIAMETER, kind)
    np.testing.assert_allclose(again[40:], single / 2, rtol=1e-6)


@every_kind
def test_the_unit_of_length_is_free(kind):
    directions = SETS["leaning"]
    np.testing.assert_allclose(
        radial_lines(directions, K / 7.3, DIAMETER * 7.3, kind),
        radial_lines(directions, K, DIAMETER, kind),
    )


def test_capped_cells_are_strips_of_the_object():
    """A lonely line keeps (1 / (D k))^2, a lonely plane the slab 1 / D: H = 1 / D."""
    directions = np.concatenate([normal(300, 7) * (1, 1, 0.05), [[0, 0, 1.0]]])
    lonely = radial_lines(directions, [0.3], DIAMETER)[-1, 0]
    assert lonely == pytest.approx(1 / (DIAMETER * 0.3) ** 2)
    k = 0.3
    lonely = central_planes(frames(directions), [[k, 0]], DIAMETER)[-1, 0]
    assert 2 * k * lonely == pytest.approx(1 / DIAMETER)


def test_exact_planes_divide_by_the_overlap():
    axes, k = frames(SETS["leaning"]), np.array([[0.1, 0.2], [-0.2, 0.1]])
    normals = np.cross(axes[:, 0], axes[:, 1])
    points = np.einsum("nd,jdx->jnx", k, axes)
    overlap = np.maximum(0, 1 - DIAMETER * np.abs(points @ normals.T)).sum(2)
    found = central_planes(axes, k, DIAMETER, "exact") * overlap
    np.testing.assert_allclose(found, found[0, 0])


@every_kind
def test_levels_come_back(kind):
    """The middle of a Gaussian: the sum over all views of its spectrum under the filter."""
    width = DIAMETER / 4
    k = np.linspace(0, 0.25, 101)
    spectrum = np.exp(-2 * (np.pi * k * width) ** 2) * (2 * np.pi) ** 1.5 * width**3
    step = k[1]
    for directions in (SETS["random"], SETS["leaning"], SETS["cone"]):
        lines = radial_lines(directions, k, DIAMETER, kind).sum(0)
        assert 2 * step * np.sum(k**2 * lines * spectrum) == pytest.approx(1, abs=0.05)
        angles = np.arange(12) * np.pi / 12
        points = np.concatenate([r * np.stack([np.cos(angles), np.sin(angles)], 1) for r in k])
        planes = central_planes(frames(directions), points, DIAMETER, kind)
        rings = planes.sum(0).reshape(len(k), 12).mean(1)
        level = step * np.sum(2 * np.pi * k * 2 * k * rings * spectrum)
        assert level == pytest.approx(1, abs=0.05)


def test_lines_in_a_plane_are_the_views_of_a_scan():
    """What each stands for at low frequency, as a part of the whole."""
    angles = np.sort(RANDOM.uniform(0, np.pi, 20))
    flat = np.stack([np.cos(angles), np.sin(angles), 0 * angles], 1)
    found = radial_lines(flat, [0.0], DIAMETER)[:, 0] / (2 * np.pi)
    expected = Compensation(angles, "capped-voronoi", DIAMETER)(np.zeros(1))[:, 0] / np.pi
    np.testing.assert_allclose(found, expected)


def test_thousands_of_equal_and_of_different_views():
    many = np.concatenate([np.tile([[1.0, 2, 3]], (5000, 1)), normal(5000, 9)])
    shares = radial_lines(many, [0.0, 0.2], DIAMETER)
    assert shares[:, 0].sum() == pytest.approx(2 * np.pi)
    np.testing.assert_allclose(shares[:5000], shares[:1].repeat(5000, 0))


@pytest.mark.parametrize(
    "directions", [[], [[1, 2]], [[0, 0, 0]], [[1, np.nan, 0]], [["a", "b", "c"]], 3, [[1j, 0, 0]]]
)
def test_what_is_no_direction_is_refused(directions):
    with pytest.raises(InputError, match="directions"):
        radial_lines(directions, K, DIAMETER)


@pytest.mark.parametrize(
    "axes",
    [
        np.zeros((0, 2, 3)),
        np.eye(3),
        [np.eye(3)[:2] * 2],
        [[[1, 0, 0], [1, 0, 0]]],
        [[[1, 0, 0], [0, np.nan, 0]]],
    ],
)
def test_what_are_no_axes_are_refused(axes):
    with pytest.raises(InputError, match="axes"):
        central_planes(axes, np.zeros((1, 2)), DIAMETER)


def test_other_bad_arguments_are_refused():
    axes = frames(np.eye(3))
    for call in (
        lambda kind, size: radial_lines(np.eye(3), K, size, kind),
        lambda kind, size: central_planes(axes, along(), size, kind),
    ):
        with pytest.raises(InputError, match="kind is 'nope'"):
            call("nope", 1.0)
        for size in (0, -1, np.nan, "a"):
            with pytest.raises(InputError, match="diameter"):
                call("exact", size)
    for k in ([[0.1, 0.2]], [np.nan], "a"):
        with pytest.raises(InputError, match="frequencies"):
            radial_lines(np.eye(3), k, DIAMETER)
    for k in ([0.1], [[0.1, np.inf]], [[1, 2, 3]]):
        with pytest.raises(InputError, match="frequencies"):
            central_planes(axes, k, DIAMETER)
