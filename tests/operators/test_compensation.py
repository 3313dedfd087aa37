"""What views stand for, frequency by frequency: laws for every kind, and known sets."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from rift_cl import Parallel, Ramp
from rift_cl.errors import InputError
from rift_cl.operators import ViewFilter
from rift_cl.operators.filters.compensation import COMPENSATIONS, LEVEL, Compensation, _Neighbours
from rift_cl.operators.filters.directions import Directions
from rift_cl.reference import filter_rows, response_taps

pytestmark = pytest.mark.dealt

KINDS = tuple(COMPENSATIONS)
BINS, PITCH = 96, 1.0
DIAMETER = 96.0
K = np.linspace(0, 0.5, 129)
RANDOM = np.random.default_rng(8)
ANGLES = st.lists(st.floats(-20, 20), min_size=1, max_size=20).map(np.array)
EVEN = np.linspace(0, np.pi, 24, endpoint=False)
SETS = {
    "even": EVEN,
    "jittered": EVEN + RANDOM.uniform(-0.5, 0.5, 24) * np.pi / 24,
    "random": RANDOM.uniform(0, np.pi, 24),
    "golden": np.arange(24) * np.pi * (np.sqrt(5) - 1) / 2,
    "wedge": np.linspace(0, 2 * np.pi / 3, 24),
    "clustered": np.concatenate([RANDOM.normal(1.0, 0.1, 16), RANDOM.uniform(0, np.pi, 8)]),
    "one view": np.array([0.4]),
    "the same view": np.full(9, 0.4),
    "two": np.array([0.4, 0.5]),
    "a right angle": np.array([0.0, np.pi / 2]),
}

every_kind = pytest.mark.parametrize("kind", KINDS)
every_set = pytest.mark.parametrize("angles", SETS.values(), ids=SETS)


def shares(angles, kind, diameter=DIAMETER, frequencies=K):
    return Compensation(angles, kind, diameter)(frequencies)


@every_kind
@every_set
def test_shares_are_positive_and_no_more_than_the_half_circle(angles, kind):
    found = shares(angles, kind)
    assert found.shape == (len(angles), len(K))
    assert (found > 0).all()
    assert (found.sum(0) <= np.pi + 1e-9).all()


@every_kind
@every_set
def test_low_frequencies_are_known_whole(angles, kind):
    """Up to 1 / D over the widest gap: the levels of a reconstruction hang on these."""
    gap = Directions.of(angles).gaps.max()
    low = K * DIAMETER * gap <= 1
    np.testing.assert_allclose(shares(angles, kind)[:, low].sum(0), np.pi)
    assert shares(angles, kind)[:, 0].sum() == pytest.approx(np.pi, abs=1e-9)


@every_kind
@given(ANGLES)
@settings(deadline=None, max_examples=50)
def test_any_angles_have_shares(kind, angles):
    found = shares(angles, kind, frequencies=K[::16])
    assert np.isfinite(found).all()
    assert (found >= 0).all()
    assert found[:, 0].sum() == pytest.approx(np.pi)


@every_kind
@pytest.mark.parametrize("count", [1, 2, 3, 24, 97])
@pytest.mark.parametrize("diameter", [1e-3, 10.0, 96.0, 1e5])
def test_even_angles_get_the_plain_ramp_at_every_frequency(kind, count, diameter):
    even = 0.3 + np.arange(count) * np.pi / count
    np.testing.assert_allclose(shares(even, kind, diameter), np.pi / count, rtol=1e-7)
    full = 0.3 + np.arange(2 * count) * np.pi / count
    np.testing.assert_allclose(shares(full, kind, diameter), np.pi / count / 2, rtol=1e-7)


@every_kind
@every_set
def test_turning_all_views_changes_nothing(angles, kind):
    turned = shares(angles + 1.234, kind)
    np.testing.assert_allclose(turned, shares(angles, kind), rtol=1e-6, atol=1e-9)


@every_kind
@every_set
def test_the_order_and_the_sense_of_views_change_nothing(angles, kind):
    order = np.random.default_rng(1).permutation(len(angles))
    signs = np.random.default_rng(2).integers(-3, 4, len(angles))
    other = shares(angles[order] + np.pi * signs, kind)
    np.testing.assert_allclose(other, shares(angles, kind)[order], rtol=1e-6, atol=1e-9)


@every_kind
def test_repeated_and_opposite_views_share_alike(kind):
    angles = SETS["random"]
    doubled = np.concatenate([angles, angles + np.pi, angles[:3]])
    found, single = shares(doubled, kind), shares(angles, kind)
    copies = np.full(24, 2)
    copies[:3] = 3
    expected = single / copies[:, None]
    np.testing.assert_allclose(found[:24], expected, rtol=1e-6, atol=1e-12)
    np.testing.assert_allclose(found[24:48], expected, rtol=1e-6, atol=1e-12)


@every_kind
def test_the_unit_of_length_is_free(kind):
    angles = SETS["random"]
    other = Compensation(angles, kind, DIAMETER * 7.3)(K / 7.3)
    np.testing.assert_allclose(other, shares(angles, kind), rtol=1e-9)


@every_kind
def test_a_point_knows_every_direction(kind):
    """An object of no size: nothing is capped, and the whole half-circle known."""
    found = shares(SETS["wedge"], kind, 1e-6)
    np.testing.assert_allclose(found.sum(0), np.pi)


def test_capped_shares_are_half_gaps_and_then_strips():
    angles = np.array([0.0, 0.2, 0.5, 2.0])
    gaps = np.array([0.2, 0.3, 1.5, np.pi - 2])
    for k in (0.001, 0.01, 0.02, 0.1, 0.5):
        cap = max(1 / (DIAMETER * k), np.pi / 4)
        expected = [(min(gaps[j], cap) + min(gaps[j - 1], cap)) / 2 for j in range(4)]
        found = shares(angles, "capped-voronoi", frequencies=np.array([k]))
        np.testing.assert_allclose(found[:, 0], expected)


@pytest.mark.parametrize("steepness", [0, 0.3, 1, 1 + 1e-9, 3, 50, 1e4])
@every_set
def test_running_sums_are_the_overlap(angles, steepness):
    directions = Directions.of(angles)
    neighbours = _Neighbours(directions)
    neighbours.within(steepness)
    weights = RANDOM.random(len(directions))
    sines = np.abs(np.sin(directions.angles[:, None] - directions.angles))
    expected = np.maximum(0, 1 - steepness * sines) @ weights
    np.testing.assert_allclose(neighbours.overlap(weights), expected, atol=1e-10)


def test_the_exact_filter_divides_by_the_overlap():
    angles, k = SETS["random"], 0.07
    sines = np.abs(np.sin(angles[:, None] - angles))
    overlap = np.maximum(0, 1 - DIAMETER * k * sines).sum(1)
    found = shares(angles, "exact", frequencies=np.array([k]))[:, 0]
    np.testing.assert_allclose(found * overlap, (found * overlap)[0], rtol=1e-3)


@pytest.mark.parametrize("name", ["jittered", "golden", "random"])
def test_pipe_and_menon_level_the_overlap(name):
    angles = SETS[name]
    sines = np.abs(np.sin(angles[:, None] - angles))
    for k in (0.01, 0.03, 0.1, 0.3):
        T = np.maximum(0, 1 - DIAMETER * k * sines)
        uneven = []
        for kind in ("exact", "pipe-menon"):
            covered = T @ shares(angles, kind, frequencies=np.array([k]))[:, 0]
            uneven.append(np.ptp(covered) / covered.mean())
        assert uneven[1] <= max(2.5 * LEVEL, 0.5 * uneven[0])


@every_kind
def test_clusters_weigh_no_more_than_what_they_know(kind):
    """A hundred views within a strip together count as about one beside it."""
    cluster = np.concatenate([np.linspace(1.0, 1.0005, 100), [0.2, 1.9, 2.6]])
    found = shares(cluster, kind, frequencies=np.array([0.2]))[:, 0]
    assert 0.3 < found[:100].sum() / found[100:].mean() < 3


@every_kind
@every_set
def test_filters_have_the_response(device, angles, kind):
    """Against quadrature: |k| times the share, cut off at the detector's Nyquist."""
    scan = Parallel(angles, BINS, PITCH)
    compensation = Compensation(angles, kind, DIAMETER)
    F = ViewFilter(scan, Ramp(), gains=compensation, device=device)
    y = RANDOM.standard_normal(F.domain)
    view = len(angles) // 2

    def response(f):
        return f * compensation(f)[view]

    taps = response_taps(response, BINS, PITCH)
    exact = filter_rows(y[view : view + 1], taps, PITCH)[0]
    error = np.linalg.norm(F(y)[view] - exact) / np.linalg.norm(exact)
    assert error < 2e-3


