"""The settings of ``rift view``."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar, Literal

from rift_cl.commands.inputs.orbit_input import OrbitInput
from rift_cl.commands.options import DeviceOption


@dataclass(frozen=True, kw_only=True)
class PageOptions:
    """The page in the browser."""

    group: ClassVar[str] = "page"

    port: int = 8080
    """Port to listen on, at 127.0.0.1 only (0 = any free port)."""
    moving: Literal["browser", "rift"] = "browser"
    """What draws while the camera moves: the browser, where it can (splats of one colour each,
    without modes or lobes), or rift, at a lower resolution. At rest, rift always draws."""
    size: int = 960
    """Longer edge of the picture in pixels, while the camera is at rest."""


@dataclass(frozen=True)
class ViewSettings(DeviceOption, PageOptions, OrbitInput):
    """Show a scene in a web browser on this computer, until Ctrl-C.

    Example: rift view fit --port 8080 --size 1200
    """
