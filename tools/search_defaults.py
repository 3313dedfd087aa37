"""Which settings of ``rift fit`` serve: one change at a time, several captures and seeds.

    python tools/search_defaults.py capture/ornament capture/lego --steps 500 --out search
    python tools/search_defaults.py capture/ornament --variants 0.1 defaults --seeds 0 1 2
    python tools/search_defaults.py tooth/tooth.h5 walnut/walnut_cone.npz --kind xray --steps 500
    python tools/search_defaults.py --out search --markdown docs/benchmarks/defaults.md

Every eighth view of a capture is held out and scored; views that a final judgement is to be made on
must not be among them, so give captures without those. Each fit leaves its scores in --out, and
a search that is stopped goes on where it was; without captures nothing is fitted. The tables are of
all fits in --out: the mean PSNR of the held-out views, its spread over the seeds, the gain over the
defaults of 0.1.0 (photographs) or of today (X-rays), and processor seconds, of all variants that
were tried, the losing ones too.
"""

from __future__ import annotations

import json
import sys
import time
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from statistics import mean
from typing import Annotated, Any, Literal

import tyro
from tyro.conf import Positional

import rift_cl as rift
from bench.command import say
from bench.surroundings import in_words, surroundings
from bench.table import NONE, Table, markdown_lines, show
from rift_cl.commands.fit_photos.presets import PRESETS
from rift_cl.commands.fit_photos.settings import FitPhotosSettings
from rift_cl.commands.fit_xray.settings import FitXraySettings
from rift_cl.commands.run_folder.saved_settings import options_of
from rift_cl.io import write_text

Settings = Mapping[str, Any]
Kind = Literal["photos", "xray"]
# What all gains are over.
BASES: dict[Kind, str] = {"photos": "0.1", "xray": "defaults"}
_PHOTOS, _XRAY = (
    {option.name: option.value for option in options_of(settings.of(Path("x"), Path("y")))}
    for settings in (FitPhotosSettings, FitXraySettings)
)
_MEANS = "learning_rates.means"
_SHAPES = ("learning_rates.log_scales", "learning_rates.quats")
_SCALES = "strategy.scale_penalty"
# The default strategy of before, which finds what it relocates by opacity.
_MCMC = {"strategy": "mcmc"}


def times(
    factor: float, *names: str, of: Settings | None = None, usual: Settings = _PHOTOS
) -> Settings:
    """Settings in which some values are larger by a factor than in others, or by default."""
    begun = {} if of is None else dict(of)
    return {**begun, **{name: factor * begun.get(name, usual[name]) for name in names}}


