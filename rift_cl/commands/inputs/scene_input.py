"""Which scene a command takes, and how its splats are drawn."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from tyro.conf import Positional

if TYPE_CHECKING:
    from rift_cl.commands.inputs.opened_scene import OpenedScene


@dataclass(frozen=True)
class SceneInput:
    """Where a scene is and how it is drawn."""

    scene: Annotated[Path, Positional]
    """A .ply or .splat file, or the folder of a 'rift fit'."""
    eps2d: float | None = None
    """Variance that splats gain on the screen, in square pixels; that of the fit, or 0.3, when not
    given."""
    background: tuple[float, float, float] | None = None
    """Red, green and blue behind the splats in display light, 0 to 1; that of the fit, or black,
    when not given."""
    device: str | None = None
    """Device to use: its number, cpu, gpu, or a part of its name; see 'rift devices'."""

    def open_scene(self, *, densities: bool = False) -> OpenedScene:
        """Read the scene.

        Args:
            densities: whether it may be one of X-rays.

        Raises:
            RiftError: there is none, it is damaged, or a number makes no sense.
        """
        from rift_cl.commands.inputs.opened_scene import OpenedScene

        return OpenedScene(self, densities=densities)
