"""Views in another order than their angles are told from any scan whose order is right."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.ndimage import gaussian_filter1d

import rift_cl as rift
from rift_cl.commands.cli import main
from rift_cl.reconstruct.axis.circular import axis_of_fan
from rift_cl.reconstruct.axis.moments import mass_doubt
from rift_cl.reconstruct.axis.search import angle_doubt
from rift_cl.reconstruct.axis.view_order import jump_doubt, order_doubt

BINS = 128


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
    views += (noise * views.std() * np.random.default_rng(1).standard_normal(views.shape)).astype(
        np.float32
    )
    assert order_doubt(views, angles) == ""
    for order in (by_name(count), np.random.default_rng(1).permutation(count)):
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
        np.sort(np.random.default_rng(1).uniform(0, np.pi, 200)),
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


@pytest.mark.parametrize("bins", [96, 128, 300])
@pytest.mark.parametrize("blur", [0, 1, 2])
@pytest.mark.parametrize("noise", [0.1, 1, 100])
def test_noise_on_what_looks_alike_from_all_sides_tells_nothing(bins, blur, noise):
    """Among many views of noise some match by chance; a detector's light spreads over bins."""
    angles, u = even(180), np.arange(bins) - (bins - 1) / 2
    disc = np.sqrt(np.maximum((0.3 * bins) ** 2 - u**2, 0))
    white = np.random.default_rng(1).standard_normal((180, bins))
    views = disc + noise * (gaussian_filter1d(white, blur, axis=1) if blur else white)
    assert order_doubt(views.astype(np.float32), angles) == ""


def test_fewer_views_than_tell_and_empty_ones():
    angles = even(60)
    assert order_doubt(sinogram(angles)[by_name(60)], angles) == ""
    assert order_doubt(np.zeros((200, BINS), np.float32), even(200)) == ""
    assert order_doubt(sinogram(np.zeros(200)), np.zeros(200)) == ""


@pytest.mark.full
def test_fans_are_doubted_too():
    fan = rift.Fan(even(200, 2 * np.pi), BINS, 1.0, 300, 500)
    A = rift.Projector(rift.Grid((64, 64)), fan)
    views = A(rift.phantom.shepp_logan(rift.Grid((64, 64))))[by_name(200)]
    try:
        said = axis_of_fan(views[:, None], np.zeros(1), 0, fan).doubt
    except rift.errors.InputError as error:
        said = str(error)
    assert "another order" in said


@pytest.mark.full
def test_the_command_says_so(tmp_path, capsys):
    angles = even(181)
    views = sinogram(angles)[by_name(181)]
    np.savez(tmp_path / "scan.npz", sinogram=views, theta=np.rad2deg(angles))
    for more in ([], ["--center", "63.5"]):
        given = ["reconstruct", str(tmp_path / "scan.npz"), "--out", str(tmp_path / "out")]
        main([*given, "--overwrite", *more])
        assert "angles are probably in another order" in capsys.readouterr().err


def discs(angles, shift=0.0):
    """Views of a disc with four others in it, moved along the detector."""
    moved = np.arange(BINS) - (BINS - 1) / 2 - np.broadcast_to(shift, len(angles))[:, None]
    total = 0.0
    for x, y, radius in ((0, 0, 45), (20, 8, 9), (-16, 14, 6), (-4, -24, 7), (26, -16, 4)):
        off = moved - x * np.cos(angles)[:, None] - y * np.sin(angles)[:, None]
        total = total + np.sqrt(np.maximum(radius**2 - off**2, 0))
    return np.asarray(total, np.float32)


JUMPS = {
    "lost": lambda: discs(np.delete(even(180), slice(80, 105))),
    "moved": lambda: discs(even(180), np.where(np.arange(180) < 90, 0, 4.0)),
    "interlaced": lambda: discs(even(180)[np.r_[0:180:2, 1:180:2]]),
}


@pytest.mark.parametrize("case", JUMPS)
def test_one_pair_that_does_not_belong_together_is_named(case):
    views = JUMPS[case]()
    said = angle_doubt(views, even(len(views)))
    first = 79 if case == "lost" else 89
    assert f"views {first} and {first + 1}, whose angles are neighbours" in said


@pytest.mark.parametrize(
    "angles",
    [even(180), even(400, 2 * np.pi), np.delete(even(180), slice(60, 100)), even(400, 4 * np.pi)],
)
@pytest.mark.parametrize("noise", [0, 0.05, 1])
def test_scans_as_they_are_taken_have_no_such_pair(angles, noise):
    views = sinogram(angles)
    views += (noise * views.std() * np.random.default_rng(1).standard_normal(views.shape)).astype(
        np.float32
    )
    assert jump_doubt(views, angles) == ""
    views[30] = 0  # one bad view
    assert jump_doubt(views, angles) == ""


def test_the_largest_views_of_a_jump_are_numbered_as_in_the_file():
    angles = even(180)
    views = JUMPS["moved"]()[::-1]
    assert "views 89 and 90" in jump_doubt(views, angles[::-1])


@pytest.mark.parametrize(
    ("shift", "doubted"),
    [
        (np.zeros(180), False),
        (0.1 * np.sin(np.arange(180) / 7), False),
        (np.where(np.arange(180) < 90, 0, 4.0), True),
        (1.5 * np.sin(np.arange(180) / 11), True),
    ],
)
def test_centres_of_mass_that_leave_their_sinusoid_are_doubted(shift, doubted):
    angles = even(180)
    assert bool(mass_doubt(discs(angles, shift), angles)) is doubted


@pytest.mark.parametrize("noise", [0, 0.1, 0.3])
def test_noise_moves_no_centre_of_mass_for_long(noise):
    for count, turn in ((60, np.pi), (180, np.pi), (360, 2 * np.pi)):
        angles = even(count, turn)
        views = sinogram(angles)
        views += (
            noise * views.std() * np.random.default_rng(1).standard_normal(views.shape)
        ).astype(np.float32)
        assert mass_doubt(views, angles) == ""


def test_views_of_nothing_are_refused_in_a_sentence():
    views = np.concatenate([sinogram(even(180)), np.zeros((20, BINS), np.float32)])
    with pytest.raises(rift.errors.InputError, match="the rotation axis cannot be found"):
        rift.find_center(views, np.deg2rad(np.arange(200.0)))
