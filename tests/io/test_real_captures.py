"""Real captures: as many views as there are photographs, all of which look at the scene."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from rift_cl.io import camera_at, open_capture, read_view


@pytest.mark.parametrize(
    ("folder", "views", "shape", "off"),
    [
        ("lego", 100, (200, 200, 4), 1e-3),
        # The middle of its axes is 0.07 above the origin: 3.4 pixels at 5.5 away.
        ("ornament/orbit", 570, (168, 224, 3), 3.5),
        ("fox", 50, (480, 270, 3), 100),
    ],
)
def test_views_of_the_origin(
    shared_data: Path, folder: str, views: int, shape: tuple[int, ...], off: float
) -> None:
    if not (shared_data / folder).is_dir():
        pytest.skip(f"no real data: {shared_data / folder} is absent")
    capture = open_capture(shared_data / folder)
    assert len(capture.views) == views
    for view in capture.views:
        x, y, depth = view.camera.K @ view.camera.view[:3, 3]
        assert depth > 0
        assert np.hypot(x / depth - shape[1] / 2, y / depth - shape[0] / 2) < off
        assert view.camera.size == shape[:2] and view.lens is None and view.mask is None


@pytest.mark.parametrize(("folder", "channels"), [("lego", 4), ("ornament/orbit", 3), ("fox", 3)])
def test_photographs_can_be_read(shared_data: Path, folder: str, channels: int) -> None:
    if not (shared_data / folder).is_dir():
        pytest.skip(f"no real data: {shared_data / folder} is absent")
    for view in open_capture(shared_data / folder).views[::50]:
        image = read_view(view, downscale=2)
        assert image.shape == (*camera_at(view, 2).size, channels)
        assert image.min() >= 0 and image.max() <= 1 and image.std() > 0.02


def test_the_lego_is_in_the_middle(shared_data: Path) -> None:
    if not (shared_data / "lego").is_dir():
        pytest.skip(f"no real data: {shared_data / 'lego'} is absent")
    alpha = read_view(open_capture(shared_data / "lego").views[0])[..., 3]
    assert alpha[90:110, 90:110].min() == 1 and alpha[:5].max() == 0
