"""The page that a fit leaves beside its report: the scene in any browser, where viser is installed.

The same page as ``rift export fit --to html`` writes. What goes wrong with it is said, and ends no
fit.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from importlib.util import find_spec
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from rift_cl.commands.cameras.film_path import first_view
from rift_cl.commands.export.plain_scene import plain_scene
from rift_cl.commands.export.web_page import FirstView, web_page
from rift_cl.commands.fit_photos.pictures import CapturePictures
from rift_cl.commands.inputs.opened_scene import in_display_light
from rift_cl.commands.inputs.scene_bounds import bounds_of_cameras, bounds_of_splats
from rift_cl.io.output import write_text
from rift_cl.io.scenes.splat_scene import SplatScene

SCENE_PAGE = "scene.html"
# Splats up to which the page is made unasked: some 8 MB, in seconds.
_MOST = 200_000


def leave_page(fit: Path, pictures: CapturePictures, announce: Callable[[str], None]) -> str | None:
    """Write the page of a fit whose scene.ply is written.

    Args:
        fit: its folder.
        pictures: that it was trained on.
        announce: told what went wrong.

    Returns:
        The page's name in the folder; None where there is none.
    """
    (fit / SCENE_PAGE).unlink(missing_ok=True)
    if find_spec("viser") is None:
        return None
    try:
        scene = replace(SplatScene.load(fit / "scene.ply"), light=pictures.light)
        if len(scene) > _MOST:
            return None
        behind = np.asarray(pictures.behind, np.float32)
        page = _page(fit, scene, pictures, behind)
        write_text(fit / SCENE_PAGE, page)
    except Exception as error:
        words = f"{type(error).__name__}: {error}".splitlines()[0]
        announce(f"rift: warning: {SCENE_PAGE} cannot be made ({words}), but the fit goes on")
        return None
    return SCENE_PAGE


def _page(
    fit: Path, scene: SplatScene, pictures: CapturePictures, behind: NDArray[np.float32]
) -> str:
    plain, _ = plain_scene(scene, pictures.cameras)
    bounds = bounds_of_cameras(pictures.cameras, bounds_of_splats(plain))
    camera, target = first_view(bounds)
    return web_page(
        plain,
        FirstView(camera, target, bounds.up),
        pictures.cameras,
        title=fit.resolve().name,
        background=in_display_light(behind, pictures.light),
    )
