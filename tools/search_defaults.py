"""Which settings of ``rift fit photos`` serve: one change at a time, several captures and seeds.

    python tools/search_defaults.py capture/ornament capture/lego --steps 500 --out search
    python tools/search_defaults.py capture/ornament --variants shipped found --seeds 0 1 2

Every eighth view of a capture is held out and scored; views that a final judgement is to be made on
must not be among them, so give captures without those. Each fit leaves its scores in --out, and
a search that is stopped goes on where it was. The tables give the mean PSNR of the held-out views
of each capture, its spread over the seeds, and the gain over the first variant, of all variants
that were tried, the losing ones too. Seconds are processor time.
"""

from __future__ import annotations

import json
import sys
import time
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from statistics import mean
from typing import Annotated, Any

import tyro
from tyro.conf import Positional

import rift_cl as rift
from bench.command import say
from bench.table import Table, show
from rift_cl.commands.fit_photos.presets import PRESETS
from rift_cl.io import write_text

Settings = dict[str, Any]
# The defaults of 0.1.0, whatever the package's are now.
SHIPPED: Settings = {
    "angular": "sh",
    "sh_every": 1 / 6,
    "learning_rates.means": 1.6e-4,
    "learning_rates.log_scales": 5e-3,
    "learning_rates.quats": 1e-3,
    "learning_rates.sh_rest": 0.2,
    "strategy.noise": 5e5,
    "strategy.first": 500,
    "cooldown": 0.12,
}
FOUND: Settings = dict(PRESETS["fast"])

# Rates of the default settings that a preset leaves as they are.
_RATES: Settings = {
    **FOUND,
    "learning_rates.logits": 5e-2,
    "learning_rates.sh": 2.5e-3,
    "learning_rates.lobes": 1e-2,
    "strategy.opacity_penalty": 0.01,
    "strategy.scale_penalty": 0.01,
}


def times(factor: float, *names: str, of: Settings = FOUND) -> Settings:
    """Settings in which some values are larger by a factor than those that were found."""
    return {**of, **{name: factor * {**_RATES, **of}[name] for name in names}}


_MEANS = "learning_rates.means"
_SHAPES = ("learning_rates.log_scales", "learning_rates.quats")
_PENALTIES = ("strategy.opacity_penalty", "strategy.scale_penalty")
_HARMONICS: Settings = dict(PRESETS["harmonics"])

VARIANTS: dict[str, Settings] = {
    "shipped": SHIPPED,
    "found": FOUND,
    "harmonics": _HARMONICS,
    "all x 2": times(2, _MEANS, *_SHAPES),
    "all / 2": times(0.5, _MEANS, *_SHAPES),
    "harmonics, all x 2": times(2, _MEANS, *_SHAPES, of=_HARMONICS),
    "harmonics, all / 2": times(0.5, _MEANS, *_SHAPES, of=_HARMONICS),
    "scales x 2": times(2, _SHAPES[0]),
    "scales and quaternions x 2": times(2, *_SHAPES),
    "scales and quaternions / 2": times(0.5, *_SHAPES),
    "positions x 2": times(2, _MEANS),
    "positions / 2": times(0.5, _MEANS),
    "logits x 2": times(2, "learning_rates.logits"),
    "logits / 2": times(0.5, "learning_rates.logits"),
    "colours x 2": times(2, "learning_rates.sh"),
    "colours / 2": times(0.5, "learning_rates.sh"),
    "lobes x 2": times(2, "learning_rates.lobes"),
    "lobes / 2": times(0.5, "learning_rates.lobes"),
    "4 lobes": {**FOUND, "modes": 4},
    "walk / 10": {**FOUND, "strategy.noise": 5e4},
    "cooldown 0.25": {**FOUND, "cooldown": 0.25},
    "cooldown 0.5": {**FOUND, "cooldown": 0.5},
    "penalties / 2": times(0.5, *_PENALTIES),
    "penalties x 2": times(2, *_PENALTIES),
    "relocation from 200": {**FOUND, "strategy.first": 200},
    "relocation every 50": {**FOUND, "strategy.first": 200, "strategy.every": 50},
}


