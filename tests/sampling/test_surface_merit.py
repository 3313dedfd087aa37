"""Merits of views of an opaque surface: laws of texture and of sheen, and gradients."""

import numpy as np
import pytest
from scattered_cameras import cameras, changed
from scipy.spatial.transform import Rotation

from rift_cl.errors import InputError
from rift_cl.reference.splat_projection import spherical_harmonics
from rift_cl.sampling.criteria.appearance import variances
from rift_cl.sampling.criteria.merit import merit
from rift_cl.sampling.criteria.surface import surface_criterion, texture_coverage
from rift_cl.sampling.targets.observations import Observations
from rift_cl.sampling.targets.prior import directions_for
from rift_cl.sampling.targets.target import Target

POINTS = np.array([[0.2, 0, 0.1], [-0.1, 0.2, 0.05], [0, 0, -0.3]])
NORMALS = np.array([[1, 0, 0.5], [-0.3, 1, 0.2], [0.1, 0, -1]])


def patch(**settings):
    return Target((0, 0, 0), 1.0, normals=[[0, 0, 1.0]], mode="surface", **settings)


def looking(directions, pixel=0.0):
    observations = Observations.along(directions)
    return Observations(
        observations.direction,
        observations.weight,
        observations.pixel + pixel,
        observations.cutoff,
        observations.blur,
    )


def tilted(angle, turn=0.0):
    return [np.sin(angle) * np.cos(turn), np.sin(angle) * np.sin(turn), np.cos(angle)]


def test_a_view_from_straight_above_sees_all_and_one_from_behind_nothing():
    np.testing.assert_allclose(texture_coverage(looking([[0, 0, 2.0]]), patch()), 1)
    assert not texture_coverage(looking([[0, 0, -1.0], [1, 0, 0]]), patch()).any()
    behind, _ = surface_criterion(looking([[0, 0, -1.0]]), patch())
    assert behind == pytest.approx(2)


def test_a_tilt_costs_light_and_the_detail_along_it():
    target = patch(band=0.4 / 0.05)
    found = texture_coverage(looking([tilted(1.0)], pixel=0.05), target)[0]
    above = texture_coverage(looking([tilted(0.0)], pixel=0.05), target)[0]
    assert (found <= above * np.cos(1.0) + 1e-12).all()
    # Across the tilt nothing is squeezed: only light is lost.
    assert (found / above).max() == pytest.approx(np.cos(1.0), rel=0.01)
    assert (found / above).min() < 0.3 * np.cos(1.0)


def test_light_adds_up_and_more_views_never_make_it_worse():
    views = np.random.default_rng(0).normal((0, 0, 1), size=(9, 3))
    one, two = looking(views[:4]), looking([*views[:4], *views[:4]])
    np.testing.assert_allclose(texture_coverage(two, patch()), 2 * texture_coverage(one, patch()))
    for kind in ("wiener", "logdet", "worst"):
        values = [surface_criterion(looking(views[: n + 1]), patch(), kind)[0] for n in range(9)]
        assert (np.diff(values) <= 1e-12).all()
        assert values[-1] < values[0]


@pytest.mark.parametrize("kind", ["wiener", "logdet"])
def test_sheen_is_that_of_the_matrix_of_harmonics(kind):
    views = np.random.default_rng(1).normal((0, 0, 2), size=(7, 3))
    observations, degree = looking(views), 2
    both, _ = surface_criterion(observations, patch(snr=20.0, degree=degree), kind)
    # Of degree 0 the brightness is one number, whose error is known by itself.
    units = observations.direction[:, 0]
    light = units[:, 2]
    scale = np.sqrt(np.repeat(variances(degree), [1, 3, 5]))
    basis = spherical_harmonics(units, degree) * np.sqrt(4 * np.pi) * scale
    gram = np.eye(9) + 20 * (basis * light[:, None]).T @ basis
    plain, _ = surface_criterion(observations, patch(snr=20.0, degree=0), kind)
    if kind == "wiener":
        toward = directions_for(3, 4000)
        waves = spherical_harmonics(toward, degree) * np.sqrt(4 * np.pi) * scale
        variance = ((waves @ np.linalg.inv(gram)) * waves).sum(1)
        shown = np.maximum(toward[:, 2], 0)
        wanted = shown @ variance / shown.sum() - 1 / (1 + 20 * light.sum())
    else:
        wanted = (-np.linalg.slogdet(gram)[1] / 9 + np.log1p(20 * light.sum())) / np.log(2)
    # Evenly spread directions stand for the mean over all of them.
    assert both - plain == pytest.approx(wanted, rel=2e-3)


