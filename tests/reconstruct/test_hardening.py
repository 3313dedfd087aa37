"""The linearisation undoes a polychromatic beam's saturation, and refuses a fall."""

from __future__ import annotations

import numpy as np
import pytest

from rift_cl.errors import InputError
from rift_cl.reconstruct.preprocess import linearised


def test_two_energies_of_one_material_become_thickness_again() -> None:
    """-log of the mean of two exponentials, inverted by a fit over its range."""
    thickness = np.linspace(0, 6, 200)
    y = -np.log(0.5 * np.exp(-0.3 * thickness) + 0.5 * np.exp(-0.9 * thickness))
    powers = np.stack([y**k for k in range(1, 6)], axis=1)
    fit = np.linalg.lstsq(powers, thickness, rcond=None)[0]
    projections = y.reshape(1, 1, -1)
    found = linearised(projections, fit)
    assert found.dtype == np.float32 and found.shape == projections.shape
    np.testing.assert_allclose(found[0, 0], thickness, atol=5e-3)
    assert np.abs(y / y[-1] * 6 - thickness).max() > 0.5


def test_the_identity_and_air() -> None:
    values = np.array([[[-0.2, 0.0, 0.5, 2.0]]], np.float32)
    np.testing.assert_array_equal(linearised(values, [1.0]), values)
    np.testing.assert_allclose(linearised(values, [2.0, 1.0])[0, 0], [-0.4, 0.0, 1.25, 8.0])


@pytest.mark.parametrize(
    ("coefficients", "words"),
    [
        ((), "finite numbers"),
        ((np.nan,), "finite"),
        ((0.0, 1.0), "a1 is 0"),
        ((1.0, -0.4), "falls"),
    ],
)
def test_what_is_no_linearisation(coefficients: tuple[float, ...], words: str) -> None:
    with pytest.raises(InputError, match=words):
        linearised(np.array([[[0.0, 2.0]]], np.float32), coefficients)
