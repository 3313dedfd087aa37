"""Which settings of ``rift fit photos`` serve: one change at a time, several captures and seeds.

    python tools/search_defaults.py capture/ornament capture/lego --steps 500 --out search
    python tools/search_defaults.py capture/ornament --variants 0.1 defaults --seeds 0 1 2
    python tools/search_defaults.py --out search --markdown docs/benchmarks/defaults.md

Every eighth view of a capture is held out and scored; views that a final judgement is to be made on
must not be among them, so give captures without those. Each fit leaves its scores in --out, and
a search that is stopped goes on where it was; without captures nothing is fitted. The tables are of
all fits in --out: the mean PSNR of the held-out views, its spread over the seeds, the gain over the
defaults of 0.1.0, and processor seconds, of all variants that were tried, the losing ones too.
"""

from __future__ import annotations

import json
import sys
import time
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from statistics import mean
from typing import Annotated, Any

import tyro
from tyro.conf import Positional

import rift_cl as rift
from bench.command import say
from bench.surroundings import in_words, surroundings
from bench.table import NONE, Table, markdown_lines, show
from rift_cl.commands.fit_photos.presets import PRESETS
from rift_cl.commands.fit_photos.settings import FitPhotosSettings
from rift_cl.commands.run_folder.saved_settings import options_of
from rift_cl.io import write_text

Settings = Mapping[str, Any]
# What all gains are over.
BASE = "0.1"
_USUAL = {
    option.name: option.value for option in options_of(FitPhotosSettings.of(Path("x"), Path("y")))
}
_MEANS = "learning_rates.means"
_SHAPES = ("learning_rates.log_scales", "learning_rates.quats")
_SCALES = "strategy.scale_penalty"
# The default strategy of before, which finds what it relocates by opacity.
_MCMC = {"strategy": "mcmc"}


def times(factor: float, *names: str, of: Settings | None = None) -> Settings:
    """Settings in which some values are larger by a factor than in others, or by default."""
    begun = {} if of is None else dict(of)
    return {**begun, **{name: factor * begun.get(name, _USUAL[name]) for name in names}}


_MOVES = (_MEANS, *_SHAPES)
_LOBES = PRESETS["lobes"]
VARIANTS: dict[str, Settings] = {
    BASE: PRESETS["0.1"],
    "defaults": {},
    "moves x 2": times(2, *_MOVES),
    "moves / 2": times(0.5, *_MOVES),
    "scales and rotations x 2": times(2, *_SHAPES),
    "scales and rotations / 2": times(0.5, *_SHAPES),
    "positions x 2": times(2, _MEANS),
    "positions / 2": times(0.5, _MEANS),
    "positions as in short runs": {f"{_MEANS}_steps": 0},
    "shapes fall": {"learning_rates.shapes_last": 0.25},
    "no ramp": {"homogenise": 0.0},
    "linear light": {"light": "linear"},
    "surface": PRESETS["surface"],
    "full size": {"octaves": 0},
    "full size earlier": {"octaves.last": 0.2},
    "mcmc": _MCMC,
    "walk": {**_MCMC, "strategy.noise": 5e5},
    "walk / 10": {**_MCMC, "strategy.noise": 5e4},
    "harmonics as in 0.1": {"sh_every": 1 / 6, "learning_rates.sh_rest": 0.2},
    "colours x 2": times(2, "learning_rates.sh"),
    "colours / 2": times(0.5, "learning_rates.sh"),
    "logits x 2": times(2, "learning_rates.logits"),
    "logits / 2": times(0.5, "learning_rates.logits"),
    "scales penalised x 2": times(2, _SCALES),
    "scales penalised / 2": times(0.5, _SCALES),
    "opacities penalised": {"strategy.opacity_penalty": 0.01},
    "cooldown 0.25": {"cooldown": 0.25},
    "relocations / 2": {"strategy.first": 200, "strategy.every": 100, "strategy.relocations": 25},
    **{
        f"contribution {first:g} to {last:g}": {
            "strategy.min_contribution": first,
            "strategy.min_contribution_last": last,
        }
        for first, last in (
            (0.05, 0.05),
            (0.1, 0.1),
            (0.2, 0.2),
            (0.2, 0.1),
            (0.2, 0.05),
            (0.2, 0.0),
            (0.3, 0.05),
            (0.4, 0.1),
            (0.4, 0.0),
        )
    },
    "lobes": _LOBES,
    "lobes, mcmc": {**_LOBES, **_MCMC},
    "lobes, moves x 2": times(2, *_MOVES, of=_LOBES),
    "lobes, moves / 2": times(0.5, *_MOVES, of=_LOBES),
    "lobes, scales and rotations / 2": times(0.5, *_SHAPES, of=_LOBES),
    "lobes, positions / 2": times(0.5, _MEANS, of=_LOBES),
    "lobes, shapes fall": {**_LOBES, "learning_rates.shapes_last": 0.25},
    "lobes, learned x 2": times(2, "learning_rates.lobes", of=_LOBES),
    "lobes, learned / 2": times(0.5, "learning_rates.lobes", of=_LOBES),
    "4 lobes": {**_LOBES, "modes": 4},
}


