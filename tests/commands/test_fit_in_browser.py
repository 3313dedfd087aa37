"""``rift fit --view`` on real captures: a browser shows the photograph where the page stands.

The subject must be in the first view, which the correlation with the photograph taken there shows.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from browser import CHROMIUM, command, opened, until

from rift_cl.commands.cameras.camera_path import pinhole
from rift_cl.commands.cameras.film_path import first_view
from rift_cl.commands.inputs.scene_bounds import bounds_of_cameras
from rift_cl.commands.view.photographs import photographs_of, seen_by
from rift_cl.commands.view.standpoint import standpoint_of
from rift_cl.io.captures.capture import open_capture

DATA = Path(__file__).parents[3] / "shared" / "data"
# The captures, and how alike page and photograph are early in a small fit.
CAPTURES = {"fox": DATA / "fox", "ornament": DATA / "ornament" / "orbit"}
ALIKE, PATIENCE = 0.75, 120
PRESS = """(() => {
  const found = [...document.querySelectorAll("button")].filter(b => b.textContent.trim() == "%s");
  found.forEach(button => button.click());
  return found.length;
})()"""

pytestmark = [
    pytest.mark.skipif(CHROMIUM is None, reason="there is no chromium to look with"),
    pytest.mark.timeout(280),
]


def likeness(picture, photograph, there):
    """The correlation of what a page shows with a photograph, where neither panel nor notes are."""
    # A page is white before it shows anything.
    if picture is None or picture.min() == picture.max():
        return 0.0
    window = pinhole(picture.shape[:2], np.degrees(there.fov), photograph.camera.view)
    seen, known = seen_by(photograph, window)
    # The panel lies to the right, and notes to the upper left.
    known[:, -290:], known[:180, :320] = False, False
    shown = [image.mean(axis=2)[known] for image in (picture, seen)]
    return float(np.corrcoef(*shown)[0, 1]) if np.ptp(shown[0]) > 0 else 0.0


@pytest.mark.full
@pytest.mark.parametrize("name", ["ornament", pytest.param("fox", marks=pytest.mark.study)])
def test_a_fit_that_runs_is_seen_from_its_photographs(tmp_path, name):
    pytest.importorskip("viser", reason="viser is not installed")
    path = CAPTURES[name]
    if not path.exists():
        pytest.skip("../shared/data is not there")
    photographs = photographs_of(open_capture(path).views)
    bounds = bounds_of_cameras([photograph.camera for photograph in photographs])
    first, target = first_view(bounds)
    there = standpoint_of(first, target, bounds.up, 4 / 3)
    [number] = [k for k, p in enumerate(photographs) if p.camera == first]
    options = ["--steps", "100000", "--splats", "2000", "--hold-out", "0", "--downscale", "2"]
    options += ["--checkpoint-every", "0", "--out", str(tmp_path / "fit"), "--view"]
    with (
        command("fit", str(path), *options, status=130) as address,
        opened(tmp_path / "browser") as page,
    ):
        page.do("Page.enable")
        page.do("Page.navigate", url=address)

        def shows(which):
            alike = likeness(page.picture(tmp_path), photographs[which], there)
            return alike > ALIKE

        until(lambda: shows(number), PATIENCE)
        assert page.do("Runtime.evaluate", expression=PRESS % "next", returnByValue=True)
        until(lambda: shows((number + 1) % len(photographs)), PATIENCE)
