"""The settings of ``rift demo``."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import ClassVar

from rift_cl.commands.options import DeviceOption


@dataclass(frozen=True, kw_only=True)
class DemoOptions:
    """The sizes of the demonstration."""

    group: ClassVar[str] = "demo"

    out: Path = Path("rift-demo")
    """Folder for the pictures, report.html, config.json, metrics.json, the fits (ornament/, wall/)
    and a film of the wall (film/); an earlier demo in it is replaced."""
    size: int = 512
    """Samples along each side of the reconstructed slice."""
    views: tuple[int, ...] = (2, 12, 24, 95, 512)
    """Numbers of views to reconstruct from; the default is that of the paper's Figure 5."""
    steps: int = 1500
    """Number of optimization steps of the ornament's fit (one training image each); a third of it
    for the wall (0 = no fits)."""
    splats: int = 4000
    """Maximum number of splats of each fit."""


@dataclass(frozen=True)
class DemoSettings(DeviceOption, DemoOptions):
    """Reconstruct a phantom and fit splats to two small sample captures.

    Example: rift demo --size 256 --views 8 32 128
    """
