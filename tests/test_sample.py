"""The captures inside the package: whole, small, and without a word about anything else."""

from __future__ import annotations

import numpy as np

from rift_cl.io import open_capture, read_view
from rift_cl.sample import ornament, ornament_off_path, wall


def test_every_picture_is_there_and_has_the_constant_background():
    for folder, count in ((ornament(), 60), (ornament_off_path(), 8)):
        views = open_capture(folder).views
        assert len(views) == count
        for view in views:
            image = read_view(view)
            assert image.shape == (120, 160, 3)
            assert (np.rint(255 * image[:10, :10]) == 128).all()
            assert 0.2 < (np.abs(image - 0.5).max(axis=2) > 0.02).mean() < 0.6


def test_off_path_views_are_no_views_of_the_ring():
    ring = np.array([view.camera.center for view in open_capture(ornament()).views])
    assert np.ptp(ring[:, 2]) < 1e-9
    for view in open_capture(ornament_off_path()).views:
        assert np.linalg.norm(ring - view.camera.center, axis=1).min() > 0.2


def test_the_sample_is_small_and_says_how_it_was_made():
    files = [path for path in ornament().rglob("*") if path.is_file()]
    assert sum(path.stat().st_size for path in files) <= 2_000_000
    assert "tools/render_ornament.py" in (ornament() / "README.txt").read_text()
    assert {path.suffix for path in files} == {".png", ".json", ".txt"}


def test_the_wall_is_seen_from_its_front_alone_and_is_small():
    capture = open_capture(wall())
    centers = np.array([view.camera.center for view in capture.views])
    assert len(capture.views) == 24 and len(capture.points) > 700
    # The wall is a plane across y; cameras and everything that was seen lie on one side of it.
    assert capture.points[:, 1].max() < 0.31 and centers[:, 1].max() < -2
    assert all(read_view(view).shape == (120, 160, 3) for view in capture.views)
    files = [path for path in wall().rglob("*") if path.is_file()]
    assert sum(path.stat().st_size for path in files) <= 300_000
    assert {path.suffix for path in files} == {".jpg", ".json", ".ply", ".txt"}
    assert "tools/render_one_sided.py" in (wall() / "README.txt").read_text()


def test_sparse_points_of_the_wall_have_the_colours_of_the_photographs_that_show_them():
    """They come from one view each, and others see most of them unhidden."""
    capture = open_capture(wall())
    off = []
    for view in capture.views:
        local = capture.points @ view.camera.view[:3, :3].T + view.camera.view[:3, 3]
        fx, fy, cx, cy = view.camera.intrinsics
        x, y = (local[:, :2] / local[:, 2:] * [fx, fy] + [cx, cy]).T
        inside = (x > 0) & (x < 160) & (y > 0) & (y < 120)
        shown = read_view(view)[y[inside].astype(int), x[inside].astype(int)]
        off.append(np.median(np.abs(shown - capture.point_colors[inside])))
    assert max(off) < 0.06