def test_sheen_wants_views_from_several_sides():
    close = [tilted(0.05 * n, n) for n in range(16)]
    spread = [tilted(1.2 * np.sqrt((n + 0.5) / 16), 2.4 * n) for n in range(16)]
    appearance = [surface_criterion(looking(v), patch(degree=3))[0] for v in (close, spread)]
    matt = [surface_criterion(looking(v), patch(degree=0))[0] for v in (close, spread)]
    assert appearance[1] < appearance[0]
    assert matt[1] > matt[0]


def test_turning_target_and_views_together_changes_nothing():
    views, turn = cameras(6), Rotation.random(random_state=1).as_matrix()
    target = Target((0, 0, 0), 1.0, POINTS, NORMALS, "surface")
    turned = Target((0, 0, 0), 1.0, POINTS @ turn.T, NORMALS @ turn.T, "surface")
    there = []
    for view in views:
        pose = view.view.copy()
        pose[:3, :3] = pose[:3, :3] @ turn.T
        there.append(type(view)(view.size, view.K, pose, view.model, view.aperture))
    # The frequencies of a tangent plane start anywhere in it.
    assert merit(there, turned).value == pytest.approx(merit(views, target).value, rel=0.01)


@pytest.mark.parametrize("seen_from", [None, [[1, 0.2, 0.4], [0, 1, 0.5], [0.3, -0.2, -1]]])
@pytest.mark.parametrize("kind", ["wiener", "logdet", "worst"])
def test_gradients_are_those_of_finite_differences(kind, seen_from):
    target = Target((0, 0, 0), 1.0, POINTS, NORMALS, "surface", degree=2, seen_from=seen_from)
    views, random = cameras(6), np.random.default_rng(5)
    ways = random.normal(size=(6, 3))
    found = merit(views, target, kind).gradient

    def slope(step, **way):
        ends = [
            merit(
                [
                    changed(view, **{name: sign * step * w[n] for name, w in way.items()})
                    for n, view in enumerate(views)
                ],
                target,
                kind,
            ).value
            for sign in (1, -1)
        ]
        return (ends[0] - ends[1]) / (2 * step)

    one = ways[:, 0]
    assert slope(1e-5, shift=ways) == pytest.approx((found.position * ways).sum(), rel=1e-5)
    assert slope(1e-3, focal=one) == pytest.approx(found.focal @ one, rel=1e-5)
    assert slope(1e-6, radius=one) == pytest.approx(found.radius @ one, rel=1e-5)
    assert slope(1e-4, focus=one) == pytest.approx(found.focus @ one, rel=1e-5)
    ends = [merit(views, target, kind, weights=1 + h * one).value for h in (1e-5, -1e-5)]
    assert (ends[0] - ends[1]) / 2e-5 == pytest.approx(found.weight @ one, rel=1e-5)


def test_what_a_surface_has_not_is_refused():
    target = Target((0, 0, 0), 1.0, POINTS, NORMALS, "surface")
    with pytest.raises(InputError, match=r"surface.*exact"):
        merit(cameras(2), target, "exact")
    with pytest.raises(InputError, match="degree is 33"):
        patch(degree=33)
    with pytest.raises(InputError, match="kind is 'best'"):
        surface_criterion(looking([[0, 0, 1]]), patch(), "best")
    with pytest.raises(InputError, match="no normals"):
        surface_criterion(looking([[0, 0, 1]]), Target((0, 0, 0), 1.0))
