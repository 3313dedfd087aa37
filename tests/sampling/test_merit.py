"""The merits of views: laws they obey, and gradients they have."""

import numpy as np
import pytest
from scattered_cameras import cameras, changed
from scipy.spatial.transform import Rotation
from scipy.stats import spearmanr

from rift_cl.geometry import Camera, Parallel
from rift_cl.geometry.pose import look_at
from rift_cl.sampling.coverage.host import host_coverage
from rift_cl.sampling.criteria import merit as merit_file
from rift_cl.sampling.criteria.exact import exact
from rift_cl.sampling.criteria.kriging import kriging
from rift_cl.sampling.criteria.merit import criterion_of_coverage, merit
from rift_cl.sampling.targets.observations import Observations
from rift_cl.sampling.targets.prior import PowerLaw, directions_for
from rift_cl.sampling.targets.target import Target, half_ball

KINDS = ("wiener", "logdet", "worst")
POINTS = ((0.1, 0, 0), (-0.1, 0.2, 0.05))


def scored(kind, directions, target):
    observations = Observations.along(directions)
    return criterion_of_coverage(
        kind, host_coverage(observations, target.k, target.diameter), target
    ).value


def scattered(count, seed):
    return np.random.default_rng(seed).normal(size=(count, 3))


@pytest.fixture(scope="module")
def target():
    return Target((0, 0, 0), 1.0, snr=300.0, frequencies=half_ball(16.0, 800))


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("seed", range(3))
def test_one_more_view_never_makes_it_worse(kind, seed, target):
    views = scattered(12, seed)
    values = [scored(kind, views[:count], target) for count in range(1, 13)]
    assert (np.diff(values) < 0).all()


@pytest.mark.parametrize("seed", range(5))
def test_bits_that_a_view_brings_shrink_as_others_are_there(seed, target):
    views = scattered(9, seed)
    few, many = views[1:4], views[1:]
    gain = [
        scored("logdet", some, target) - scored("logdet", [views[0], *some], target)
        for some in (few, many)
    ]
    assert gain[0] >= gain[1] > 0


@pytest.mark.parametrize(
    ("count", "reach", "stated", "wanted"),
    [(6, 150, 0.199, 0.291), (12, 165, 0.071, 0.135), (12, 100, 0.201, 0.172)],
)
def test_what_a_share_states_is_no_bound_on_the_exact_one(count, reach, stated, wanted):
    """Figures that ``docs/explanation/sampling.md`` states: the last over a sector, not even."""
    flat = Target.flat(24.0, band=0.5, snr=1e4, prior=PowerLaw(2.0))
    turns = np.radians(np.linspace(0, reach, count))
    eyes = 200 * np.column_stack([np.cos(turns), np.sin(turns), 0 * turns])
    K = [[2000.0, 0, 200], [0, 2000, 200], [0, 0, 1]]
    views = [Camera((400, 400), K, look_at(eye, (0, 0, 0), (0, 0, 1))) for eye in eyes]
    assert merit(views, flat).value == pytest.approx(stated, abs=1e-3)
    assert merit(views, flat, "exact").value == pytest.approx(wanted, abs=1e-3)


@pytest.mark.parametrize("kind", ["wiener", "worst"])
def test_a_share_is_between_none_and_all(kind, target):
    nothing = np.zeros((2, len(target.k)))
    assert criterion_of_coverage(kind, nothing, target).value == pytest.approx(1)
    assert criterion_of_coverage(kind, nothing + 1e9, target).value == pytest.approx(0, abs=1e-8)
    assert 0 < scored(kind, scattered(8, 0), target) < 1
    assert criterion_of_coverage("logdet", nothing, target).value == 0


def test_many_views_all_round_know_nearly_everything(target):
    few, many = (scored("wiener", directions_for(3, count), target) for count in (20, 5000))
    assert many < 0.02
    assert few > 0.3


def test_turning_everything_changes_nothing(target):
    views, turn = scattered(10, 1), Rotation.random(random_state=3).as_matrix()
    turned = Target((0, 0, 0), 1.0, snr=300.0, frequencies=target.k @ turn.T)
    for kind in ("wiener", "logdet"):
        assert scored(kind, views @ turn.T, turned) == pytest.approx(scored(kind, views, target))


