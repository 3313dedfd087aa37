"""Slices from projections: the Shepp-Logan head and two photographs, exact line integrals.

The slices of a case stand in one stack, a detector row each, and are fitted at once: splats are so
thin across the slices that none reaches its neighbour, and one row of tiles serves eight slices,
as it does in a scan of many rows. The clock is that of the stack.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from bases.additive import Geometry
from bases.additive_fit import EXACT, AdditiveFit, Floats, Task, psnr, race, record
from bases.densities import density
from bases.mode_sets import ModeSet, in_plane
from bases.plan import Plan
from bases.races import race_pictures, race_tables, race_verdicts
from bases.starts import slice_start
from bases.views import additive_renderer, turned_cameras
from rift_cl import Device, Grid, Parallel, Projector
from rift_cl.phantom import shepp_logan, shepp_logan_sinogram

NAME = "slices"
TITLE = "Tomography of slices by additive splats"
IMAGES = ("head", "camera", "coins")
# Standard deviation of splats across slices, which are one apart.
_THIN = 0.1
_FLAT = np.array([1, 1, 0, 1, 0, 0, 1, 1, 1, 0], float)


def settings(plan: Plan) -> dict[str, Any]:
    """What decides the result."""
    return {
        **plan.settings(),
        "images": list(plan.of(tiny=IMAGES[:1], quick=IMAGES[:2], full=IMAGES)),
        "pixels": plan.of(tiny=16, quick=48, full=64),
        "views": plan.of(tiny=[4], quick=[30], full=[20, 60]),
        "noise": plan.of(tiny={}, quick={}, full={"20": 0.01}),
        "budgets": plan.of(tiny=[60], quick=[300], full=[300, 600, 1200]),
        "orders": plan.of(tiny=[0, 1], quick=[0, 1, 2], full=[0, 1, 2, 3, 4]),
        "solves": plan.of(tiny=[2, EXACT], quick=[4, EXACT], full=[4, 12, EXACT]),
        "marks": plan.of(tiny=[2], quick=[5, 10, 20, 30, 45, 60], full=MARKS),
        "short": plan.of(tiny=2, quick=30, full=60),
    }


MARKS = [5, 10, 20, 30, 45, 60, 90, 120, 180, 240]


@dataclass(frozen=True, eq=False)
class Stack:
    """Slices one above the other.

    Args:
        truth: (S, pixels, pixels) densities.
        sinograms: (V, S, bins, 1) line integrals.
        angles: (V,) in radians.
        names: what each slice is.
        seeds: of each slice's start.
    """

    truth: Floats
    sinograms: Floats
    angles: Floats
    names: Sequence[str]
    seeds: Sequence[int]

    @property
    def heights(self) -> Floats:
        """Z of every slice."""
        return np.arange(len(self.names)) - (len(self.names) - 1) / 2


def compute(plan: Plan, device: Device, kept: dict[str, Any]) -> Iterator[dict[str, Any]]:
    """Every budget and number of views, the bases in turns."""
    asked = settings(plan)
    sets = [in_plane(order) for order in asked["orders"]]
    wanted = [(views, budget) for budget in asked["budgets"] for views in asked["views"]]
    done = {(run["views"], run["budget"]) for run in kept["runs"]}
    each = len(sets) * len(asked["solves"]) * len(asked["images"]) * len(plan.seeds)
    result = {
        "total": len(wanted) * each,
        "short": asked["short"],
        "runs": list(kept["runs"]),
    }
    for views, budget in wanted:
        if (views, budget) not in done:
            noise = asked["noise"].get(str(views), 0.0)
            stack = stacked(device, asked["images"], plan.seeds, asked["pixels"], views, noise)
            task = stack_task(device, stack)
            fits = [
                AdditiveFit(task, modes, len(stack.names) * modes.splats(budget, 1), solve)
                for modes in sets
                for solve in asked["solves"]
            ]
            race(fits, asked["marks"])
            for fit in fits:
                result["runs"] += _records(fit, stack, views=views, budget=budget)
        yield result


def _records(fit: AdditiveFit, stack: Stack, **keys: Any) -> list[dict[str, Any]]:
    """A record for every slice, each with its own scores."""
    whole, found = record(fit, **keys), []
    for k, (name, seed) in enumerate(zip(stack.names, stack.seeds, strict=True)):
        history = [{**mark, "psnr": mark[f"psnr {k}"]} for mark in whole["history"]]
        thin = [{key: v for key, v in mark.items() if " " not in key} for mark in history]
        share = {"splats": whole["splats"] // len(stack.names)}
        share["parameters"] = share["splats"] * whole["per_splat"]
        found.append({**whole, **share, "target": name, "seed": seed, "history": thin})
    return found


def stacked(
    device: Device,
    images: Sequence[str],
    seeds: Sequence[int],
    pixels: int,
    views: int,
    noise: float,
) -> Stack:
    """Every image once for each seed."""
    angles = np.arange(views) * np.pi / views
    truths = {name: slice_image(name, pixels) for name in images}
    scan = Parallel(angles, int(np.ceil(np.sqrt(2) * pixels)))
    rows = {name: _sinogram(device, name, truth, scan) for name, truth in truths.items()}
    pairs = [(name, seed) for seed in seeds for name in images]
    seen = np.stack([rows[name] for name, _ in pairs], axis=1)
    for k, (name, seed) in enumerate(pairs):
        random = np.random.default_rng([seed, views, *name.encode()])
        seen[:, k] += noise * seen[:, k].max() * random.normal(size=seen[:, k].shape)
    truth = np.stack([truths[name] for name, _ in pairs])
    return Stack(truth, seen[..., None], angles, *zip(*pairs, strict=True))


def slice_image(name: str, pixels: int) -> Floats:
    """An image (pixels, pixels) from 0 to 1, nothing outside its inscribed disc."""
    if name == "head":
        return shepp_logan(Grid((pixels, pixels))).astype(np.float64)
    import skimage.data
    from skimage.transform import resize

    picture = getattr(skimage.data, name)() / 255.0
    side = min(picture.shape)
    small = resize(picture[:side, :side], (pixels, pixels), anti_aliasing=True)
    line = np.arange(pixels) - (pixels - 1) / 2
    return np.asarray(np.where(np.hypot(line[:, None], line) < pixels / 2 - 1, small, 0.0))


def _sinogram(device: Device, name: str, truth: Floats, scan: Parallel) -> Floats:
    grid = Grid(truth.shape)
    if name == "head":
        return shepp_logan_sinogram(grid, scan).astype(np.float64)
    return np.asarray(Projector(grid, scan, device=device)(truth.astype(np.float32)), np.float64)


def stack_task(device: Device, stack: Stack) -> Task:
    """The fit of a whole stack."""
    slices, pixels = stack.truth.shape[:2]
    line = np.arange(pixels) - (pixels - 1) / 2
    y, x = np.meshgrid(line, line, indexing="ij")
    z = stack.heights[:, None, None]
    shape = stack.truth.shape
    points = np.stack([np.broadcast_to(a, shape) for a in (x, y, z)], axis=-1).reshape(-1, 3)

    def start(count: int) -> Geometry:
        each = count // slices
        starts = [
            slice_start(each, pixels / 2, height, _THIN, seed).flat()
            for height, seed in zip(stack.heights, stack.seeds, strict=True)
        ]
        return Geometry.of_flat(np.concatenate(starts))

    def score(
        geometry: Geometry, modes: ModeSet, coefficients: Floats, residual: Floats
    ) -> dict[str, float]:
        found = density(geometry, modes, coefficients, points).reshape(shape)
        each = {f"psnr {k}": psnr(error) for k, error in enumerate(found - stack.truth)}
        return {"psnr": float(np.mean(list(each.values()))), **each}

    return Task(
        additive_renderer(device, tile=8, eps2d=0.0),
        turned_cameras(slices, stack.sinograms.shape[2], stack.angles),
        stack.sinograms,
        _FLAT,
        start,
        0.5,
        pixels / 2,
        score,
        [np.array([[np.cos(a), np.sin(a), 0.0]]) for a in stack.angles],
        1.5,
        slices,
    )


tables, pictures, verdicts = race_tables, race_pictures, race_verdicts
