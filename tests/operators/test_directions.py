"""Distinct directions in the plane and in space, and the cells about them."""

from __future__ import annotations

import numpy as np
import pytest

from rift_cl.operators.filters.directions import Directions
from rift_cl.operators.filters.directions_3d import Lines

LEANING = np.random.default_rng(1).standard_normal((40, 3)) * (3, 1, 0.6)
ACROSS = LEANING * (1, 1, 0)
SETS = {
    "leaning": LEANING,
    "in one plane": ACROSS,
    "nearly in one plane": ACROSS + LEANING * 1e-4,
    "one": np.array([[0.0, 3, 4]]),
    "the same": np.tile([[0.0, 3, 4]], (9, 1)),
    "two": np.array([[0.0, 3, 4], [1, 0, 0]]),
    "three": np.eye(3),
    "of any length": LEANING * 10.0 ** np.arange(-150, 150, 300 / 40)[:, None],
}


@pytest.mark.parametrize("directions", SETS.values(), ids=SETS)
def test_cells_are_the_half_sphere(directions):
    lines = Lines.of(directions)
    assert (lines.areas > 0).all()
    assert lines.areas.sum() == pytest.approx(2 * np.pi)


def test_cells_of_known_sets():
    np.testing.assert_allclose(Lines.of(np.eye(3)).areas, 2 * np.pi / 3)
    np.testing.assert_allclose(
        Lines.of([[1, 1, 1], [1, 1, -1], [1, -1, 1], [-1, 1, 1]]).areas, np.pi / 2
    )
    flat = Lines.of([[1.0, 0, 0], [1, 1, 0], [0, 1, 0]])
    np.testing.assert_allclose(flat.areas, [0.75 * np.pi, 0.5 * np.pi, 0.75 * np.pi])


def test_cells_are_what_random_points_find_nearest():
    lines = Lines.of(LEANING)
    points = np.random.default_rng(3).standard_normal((200_000, 3))
    nearest = np.abs(points @ lines.vectors.T).argmax(1)
    counted = np.bincount(nearest, minlength=len(lines)) * 2 * np.pi / len(points)
    np.testing.assert_allclose(lines.areas, counted, atol=0.006)


def test_opposite_and_repeated_lines_are_one():
    lines = Lines.of(np.concatenate([LEANING, -LEANING[::-1], LEANING[:3] * 7]))
    assert len(lines) == 40
    assert lines.group[0] == lines.group[79] == lines.group[80]
    shares = lines.share(lines.areas)
    assert shares.sum() == pytest.approx(2 * np.pi)
    assert shares[0] == pytest.approx(lines.areas[lines.group[0]] / 3)


@pytest.mark.parametrize("turn", [0.0, np.pi, -7 * np.pi, 1000 * np.pi])
def test_opposite_and_repeated_directions_are_one(turn):
    angles = np.array([0.0, 1.0, 2.0])
    directions = Directions.of(np.concatenate([angles, angles + turn, [np.pi]]))
    assert len(directions) == 3
    np.testing.assert_allclose(directions.gaps.sum(), np.pi)
    assert directions.group.tolist() == [0, 1, 2, 0, 1, 2, 0]
    np.testing.assert_allclose(directions.share(directions.gaps).sum(), np.pi)
