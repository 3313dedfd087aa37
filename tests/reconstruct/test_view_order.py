"""Views in another order than their angles are told from any scan whose order is right."""

from __future__ import annotations

import numpy as np
import pytest

import rift_cl as rift
from rift_cl.commands.cli import main
from rift_cl.reconstruct.axis.circular import axis_of_fan
from rift_cl.reconstruct.axis.search import angle_doubt
from rift_cl.reconstruct.axis.view_order import order_doubt

BINS = 128
RANDOM = np.random.default_rng(0)


def sinogram(angles):
    scan = rift.Parallel(angles, BINS)
    views = rift.phantom.shepp_logan_sinogram(rift.Grid((BINS, BINS)), scan)
    return np.asarray(views, np.float32)


def even(count, turn=np.pi):
    return np.arange(count) * (turn / count)


def by_name(count):
    """How files 0, 1 .. count - 1 are sorted by their names."""
    return np.array(sorted(range(count), key=str))


@pytest.mark.parametrize(("count", "turn"), [(90, np.pi), (181, np.pi), (400, 2 * np.pi)])
@pytest.mark.parametrize("noise", [0, 0.3])
def test_another_order_is_doubted_and_the_right_one_is_not(count, turn, noise):
    angles = even(count, turn)
    views = sinogram(angles)
    views += (noise * views.std() * RANDOM.standard_normal(views.shape)).astype(np.float32)
    assert order_doubt(views, angles) == ""
    for order in (by_name(count), RANDOM.permutation(count)):
        assert "another order" in order_doubt(views[order], angles)
        # It is the pairs that count, and not which of them stand first.
        assert order_doubt(views[order], angles[order]) == ""
    assert "another order" in angle_doubt(views[by_name(count)], angles)


@pytest.mark.parametrize(
    "angles",
    [
        np.concatenate([even(120), even(120)]),  # twice the same
        even(400, 4 * np.pi),  # two turns
        np.mod(np.arange(200) * 2.399963, 2 * np.pi),  # by the golden angle
        np.sort(RANDOM.uniform(0, np.pi, 200)),
        np.concatenate([even(100)[:60], even(100)[85:]]),  # a gap
    ],
)
def test_other_ways_to_take_views_are_no_other_order(angles):
    assert order_doubt(sinogram(angles), angles) == ""


def test_a_few_views_that_went_wrong_are_no_other_order():
    angles = even(300)
    views = sinogram(angles)
    views[[20, 150, 151]] = views[[100, 10, 220]]
    assert order_doubt(views, angles) == ""


def test_what_looks_alike_from_all_sides_tells_nothing():
    angles, u = even(180), np.arange(BINS) - 63.5
    disc = np.sqrt(np.maximum(40.0**2 - u**2, 0))
    views = disc + RANDOM.standard_normal((180, BINS))
    assert order_doubt(views.astype(np.float32), angles) == ""


def test_fewer_views_than_tell_and_empty_ones():
    angles = even(60)
    assert order_doubt(sinogram(angles)[by_name(60)], angles) == ""
    assert order_doubt(np.zeros((200, BINS), np.float32), even(200)) == ""
    assert order_doubt(sinogram(np.zeros(200)), np.zeros(200)) == ""


def test_fans_are_doubted_too():
    fan = rift.Fan(even(200, 2 * np.pi), BINS, 1.0, 300, 500)
    A = rift.Projector(rift.Grid((64, 64)), fan)
    views = A(rift.phantom.shepp_logan(rift.Grid((64, 64))))[by_name(200)]
    try:
        said = axis_of_fan(views[:, None], np.zeros(1), 0, fan).doubt
    except rift.errors.InputError as error:
        said = str(error)
    assert "another order" in said


def test_the_command_says_so(tmp_path, capsys):
    angles = even(181)
    views = sinogram(angles)[by_name(181)]
    np.savez(tmp_path / "scan.npz", sinogram=views, theta=np.rad2deg(angles))
    for more in ([], ["--center", "63.5"]):
        given = ["reconstruct", str(tmp_path / "scan.npz"), "--out", str(tmp_path / "out")]
        main([*given, "--overwrite", *more])
        assert "angles are probably in another order" in capsys.readouterr().err
