"""The scene that a command takes, and how its splats are rendered."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, ClassVar

from tyro.conf import Positional

from rift_cl.option_marks import Auto

if TYPE_CHECKING:
    from rift_cl.commands.inputs.opened_scene import OpenedScene


@dataclass(frozen=True)
class SceneInput:
    """The scene, and how its splats are rendered."""

    group: ClassVar[str] = "input"

    scene: Annotated[Path, Positional]
    """A .ply, .spz or .splat file, or the folder of a 'rift fit'."""
    eps2d: Auto[float] = None
    """Variance added to every splat on the screen, in square pixels. Default: what the file
    says, as 0 for X-rays whose splats hold it already; otherwise that of the fit, or 0.3 for a
    file."""
    background: Auto[tuple[float, float, float]] = None
    """Background colour: red, green and blue in display light, 0 to 1. Default: that of the fit, or
    black for a file."""

    environment: Auto[Path] = None
    """Picture of a light that replaces the one a fit with --environment shared found: all
    directions in equirectangular projection, z at the top, x in the middle; OpenEXR or HDR in
    linear light, other formats in display light. Default: the fit's own light."""

    def open_scene(self, *, densities: bool = False) -> OpenedScene:
        """Read the scene.

        Args:
            densities: whether X-ray scenes are accepted.

        Raises:
            RiftError: there is none, it is damaged, or a number is out of range.
        """
        # Imported when used, so that a command's help loads no reader.
        from rift_cl.commands.inputs.opened_scene import OpenedScene

        return OpenedScene(self, densities=densities)
