"""The settings of ``rift eval``."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, ClassVar

from tyro.conf import Positional, arg

from rift_cl.commands.inputs.scene_input import SceneInput
from rift_cl.commands.options import ResumableRun
from rift_cl.option_marks import Auto


@dataclass(frozen=True)
class EvalInput(SceneInput):
    """The scene, how its splats are rendered, and the photographs to score it on."""

    group: ClassVar[str] = "input"

    captures: Annotated[tuple[Path, ...], Positional, arg(help_behavior_hint="")] = ()
    """Captures to score: each a transforms.json, a folder with one, or a COLMAP model. Default: the
    photographs that the fit held out."""
    background: Auto[tuple[float, float, float]] = None
    """Background colour: red, green and blue in display light, 0 to 1. Default: that of the fit;
    for a file the colour that all borders of the photographs have, or black without one."""
    train: Auto[Path] = None
    """Capture that the scene was trained on, for the baselines (nearest training photographs) and
    the angles to them. Default: the training photographs of the fit."""
    photographs: Auto[Path] = None
    """Folder of the fit's photographs, if they were moved."""
    hold_out: int = 0
    """Score every Nth photograph of each capture, and treat those of --train as held out, as
    'rift fit' does (0 = score all)."""
    downscale: Auto[int] = None
    """Whole factor by which photographs are downscaled. Default: that of the fit, or 1."""
    flip: bool = False
    """Also score FLIP, a perceptual difference from 0 (equal) to 1. Needs flip-evaluator (pip
    install flip-evaluator)."""
    lpips: Auto[Path] = None
    """Also score LPIPS (0 is equal), with the network's weights from this file: torch.save of the
    state_dict() of lpips.LPIPS, net 'alex' or 'vgg'. Needs torch. Left out for photographs that a
    mask or a lens leaves only a part of. Default: no LPIPS."""


@dataclass(frozen=True, kw_only=True)
class EvalOutput:
    """What is written."""

    group: ClassVar[str] = "output"

    out: Path = Path("rift-eval")
    """Folder for report.html, config.json and metrics.json."""


@dataclass(frozen=True)
class EvalSettings(ResumableRun, EvalOutput, EvalInput):
    """Score a scene on held-out photographs, or on other captures of it.

    Example: rift eval fit --out scores
    """
