"""The rotation axis is found in every kind of scan, or refused in a sentence."""

import h5py
import numpy as np
import pytest
from axis_scenes import BINS, FULL, HALF, PARTS, grains, sinogram

import rift_cl as rift
from rift_cl.errors import InputError, NonFiniteError
from rift_cl.reconstruct import attenuation, find_center
from rift_cl.reconstruct.axis import axis_of_stack

ANGLES = {
    "half turn": np.arange(90) * np.pi / 90,
    "full turn": np.arange(120) * 2 * np.pi / 120,
    "irregular": np.random.default_rng(1).uniform(0, 2 * np.pi, 150),
}


def _sinogram(angles, center, bins=128):
    scan = rift.Parallel(angles, bins, center=center)
    return rift.phantom.shepp_logan_sinogram(rift.Grid((100, 100)), scan)


@pytest.mark.parametrize("angles", ANGLES.values(), ids=ANGLES)
@pytest.mark.parametrize("center", [60.0, 64.3, 70.77])
def test_phantom(angles, center):
    assert find_center(_sinogram(angles, center), angles).center == pytest.approx(center, abs=0.3)


@pytest.mark.parametrize("center", [60.0, 66.6])
def test_noise(center):
    y = _sinogram(ANGLES["half turn"], center)
    noisy = y + np.random.default_rng(0).normal(0, 1, y.shape)
    assert find_center(noisy, ANGLES["half turn"]).center == pytest.approx(center, abs=0.5)


def test_truncated_detector():
    angles = ANGLES["half turn"]
    found = find_center(_sinogram(angles, 33.0, bins=80), angles)
    assert found.center == pytest.approx(33, abs=1.0)


def test_the_best_of_the_scores_is_the_answer():
    found = find_center(_sinogram(ANGLES["half turn"], 64.0), ANGLES["half turn"])
    assert found.scores[0, found.scores[1].argmax()] == pytest.approx(found.center, abs=0.1)
    assert found.interval[0] < found.center < found.interval[1]


def test_a_span_bounds_the_search():
    angles = ANGLES["half turn"]
    found = find_center(_sinogram(angles, 64.0), angles, span=(60, 70))
    assert found.center == pytest.approx(64, abs=0.1)
    with pytest.raises(InputError, match="span"):
        find_center(_sinogram(angles, 64.0), angles, span=(60, 200))


def test_a_sinogram_without_contrast_is_told():
    with pytest.raises(InputError, match="no contrast"):
        find_center(np.ones((10, 64), np.float32), np.linspace(0, 3, 10))


def test_non_finite_values_are_told():
    y = _sinogram(ANGLES["half turn"], 64.0)
    y[3, 4] = np.nan
    with pytest.raises(NonFiniteError, match=r"\(3, 4\)"):
        find_center(y, ANGLES["half turn"])


def test_real_tooth(shared_data):
    with h5py.File(shared_data / "tooth" / "tooth.h5") as file:
        frames = [
            file[f"exchange/{n}"][:].astype("f4") for n in ("data", "data_white", "data_dark")
        ]
        angles = np.deg2rad(file["exchange/theta"][:])
    y = attenuation(*frames).projections
    for row in range(y.shape[1]):
        assert find_center(y[:, row], angles).center == pytest.approx(296.0, abs=0.5)


KINDS = {"parts": PARTS, "porous": grains(45, 80), "wider than the detector": grains(110, 1500)}
RANDOM = np.random.default_rng(3)
VIEWS = {
    "half turn": HALF,
    "its end too": np.linspace(0, np.pi, 225),
    "backwards": -HALF,
    "from elsewhere": HALF + 4,
    "200 degrees": np.deg2rad(np.arange(0, 200, 0.8)),
    "repeated": np.tile(HALF[::2], 2),
    "views missing": np.delete(HALF, range(90, 94)),
    "full turn": FULL,
    "two turns": np.arange(600) * 4 * np.pi / 600,
    "full turn at random": RANDOM.uniform(0, 2 * np.pi, 300),
}


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("views", VIEWS)
def test_every_kind_of_object_and_of_views(kind, views):
    center, angles = 83.7, VIEWS[views]
    found = rift.find_center(sinogram(KINDS[kind], angles, center), angles)
    assert found.center == pytest.approx(center, abs=0.25 if kind.startswith("wider") else 0.15)
    assert found.interval[1] - found.interval[0] < 0.8
    assert abs(found.center - center) < 1.5 * (found.interval[1] - found.interval[0])
    assert found.tilt == found.spread == 0


