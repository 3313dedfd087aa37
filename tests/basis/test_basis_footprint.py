"""Where a splat falls on a screen: the triangle, the map and the scale of its line integrals."""

from __future__ import annotations

import math

import numpy as np
import pytest

from rift_cl.basis import footprint
from rift_cl.errors import InputError, ShapeError


def test_the_line_integral_of_a_gaussian_is_that_of_the_textbook() -> None:
    """sqrt(2 pi) / |M^-1 d| along the unit direction d."""
    rng = np.random.default_rng(15)
    root, P = rng.normal(size=(3, 3)), rng.normal(size=(2, 3))
    ray = np.cross(*P)
    way = np.linalg.norm(np.linalg.solve(root, ray / np.linalg.norm(ray)))
    assert footprint(root, P).scale == pytest.approx(math.sqrt(2 * math.pi) / way, rel=1e-13)


def test_the_map_is_what_is_left_of_the_covariance() -> None:
    rng = np.random.default_rng(22)
    root, P = rng.normal(size=(3, 3)), rng.normal(size=(2, 3))
    for dilation in (0.0, 0.4):
        L, A, _ = footprint(root, P, dilation)
        assert L[0, 1] == 0 and (np.diag(L) > 0).all()
        covariance = P @ root @ root.T @ P.T
        np.testing.assert_allclose(L @ L.T, covariance + dilation * np.eye(2), atol=1e-13)
        np.testing.assert_allclose(L @ A, P @ root, atol=1e-13)


def test_a_screen_of_other_units_sees_the_same_line_integrals() -> None:
    rng = np.random.default_rng(23)
    root, P, units = rng.normal(size=(3, 3)), rng.normal(size=(2, 3)), rng.normal(size=(2, 2))
    assert footprint(root, P).scale == pytest.approx(footprint(root, units @ P).scale, rel=1e-12)


def test_impossible_footprints_are_refused() -> None:
    for root, P in ((np.eye(3), np.eye(3)), (np.eye(2), np.eye(2)), (np.ones(3), np.eye(3)[:2])):
        with pytest.raises(ShapeError, match="root and P"):
            footprint(root, P)
    with pytest.raises(InputError, match="no area"):
        footprint(np.zeros((3, 3)), np.eye(3)[:2])
    for bad in (-1.0, math.nan, math.inf):
        with pytest.raises(InputError, match="dilation"):
            footprint(np.eye(3), np.eye(3)[:2], bad)