@dataclass(frozen=True)
class Options:
    """Compare settings of fits to photographs.

    Args:
        captures: what is fitted, as ``rift fit photos`` takes it; nothing if not given.
        steps: of each fit.
        splats: of each fit.
        downscale: of the photographs.
        eps2d: variance that the rasterizer adds, in square pixels.
        seeds: of each variant.
        variants: by name; all if not given.
        out: folder for the scores.
        markdown: file for the tables.
        device: which OpenCL device, as RIFT_DEVICE selects it.
    """

    captures: Annotated[tuple[Path, ...], Positional] = ()
    steps: int = 500
    splats: int = 8000
    downscale: int = 1
    eps2d: float = 0.1
    seeds: tuple[int, ...] = (0,)
    variants: tuple[str, ...] = tuple(VARIANTS)
    out: Path = Path("rift-search")
    markdown: Path | None = None
    device: str | None = None


@dataclass(frozen=True)
class Size:
    """How large fits are that compare.

    Args:
        steps: of a fit.
        splats: of a fit.
        downscale: of the photographs.
        eps2d: variance that the rasterizer adds, in square pixels.
    """

    steps: int
    splats: int
    downscale: int
    eps2d: float

    @property
    def title(self) -> str:
        """How tables call it."""
        smaller = f", photographs / {self.downscale}" if self.downscale > 1 else ""
        return f"{self.steps} steps, {self.splats} splats{smaller}"


@dataclass(frozen=True)
class Scores:
    """A fit of the search, and what it gave.

    Args:
        variant: name of its settings.
        capture: name of what was fitted.
        seed: its seed.
        size: how large it is.
        psnr: mean of the held-out views, dB.
        ssim: mean of the held-out views.
        cpu_s: processor seconds of all threads.
    """

    variant: str
    capture: str
    seed: int
    size: Size
    psnr: float
    ssim: float
    cpu_s: float

    @classmethod
    def read(cls, path: Path) -> Scores:
        """From a file of the search's folder."""
        record = json.loads(path.read_text(encoding="utf-8"))
        return cls(**{**record, "size": Size(**record["size"])})


def search(options: Options) -> None:
    """Fit what was not fitted before: every variant once, before any has another seed."""
    size = Size(options.steps, options.splats, options.downscale, options.eps2d)
    options.out.mkdir(parents=True, exist_ok=True)
    for seed in options.seeds:
        for capture in options.captures:
            for variant in options.variants:
                given = f"{size.steps}-{size.splats}-{size.downscale}-{size.eps2d:g}"
                name = f"{capture.name}-{given}-{variant}-{seed}".replace(" ", "_")
                path = options.out / f"{name.replace('/', 'over')}.json"
                if not path.is_file():
                    say(name)
                    found = _fitted(capture, variant, seed, size, options.device)
                    write_text(path, json.dumps(asdict(found), indent=1) + "\n")


