"""How fast a fit to pictures goes, where its time goes, and how it compares with one in torch.

    python tools/bench_training.py --json training.json
    python tools/bench_training.py --peers --json t.json --markdown docs/benchmarks/training.md

Everything is measured in one process on one device, trainers in turns. A kernel that the trainer
launches and that belongs to no stage makes the run fail.
"""

from __future__ import annotations

import sys
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import tyro

import rift_cl as rift
from bench.command import report, say
from bench.race import compared
from bench.surroundings import surroundings
from bench.trainers import TRAINERS, RiftTrainer, TorchTilesAlone, TrainerContender
from bench.training_case import TrainingCase
from bench.training_stages import host_work, relocation_price, stages, ways
from bench.training_tables import training_page, training_tables

_SCENES = ("ornament:10000", "10000:160x120", "20000:224x168", "20000:512x512")
_QUICK_SCENES = ("500:48x32",)


@dataclass(frozen=True)
class Options:
    """Measure the trainer, and with --peers one in plain torch on the same work.

    Args:
        json: file for every figure and every raw time.
        markdown: file for the tables, ready for the documentation.
        peers: also run the trainer in torch, if torch is installed.
        quick: one small scene and few repeats.
        device: which OpenCL device, as RIFT_DEVICE selects it.
        scenes: ornament:SPLATS or SPLATS:WIDTHxHEIGHT, any number of them.
        rounds: how often each trainer has its turn, and each pass is measured; 1 or more.
    """

    json: Path
    markdown: Path | None = None
    peers: bool = False
    quick: bool = False
    device: str | None = None
    scenes: tuple[str, ...] = ()
    rounds: int | None = None


def measure_all(options: Options) -> Iterator[dict[str, Any]]:
    """Run the benchmark, scene by scene.

    Yields:
        The record of all that was measured so far, after each scene.

    Raises:
        CoverageError: a kernel belongs to no stage.
        RiftError: no device fits, or a scene cannot be read.
    """
    device = rift.open_device(options.device)
    names = options.scenes or (_QUICK_SCENES if options.quick else _SCENES)
    cases = [TrainingCase.parse(name, device) for name in names]
    head = surroundings(device)
    found, skipped = [], dict[str, str]()
    for case in cases:
        found.append(_measure(case, options, skipped))
        yield {**head, "peers": options.peers, "skipped": skipped, "scenes": found}


def _measure(case: TrainingCase, options: Options, skipped: dict[str, str]) -> dict[str, Any]:
    rounds = options.rounds or (1 if options.quick else 4)
    kinds = _trainers(options)
    say(f"{case.name}: {', '.join(kind.name for kind in kinds)}")
    lead = compared(kinds, case.device, case, rounds=rounds, seed=0, skipped=skipped)
    say(f"{case.name}: stages")
    return {
        **case.record(),
        **lead,
        "stages": {way: stages(fit, passes=rounds) for way, fit in ways(case).items()},
        "host": host_work(case, passes=2 * rounds),
        "relocation": relocation_price(case, passes=rounds),
    }


def _trainers(options: Options) -> tuple[type[TrainerContender], ...]:
    if not options.peers:
        return (RiftTrainer,)
    return (RiftTrainer, TorchTilesAlone) if options.quick else TRAINERS


def main() -> int:
    """Run with the command line's arguments; the exit status."""
    options = tyro.cli(Options)
    return report(
        "bench_training",
        measure_all(options),
        json_file=options.json,
        markdown_file=options.markdown,
        page=training_page,
        tables=training_tables,
    )


if __name__ == "__main__":
    sys.exit(main())