_MOVES = (_MEANS, *_SHAPES)
_LOBES = PRESETS["lobes"]
_OF_PHOTOS: dict[str, Settings] = {
    "0.1": PRESETS["0.1"],
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
_LOGITS = "learning_rates.logits"
_OF_XRAYS: dict[str, Settings] = {
    "defaults": {},
    # Those of the search before, which found these.
    "as before": times(2, _MEANS, _LOGITS, usual=_XRAY),
    **{
        f"{name} {word}": times(factor, *changed, usual=_XRAY)
        for name, changed in (
            ("positions", (_MEANS,)),
            ("scales and rotations", _SHAPES),
            ("densities", (_LOGITS,)),
            ("all", (_MEANS, *_SHAPES, _LOGITS)),
        )
        for word, factor in (("x 2", 2), ("/ 2", 0.5))
    },
    "positions hold longer": {"learning_rates.means_last": 0.5},
    "shapes fall": {"learning_rates.shapes_last": 0.25},
    "cooldown 0.25": {"cooldown": 0.25},
    "no relocation": {"strategy.last": 0.0},
    "relocations x 2": {"strategy.every": 50},
    "min mass x 4": times(4, "strategy.min_mass", usual=_XRAY),
    "min mass / 4": times(0.25, "strategy.min_mass", usual=_XRAY),
    "ramp": {"homogenise": 1.0},
    "densities solved for": {"solve": 250},
    "hermite of order 2": {"basis": "hermite", "order": 2},
}
VARIANTS: dict[Kind, dict[str, Settings]] = {"photos": _OF_PHOTOS, "xray": _OF_XRAYS}


@dataclass(frozen=True)
class Options:
    """Compare settings of fits to photographs or to projections.

    Args:
        captures: what is fitted, as ``rift fit`` takes it; nothing if not given.
        kind: of the captures.
        steps: of each fit.
        splats: of each fit.
        downscale: of the photographs.
        eps2d: variance that the rasterizer adds, in square pixels.
        seeds: of each variant.
        variants: by name; all of the kind if not given.
        out: folder for the scores.
        markdown: file for the tables.
        device: which OpenCL device, as RIFT_DEVICE selects it.
    """

    captures: Annotated[tuple[Path, ...], Positional] = ()
    kind: Kind = "photos"
    steps: int = 500
    splats: int = 8000
    downscale: int = 1
    eps2d: float = 0.1
    seeds: tuple[int, ...] = (0,)
    variants: tuple[str, ...] = ()
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
        ssim: mean of the held-out views; None of projections.
        cpu_s: processor seconds of all threads.
        kind: of the capture.
    """

    variant: str
    capture: str
    seed: int
    size: Size
    psnr: float
    ssim: float | None
    cpu_s: float
    kind: Kind = "photos"

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
            for variant in options.variants or VARIANTS[options.kind]:
                given = f"{size.steps}-{size.splats}-{size.downscale}-{size.eps2d:g}"
                name = f"{capture.stem}-{given}-{variant}-{seed}".replace(" ", "_")
                path = options.out / f"{name.replace('/', 'over')}.json"
                if not path.is_file():
                    say(name)
                    found = _fitted(options, capture, variant, seed, size)
                    write_text(path, json.dumps(asdict(found), indent=1) + "\n")


def _fitted(options: Options, capture: Path, variant: str, seed: int, size: Size) -> Scores:
    kind = options.kind
    sizes = asdict(size)
    if kind == "xray":
        del sizes["downscale"]
    began = time.process_time()
    fitted = rift.fit(
        capture,
        kind=kind,
        hold_out=8,
        seed=seed,
        device=options.device,
        **sizes,
        **VARIANTS[kind][variant],
    )
    took = time.process_time() - began
    told = fitted.metrics["scores"]["held out"]
    name, ssim = capture.stem, told.get("fit_ssim")
    return Scores(variant, name, seed, size, told["fit_psnr"], ssim, took, kind)


def tables(found: Sequence[Scores]) -> Iterator[Table]:
    """A table for each size of each kind, and one of what the variants of each kind are."""
    for kind, variants in VARIANTS.items():
        ours = [fit for fit in found if fit.kind == kind]
        names = [name for name in variants if any(fit.variant == name for fit in ours)]
        for size in sorted({fit.size for fit in ours}, key=lambda size: (size.splats, size.steps)):
            fits = [fit for fit in ours if fit.size == size]
            captures = sorted({fit.capture for fit in fits})
            rows = [
                (name, *(_cell(fits, name, capture) for capture in captures))
                for name in names
                if any(fit.variant == name for fit in fits)
            ]
            note = _NOTE.format(BASES[kind])
            yield Table(f"{_TITLES[kind]}: {size.title}", ("variant", *captures), rows, (note,))
        if names:
            rows = [(name, _words(variants[name])) for name in names]
            title = f"{_TITLES[kind]}: what the variants change"
            yield Table(title, ("variant", "in place of the defaults"), rows, texts=2)


_TITLES: dict[Kind, str] = {"photos": "Photographs", "xray": "X-rays"}
_NOTE = (
    "Mean PSNR of held-out views in dB (and half the spread over seeds, if there are several); its "
    "gain over {} with the same seeds; processor seconds."
)


def _cell(fits: Sequence[Scores], variant: str, capture: str) -> str:
    base = BASES[fits[0].kind]
    ours = {fit.seed: fit for fit in fits if (fit.variant, fit.capture) == (variant, capture)}
    based = {fit.seed: fit for fit in fits if (fit.variant, fit.capture) == (base, capture)}
    if not ours:
        return NONE
    psnr = [fit.psnr for fit in ours.values()]
    spread = f" ± {(max(psnr) - min(psnr)) / 2:.2f}" if len(psnr) > 1 else ""
    gains = [fit.psnr - based[seed].psnr for seed, fit in ours.items() if seed in based]
    gain = f" ({mean(gains):+.2f})" if gains and variant != base else ""
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
        "# Defaults of `rift fit`",
        "",
        "    python tools/search_defaults.py CAPTURES --steps 3000 --splats 20000 --out search",
        "    python tools/search_defaults.py SCANS --kind xray --steps 3000 --out search",
        "    python tools/search_defaults.py --out search --markdown docs/benchmarks/defaults.md",
        "",
        f"{in_words(surroundings(device))} Other programs ran on the same machine: processor "
        "seconds say less than scores.",
    ]
    return "\n".join([*lines, *markdown_lines(tables(found))]) + "\n"


def main() -> int:
    """Search with the command line's arguments; the exit status."""
    options = tyro.cli(Options)
    known = VARIANTS[options.kind]
    unknown = [name for name in options.variants if name not in known]
    if unknown:
        say(f"search_defaults: there is no variant {unknown[0]!r}; there are {', '.join(known)}")
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
