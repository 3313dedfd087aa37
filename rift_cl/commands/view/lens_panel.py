"""The panel of the lens that pictures are drawn through: how wide it is open, and what is sharp."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import numpy as np

from rift_cl.geometry import Aperture

# The widest opening, and the nearest and farthest focus, in distances to what is looked at; and
# how finely they are set.
_WIDEST, _NEAREST, _FARTHEST, _STEPS = 0.1, 0.1, 4.0, 400


class LensPanel:
    """The radius of the opening and the depth that is sharp, in scene units.

    Args:
        server: viser's.
        reach: distance to what is looked at, in scene units.
        aperture: that pages begin with; None for a pinhole.
        asked: called when anything is changed.
        visible: whether pages show the panel.
    """

    def __init__(
        self,
        server: Any,
        reach: float,
        aperture: Aperture | None,
        asked: Callable[[], None],
        *,
        visible: bool = True,
    ) -> None:
        self._reach = reach
        gui = server.gui
        with gui.add_folder("lens", expand_by_default=False, visible=visible):
            self._radius = gui.add_slider(
                "aperture",
                min=0.0,
                max=self._widest(aperture),
                step=_WIDEST * reach / _STEPS,
                initial_value=0.0,
                hint="radius of the opening in scene units; 0 for a pinhole, sharp at every depth",
            )
            self._focus = gui.add_slider(
                "focus",
                min=_NEAREST * reach,
                max=_FARTHEST * reach,
                step=_FARTHEST * reach / _STEPS,
                initial_value=reach,
                hint="depth that is sharp, in scene units",
            )
        self.take(aperture)

        async def on_change(_: Any) -> None:
            asked()

        self._radius.on_update(on_change)
        self._focus.on_update(on_change)

    @property
    def aperture(self) -> Aperture | None:
        """The opening; None for a pinhole."""
        radius, focus = float(self._radius.value), float(self._focus.value)
        # A page may say anything.
        if not (0 < radius < math.inf and 0 < focus < math.inf):
            return None
        return Aperture(radius, focus)

    def take(self, aperture: Aperture | None) -> None:
        """Set what a photograph was taken through."""
        if aperture is None:
            self._radius.value = 0.0
            return
        self._radius.value = min(aperture.radius, self._radius.max)
        self._focus.value = float(np.clip(aperture.focus, self._focus.min, self._focus.max))

    def _widest(self, aperture: Aperture | None) -> float:
        return max(_WIDEST * self._reach, 0.0 if aperture is None else aperture.radius)