def _fitted(capture: Path, variant: str, seed: int, size: Size, device: str | None) -> Scores:
    began = time.process_time()
    fitted = rift.fit(
        capture,
        kind="photos",
        hold_out=8,
        seed=seed,
        device=device,
        **asdict(size),
        **VARIANTS[variant],
    )
    took = time.process_time() - began
    scores = fitted.metrics["scores"]["held out"]
    name = capture.name
    return Scores(variant, name, seed, size, scores["fit_psnr"], scores["fit_ssim"], took)


def tables(found: Sequence[Scores]) -> Iterator[Table]:
    """A table for each size, with a row for each variant, and one of what the variants are."""
    names = [name for name in VARIANTS if any(fit.variant == name for fit in found)]
    for size in sorted({fit.size for fit in found}, key=lambda size: (size.splats, size.steps)):
        fits = [fit for fit in found if fit.size == size]
        captures = sorted({fit.capture for fit in fits})
        rows = [
            (name, *(_cell(fits, name, capture) for capture in captures))
            for name in names
            if any(fit.variant == name for fit in fits)
        ]
        yield Table(size.title, ("variant", *captures), rows, (_NOTE,))
    rows = [(name, _words(VARIANTS[name])) for name in names]
    yield Table("What the variants change", ("variant", "in place of the defaults"), rows, texts=2)


_NOTE = (
    "Mean PSNR of held-out views in dB (and half the spread over seeds, if there are several); its "
    f"gain over {BASE} with the same seeds; processor seconds."
)


def _cell(fits: Sequence[Scores], variant: str, capture: str) -> str:
    ours = {fit.seed: fit for fit in fits if (fit.variant, fit.capture) == (variant, capture)}
    base = {fit.seed: fit for fit in fits if (fit.variant, fit.capture) == (BASE, capture)}
    if not ours:
        return NONE
    psnr = [fit.psnr for fit in ours.values()]
    spread = f" ± {(max(psnr) - min(psnr)) / 2:.2f}" if len(psnr) > 1 else ""
    gains = [fit.psnr - base[seed].psnr for seed, fit in ours.items() if seed in base]
    gain = f" ({mean(gains):+.2f})" if gains and variant != BASE else ""
    return f"{mean(psnr):.2f}{spread}{gain}, {mean(fit.cpu_s for fit in ours.values()):.0f} s"


def _words(settings: Settings) -> str:
    """Options as a command line takes them."""
    return " ".join(
        f"`--{name.replace('_', '-')} {value:.4g}`"
        if isinstance(value, float)
        else f"`--{name.replace('_', '-')} {value}`"
        for name, value in settings.items()
    )


def page(found: Sequence[Scores], device: rift.Device) -> str:
    """The tables as a page, with the device named."""
    lines = [
        "<!-- Generated by tools/search_defaults.py; do not edit. -->",
        "# Defaults of `rift fit photos`",
        "",
        "    python tools/search_defaults.py CAPTURES --steps 3000 --splats 20000 --out search",
        "    python tools/search_defaults.py --out search --markdown docs/benchmarks/defaults.md",
        "",
        f"{in_words(surroundings(device))} Other programs ran on the same machine: processor "
        "seconds say less than scores.",
    ]
    return "\n".join([*lines, *markdown_lines(tables(found))]) + "\n"


def main() -> int:
    """Search with the command line's arguments; the exit status."""
    options = tyro.cli(Options)
    unknown = [name for name in options.variants if name not in VARIANTS]
    if unknown:
        say(f"search_defaults: there is no variant {unknown[0]!r}; there are {', '.join(VARIANTS)}")
        return 2
    try:
        search(options)
    except rift.RiftError as error:
        say(f"search_defaults: {error}")
        return error.exit_status
    finally:
        found = [Scores.read(path) for path in sorted(options.out.glob("*.json"))]
        if found:
            show(tables(found))
    if options.markdown is not None:
        write_text(options.markdown, page(found, rift.open_device(options.device)))
    return 0


if __name__ == "__main__":
    sys.exit(main())
