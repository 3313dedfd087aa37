"""The fits that the figures share: each in a folder of its own, gone on with where it was."""

from __future__ import annotations

import json
import sys
from dataclasses import dataclass
from typing import Any

from paper.plan import EPS2D, PRESET, Plan
from paper.view_choice import choose_views, fixed_views, write_capture
from rift_cl.commands.fit_photos.job import Fit
from rift_cl.commands.fit_photos.settings import FitPhotosSettings
from rift_cl.commands.progress_bar import show_progress

# The sets of pictures that are scored, in the order in which a fit gets them.
HELD_OUT, FIXED, OFF_PATH = "held_out", "fixed", "off_path"
SETS = {
    HELD_OUT: "every 8th of the chosen views (the paper's split)",
    FIXED: "every 8th view of the whole ring (fixed)",
    OFF_PATH: "off the ring (fixed)",
}


@dataclass(frozen=True)
class Fitted:
    """A finished fit.

    Args:
        count: of the views that were chosen, those held out included.
        settings: of the fit.
        metrics: as the fit wrote them.
    """

    count: int
    settings: FitPhotosSettings
    metrics: dict[str, Any]

    def scores(self, name: str) -> dict[str, float]:
        """Mean scores of one of ``SETS``."""
        return dict(self._of("scores", name))

    def views(self, name: str) -> list[dict[str, Any]]:
        """Scores of every picture of one of ``SETS``."""
        return list(self._of("views", name))

    def _of(self, kind: str, name: str) -> Any:
        return self.metrics[kind][dict(zip(SETS, self.settings.test, strict=True))[name].name]


def fit_settings(
    plan: Plan,
    count: int,
    *,
    exponent: float = 0.0,
    seed: int,
    noise: float = 0.0,
    preset: str = PRESET,
) -> FitPhotosSettings:
    """The settings of a fit to some of the ring's views; writes the captures it wants.

    Only what is trained on is noisy.
    """
    captures, total = plan.captures, fixed_views(plan.captures)
    choice = choose_views(count, *total)
    fits = plan.out / "fits" / ("full" if plan.full else "quick")
    place = fits / f"views_{count}"
    ring = captures.ring
    test = captures.test or write_capture(ring, choice.fixed, fits / FIXED)
    held_out = write_capture(ring, choice.held_out, place / HELD_OUT)
    noisy = f"_noise_{noise:g}" if noise else ""
    name = f"fit_{plan.steps}_steps_{plan.splats}_splats_ramp_{exponent:g}_seed_{seed}{noisy}"
    return FitPhotosSettings.of(
        capture=write_capture(ring, choice.trained, place / f"trained{noisy}", noise=noise),
        preset=preset,
        test=(held_out, test, captures.off_path),
        out=place / name,
        steps=plan.steps,
        splats=plan.splats,
        seed=seed,
        homogenise=exponent,
        eps2d=EPS2D,
        hold_out=0,
        resume=True,
        device=plan.device,
    )


def fitted(
    plan: Plan, count: int, *, exponent: float = 0.0, seed: int | None = None, noise: float = 0.0
) -> Fitted:
    """A fit that is done, now or by an earlier run."""
    seed = plan.seeds[0] if seed is None else seed
    settings = fit_settings(plan, count, exponent=exponent, seed=seed, noise=noise)
    if not _complete(settings):
        print(f"{count} views, {settings.out.name} ...", file=sys.stderr)
        show_progress(Fit(settings).run(), quiet=False)
    metrics = json.loads((settings.out / "metrics.json").read_text(encoding="utf-8"))
    return Fitted(count, settings, metrics)


def _complete(settings: FitPhotosSettings) -> bool:
    """Whether a fit with these settings is finished in its folder."""
    try:
        config = json.loads((settings.out / "config.json").read_text(encoding="utf-8"))
        return bool(config["complete"])
    except (OSError, ValueError, LookupError):
        return False