@dataclass(frozen=True)
class Options:
    """Compare settings of fits to photographs.

    Args:
        captures: what is fitted, as ``rift fit photos`` takes it.
        steps: of each fit.
        splats: of each fit.
        downscale: of the photographs.
        eps2d: variance that the rasterizer adds, in square pixels.
        seeds: of each variant.
        variants: by name; all if not given.
        out: folder for the scores.
        device: which OpenCL device, as RIFT_DEVICE selects it.
    """

    captures: Annotated[tuple[Path, ...], Positional]
    steps: int = 500
    splats: int = 8000
    downscale: int = 1
    eps2d: float = 0.1
    seeds: tuple[int, ...] = (0,)
    variants: tuple[str, ...] = tuple(VARIANTS)
    out: Path = Path("rift-search")
    device: str | None = None


@dataclass(frozen=True)
class Fit:
    """A fit of the search.

    Args:
        variant: name of its settings.
        capture: what is fitted.
        seed: its seed.
    """

    variant: str
    capture: Path
    seed: int

    def scores(self, options: Options) -> dict[str, float]:
        """PSNR, SSIM and processor seconds; from the folder, if it was done before."""
        size = f"{options.steps}-{options.splats}-{options.downscale}-{options.eps2d:g}"
        name = f"{self.capture.name}-{size}-{self.variant}-{self.seed}".replace(" ", "_")
        path = options.out / f"{name.replace('/', 'over')}.json"
        if path.is_file():
            return dict(json.loads(path.read_text(encoding="utf-8")))
        say(name)
        found = self._fit(options)
        write_text(path, json.dumps(found, indent=1) + "\n")
        return found

    def _fit(self, options: Options) -> dict[str, float]:
        began = time.process_time()
        fitted = rift.fit(
            self.capture,
            kind="photos",
            hold_out=8,
            steps=options.steps,
            splats=options.splats,
            downscale=options.downscale,
            seed=self.seed,
            eps2d=options.eps2d,
            device=options.device,
            **VARIANTS[self.variant],
        )
        took = time.process_time() - began
        scores = fitted.metrics["scores"]["held out"]
        return {"psnr": scores["fit_psnr"], "ssim": scores["fit_ssim"], "cpu_s": took}


def fits(options: Options) -> Iterator[Fit]:
    """All fits, so that a search that is stopped has tried every variant as often."""
    for seed in options.seeds:
        for capture in options.captures:
            for variant in options.variants:
                yield Fit(variant, capture, seed)


def table(found: dict[Fit, dict[str, float]], options: Options) -> Table:
    """A row for each variant: mean, spread and gain by capture."""
    names = [capture.name for capture in options.captures]
    rows = []
    for variant in options.variants:
        cells = [variant]
        for capture in options.captures:
            ours = _psnr(found, variant, capture)
            first = _psnr(found, options.variants[0], capture)
            cells.append(_cell(ours, first))
        seconds = [score["cpu_s"] for fit, score in found.items() if fit.variant == variant]
        rows.append((*cells, f"{mean(seconds):.0f}" if seconds else ""))
    title = f"{options.steps} steps, {options.splats} splats, photographs / {options.downscale}"
    return Table(title, ("variant", *names, "CPU s"), rows)


def _psnr(found: dict[Fit, dict[str, float]], variant: str, capture: Path) -> list[float]:
    ours = [fit for fit in found if (fit.variant, fit.capture) == (variant, capture)]
    return [found[fit]["psnr"] for fit in ours]


def _cell(ours: Sequence[float], first: Sequence[float]) -> str:
    if not ours:
        return ""
    spread = f" ± {(max(ours) - min(ours)) / 2:.2f}" if len(ours) > 1 else ""
    both = min(len(ours), len(first))
    return f"{mean(ours):.2f}{spread} ({mean(ours[:both]) - mean(first[:both]):+.2f})"


def main() -> int:
    """Search with the command line's arguments; the exit status."""
    options = tyro.cli(Options)
    unknown = [name for name in options.variants if name not in VARIANTS]
    if unknown:
        say(f"search_defaults: there is no variant {unknown[0]!r}; there are {', '.join(VARIANTS)}")
        return 2
    found: dict[Fit, dict[str, float]] = {}
    try:
        for fit in fits(options):
            found[fit] = fit.scores(options)
    except rift.RiftError as error:
        say(f"search_defaults: {error}")
        return error.exit_status
    finally:
        if found:
            show([table(found, options)])
    return 0


if __name__ == "__main__":
    sys.exit(main())
