"""What ``rift view`` takes."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

from rift_cl.commands.inputs.orbit_input import OrbitInput


@dataclass(frozen=True)
class ViewSettings(OrbitInput):
    """Show a scene in a web browser on this computer, until Ctrl-C.

    Example: rift view fit --port 8080 --size 1200
    """

    port: int = 8080
    """Port to listen on, at 127.0.0.1 alone; 0 for any that is free."""
    moving: Literal["browser", "rift"] = "browser"
    """Who draws while the camera moves: the browser, where it can (splats without modes or lobes,
    one colour each), or rift, as it does when the camera rests, in smaller pictures."""
    size: int = 960
    """Longer edge of a picture in pixels, once the camera rests."""
