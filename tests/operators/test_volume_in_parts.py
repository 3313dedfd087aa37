"""Volumes and projections of cones, fans and vectors that are larger than a device's memory."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from limited_devices import assert_same, limited, normal

from rift_cl import Cone, Fan, Grid, Projector, Vectors, backproject, fbp
from rift_cl.errors import ResourceLimitError
from rift_cl.geometry.leaning import leaning
from rift_cl.reconstruct import FDK
from rift_cl.reconstruct.direct.filtered_backprojection import unfiltered_backprojection

pytestmark = pytest.mark.variants

# Off the middle, no whole number of lanes, and looked at along both axes.
GRID = Grid((22, 18, 20), (1.3, 0.8, 1.1), (1, 2, -1))
ANGLES = np.arange(40) * 2 * np.pi / 40
CONE = Cone(ANGLES, 16, 24, (1.8, 2.0), 60, 90, center=(7.2, 11.1))
HELIX = Cone(ANGLES, 16, 24, (1.8, 2.0), 60, 90, heights=np.linspace(-3, 3, 40))
FAN = Fan(ANGLES, 24, 2.0, 60, 90, center=11.1)
LEANING = leaning(CONE.subset(np.arange(0, 40, 5)), 0.05)
# Seen from beside and from below.
ANYWHERE = Vectors(
    [[0.0, -60, 0], [60, 3, 1], [2, 1, -60], [-3, 0, -60]],
    [[0.0, 30, 0], [-30, 0, 0], [0, 0, 30], [2, 0, 30]],
    [[2.0, 0, 0.1], [0, 2, 0], [2, 0, 0], [2, 0.1, 0]],
    [[0, 0, 2.0], [0, 0.1, 2], [0, 2, 0], [0, 2, 0]],
    30,
    32,
)


def parts(A: Any, budget: int | None = None) -> tuple[int, int]:
    """Runs of views of a projection, and of slices of a backprojection."""
    budget = budget or A.device.budget
    forward, back = A._chunks(budget), A._adjoint_chunks(budget)
    return len({str(c.outside) for c in forward}), len({str(c.outside) for c in back})


def both(A: Any) -> list[np.ndarray[Any, Any]]:
    return [A(normal(*A.domain)), A.T(normal(*A.range))]


def memory_of(A: Any, slices: int, views: int) -> int:
    """Bytes that some slices of all views, and all slices of some views, can be worked on in."""
    (nz, *_), (n, *_) = A.domain, A.range
    return max(A._need(slices, n, sparing=True)[0], A._need(nz, views, sparing=True)[0])


@pytest.mark.parametrize(
    ("scan", "dtype", "footprint"),
    [
        (CONE, "float32", "strip"),
        (FAN, "float32", "strip"),
        (LEANING, "float32", "strip"),
        pytest.param(HELIX, "float64", "linear", marks=pytest.mark.full),
        pytest.param(CONE, "float32", "point", marks=pytest.mark.full),
    ],
    ids=["cone", "fan", "vectors", "helix", "points"],
)
def test_runs_of_views_and_slabs_of_slices_have_the_same_bits(device, scan, dtype, footprint):
    whole = Projector(GRID, scan, footprint, device=device, dtype=dtype)
    small = limited(device, memory_of(whole, 8, scan.views // 2))
    A = Projector(GRID, scan, footprint, device=small, dtype=dtype)
    assert min(parts(A)) >= 2
    assert_same(both(A), both(whole))


@pytest.mark.full
def test_what_is_cut_both_ways_is_added_up_to_rounding(device):
    """Neither the padded volume nor the projections are as small as the largest array."""
    small = limited(device, allocation=40_000)
    A, whole = (Projector(GRID, CONE, device=each) for each in (small, device))
    assert len({str(chunk.inside) for chunk in A._chunks(A.device.budget)}) >= 2
    assert min(parts(A)) >= 2
    for one, other in zip(both(A), both(whole), strict=True):
        assert np.abs(one - other).max() <= 1e-6 * np.abs(other).max()


@pytest.mark.full
def test_views_along_z_are_taken_in_runs_of_all_slices(device):
    """Whose walk goes from slice to slice: a backprojection of such is cut into views, too."""
    whole = Projector(GRID, ANYWHERE, device=device)
    A = Projector(GRID, ANYWHERE, device=limited(device, whole._need(22, 2, sparing=True)[0]))
    assert parts(A)[0] >= 2
    (seen, volume), (seen_whole, volume_whole) = both(A), both(whole)
    assert_same([seen], [seen_whole])
    assert np.abs(volume - volume_whole).max() <= 1e-6 * np.abs(volume_whole).max()


def test_not_even_a_part_fits(device):
    A = Projector(GRID, CONE, device=limited(device, 20_000))
    for operator in (A, A.T, FDK(A)):
        with pytest.raises(ResourceLimitError, match=r"needs .* 19.5 KiB"):
            operator(normal(*operator.domain))


@pytest.mark.full
@pytest.mark.parametrize("scan", [CONE, FAN, LEANING], ids=["cone", "fan", "leaning"])
def test_fdk_filters_runs_of_views_and_backprojects_slabs(device, scan):
    whole = FDK(Projector(GRID, scan, device=device))
    A = Projector(GRID, scan, device=limited(device, memory_of(whole._A, 8, 1)))
    small, y = FDK(A), normal(*A.range)
    assert parts(small._A)[1] >= 2
    assert_same([fbp(A, y)], [whole(y)])
    volume = normal(*A.domain)
    assert_same([small.T(volume)], [whole.T(volume)])
    few = small._weighting.records + 60_000
    assert len(list(small._weighting._chunks(few))) >= 2


@pytest.mark.full
def test_sums_products_and_multiples_are_taken_step_by_step(device):
    """Where the device holds no two results at a time."""

    def combined(A: Any) -> Any:
        return 0.5 * (A + 2.0 * A) @ (A.T @ A)

    whole = Projector(GRID, CONE, device=device)
    small = limited(device, memory_of(whole, 8, CONE.views // 2))
    A = Projector(GRID, CONE, device=small)
    assert min(parts(A)) >= 2
    assert_same(both(combined(A)), both(combined(whole)))


def test_a_backprojection_without_a_filter_is_made_in_slabs(device):
    A = Projector(GRID, CONE, device=device)
    y, small = normal(*A.range), A._need(8, CONE.views, sparing=True)[0]
    whole = backproject(A, y)
    slabs = list(unfiltered_backprojection(A).slabs(y, small))
    assert len(slabs) >= 2
    assert_same([np.concatenate(slabs)], [whole])
    assert_same([backproject(Projector(GRID, CONE, device=limited(device, small)), y)], [whole])


def test_vectors_on_no_circle_are_backprojected_as_a_cone_is(device):
    near = leaning(CONE, 1e-9)
    y = normal(CONE.views, CONE.rows, CONE.bins)
    found, wanted = (backproject(Projector(GRID, scan, device=device), y) for scan in (near, CONE))
    assert np.abs(found - wanted).max() <= 1e-3 * np.abs(wanted).max()
    assert np.isfinite(
        backproject(Projector(GRID, ANYWHERE, device=device), normal(4, 30, 32))
    ).all()