@pytest.mark.parametrize("offset", [-0.15, -0.08, 0.05, 0.12])
@pytest.mark.parametrize("angles", [HALF, FULL], ids=["half", "full"])
def test_an_axis_off_the_middle_is_not_pulled_towards_it(offset, angles):
    center = (BINS - 1) / 2 + offset * BINS
    found = rift.find_center(sinogram(PARTS, angles, center), angles)
    assert found.center == pytest.approx(center, abs=0.1)


@pytest.mark.parametrize("noise", [0.0, 1e-4, 1e-3])
def test_half_acquisitions_with_hardly_any_noise_tell_their_axis(noise):
    """Their likelihood is so sharp that a coarse step misses where it bends the right way."""
    parts = [
        (1.0, 0, 0, 80, 64, 0.35),
        (0.8, 28, 8, 16, 24, -0.52),
        (-0.6, -32, 20, 18, 12, 0.87),
        (2.0, -8, -36, 10, 10, 0),
        (1.5, 44, -20, 6, 11, 0.17),
    ]
    for center in (11.7, 16.7, 31.7):
        shifts = (np.arange(4) - 1.5) / 4
        bins = round(center + 124.6)
        averaged = np.mean(
            [sinogram(parts, FULL, center + shift, bins=bins, noise=noise) for shift in shifts], 0
        )
        assert find_center(averaged, FULL).center == pytest.approx(center, abs=0.02)


def test_windows_with_nothing_in_them_say_nothing():
    """A small disc beside the axis: zeros exactly, all about many of the places that are tried."""
    angles = np.arange(90) * np.pi / 90
    views = sinogram([(1.0, 12.0, 0.0, 5.0, 5.0, 0.0)], angles, 76.0, bins=91, noise=0)
    # The axis lies beyond the middle part, where it is looked for.
    with pytest.raises(InputError, match="no place on the detector"):
        find_center(views, angles)
    assert find_center(views, angles, span=(50, 85)).center == pytest.approx(76.0, abs=0.05)


@pytest.mark.parametrize("span", [90, 120, 150])
def test_limited_angles_are_told_by_the_centres_of_mass(span):
    angles = np.deg2rad(np.arange(0, span, 0.5))
    found = rift.find_center(sinogram(PARTS, angles, 74.2), angles)
    assert found.by == "centre of mass"
    assert found.center == pytest.approx(74.2, abs=0.2)


@pytest.mark.parametrize("center", [39.225, 37.675, 41.9, 44.675])
def test_bins_that_sample_instead_of_averaging_do_not_pull_to_half_a_bin(center):
    angles = np.arange(120) * np.pi / 120
    small = [(part[0], *(0.5 * length for length in part[1:5]), part[5]) for part in PARTS]
    found = rift.find_center(sinogram(small, angles, center, bins=80, noise=0.002), angles)
    off = abs(found.center - center)
    assert off < 0.1 or found.interval[0] < center < found.interval[1]


@pytest.mark.full
def test_of_noisy_half_turns_the_centre_of_mass_is_part_of_the_answer():
    off = []
    for seed in range(6):
        y = sinogram(KINDS["porous"], HALF, 83.7, noise=0.05, seed=seed)
        found = rift.find_center(y, HALF)
        assert found.by == "double wedge and centre of mass"
        off.append(found.center - 83.7)
    assert np.sqrt(np.mean(np.square(off))) < 0.06


