"""The panel of what is shown and from where: colour or depth, size, reset, up, statistics."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from rift_cl.commands.view.markdown import markdown_of
from rift_cl.commands.view.standpoint import Standpoint
from rift_cl.commands.view.viser_camera import go, pose_of
from rift_cl.commands.view.wish import Kind

_DRAWN_BY = ("browser", "rift")
_RESET, _UPRIGHT = "reset view", "set up"
_SMALLEST, _LARGEST, _USUAL = 64, 4096, 2048


class ViewPanel:
    """What is shown, and from where.

    Args:
        server: viser's.
        size: longer edge of a picture in pixels to begin with.
        first: the standpoint that 'reset view' returns to.
        asked: called when anything is changed.
        moving: whether a browser can draw while its camera moves.
        kinds: of pictures that can be asked for, the first one to begin with.
    """

    def __init__(
        self,
        server: Any,
        size: int,
        first: Standpoint,
        asked: Callable[[], None],
        *,
        moving: bool,
        kinds: Sequence[Kind],
    ) -> None:
        self._server, self._first, self._kinds = server, first, kinds
        gui = server.gui
        self._kind = gui.add_dropdown("show", kinds, initial_value=kinds[0], visible=len(kinds) > 1)
        self._size = gui.add_slider(
            "size",
            min=_SMALLEST,
            max=max(_USUAL, size),
            step=1,
            initial_value=size,
            hint="longer edge of a picture in pixels, once the camera rests",
        )
        self._drawn_by = gui.add_dropdown(
            "moving",
            _DRAWN_BY,
            initial_value=_DRAWN_BY[0] if moving else _DRAWN_BY[1],
            visible=moving,
            hint="while the camera moves, the browser draws splats of one colour each; rift draws "
            "them as they were fitted, colours by direction and all, as it does at rest",
        )
        where = gui.add_button_group(
            "camera",
            (_RESET, _UPRIGHT),
            hint="go back to where the page began; take what is up in the window for up from now "
            "on, and turn about it",
        )
        self._up = gui.add_markdown("", visible=False)
        self._facts = gui.add_markdown("")

        async def on_change(_: Any) -> None:
            asked()

        async def on_where(event: Any) -> None:
            if event.client is None:
                return
            if event.target.value == _RESET:
                go(event.client, self._first)
            else:
                self._set_up(event.client)

        self._kind.on_update(on_change)
        self._size.on_update(on_change)
        where.on_click(on_where)

    @property
    def kind(self) -> Kind:
        """Which of the kinds is to be shown."""
        kind = self._kind.value
        return kind if kind in self._kinds else self._kinds[0]

    @property
    def browser_draws(self) -> bool:
        """Whether the browser draws while the camera moves."""
        return bool(self._drawn_by.value == _DRAWN_BY[0])

    @property
    def size(self) -> int:
        """Longer edge in pixels that is asked for."""
        return int(np.clip(self._size.value, _SMALLEST, _LARGEST))

    def tell(self, facts: str) -> None:
        """What the panel says about the last picture, in plain lines."""
        self._facts.content = markdown_of(facts)

    def _set_up(self, client: Any) -> None:
        """Take the page's own upright for the scene's."""
        pose = pose_of(client.camera)
        if pose is None:
            return
        up = -pose.camera(_SMALLEST).view[1, :3]
        self._server.scene.set_up_direction(tuple(up.tolist()))
        client.camera.up_direction = up
        self._up.content = markdown_of("--up " + " ".join(f"{part:.4f}" for part in up))
        self._up.visible = True
