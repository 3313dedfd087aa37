"""An opening blurs what is out of focus, by similar triangles, and cuts off what is too fine."""

from __future__ import annotations

import copy
import math

import numpy as np
import pytest

from rift_cl.errors import InputError
from rift_cl.geometry import Aperture, Camera


def test_what_is_in_focus_is_sharp_and_what_is_at_the_lens_is_as_wide_as_it() -> None:
    aperture = Aperture(radius=0.25, focus=4.0)
    np.testing.assert_allclose(aperture.blur([0.0, 2.0, 4.0, 8.0]), [0.5, 0.25, 0.0, 0.5])


def test_a_lens_focused_at_infinity_blurs_everything_by_its_own_width() -> None:
    np.testing.assert_allclose(Aperture(0.25, math.inf).blur([1.0, 100.0]), 0.5)


def test_the_cutoff_is_that_of_incoherent_light() -> None:
    """f = 16 mm at f/4, 550 nm, 270 mm away: 26.9 line pairs per millimetre."""
    assert Aperture(2.0, 270.0, 550e-6).cutoff(270.0) == pytest.approx(26.9, abs=0.05)
    assert np.isinf(Aperture(2.0, 270.0).cutoff([1.0, 2.0])).all()


@pytest.mark.parametrize(
    ("numbers", "word"),
    [
        ((0, 1), "radius"),
        ((-1, 1), "radius"),
        ((math.inf, 1), "radius"),
        (("wide", 1), "radius"),
        ((1, 0), "focus"),
        ((1, -2), "focus"),
        ((1, math.nan), "focus"),
        ((1, np.array([1.0, 2.0])), "focus"),
        ((1, 1, -1e-6), "wavelength"),
        ((1, 1, math.nan), "wavelength"),
    ],
)
def test_impossible_openings_are_refused(numbers: tuple[float, ...], word: str) -> None:
    with pytest.raises(InputError, match=word):
        Aperture(*numbers)


def test_a_camera_carries_its_aperture() -> None:
    K = [[10, 0, 4], [0, 10, 4], [0, 0, 1]]
    plain = Camera((8, 8), K, np.eye(4))
    lens = Camera((8, 8), K, np.eye(4), aperture=Aperture(0.1, 2.0))
    assert plain != lens and lens == copy.deepcopy(lens) and hash(lens) == hash(copy.copy(lens))
    with pytest.raises(InputError, match="aperture"):
        Camera((8, 8), K, np.eye(4), "ortho", Aperture(0.1, 2.0))
    with pytest.raises(InputError, match="aperture"):
        Camera((8, 8), K, np.eye(4), aperture=0.1)  # type: ignore[arg-type]


def test_numbers_of_any_kind_are_the_same_opening() -> None:
    given = Aperture(np.float32(0.5), np.array(2.0), np.int64(0))  # type: ignore[arg-type]
    assert given == Aperture(0.5, 2.0) and hash(given) == hash(Aperture(0.5, 2.0))
    assert {type(n) for n in (given.radius, given.focus, given.wavelength)} == {float}


def test_at_the_lens_itself_everything_passes() -> None:
    assert Aperture(2.0, 270.0, 550e-6).cutoff(0.0) == math.inf
