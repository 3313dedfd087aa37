"""``rift view``: a scene in the browser, drawn by our own kernels."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from rift_cl.commands.cameras.camera_path import resized
from rift_cl.commands.cameras.film_path import first_view
from rift_cl.commands.inputs.opened_scene import OpenedScene
from rift_cl.commands.inputs.scene_bounds import SceneBounds
from rift_cl.commands.view.browser_splats import MovingSplats, browser_can
from rift_cl.commands.view.photographs import photographs_of
from rift_cl.commands.view.settings import ViewSettings
from rift_cl.commands.view.viewer import SplatViewer
from rift_cl.commands.view.wish import kinds_of
from rift_cl.io.captures.capture import View, as_pinholes, open_capture
from rift_cl.progress import Report
from rift_cl.splat.renderer import Renderer

# Seconds between two looks at whether a camera has come to rest.
_PAUSE = 0.05


class ViewJob:
    """A page that is served; it is there from now on, and draws while ``run`` runs.

    Args:
        settings: what to show.

    Raises:
        RiftError: the scene cannot be read, viser is absent, or the port is taken.
    """

    def __init__(self, settings: ViewSettings) -> None:
        scene = settings.open_scene(densities=True)
        self.notes = settings.notes(scene)
        bounds = settings.bounds(scene)
        device = settings.open_device()
        self._renderer = Renderer(scene.rendering, device=device)
        self._splats = scene.splats.upload(device)
        # Kernels are built before anybody waits for a picture.
        self._renderer.forward(self._splats, resized(first_view(bounds)[0], (16, 16)))
        self._viewer = SplatViewer(
            bounds,
            photographs=photographs_of(_views(settings, scene)),
            moving=_moving(settings, scene, bounds),
            port=settings.port,
            size=settings.size,
            background=scene.background,
            light=scene.light,
            title=scene.name,
            kinds=kinds_of(scene.rendering),
        )

    @property
    def url(self) -> str:
        """Where the page is."""
        return self._viewer.url

    def run(self) -> Iterator[Report]:
        """Draw whatever is asked for, without end; a report after each picture."""
        frames = 0
        while True:
            drawn = self._viewer.serve(self._splats, self._renderer)
            if drawn:
                frames += drawn
                yield Report(frames, frames, "frames")
            else:
                self._viewer.wait(_PAUSE)

    def __enter__(self) -> ViewJob:
        """The job itself."""
        return self

    def __exit__(self, *_: object) -> None:
        """Stop serving."""
        self._viewer.close()


def _views(settings: ViewSettings, scene: OpenedScene) -> Sequence[View]:
    """The photographs of --capture, or of the fit."""
    if settings.capture is not None:
        capture = open_capture(settings.capture, photographs=False)
    elif scene.cameras is not None:
        capture = scene.cameras.reopened
    else:
        return ()
    # Where lenses were taken for pinholes, what is out of focus is so in the splats.
    return (as_pinholes(capture) if scene.pinhole else capture).views


def _moving(settings: ViewSettings, scene: OpenedScene, bounds: SceneBounds) -> MovingSplats | None:
    """What a browser draws while its camera moves; None where it cannot, or shall not."""
    plain = scene.light == "display" and browser_can(scene.splats)
    if settings.moving == "rift" or not plain:
        return None
    first, target = first_view(bounds)
    reach = float(np.linalg.norm(first.center - target))
    return MovingSplats(scene.splats, bounds.cameras or [first], reach or bounds.radius)
