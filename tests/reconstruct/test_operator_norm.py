"""The norm of an operator: from a little above its largest singular value."""

from __future__ import annotations

import numpy as np
import pytest

import rift_cl as rift
from rift_cl.errors import InputError


def matrix_of(A):
    units = np.eye(A.shape[1], dtype=A.dtype)
    return np.array([A(unit.reshape(A.domain)).ravel() for unit in units]).T.astype(float)


@pytest.mark.full
def test_it_bounds_the_largest_singular_value_closely(device):
    grid = rift.Grid((9, 11), spacing=0.4)
    A = rift.Projector(grid, rift.Parallel(np.arange(7) / 7 * np.pi, 15, 0.5), device=device)
    B = rift.Projector(grid, rift.Parallel(np.arange(3) / 3 * np.pi, 15, 0.5), device=device)
    same = rift.HostOperator(lambda x: 3 * x, lambda y: 3 * y, (5,), (5,), device=device)
    for K in (A, A.T, 3 * A, rift.vstack(A, -2 * B), A.T @ A, same):
        wanted = np.linalg.norm(matrix_of(K), 2)
        assert wanted <= rift.operator_norm(K) <= 1.05 * wanted
        assert rift.operator_norm(K) == rift.operator_norm(K)


def test_that_of_nothing_is_0_and_what_is_no_operator_has_none(device):
    A = rift.Projector(rift.Grid((4, 4)), rift.Parallel([0.0, 1.0], 5), device=device)
    assert rift.operator_norm(0 * A) == 0
    with pytest.raises(InputError, match="LinearOperator"):
        rift.operator_norm(np.eye(3))