@pytest.mark.parametrize("level", [[0.02, 0.02], [0.0, 0.03], [-0.02, 0.01], [0.0, 0.01]])
def test_air_that_is_not_at_zero_does_not_move_the_axis(level):
    clean = sinogram(PARTS, HALF, 88.3, noise=0.01)
    air = (clean.max() * np.linspace(*level, BINS)).astype(np.float32)
    found = rift.find_center(clean + air, HALF)
    assert found.center == pytest.approx(88.3, abs=0.06)
    assert found.interval[0] < 88.3 < found.interval[1]


def test_limited_angles_over_sloping_air_are_refused():
    y = sinogram(PARTS, HALF[:120], 74.2)
    air = (0.03 * y.max() * np.linspace(0, 1, BINS)).astype(np.float32)
    with pytest.raises(InputError, match="--center"):
        rift.find_center(y + air, HALF[:120])


@pytest.mark.full
def test_nothing_but_the_detector_changes_the_answer():
    y = sinogram(KINDS["porous"], HALF, 83.7)
    order = np.random.default_rng(1).permutation(HALF.size)
    first = rift.find_center(y, HALF)
    again = rift.find_center(y, HALF)
    assert first.center == again.center
    assert first.interval == again.interval
    assert rift.find_center(y[order], HALF[order]).center == pytest.approx(first.center, abs=1e-3)
    assert rift.find_center(1000 * y, HALF).center == pytest.approx(first.center, abs=1e-3)
    mirrored = rift.find_center(y[:, ::-1], -HALF)
    assert mirrored.center == pytest.approx(BINS - 1 - first.center, abs=0.03)


def test_rows_tell_the_tilt():
    rows = 9
    centers = 80 + 0.4 * (np.arange(rows) - 4)
    stack = np.stack([sinogram(PARTS, HALF, c, seed=row) for row, c in enumerate(centers)], axis=1)
    found = rift.find_center(stack, HALF)
    assert found.center == pytest.approx(80, abs=0.1)
    assert found.tilt == pytest.approx(0.4, abs=0.03)
    assert found.spread < 0.1
    np.testing.assert_allclose(found.centers, centers[found.rows.astype(int)], atol=0.1)


def _beside_air(slope, first, stop, rows=40):
    """Noisy rows of air, but for some of an object whose axis leans."""
    stack = np.random.default_rng(0).normal(0, 0.3, (HALF.size, rows, BINS)).astype(np.float32)
    for row in range(first, stop):
        center = 83.2 + slope * (row - (rows - 1) / 2)
        stack[:, row] = sinogram(PARTS, HALF, center, seed=row, noise=0.005)
    return stack


@pytest.mark.full
@pytest.mark.parametrize(("first", "stop"), [(1, 11), (14, 27)])
@pytest.mark.parametrize("slope", [0.0, 0.2])
def test_rows_of_air_have_no_vote(first, stop, slope):
    found = rift.find_center(_beside_air(slope, first, stop), HALF)
    assert found.rows.min() >= first and found.rows.max() < stop
    assert found.center == pytest.approx(83.2, abs=0.1)
    assert found.interval[0] < 83.2 < found.interval[1]
    assert found.tilt == pytest.approx(slope, abs=0.01)
    assert f"from {found.rows[0]:.0f} to {found.rows[-1]:.0f}" in found.in_words()


@pytest.mark.full
def test_rows_that_are_wanted_tell_the_axis_beside_air():
    stack = _beside_air(0.0, 1, 9)
    stack[:, 30:38] = 3 * _beside_air(0.0, 30, 38)[:, 30:38, ::-1]

    def look(views, rows):
        return stack[np.ix_(views, rows)]

    def found(within):
        return axis_of_stack(lambda row: stack[:, row], look, 40, HALF, None, within)

    assert found((0, 12)).center == pytest.approx(83.2, abs=0.1)
    assert found((25, 40)).center == pytest.approx(BINS - 1 - 83.2, abs=0.1)
    with pytest.raises(InputError, match="--center"):
        found((12, 25))