@every_kind
def test_ten_thousand_views_are_no_trouble(kind):
    angles = np.random.default_rng(3).uniform(0, np.pi, 10_000)
    found = shares(angles, kind, frequencies=K[::32])
    assert found.sum(0) == pytest.approx(np.pi)


@every_kind
def test_many_views_give_the_density(kind):
    """Random views, up to nine times denser here than there: together the ramp everywhere."""
    u = np.random.default_rng(4).uniform(0, np.pi, 4000)
    angles = u + 0.4 * np.sin(2 * u)
    found = shares(angles, kind, frequencies=np.array([0.1]))[:, 0]
    sectors = np.histogram(angles, 6, (0, np.pi), weights=found)[0]
    np.testing.assert_allclose(sectors, np.pi / 6, rtol=0.1)
    plain = np.histogram(angles, 6, (0, np.pi))[0] * np.pi / 4000
    assert np.ptp(plain) > 5 * np.ptp(sectors)


@pytest.mark.parametrize("kind", ["", "voronoi", "Exact", None, 3])
def test_unknown_kinds_are_refused(kind):
    with pytest.raises(InputError, match=r"compensate.*'pipe-menon', 'exact'"):
        Compensation(EVEN, kind, 1.0)


@pytest.mark.parametrize("diameter", [0, -1, np.nan, np.inf, "a", None, [1, 2]])
def test_diameters_that_are_no_length_are_refused(diameter):
    with pytest.raises(InputError, match="diameter"):
        Compensation(EVEN, "exact", diameter)


@pytest.mark.parametrize("angles", [[], [[1.0]], [np.nan], [0.0, np.inf], ["a"], [1j], 3.0])
def test_angles_that_are_no_directions_are_refused(angles):
    with pytest.raises(InputError, match="angles"):
        Compensation(angles, "exact", 1.0)
