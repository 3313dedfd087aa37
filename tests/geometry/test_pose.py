"""Cameras that are pointed at something see it in the middle, upright."""

from __future__ import annotations

import math

import numpy as np
import pytest

from rift_cl.errors import InputError, ShapeError
from rift_cl.geometry import Camera
from rift_cl.geometry.pose import look_at


def test_what_is_looked_at_is_ahead_and_what_is_above_it_is_above() -> None:
    """In the camera's axes: z forward, y down."""
    rng = np.random.default_rng(0)
    for _ in range(20):
        center, target, up = rng.normal(size=(3, 3))
        view = look_at(center, target, up)
        camera = Camera((4, 4), np.eye(3), view)
        np.testing.assert_allclose(camera.center, center, atol=1e-12)
        seen = view[:3, :3] @ target + view[:3, 3]
        np.testing.assert_allclose(seen, [0, 0, np.linalg.norm(target - center)], atol=1e-12)
        lifted = view[:3, :3] @ (target + up) + view[:3, 3]
        assert lifted[1] < 0 and abs(lifted[0]) < 1e-12
        np.testing.assert_allclose(np.linalg.det(view), 1)


@pytest.mark.parametrize(
    ("numbers", "kind", "word"),
    [
        (([1, 2, 3], [1, 2, 3], [0, 0, 1]), InputError, "stands at"),
        (([0, 0, 1], [0, 0, 0], [0, 0, 1]), InputError, "straight up or down"),
        (([0, 0, 1], [1, 0, 0], [0, 0, 0]), InputError, "up is"),
        (([0, 0], [1, 0, 0], [0, 0, 1]), ShapeError, "center"),
        (([0, 0, math.nan], [1, 0, 0], [0, 0, 1]), ShapeError, "center"),
        (("abc", [1, 0, 0], [0, 0, 1]), ShapeError, "center"),
        (([0, 0, 1], [1, 0, math.inf], [0, 0, 1]), ShapeError, "target"),
        (([0, 0, 1], [1, 0, 0], None), ShapeError, "up"),
    ],
)
def test_what_is_no_pose_is_named(
    numbers: tuple[object, ...], kind: type[Exception], word: str
) -> None:
    with pytest.raises(kind, match=word):
        look_at(*numbers)  # type: ignore[arg-type]
