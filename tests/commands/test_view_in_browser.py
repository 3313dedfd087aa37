"""``rift view`` as a person sees it: a browser opens the page, and is looked at."""

from __future__ import annotations

import numpy as np
import pytest
from browser import CHROMIUM, command, opened, until

from rift_cl.commands.cameras.camera_path import resized
from rift_cl.commands.cameras.film_path import first_view
from rift_cl.commands.inputs.scene_bounds import bounds_of_splats
from rift_cl.io.scenes.splat_scene import SplatScene

# Red above the middle, the others round it: where neither panel nor notes are.
MEANS = np.array([[0, 0, 0], [0.6, 0, -0.5], [-0.6, 0, -0.5], [0, 0.5, -0.5], [0, -0.5, -0.5]])
COLORS = np.array([[1, 0, 0], [0, 1, 0], [0, 0, 1], [0, 1, 1], [1, 0, 1]], float)
# Seconds until a page must show what it should, kernels compiled and all.
PATIENCE = 90

pytestmark = [
    pytest.mark.skipif(CHROMIUM is None, reason="there is no chromium to look with"),
    pytest.mark.timeout(240),
]


@pytest.fixture(scope="module")
def scene(tmp_path_factory):
    """Five round splats of plain colours, nearly opaque."""
    folder = tmp_path_factory.mktemp("scene")
    scene = SplatScene(
        means=MEANS,
        log_scales=np.full((5, 3), np.log(0.12)),
        quats=np.tile([1.0, 0, 0, 0], (5, 1)),
        logit_opacities=np.full(5, 6.0),
        sh=((COLORS - 0.5) / 0.28209479177387814)[:, None, :],
    )
    scene.save(folder / "scene.ply")
    return scene, folder / "scene.ply"


@pytest.fixture(scope="module")
def served(scene):
    """The page's address, while ``rift view`` runs."""
    pytest.importorskip("viser", reason="viser is not installed")
    more = ["--port", "0", "--size", "600", "--up", "0", "0", "1", "--background", *["0.5"] * 3]
    with command("view", str(scene[1]), *more) as address:
        yield address


@pytest.fixture(scope="module")
def page(tmp_path_factory):
    """A browser."""
    with opened(tmp_path_factory.mktemp("browser")) as page:
        yield page


def middles(picture):
    """Where each colour is seen, (x, y) by its number, where it is."""
    found = {}
    for number, color in enumerate(COLORS):
        near = np.abs(picture - color).max(axis=2) < 0.3
        if near.sum() > 20:
            found[number] = np.argwhere(near).mean(axis=0)[::-1] + 0.5
    return found


def expected(scene, size):
    """Where our own camera sees the splats in a window of (height, width)."""
    camera = resized(first_view(bounds_of_splats(scene))[0], size)
    local = scene.means @ camera.view[:3, :3].T + camera.view[:3, 3]
    fx, fy, cx, cy = camera.intrinsics
    return local[:, :2] / local[:, 2:] * (fx, fy) + (cx, cy)


def settled(page, folder, wanted):
    """The picture, once it is as it should be and stays so: a page fades from white into it."""
    before = None

    def look():
        nonlocal before
        last, before = before, page.picture(folder)
        still = last is not None and before is not None and np.array_equal(last, before)
        if not (still and wanted(middles(before))):
            return None
        # The corner far from the panel is background; the fade may stand still on a busy machine.
        return [before] if abs(before[-40, 40] - 0.5).max() < 0.03 else None

    return until(look, PATIENCE)[0]


def test_splats_are_seen_where_they_should_be_and_so_after_a_move_and_a_reload(
    served, page, scene, tmp_path
):
    page.do("Page.enable")
    page.do("Page.navigate", url=served)
    picture = settled(page, tmp_path, lambda found: len(found) >= 4)
    places, seen = expected(scene[0], picture.shape[:2]), middles(picture)
    for number, place in seen.items():
        np.testing.assert_allclose(place, places[number], atol=8)

    page.drag((250, 340), (350, 340))
    moved = settled(page, tmp_path, lambda found: 1 in found and abs(found[1] - seen[1]).max() > 15)
    turned = middles(moved)
    # The camera turns about the upright axis through the middle, on which red stays in place.
    assert 0 in turned and len(turned) >= 4
    np.testing.assert_allclose(turned[0], seen[0], atol=10)

    page.do("Page.reload")
    again = settled(page, tmp_path, lambda found: 1 in found and abs(found[1] - seen[1]).max() < 8)
    assert len(middles(again)) == len(seen)
