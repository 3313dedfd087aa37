"""What ``rift export`` takes."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Literal

from rift_cl.commands.inputs.orbit_input import OrbitInput

Target = Literal["html", "ply", "compressed-ply", "spz", "sog", "glb", "stl", "obj"]


@dataclass(frozen=True)
class ExportSettings(OrbitInput):
    """Write a scene as a web page, as splats or as a mesh for other software.

    Example: rift export fit --to spz --out scene.spz
    """

    to: Target | None = None
    """File format: a page for any browser (html, when not given), splats (ply, compressed-ply,
    spz, sog, glb), or with --mesh triangles (ply, when not given, stl, obj, glb)."""
    out: Path | None = None
    """File to write; the scene's name with the format's ending, in the current folder, when not
    given."""
    mesh: bool = False
    """X-rays: the surface of one density as triangles, by marching cubes."""
    level: float | None = None
    """With --mesh: the density of the surface, per unit of length; that which parts inside and
    outside best (Otsu's threshold) when not given."""
    voxels: int = 256
    """With --mesh: voxels along the longest edge, in which the surface is looked for."""
    overwrite: bool = False
    """Replace a file that is there."""
    dry_run: bool = False
    """Say what would be written and what would be lost, and stop."""
