"""What ``rift eval`` takes."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

from tyro.conf import Positional

from rift_cl.commands.inputs.scene_input import SceneInput


@dataclass(frozen=True)
class EvalSettings(SceneInput):
    """Score a scene on held-out photographs, or on other captures of it.

    Example: rift eval fit --out scores
    """

    captures: Annotated[tuple[Path, ...], Positional] = ()
    """Captures to score: each a transforms.json, a folder with one, or a COLMAP model; the
    photographs that the fit held out when not given."""
    out: Path = Path("rift-eval")
    """Folder for report.html, config.json and metrics.json."""
    train: Path | None = None
    """The capture that was trained on: for the scores of its nearest pictures, and the angles;
    what the fit was trained on when not given."""
    photographs: Path | None = None
    """Folder of the fit's own photographs, if they have moved."""
    hold_out: int = 0
    """Score every so many-th photograph of each capture, and take those of --train for unseen, as
    'rift fit' does; 0 scores all of them."""
    downscale: int | None = None
    """Whole factor by which photographs are made smaller; that of the fit, or 1, when not given."""
    overwrite: bool = False
    """Replace an earlier evaluation in the same folder."""
    dry_run: bool = False
    """Say what would be done, and stop."""
