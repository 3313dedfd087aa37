"""Do verdicts of ``rift analyze`` on photographs hold? Each against the error of held-out views.

    python tools/check_verdicts.py FIT [FIT ...] [--json FILE]

A fit's folder says which photographs were trained on and how well each held-out one is predicted.
What the analyzer would say of each of those from the trained views alone is set beside its error,
and the rank correlation (Spearman) is printed for every scene: nan where it says much the same of
all its views. A verdict that says nothing of the
errors, or the opposite, is withheld (``HELD`` in ``rift_cl.commands.analyze.verdicts``).
"""

from __future__ import annotations

import json
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import tyro
from numpy.typing import NDArray
from scipy.stats import spearmanr
from tyro.conf import Positional

from rift_cl.commands.analyze.input import open_sampled
from rift_cl.commands.analyze.settings import AnalyzeSettings
from rift_cl.commands.analyze.verdicts import HELD, foretold
from rift_cl.commands.cameras.fit_cameras import open_fit_cameras

# A verdict holds where its worst scene has this rank correlation at least; a scene in which it says
# much the same of all views, with a spread below this share of its mean, tells nothing of it.
_HOLDS, _SPREAD = 0.3, 0.1


@dataclass(frozen=True)
class Asked:
    """What is checked."""

    fits: Positional[tuple[Path, ...]]
    """Folders of 'rift fit' on photographs, with views held out (--hold-out 3)."""
    json: Path | None = None
    """File for the figures."""


def check(fit: Path) -> tuple[int, dict[str, float]]:
    """How many views of a fit were held out, and the rank correlation of each verdict.

    Args:
        fit: a folder of ``rift fit``, with views held out.
    """
    found = open_fit_cameras(fit)
    if found is None or not found.test_views:
        raise SystemExit(f"{fit}: no fit with views that were held out")
    scores = json.loads((fit / "metrics.json").read_text())["views"]["held out"]
    error = {row["name"]: -row["fit_psnr"] for row in scores}
    sampled = open_sampled(AnalyzeSettings(fit))
    trained = replace(sampled, cameras=tuple(view.camera for view in found.training_views))
    cameras = [view.camera for view in found.test_views]
    errors = [error[view.name] for view in found.test_views]
    rows = foretold(trained, cameras)
    return len(cameras), {name: _rank(values, errors) for name, values in rows.items()}


def _rank(values: NDArray[np.float64], errors: list[float]) -> float:
    """Spearman's correlation; NaN where a verdict says much the same of all views."""
    if np.std(values) < _SPREAD * abs(np.mean(values)):
        return float("nan")
    return float(spearmanr(values, errors).statistic)


def main(asked: Asked) -> None:
    """Print the table."""
    found = {str(fit): check(fit) for fit in asked.fits}
    names = list(next(iter(found.values()))[1])
    print(f"{'fit':20} {'held out':>8} " + " ".join(f"{name:>9}" for name in names))
    for fit, (count, row) in found.items():
        shown = " ".join(f"{row[name]:9.2f}" for name in names)
        print(f"{Path(fit).name:20} {count:8} {shown}")
    for name in names:
        ranks = [row[name] for _, row in found.values() if not np.isnan(row[name])]
        worst = min(ranks, default=float("nan"))
        holds = "holds" if worst >= _HOLDS else "does not hold"
        told = "said" if name in HELD else "not said"
        print(f"{name}: {holds} (least {worst:.2f} of {len(ranks)}); {told}")
    if asked.json is not None:
        figures = {fit: {"held_out": count, **row} for fit, (count, row) in found.items()}
        asked.json.write_text(json.dumps(figures, indent=1))


if __name__ == "__main__":
    main(tyro.cli(Asked, description=__doc__))
