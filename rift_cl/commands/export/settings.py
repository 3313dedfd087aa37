"""The settings of ``rift export``."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import ClassVar, Literal

from rift_cl.commands.inputs.orbit_input import OrbitInput
from rift_cl.commands.options import RunOptions
from rift_cl.option_marks import Auto

Target = Literal["html", "ply", "compressed-ply", "spz", "sog", "glb", "stl", "obj"]


@dataclass(frozen=True, kw_only=True)
class ExportOutput:
    """The file."""

    group: ClassVar[str] = "output"

    to: Auto[Target] = None
    """File format: a web page (html), splats (ply, compressed-ply, spz, sog, glb), or with --mesh
    triangles (ply, stl, obj, glb). Default: by the extension of --out; html, or with --mesh ply,
    where there is none."""
    out: Auto[Path] = None
    """File to write. Default: the scene's name with the extension of the format, in the current
    folder."""
    scale: float = 1.0
    """Factor by which every length of the scene is multiplied, such as the metres in one of its
    units for glTF, or the millimetres for a printer."""


@dataclass(frozen=True, kw_only=True)
class MeshOptions:
    """Surfaces, by marching cubes."""

    group: ClassVar[str] = "mesh"

    mesh: bool = False
    """Export a surface as triangles: of an X-ray scene's density, or of a scene of photographs from
    the depth of its splats as its cameras see them."""
    level: Auto[float] = None
    """With --mesh of an X-ray scene: density of the surface, per unit of length. Default: Otsu's
    threshold."""
    voxels: int = 256
    """With --mesh: number of voxels along the longest edge of the grid that is searched for the
    surface."""


@dataclass(frozen=True)
class ExportSettings(RunOptions, MeshOptions, ExportOutput, OrbitInput):
    """Write a scene as a web page, as splats or as a mesh for other software.

    Example: rift export fit --to spz --out scene.spz
    """
