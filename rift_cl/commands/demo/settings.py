"""What ``rift demo`` takes."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path


@dataclass(frozen=True)
class DemoSettings:
    """Reconstruct a phantom and fit splats to two small sample captures.

    Example: rift demo --size 256 --views 8 32 128
    """

    out: Path = Path("rift-demo")
    """Folder for the pictures, report.html, config.json, metrics.json, the fits in ornament/ and
    wall/, and a film of the wall in film/."""
    size: int = 512
    """Samples along each side of the slice."""
    views: tuple[int, ...] = (2, 12, 24, 95, 512)
    """Numbers of views; the default is that of the paper's Figure 5."""
    steps: int = 1500
    """Pictures that the fit of the ornament looks at, one after the other, and a third of that for
    the wall; 0 for no fits."""
    splats: int = 4000
    """Most splats of a fit."""
    device: str | None = None
    """Device to use: its number, cpu, gpu, or a part of its name; see 'rift devices'."""