def test_turning_the_views_alone_changes_little_where_the_prior_has_no_direction():
    views, target = directions_for(3, 40), Target((0, 0, 0), 1.0, snr=300.0)
    values = [
        scored("wiener", views @ Rotation.random(random_state=seed).as_matrix().T, target)
        for seed in range(8)
    ]
    assert np.std(values) < 0.02 * np.mean(values)


@pytest.mark.parametrize("kind", KINDS)
def test_the_unit_of_length_does_not_matter(kind):
    small, large = (
        merit(
            cameras(6, unit=unit),
            Target(np.zeros(3), unit, unit * np.array(POINTS), snr=300.0),
            kind,
        )
        for unit in (1.0, 1000.0)
    )
    assert large.value == pytest.approx(small.value)
    np.testing.assert_allclose(large.gradient.position * 1000, small.gradient.position, rtol=1e-6)
    np.testing.assert_allclose(large.gradient.radius * 1000, small.gradient.radius, rtol=1e-6)


def test_twice_the_light_is_twice_the_signal_to_noise(target):
    views = cameras(6)
    brighter = Target((0, 0, 0), 1.0, snr=600.0, frequencies=target.k)
    twice = merit(views, target, weights=np.full(6, 2.0)).value
    assert twice == pytest.approx(merit(views, brighter).value)
    # A view of twice the light is two views.
    assert twice == pytest.approx(merit([*views, *views], target).value)


def test_the_worst_direction_asks_for_the_missing_cone(target):
    ring = np.stack([np.cos(a := np.arange(24) * np.pi / 24), np.sin(a), 0.6 + 0 * a], 1)
    ring = np.concatenate([ring, -ring * [1, 1, -1]])
    inside, along = [1, 0, 0.0], [1, 0.02, 0.6]
    for kind in KINDS:
        assert scored(kind, [*ring, inside], target) < scored(kind, [*ring, along], target)
    # Directions near the axis are seen by none of the ring, and weigh more there than on the whole.
    assert scored("worst", ring, target) > 1.3 * scored("wiener", ring, target)


@pytest.mark.full
@pytest.mark.parametrize("flat", [True, False])
def test_it_ranks_as_the_exact_error_does(flat):
    samples = 12 if flat else 8
    # The exact one's band is that of its samples.
    same = {"snr": 300.0, "band": samples / 2}
    target = Target.flat(1.0, **same) if flat else Target((0, 0, 0), 1.0, **same)
    found = []
    for seed in range(12):
        random = np.random.default_rng(seed)
        # From a narrow fan to all round.
        spread = random.uniform(0.2, 1)
        if flat:
            angles = np.pi * spread * random.uniform(size=10)
            observations = Observations.of_scan(Parallel(angles, 64, 1 / 64))
        else:
            observations = Observations.along(random.normal(size=(10, 3)) * [1, spread, spread**2])
        known = host_coverage(observations, target.k, 1.0)
        found.append(
            (
                criterion_of_coverage("wiener", known, target).value,
                kriging(observations, target),
                exact(observations, target, samples),
            )
        )
    diagonal, correlated, whole = np.array(found).T
    assert spearmanr(diagonal, whole).statistic > 0.9
    assert spearmanr(correlated, whole).statistic > 0.9


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("model", ["pinhole", "fisheye", "ortho"])
def test_gradients_are_those_of_finite_differences(kind, model):
    target = Target((0, 0, 0), 1.0, POINTS, snr=300.0, frequencies=half_ball(16.0, 400))
    views, random = cameras(5, model=model), np.random.default_rng(5)
    weights, ways = random.uniform(0.5, 1.5, 5), random.normal(size=(5, 3))
    found = merit(views, target, kind, weights=weights).gradient

    def slope(step, **way):
        ends = [
            merit(
                [
                    changed(view, **{name: sign * step * w[n] for name, w in way.items()})
                    for n, view in enumerate(views)
                ],
                target,
                kind,
                weights=weights,
            ).value
            for sign in (1, -1)
        ]
        return (ends[0] - ends[1]) / (2 * step)

    if model == "ortho":
        assert not found.position.any()
    else:
        assert slope(1e-5, shift=ways) == pytest.approx((found.position * ways).sum(), rel=1e-5)
    one = ways[:, 0]
    assert slope(1e-3, focal=one) == pytest.approx(found.focal @ one, rel=1e-5)
    ends = [merit(views, target, kind, weights=weights + h * one).value for h in (1e-5, -1e-5)]
    assert (ends[0] - ends[1]) / 2e-5 == pytest.approx(found.weight @ one, rel=1e-5)
    if model == "pinhole":
        assert slope(1e-6, radius=one) == pytest.approx(found.radius @ one, rel=1e-5)
        assert slope(1e-4, focus=one) == pytest.approx(found.focus @ one, rel=1e-5)
        # Focus at infinity cannot be moved by a length.
        assert found.focus[1] == 0
    else:
        assert not found.radius.any()
        assert not found.focus.any()