def test_rows_that_contradict_each_other_are_refused():
    centers = [60.0, 95, 60, 95, 78]
    stack = np.stack([sinogram(PARTS, HALF, c) for c in centers], axis=1)
    with pytest.raises(InputError, match="contradict"):
        rift.find_center(stack, HALF)


@pytest.mark.full
@pytest.mark.parametrize("noise", [0.03, 0.05])
def test_the_interval_holds_the_axis_and_grows_with_noise(noise):
    quiet = rift.find_center(sinogram(PARTS, HALF, 83.7, noise=0.005), HALF)
    wide = []
    for seed in range(6):
        found = rift.find_center(sinogram(PARTS, HALF, 83.7, noise=noise, seed=seed), HALF)
        wide.append(found.interval[1] - found.interval[0])
        assert found.interval[0] - 0.03 < 83.7 < found.interval[1] + 0.03
    assert np.median(wide) > 1.5 * (quiet.interval[1] - quiet.interval[0])


@pytest.mark.full
def test_an_axis_that_moves_during_a_turn_widens_the_interval():
    still = rift.find_center(sinogram(PARTS, FULL, 83.7), FULL)
    # It drifts by a bin during the first half turn, and stays there.
    moving = 83.7 + np.clip(FULL / np.pi, 0, 1)[:, None]
    rows = [sinogram(PARTS, FULL, moving, seed=seed) for seed in range(3)]
    for stack in (rows[0], np.stack(rows, axis=1)):
        found = rift.find_center(stack, FULL)
        assert found.interval[1] - found.interval[0] > 4 * (still.interval[1] - still.interval[0])
        assert found.interval[0] < moving.mean() < found.interval[1]


@pytest.mark.parametrize("angles", [HALF, FULL], ids=["half", "full"])
def test_rings_do_not_decide(angles):
    y = sinogram(PARTS, angles, 88.3)
    rings = 0.02 * y.max() * np.random.default_rng(5).standard_normal(BINS)
    found = rift.find_center((y + rings).astype(np.float32), angles)
    assert found.center == pytest.approx(88.3, abs=0.2)


def _noise(views):
    return np.random.default_rng(0).standard_normal((views, 96)).astype(np.float32)


REFUSED = {
    "one view": (np.ones((1, 64), np.float32), np.zeros(1)),
    "one angle": (sinogram(PARTS, np.zeros(40), 80.0), np.zeros(40)),
    "few bins": (sinogram(PARTS, HALF, 3.0, bins=6), HALF),
    "constant": (np.ones((224, 64), np.float32), HALF),
    "noise, half turn": (_noise(224), HALF),
    "noise, full turn": (_noise(300), FULL),
    "noise, limited": (_noise(100), HALF[:100]),
    "limited and too wide": (
        sinogram(KINDS["wider than the detector"], HALF[:150], 80.0),
        HALF[:150],
    ),
    "axis off the detector": (sinogram(KINDS["porous"], HALF, -30.0), HALF),
    "axis at its end": (sinogram(KINDS["porous"], HALF, 6.0), HALF),
}


@pytest.mark.parametrize("case", REFUSED)
def test_what_does_not_tell_the_axis_is_refused(case):
    y, angles = REFUSED[case]
    with pytest.raises(InputError, match="--center"):
        rift.find_center(y, angles)


def test_a_scan_is_taken_for_its_angles():
    y = _sinogram(ANGLES["half turn"], 64.3)
    scan = rift.Parallel(ANGLES["half turn"], 128, pitch=0.2)
    assert find_center(y, scan).center == find_center(y, scan.angles).center
    with pytest.raises(rift.RiftError, match="sinogram has shape"):
        find_center(y[:, 1:], scan)


def test_another_shape_is_told():
    with pytest.raises(rift.RiftError, match="angle, row, bin"):
        rift.find_center(np.ones(5, np.float32), np.zeros(5))
    with pytest.raises(rift.RiftError, match="sinogram"):
        rift.find_center(np.ones((5, 64), np.float32), np.zeros(4))
