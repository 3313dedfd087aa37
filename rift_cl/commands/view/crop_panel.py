"""The panel of the box outside of which splats are not shown."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from rift_cl.commands.inputs.scene_bounds import SceneBounds
from rift_cl.commands.view.crop import Crop

# The box may reach so far from the scene's middle, in its radii, and is set in so many steps.
_REACH, _STEPS = 3.0, 600
_COLOR = (60, 200, 255)


class CropPanel:
    """A box by its least and largest x, y and z.

    Args:
        server: viser's.
        bounds: of the scene.
        asked: called when anything is changed.
    """

    def __init__(self, server: Any, bounds: SceneBounds, asked: Callable[[], None]) -> None:
        self._scene, self._asked = server.scene, asked
        self._box: Any = None
        with server.gui.add_folder("crop box", expand_by_default=False):
            self._on = server.gui.add_checkbox("crop", initial_value=False)
            self._sides = [
                self._side(server.gui, axis, float(middle), bounds.radius)
                for axis, middle in zip("xyz", bounds.center, strict=True)
            ]

        async def on_change(_: Any) -> None:
            self._draw()
            self._asked()

        for handle in (self._on, *self._sides):
            handle.on_update(on_change)

    @property
    def box(self) -> Crop | None:
        """The box; None where nothing is cropped."""
        if not self._on.value:
            return None
        pairs = [sorted(side.value) for side in self._sides]
        # A page may say anything.
        if any(len(pair) != 2 or not np.isfinite(pair).all() for pair in pairs):
            return None
        return Crop(tuple(low for low, _ in pairs), tuple(high for _, high in pairs))

    def _side(self, gui: Any, axis: str, middle: float, radius: float) -> Any:
        """The two bounds along one axis, in scene units."""
        reach = _REACH * radius
        return gui.add_multi_slider(
            axis,
            min=middle - reach,
            max=middle + reach,
            step=2 * reach / _STEPS,
            initial_value=(middle - radius, middle + radius),
        )

    def _draw(self) -> None:
        """Draw the box where it is now."""
        box = self.box
        if self._box is not None:
            self._box.remove()
            self._box = None
        if box is not None:
            self._box = self._scene.add_line_segments(
                "/crop", box.edges(), _COLOR, thickness=1.5, thickness_units="screen"
            )
