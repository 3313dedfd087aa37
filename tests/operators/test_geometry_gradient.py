"""Derivatives of data by the places of source and detector, against finite differences."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

from rift_cl import Cone, Grid, Projector, Vectors
from rift_cl.errors import InputError
from rift_cl.operators import geometry_gradient

FIELDS = "source", "middle", "across", "down"


def changed(scan, **changes):
    names = [field.name for field in dataclasses.fields(scan)]
    return Vectors(**{name: getattr(scan, name) for name in names} | changes)


def across_and_along():
    """Three views across and one along z, all a little off."""
    cone = Cone([0.1, 1.2, 4.0], 30, 32, 1.5, 70.0, 105.0).vectors()
    lying = [[5.0, 8.0, -70.0]], [[-2.0, -4.0, 35.0]], [[1.5, 0.1, 0.0]], [[-0.1, 1.5, 0.2]]
    fields = (np.concatenate([getattr(cone, n), v]) for n, v in zip(FIELDS, lying, strict=True))
    random = np.random.default_rng(0)
    return Vectors(*(v + 0.02 * random.standard_normal((4, 3)) for v in fields), 30, 32)


WIDTHS, MIDDLE = np.array([4.5, 3.5, 4.0]), np.array([1.5, -2.0, 1.0])


def smooth(grid):
    """A Gaussian, whose line integrals are known."""
    z, y, x = (grid.coordinates(axis) for axis in range(3))
    places = np.stack(np.meshgrid(x, y, z, indexing="ij"), axis=-1).transpose(2, 1, 0, 3)
    return np.exp(-(((places - MIDDLE) / WIDTHS) ** 2).sum(axis=-1))


def line_integrals(scan):
    """Those of the Gaussian along the rays of a scan, (views, rows, bins)."""
    k, i = (np.arange(n) - (n - 1) / 2 for n in (scan.bins, scan.rows))
    across, down = (v[:, None, None] for v in (scan.across, scan.down))
    way = (scan.middle - scan.source)[:, None, None] + across * k[:, None] + down * i[:, None, None]
    way = way / np.linalg.norm(way, axis=-1, keepdims=True) / WIDTHS
    start = ((scan.source - MIDDLE) / WIDTHS)[:, None, None]
    square, cross = (way**2).sum(axis=-1), (start * way).sum(axis=-1)
    return np.sqrt(np.pi / square) * np.exp(cross**2 / square - (start**2).sum(axis=-1))


@pytest.mark.parametrize("field", FIELDS)
def test_gradients_are_those_of_line_integrals(device, field):
    """To what the projector smoothes a volume: 2 % of these data, 1 to 3 % of their gradients."""
    grid, scan = Grid((20, 22, 24)), across_and_along()
    i, k = np.mgrid[:30, :32]
    weights = np.cos(0.21 * k + 0.17 * i + np.arange(4)[:, None, None])
    A = Projector(grid, scan, device=device)
    found = getattr(geometry_gradient(A, smooth(grid), weights), field)
    wanted = np.zeros_like(found)
    for axis in range(3):
        shift = 1e-4 * np.eye(3)[axis]
        ends = (
            line_integrals(changed(scan, **{field: getattr(scan, field) + sign * shift}))
            for sign in (1, -1)
        )
        ahead, behind = (np.einsum("nij,nij->n", weights, y) for y in ends)
        wanted[:, axis] = (ahead - behind) / 2e-4
    assert np.linalg.norm(found - wanted) <= 0.05 * np.linalg.norm(wanted)
    # The view along z has its share of that.
    assert np.linalg.norm(found[3] - wanted[3]) <= 0.1 * np.linalg.norm(wanted[3])


def test_moving_everything_along_the_ray_of_one_pixel_changes_nothing(device):
    """A source that moves towards the only pixel with a weight stays on its ray."""
    grid, scan = Grid((20, 22, 24)), across_and_along()
    A = Projector(grid, scan, device=device)
    weights = np.zeros(A.range)
    weights[:, 14, 17] = 1
    gradient = geometry_gradient(A, smooth(grid), weights)
    pixel = scan.middle + 1.5 * scan.across - 0.5 * scan.down
    way = pixel - scan.source
    for part in (gradient.source, gradient.middle):
        along = np.abs((part * way).sum(axis=1)) / np.linalg.norm(way, axis=1)
        assert (along <= 0.04 * np.linalg.norm(part, axis=1)).all()


def test_what_has_no_vectors_is_refused():
    cone = Cone([0.0], 8, 8, 1.5, 40.0, 60.0)
    A = Projector(Grid((8, 8, 8)), cone)
    with pytest.raises(InputError, match="Vectors"):
        geometry_gradient(A, np.zeros(A.domain), np.zeros(A.range))
