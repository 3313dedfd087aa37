"""The panel of photographs: their cameras drawn, jumped to, and compared with what is drawn."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from rift_cl.commands.inputs.scene_bounds import SceneBounds
from rift_cl.commands.view.lens_panel import LensPanel
from rift_cl.commands.view.markdown import markdown_of
from rift_cl.commands.view.photographs import COMPARISONS, Comparison, Photograph
from rift_cl.commands.view.standpoint import standpoint_of
from rift_cl.commands.view.viser_camera import go, wxyz_of

# Size of a drawn camera, relative to how far off the cameras stand.
_SCALE = 0.015
_COLOR, _CHOSEN = (240, 160, 40), (60, 200, 255)


class PhotographPanel:
    """Which photograph is looked at, and how it is compared; empty where there is none.

    Args:
        server: viser's.
        photographs: in the order in which they are stepped through.
        number: of the photograph that the page opens at.
        bounds: of the scene.
        lens: is set to what a photograph was taken through.
        asked: called when anything is changed.
    """

    def __init__(
        self,
        server: Any,
        photographs: Sequence[Photograph],
        number: int,
        bounds: SceneBounds,
        lens: LensPanel,
        asked: Callable[[], None],
    ) -> None:
        self._lens = lens
        self._photographs, self._bounds, self._asked = photographs, bounds, asked
        self._number = number
        if photographs:
            self._frusta = [self._frustum(server.scene, k) for k in range(len(photographs))]
            with server.gui.add_folder("photographs"):
                self._fill(server.gui)

    @property
    def chosen(self) -> Photograph | None:
        """The photograph that was jumped to last; None where there is none."""
        return self._photographs[self._number] if self._photographs else None

    @property
    def comparison(self) -> Comparison:
        """How it is compared."""
        how = self._how.value if self._photographs else "off"
        return how if how in COMPARISONS else "off"

    @property
    def share(self) -> float:
        """Of the photograph in the comparison, 0 to 1."""
        return float(np.clip(np.nan_to_num(self._share.value), 0, 1))

    def _fill(self, gui: Any) -> None:
        """Put everything into the panel."""
        count = len(self._photographs)
        self._name = gui.add_markdown(markdown_of(self._photographs[self._number].name))
        step = gui.add_button_group("photograph", ("previous", "go", "next"))
        self._how = gui.add_dropdown(
            "compare",
            COMPARISONS,
            initial_value="off",
            hint="with the photograph, where the camera stands where it was taken",
        )
        self._share = gui.add_slider("share", min=0.0, max=1.0, step=0.01, initial_value=0.5)
        shown = gui.add_checkbox("cameras", initial_value=True)

        async def on_step(event: Any) -> None:
            way = {"previous": -1, "next": 1}.get(event.target.value, 0)
            if event.client is not None:
                self.jump(event.client, (self._number + way) % count)

        async def on_change(_: Any) -> None:
            self._asked()

        async def on_shown(_: Any) -> None:
            for frustum in self._frusta:
                frustum.visible = bool(shown.value)

        step.on_click(on_step)
        self._how.on_update(on_change)
        self._share.on_update(on_change)
        shown.on_update(on_shown)

    def jump(self, client: Any, number: int) -> None:
        """Stand where a photograph was taken."""
        self._frusta[self._number].color = _COLOR
        self._frusta[number].color = _CHOSEN
        self._number = number
        self._name.content = markdown_of(self._photographs[number].name)
        aspect = client.camera.aspect
        camera, bounds = self._photographs[number].camera, self._bounds
        go(client, standpoint_of(camera, bounds.center, bounds.up, aspect))
        self._lens.take(camera.aperture)
        self._asked()

    def _frustum(self, scene: Any, number: int) -> Any:
        """Draw the camera of a photograph; a click on it jumps there."""
        camera = self._photographs[number].camera
        fy = camera.intrinsics[1]
        drawn = scene.add_camera_frustum(
            f"/photographs/{number}",
            fov=2 * math.atan(camera.height / 2 / fy),
            aspect=camera.width / camera.height,
            scale=_SCALE * (self._bounds.distance or self._bounds.radius),
            thickness=1.5,
            thickness_units="screen",
            color=_COLOR,
            wxyz=wxyz_of(camera),
            position=tuple(camera.center.tolist()),
        )

        async def on_click(event: Any) -> None:
            self.jump(event.client, number)

        drawn.on_click(on_click)
        return drawn
