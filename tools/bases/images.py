"""Photographs fitted by additive splats whose modes have a coefficient for every colour.

Three pictures that come with scikit-image, centred squares made small. Everything is linear in the
coefficients, nothing is clamped, and no splat hides another: this is what the bases themselves can
do, without what blending adds.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np

from bases.additive import Geometry
from bases.additive_fit import EXACT, AdditiveFit, Floats, Task, psnr, race, record
from bases.mode_sets import ModeSet, in_plane, laguerre_rows
from bases.plan import Plan
from bases.races import race_pictures, race_tables, race_verdicts
from bases.starts import flat_start
from bases.views import additive_renderer, upright_camera
from rift_cl import Device

NAME = "images"
TITLE = "Photographs by additive splats with modes in colour"
BASELINE = "Gaussian"
_FLAT = np.array([1, 1, 0, 1, 0, 0, 1, 1, 1, 0], float)
_DILATION = 1 / 12


def settings(plan: Plan) -> dict[str, Any]:
    """What decides the result."""
    return {
        **plan.settings(),
        "pictures": plan.of(
            tiny=["chelsea"],
            quick=["chelsea", "astronaut"],
            full=["chelsea", "astronaut", "coffee"],
        ),
        "pixels": plan.of(tiny=16, quick=48, full=64),
        "budgets": plan.of(tiny=[120], quick=[600], full=[400, 800, 1600]),
        "solves": plan.of(tiny=[2, EXACT], quick=[4, EXACT], full=[4, 12, EXACT]),
        "marks": plan.of(tiny=[2], quick=[5, 10, 20, 40, 60], full=MARKS),
        "short": plan.of(tiny=2, quick=20, full=100),
    }


MARKS = [5, 10, 20, 40, 70, 100, 150, 200, 300]


def bases(plan: Plan) -> list[ModeSet]:
    """What is compared."""
    if plan.size == "tiny":
        return [in_plane(0), in_plane(1)]
    return [*(in_plane(order) for order in range(4)), laguerre_rows(2)]


def compute(plan: Plan, device: Device, kept: dict[str, Any]) -> Iterator[dict[str, Any]]:
    """Every picture, budget and seed, the bases in turns."""
    asked, sets = settings(plan), bases(plan)
    wanted = [
        (seed, picture, budget)
        for budget in asked["budgets"]
        for seed in plan.seeds
        for picture in asked["pictures"]
    ]
    done = {(run["seed"], run["target"], run["budget"]) for run in kept["runs"]}
    result = {
        "total": len(wanted) * len(sets) * len(asked["solves"]),
        "short": asked["short"],
        "runs": list(kept["runs"]),
    }
    for seed, picture, budget in wanted:
        if (seed, picture, budget) not in done:
            task = _task(device, picture, asked["pixels"], seed)
            fits = [
                AdditiveFit(task, modes, modes.splats(budget, 3), solve)
                for modes in sets
                for solve in asked["solves"]
            ]
            race(fits, asked["marks"])
            keys = {"seed": seed, "target": picture, "budget": budget}
            result["runs"] += [record(fit, **keys) for fit in fits]
        yield result


def _task(device: Device, name: str, pixels: int, seed: int) -> Task:
    target = photograph(name, pixels)

    def score(
        geometry: Geometry, modes: ModeSet, coefficients: Floats, residual: Floats
    ) -> dict[str, float]:
        return {"psnr": psnr(residual)}

    return Task(
        additive_renderer(device, tile=8, eps2d=_DILATION),
        [upright_camera(pixels, pixels)],
        target[None],
        _FLAT,
        lambda count: flat_start(count, (pixels, pixels), seed),
        0.3,
        pixels / 2,
        score,
        [np.eye(2, 3)],
        1.0,
    )


def photograph(name: str, pixels: int) -> Floats:
    """The middle square of a picture of scikit-image, (pixels, pixels, 3) from 0 to 1."""
    import skimage.data
    from skimage.transform import resize

    picture = getattr(skimage.data, name)()
    side = min(picture.shape[:2])
    top, left = (picture.shape[0] - side) // 2, (picture.shape[1] - side) // 2
    square = picture[top : top + side, left : left + side, :3] / 255.0
    return np.asarray(resize(square, (pixels, pixels, 3), anti_aliasing=True), np.float64)


tables, pictures, verdicts = race_tables, race_pictures, race_verdicts
