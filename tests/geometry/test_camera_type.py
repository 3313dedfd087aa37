"""A physical camera, placed and focused: it must be the thin lens of the textbook."""

from __future__ import annotations

import math

import numpy as np
import pytest

from rift_cl.errors import InputError, ShapeError
from rift_cl.geometry.camera_type import CameraType
from rift_cl.geometry.pose import look_at

MACHINE = CameraType("machine vision", 16.0, 4.0, 1.85e-3, (3036, 4024))


def test_a_focused_camera_obeys_the_lens_equation() -> None:
    """1 / f = 1 / z + 1 / z', and a pixel in the plane in focus is pixel / |m| wide."""
    camera = MACHINE.camera(look_at([0, 0, -270], [0, 0, 0], [0, -1, 0]), 270.0)
    z_image = camera.K[0, 0] * MACHINE.pixel
    assert 1 / 270 + 1 / z_image == pytest.approx(1 / 16)
    assert MACHINE.magnification(270.0) == pytest.approx(16 / (270 - 16))
    assert camera.aperture is not None
    assert (camera.aperture.radius, camera.aperture.focus) == (2.0, 270.0)
    assert camera.intrinsics[2:] == (2012.0, 1518.0)
    np.testing.assert_allclose(camera.center, [0, 0, -270])


def test_at_infinity_the_image_lies_in_the_focal_plane() -> None:
    assert MACHINE.image_distance(math.inf) == 16.0
    assert MACHINE.magnification(math.inf) == 0.0
    assert MACHINE.camera(np.eye(4), math.inf).K[0, 0] == pytest.approx(16 / 1.85e-3)


@pytest.mark.parametrize("P", [0.5, 1.0, 2.0])
def test_photons_follow_the_working_f_number(P: float) -> None:
    lens = CameraType("macro", 50.0, 2.8, 4e-3, (10, 10), exposure=3.0, pupil_magnification=P)
    for focus in (120.0, 300.0, math.inf):
        working = 2.8 * (1 + lens.magnification(focus) / P)
        assert lens.photons(focus) == pytest.approx(3 / working**2)
    assert lens.object_photons(300.0) == pytest.approx(3 * (50 / 2.8 / 300) ** 2)


@pytest.mark.parametrize("P", [0.5, 2.0])
def test_distances_count_from_the_entrance_pupil(P: float) -> None:
    """The pupil lies f (1 - 1/P) in front of the principal plane, where the lens equation holds."""
    lens = CameraType("macro", 50.0, 2.8, 4e-3, (10, 10), pupil_magnification=P)
    from_principal = 300 + 50 * (1 - 1 / P)
    assert lens.magnification(300.0) == pytest.approx(50 / (from_principal - 50))


@pytest.mark.parametrize("field", ["focal_length", "f_number", "pixel", "exposure"])
@pytest.mark.parametrize("value", [0, -1, math.nan, math.inf, "wide", None])
def test_impossible_numbers_are_refused(field: str, value: object) -> None:
    numbers: dict[str, object] = {"focal_length": 16, "f_number": 4, "pixel": 2e-3, field: value}
    with pytest.raises(InputError, match=field):
        CameraType("bad", size=(4, 4), **numbers)  # type: ignore[arg-type]


@pytest.mark.parametrize(
    "size", [(0, 4), (4,), (4, -1), (2.5, 4), (4, 4, 4), 5, "ab", (10**400, 4)]
)
def test_a_sensor_has_pixels(size: object) -> None:
    with pytest.raises(ShapeError, match="size"):
        CameraType("bad", 16, 4, 2e-3, size)  # type: ignore[arg-type]


@pytest.mark.parametrize("focus", [16.0, 0.0, -5.0, math.nan, "near", np.array([90.0, 95.0])])
def test_nothing_is_in_focus_before_the_focal_plane(focus: float) -> None:
    with pytest.raises(InputError, match="focus"):
        MACHINE.camera(np.eye(4), focus)


def test_a_negative_wavelength_is_refused() -> None:
    with pytest.raises(InputError, match="wavelength"):
        CameraType("bad", 16, 4, 2e-3, (4, 4), wavelength=-1)
