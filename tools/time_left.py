"""How well ``rift fit`` tells the time that it will take: what it said against what came.

    python tools/time_left.py CAPTURE [--steps N] [--splats N] [--downscale K] [--strategy NAME]

Runs a fit into a folder that is removed afterwards and prints, at 10, 25, 50 and 75 % of its
steps, the seconds left as the progress bar tells them and as they came to be, by the clock on the
wall and by processor time, which other programs disturb less. Memory and time that
``--dry-run`` would say stand above.
"""

from __future__ import annotations

import tempfile
import time
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Literal

import tyro
from tyro.conf import Positional

from rift_cl.commands.fit_photos.job import Fit
from rift_cl.commands.fit_photos.settings import FitPhotosSettings
from rift_cl.commands.progress_bar import Pace

_SHARES = (0.1, 0.25, 0.5, 0.75)
_CLOCKS = {"wall": time.monotonic, "processor": time.process_time}


@dataclass(frozen=True)
class Asked:
    """What is fitted."""

    capture: Annotated[Path, Positional]
    """A capture, as 'rift fit' takes it."""
    steps: int = 1500
    """Steps of the fit."""
    splats: int = 8000
    """Most splats."""
    downscale: int = 2
    """Whole factor by which photographs are made smaller."""
    strategy: Literal["residual", "mcmc", "default"] = "residual"
    """How splats find their places."""


def main(asked: Asked) -> None:
    """Fit, and print the table."""
    with tempfile.TemporaryDirectory() as folder:
        settings = FitPhotosSettings.of(
            asked.capture,
            Path(folder) / "fit",
            steps=asked.steps,
            splats=asked.splats,
            downscale=asked.downscale,
            strategy=asked.strategy,
            checkpoint_every=0,
        )
        for name, value in Fit(settings).plan().items():
            print(f"{name}: {value}")
        _watch(Fit(settings), asked.steps)


def _watch(job: Fit, steps: int) -> None:
    paces = {name: Pace(clock) for name, clock in _CLOCKS.items()}
    begin = time.monotonic()
    told: list[tuple[int, float, dict[str, tuple[float, float]]]] = []
    for report in job.run():
        if report.what == "steps":
            found = {n: (clock(), paces[n].after(report)[1]) for n, clock in _CLOCKS.items()}
            told.append((report.done, report.values["splats"], found))
    end = told[-1][2]
    print(f"reading and all steps took {end['wall'][0] - begin:.1f} s by the clock on the wall")
    print("share  splats" + "".join(f"  {name}: left, came, ratio" for name in _CLOCKS))
    for share in _SHARES:
        done, splats, found = next(row for row in told if row[0] >= share * steps)
        cells = []
        for name, (now, left) in found.items():
            came = end[name][0] - now
            cells.append(f"{left:8.1f} s {came:8.1f} s {left / came:6.2f}")
        print(f"{done / steps:5.0%} {splats:7.0f} " + "  ".join(cells))


if __name__ == "__main__":
    main(tyro.cli(Asked))
