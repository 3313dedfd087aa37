"""Observations: what cameras, scans and bare directions see of points, and what is refused."""

from __future__ import annotations

import numpy as np
import pytest
from observations_of_all_kinds import ring_of_cameras

from rift_cl.errors import InputError, ShapeError
from rift_cl.geometry import Aperture, Camera, Parallel
from rift_cl.geometry.pose import look_at
from rift_cl.sampling.targets.observations import Observations

VIEW = look_at((0, 0, -10), (0, 0, 0), (0, -1, 0))
K = [[100, 0, 20], [0, 100, 15], [0, 0, 1]]


def one(model="pinhole", aperture=None, matrix=K):
    return Camera((30, 40), matrix, VIEW, model, aperture)


def test_a_pinhole_sees_along_the_line_to_its_centre():
    points = np.array([[0, 0, 0], [0.5, -0.3, 2.0]])
    observations = Observations.of([one()], points)
    away = np.array([0, 0, -10]) - points
    np.testing.assert_allclose(
        observations.direction[0], away / np.linalg.norm(away, axis=1)[:, None]
    )
    # A pixel covers the depth over the focal length.
    np.testing.assert_allclose(observations.pixel[0], [0.1, 0.12])
    assert np.isinf(observations.cutoff).all() and not observations.blur.any()


@pytest.mark.parametrize("model", ["pinhole", "ortho", "fisheye"])
def test_a_point_beside_or_behind_the_picture_has_no_weight(model):
    matrix = [[4, 0, 20], [0, 4, 15], [0, 0, 1]] if model == "ortho" else K
    points = [[0, 0, 0], [0, 100, 0], [100, 0, 0], [0, 0, -30]]
    observations = Observations.of([one(model, matrix=matrix)], points)
    # Parallel rays have no behind.
    assert observations.weight[0].tolist() == [1, 0, 0, model == "ortho"]


@pytest.mark.parametrize("focal", [(400, 200), (200, 400)])
def test_of_pixels_that_are_no_squares_the_longer_edge_counts(focal):
    K = [[focal[0], 0, 50], [0, focal[1], 50], [0, 0, 1]]
    camera = Camera((100, 100), K, look_at((0, -5, 0), (0, 0, 0), (0, 0, 1)))
    found = Observations.of([camera], np.zeros((1, 3)))
    assert found.pixel[0, 0] == pytest.approx(5 / 200)


def test_a_parallel_beam_sees_all_points_alike():
    observations = Observations.of(
        [one("ortho", matrix=[[4, 0, 20], [0, 4, 15], [0, 0, 1]])], [[0, 0, 0], [3, 1, 2]]
    )
    np.testing.assert_allclose(observations.direction[0], [[0, 0, -1], [0, 0, -1]], atol=1e-12)
    np.testing.assert_allclose(observations.pixel, 0.25)


def test_a_fisheye_has_pixels_of_equal_angles():
    observations = Observations.of([one("fisheye")], [[0, 0, 0], [1.0, 0, 0]])
    np.testing.assert_allclose(observations.pixel[0], np.hypot([0, 1], 10) / 100)
    assert observations.weight.tolist() == [[1, 1]]


def test_an_aperture_blurs_away_from_its_focus():
    observations = Observations.of(
        [one(aperture=Aperture(0.2, 10.0, 0.001))], [[0, 0, 0], [0, 0, 5]]
    )
    np.testing.assert_allclose(observations.blur[0], [0, 0.2], atol=1e-12)
    np.testing.assert_allclose(observations.cutoff[0], [40, 0.4 / 0.015])


def test_weights_multiply_what_is_seen():
    observations = Observations.of([one(), one()], [[0, 0, 0], [0, 100, 0]], weights=[2, 3])
    assert observations.weight.tolist() == [[2, 0], [3, 0]]
    assert observations.weighted([0.5, 2]).weight.tolist() == [[1, 0], [6, 0]]
    assert observations.weighted(None) is observations
    assert (observations.views, observations.points) == (2, 2)


def test_a_scan_looks_across_its_detector():
    scan = Parallel([0.0, 0.5], bins=11, pitch=0.2)
    observations = Observations.of_scan(scan, [[0, 0, 0], [1.05, 0, 0], [1.2, 0, 7]])
    np.testing.assert_allclose(
        observations.direction[:, 0], [[0, 1, 0], [-np.sin(0.5), np.cos(0.5), 0]]
    )
    assert observations.weight.tolist() == [[1, 1, 0], [1, 1, 1]]
    assert observations.pixel.max() == 0.2
    assert Observations.of_scan(scan, row_pitch=0.7).pixel.max() == 0.7
    with pytest.raises(InputError, match="row_pitch"):
        Observations.of_scan(scan, row_pitch=0)


def test_a_target_that_nobody_sees_is_named():
    observations = Observations.of(ring_of_cameras(3), [[0, 0, 0], [0, 0, 500]])
    observations.check_seen(0)
    with pytest.raises(InputError, match=r"point 1.*outside"):
        observations.check_seen()


@pytest.mark.parametrize(
    ("make", "wanted"),
    [
        (lambda: Observations.of([], [[0, 0, 0]]), "cameras is empty"),
        (lambda: Observations.of(one(), [[0, 0, 0]]), "cameras in a sequence, this is a Camera"),
        (lambda: Observations.of([one(), 2], [[0, 0, 0]]), "cameras in a sequence, this is a list"),
        (lambda: Observations.of((c for c in [one()]), [[0, 0, 0]]), "this is a generator"),
        (lambda: Observations.of([one()], np.empty((0, 3))), "points has shape"),
        (lambda: Observations.of([one()], [[0, np.nan, 0]]), "NaN"),
        (lambda: Observations.of([one()], "here"), "real numbers"),
        (lambda: Observations.of([one()], [[0, 0, -10]]), "stands at a point"),
        (lambda: Observations.of([one()], [[0, 0, 0]], weights=[1, 2]), "weights has shape"),
        (lambda: Observations.of([one()], [[0, 0, 0]], weights=[-1]), "wanted 0 or more"),
        (lambda: Observations.along([[0, 0, 0]]), "is zero"),
        (lambda: Observations.along([0, 0, 1]), "directions has shape"),
        (lambda: Observations.along([[0, np.inf, 1]]), "NaN"),
    ],
)
def test_bad_arguments_are_refused(make, wanted):
    with pytest.raises(InputError, match=wanted):
        make()


@pytest.mark.parametrize(
    ("name", "value"),
    [("direction", 2.0), ("weight", -1.0), ("weight", np.inf), ("cutoff", 0.0), ("blur", np.nan)],
)
def test_numbers_out_of_their_range_are_refused(name, value):
    observations = Observations.along([[0, 0, 1.0]])
    given = {key: getattr(observations, key).copy() for key in vars(observations)}
    given[name][...] = value
    with pytest.raises(InputError, match=name):
        Observations(**given)
    with pytest.raises(InputError, match=f"{name} is .*much"):
        Observations(**{**vars(observations), name: [["much"]]})
    with pytest.raises(ShapeError, match="wanted"):
        Observations(**{**vars(observations), name: getattr(observations, name)[..., None]})