@pytest.mark.parametrize("kind", KINDS)
def test_devices_agree_with_the_host(kind, device, monkeypatch):
    target = Target((0, 0, 0), 1.0, POINTS, snr=300.0)
    views, weights = cameras(6), np.linspace(0.5, 1.5, 6)
    host = merit(views, target, kind, weights=weights)
    monkeypatch.setattr(merit_file, "_LARGE", 0)
    found = merit(views, target, kind, weights=weights, device=device)
    assert found.value == pytest.approx(host.value, rel=1e-4)
    for there, here in zip(found.gradient, host.gradient, strict=True):
        np.testing.assert_allclose(there, here, atol=1e-3 * np.abs(here).max())


def test_a_target_that_no_camera_sees_is_all_unknown():
    target = Target((50, 0, 0), 1.0)
    found = merit(cameras(4), target)
    assert found.value == 1
    assert not found.gradient.position.any()
    assert merit(cameras(4), target, "kriging").value == pytest.approx(1)
    assert merit(cameras(4), target, "exact").value == pytest.approx(1)


@pytest.mark.parametrize("model", ["pinhole", "fisheye"])
def test_points_beside_and_behind_a_camera_change_nothing(model):
    K = [[64, 0, 32], [0, 64, 32], [0, 0, 1]]
    camera = Camera((64, 64), K, look_at((0, 0, -10), (0, 0, 0), (0, -1, 0)), model)
    front = merit([camera], Target((0, 0, 0), 1.0)).gradient
    beside = [[0, 0, 0], [1, 0, -10], [0, 100, -20], [0, 0, -30]]
    found = merit([camera], Target((0, 0, 0), 1.0, points=beside)).gradient
    np.testing.assert_allclose(4 * found.position, front.position, rtol=1e-9)
    np.testing.assert_allclose(4 * found.focal, front.focal, rtol=1e-9)


def test_what_correlated_views_tell_twice_is_counted_once(target):
    observations = Observations.along(np.repeat([[1.0, 0, 0]], 8, axis=0))
    one = Observations.along([[1.0, 0, 0]])
    # Eight times the same view is one with eight times the light.
    brighter = Target((0, 0, 0), 1.0, snr=8 * target.snr, frequencies=target.k)
    assert kriging(observations, target) == pytest.approx(kriging(one, brighter), rel=1e-6)
    assert exact(observations, target, 6) == pytest.approx(exact(one, brighter, 6), rel=1e-6)


def test_the_score_of_one_camera_is_the_same_from_all_sides():
    """Of a round target: the axes of the world are no part of the problem."""
    target = Target((0, 0, 0), 60.0)
    towards = np.random.default_rng(3).normal(size=(12, 3))
    places = 300 * towards / np.linalg.norm(towards, axis=1, keepdims=True)
    lens = [[1000.0, 0, 128], [0, 1000.0, 128], [0, 0, 1]]
    cameras = [Camera((256, 256), lens, look_at(at, [0, 0, 0], [0.3, 1, 0.2])) for at in places]
    values = [merit([camera], target).value for camera in cameras]
    assert np.ptp(values) < 0.015
    assert abs(np.mean(values) - 0.8558) < 0.004
