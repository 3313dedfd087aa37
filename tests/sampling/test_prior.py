"""Priors: one meaning of power whatever it comes from, and what a first reconstruction tells."""

import numpy as np
import pytest

from rift_cl.errors import InputError, NonFiniteError, RiftError, ShapeError
from rift_cl.sampling.targets.pilot import Pilot
from rift_cl.sampling.targets.prior import PowerLaw, Spectrum, checked_power, directions_for

D = 2.0


def grid(n, step, axes):
    line = (np.arange(n) - n // 2) * step
    return np.meshgrid(*[line] * axes, indexing="ij")


def stretched_field(n, seed, turn=0.6, stretch=4.0):
    """A flat random field whose details are drawn out along ``turn``; samples at a spacing of 1."""
    line = np.fft.fftfreq(n, 1 / n)
    kx, ky = line[None], line[:, None]
    u = (kx * np.cos(turn) + ky * np.sin(turn)) * stretch
    v = ky * np.cos(turn) - kx * np.sin(turn)
    amplitude = np.maximum(np.hypot(u, v), 1) ** -1.25
    noise = np.random.default_rng(seed).standard_normal((n, n))
    return np.fft.ifft2(np.fft.fft2(noise) * amplitude).real


def priors():
    kx = grid(33, 0.1, 3)
    radius = np.maximum(np.sqrt(sum(k**2 for k in kx)), 0.2)
    return {
        "law": PowerLaw(2.5),
        "spectrum": Spectrum(7 * radius**-2.0 * (1 + (kx[0] > 0)), 0.1),
        "pilot": Pilot(stretched_field(64, 1), D / 64),
    }


@pytest.mark.parametrize("name", ["law", "spectrum", "pilot"])
def test_power_is_one_at_a_cycle_per_diameter_and_the_same_both_ways(name):
    prior = priors()[name]
    axes = 2 if name == "pilot" else 3
    ring = directions_for(axes, 300) / D
    assert prior.power(ring, D).mean() == pytest.approx(1, rel=0.03)
    k = directions_for(axes, 50) * np.linspace(0, 1.2, 50)[:, None]
    power = checked_power(prior, k, D)
    np.testing.assert_allclose(checked_power(prior, -k, D), power, rtol=1e-9)
    assert (power > 0).all()


def test_a_power_law_falls_as_it_says_and_is_level_at_the_start():
    k = np.array([[0, 0, 0], [0.25, 0, 0], [0, 0.5, 0], [0, 0, 5], [3, 4, 0]])
    np.testing.assert_allclose(PowerLaw(2).power(k, D), [1, 1, 1, 0.01, 0.01])


def test_a_spectrum_lies_as_its_array_does_x_last():
    array = np.full((9, 9, 9), 1.0)
    array[4, 4, 6] = 100
    prior = Spectrum(array, 0.25)
    along = prior.power(np.eye(3) * 0.5, D)
    assert along[0] > 20 * along[1]
    assert along[1] == along[2]
    # Its opposite has the same power.
    assert prior.power(np.array([[-0.5, 0, 0]]), D) == along[0]
    flat = np.full((9, 9), 1.0)
    flat[6, 4] = 100
    along = Spectrum(flat, 0.25).power(np.eye(3)[:2] * 0.5, D)
    assert along[1] > 20 * along[0]


def test_a_spectrum_is_interpolated_and_ends_with_its_grid():
    power = Spectrum([[0, 1, 0], [1, 3, 1], [0, 1, 0]], 1.0).power(
        np.array([[0, 0, 0], [0.5, 0, 0], [1, 0, 0], [1.5, 0, 0], [7, 0, 0]]), D
    )
    np.testing.assert_allclose(power[1:] / power[0], [2 / 3, 1 / 3, 0, 0], atol=1e-12)


def test_a_pilot_finds_the_fall_and_the_direction_of_the_power():
    turn, field = 0.6, stretched_field(128, 3)
    pilot = Pilot(field, 1.0)
    assert pilot.slope == pytest.approx(2.5, abs=0.4)
    angles = np.arange(60) * np.pi / 60
    k = 0.1 * np.stack([np.cos(angles), np.sin(angles), 0 * angles], 1)
    power = pilot.power(k, 128.0)
    # Details are long along the turn, so that power lies across it.
    strongest = angles[np.argmax(power)]
    assert abs((strongest - turn - np.pi / 2 + np.pi / 2) % np.pi - np.pi / 2) < 0.2
    assert power.max() > 10 * power.min()
    assert power.min() > 0


def test_a_pilot_takes_its_noise_off():
    field = stretched_field(128, 5, stretch=1.0)
    field /= field.std()
    noisy = field + np.random.default_rng(0).standard_normal(field.shape)
    k = np.array([[0.02, 0, 0], [0.2, 0, 0]])
    clean, told = Pilot(field, 1.0).power(k, 128.0), Pilot(noisy, 1.0).power(k, 128.0)
    raw = Pilot(noisy, 1.0, noise=0.0).power(k, 128.0)
    fall, wanted = told[0] / told[1], clean[0] / clean[1]
    assert 0.4 < fall / wanted < 2.5
    assert raw[0] / raw[1] < 0.4 * wanted


def test_a_pilot_of_a_volume_knows_the_axes():
    n = 32
    z, y, x = grid(n, 1.0, 3)
    random = np.random.default_rng(0)
    # Layers across z: power along kz.
    volume = sum(
        np.cos(2 * np.pi * (f * z / n) + random.uniform(0, 6)) / f for f in range(3, 13)
    ) + 0.05 * np.cos(x * y / n)
    power = Pilot(volume, 0.5).power(np.eye(3) * 0.3, 16.0)
    assert power[2] > 5 * max(power[0], power[1])


@pytest.mark.parametrize(
    ("make", "error", "says"),
    [
        (lambda: PowerLaw(-1), InputError, "alpha is -1"),
        (lambda: PowerLaw(np.nan), InputError, "alpha is nan"),
        (lambda: PowerLaw("steep"), InputError, "alpha is 'steep'"),
        (lambda: Spectrum(np.ones(5), 1.0), ShapeError, r"shape \(5,\)"),
        (lambda: Spectrum("flat", 1.0), ShapeError, "wanted real power"),
        (lambda: Spectrum([[1, -1], [0, 2]], 1.0), InputError, "from -1 to 2"),
        (lambda: Spectrum(np.zeros((4, 4)), 1.0), InputError, "from 0 to 0"),
        (lambda: Spectrum([[1, np.nan], [0, 2]], 1.0), NonFiniteError, "NaN"),
        (lambda: Spectrum(np.ones((4, 4)), 0), InputError, "spacing is 0"),
        (lambda: Pilot(np.ones((4, 4)), 1.0), ShapeError, r"shape \(4, 4\)"),
        (lambda: Pilot(np.ones((9, 9)), 1.0), InputError, "constant"),
        (lambda: Pilot(np.full((9, 9), np.nan), 1.0), NonFiniteError, "NaN"),
        (lambda: Pilot(stretched_field(16, 0), -1.0), InputError, "spacing is -1"),
        (lambda: Pilot(stretched_field(16, 0), 1.0, noise=np.nan), InputError, "noise is nan"),
        (
            lambda: Pilot(np.random.default_rng(0).normal(size=(32, 32)), 1.0),
            InputError,
            "does not rise above its noise",
        ),
    ],
)
def test_what_is_no_prior_is_refused(make, error, says):
    with pytest.raises(error, match=says):
        make()


def test_a_spectrum_of_the_wrong_unit_or_shape_is_refused_where_it_is_used():
    flat = Spectrum(np.ones((9, 9)), 1.0)
    with pytest.raises(RiftError, match="target is not flat"):
        flat.power(np.array([[0, 0, 1.0]]), D)
    with pytest.raises(RiftError, match=r"Pilot: reconstruction"):
        Pilot(stretched_field(32, 0), 1.0).power(np.array([[0, 0, 1.0]]), D)
    with pytest.raises(RiftError, match="spacing"):
        flat.power(np.array([[1.0, 0, 0]]), 1e-3)
