"""Planned views of a volume against arcs, in a sector of directions: part of ``planned_views``.

Pictures are projections along parallel rays with noise; what is reconstructed from them is the best
linear estimate for the volumes' mean spectrum. Volumes whose spectrum is known are others than
those that are reconstructed.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from paper.blob_volumes import (
    RADIUS,
    BlobProjector,
    best_linear,
    frequencies,
    radial_power,
    random_volumes,
)
from rift_cl.metrics import psnr
from rift_cl.sampling import Constraints, Plan, PowerLaw, Target, half_ball, plan

SIZE, VIEWS, NOISE = 36, 24, 0.5
SECTOR = Constraints(elevation=(0, np.pi / 3), azimuth=(-np.pi / 3, np.pi / 3))
# Elevations of the single arcs, degrees.
ARCS = (0, 15, 30, 45, 60)
TWICE = f"arc at 30, {2 * VIEWS} views"
_LEARNT, _LEARNT_SEED, _STEPS = 24, 99, 30
_FREQUENCIES = 4000

Floats = NDArray[np.float64]


def known() -> tuple[Target, Floats]:
    """The target that the planner is told of, and the spectrum that reconstructions use."""
    power = radial_power(random_volumes(_LEARNT, SIZE, _LEARNT_SEED))
    diameter = 2 * RADIUS * SIZE
    k = frequencies(SIZE)
    inside = (k > 1.5 / diameter) & (k < 10 / diameter)
    alpha = -float(np.polyfit(np.log(k[inside]), np.log(power[inside]), 1)[0])
    first = float(power[np.abs(k - 1 / diameter) < 0.5 / SIZE].mean())
    # |FFT|^2 of a volume at one cycle per diameter, over that of the noise in its shadow.
    snr = first * SIZE**3 / (NOISE**2 * np.pi * diameter**2 / 4)
    # As far as the power is above the noise's: what lies beyond no view can tell.
    band = snr ** (1 / alpha) / diameter
    target = Target(
        (0, 0, 0),
        diameter,
        prior=PowerLaw(alpha),
        snr=snr,
        band=band,
        frequencies=half_ball(band, _FREQUENCIES),
    )
    return target, power


def directions(azimuth: Floats, elevation: Floats) -> Floats:
    """Unit vectors (V, 3)."""
    level = np.cos(elevation)
    return np.stack([level * np.cos(azimuth), level * np.sin(azimuth), np.sin(elevation)], axis=1)


def sector_sets(target: Target, seeds: int) -> tuple[dict[str, list[Floats]], Plan]:
    """Directions (V, 3) in the sector by name, several draws of random ones; and the plan."""
    (first, last), (low, high) = SECTOR.azimuth, SECTOR.elevation
    across = np.linspace(first, last, VIEWS)
    found = {arc_name(e): [directions(across, np.full(VIEWS, np.radians(e)))] for e in ARCS}
    double = np.linspace(first, last, 2 * VIEWS)
    found[TWICE] = [directions(double, np.full(2 * VIEWS, np.pi / 6))]
    made = plan(target, VIEWS, SECTOR)
    even = made.baselines["fibonacci"].view_table.table
    found["Fibonacci"] = [directions(even[:, 0], even[:, 1])]
    random = np.random.default_rng(0)
    found["random"] = [
        directions(
            random.uniform(first, last, VIEWS),
            np.arcsin(random.uniform(np.sin(low), np.sin(high), VIEWS)),
        )
        for _ in range(seeds)
    ]
    found["planned"] = [made.directions]
    return found, made


def free_sets(target: Target) -> tuple[dict[str, list[Floats]], Plan]:
    """Directions all round by name, and the plan."""
    made = plan(target, VIEWS)
    even = made.baselines["fibonacci"].view_table.table
    turn = np.arange(VIEWS) * 2 * np.pi / VIEWS
    return {
        "ring at 30": [directions(turn, np.full(VIEWS, np.pi / 6))],
        "Fibonacci": [directions(even[:, 0], even[:, 1])],
        "planned": [made.directions],
    }, made


def arc_name(elevation: int) -> str:
    """What the arc at an elevation in degrees is called."""
    return f"arc at {elevation}"


def volume_case(name: str, volumes: int, seeds: int) -> dict[str, Any]:
    """PSNR of every set, mean over volumes, draws and noise; what the planner says.

    Args:
        name: ``sector`` or ``free``.
        volumes: how many.
        seeds: of the noise, and draws of random sets.
    """
    target, power = known()
    found, made = sector_sets(target, seeds) if name == "sector" else free_sets(target)
    truth = random_volumes(volumes, SIZE, 0)
    return {
        "name": name,
        "psnr": {
            one: float(np.mean([score(views, truth, power, seeds) for views in draws]))
            for one, draws in found.items()
        },
        "verdict": made.verdict(),
        "merit": {"planned": made.elsewhere}
        | {one: baseline.elsewhere for one, baseline in made.baselines.items()},
        "azimuth": made.azimuth.tolist(),
        "elevation": made.elevation.tolist(),
    }


def score(views: Floats, volumes: Floats, power: Floats, seeds: int) -> float:
    """PSNR in the ball from some directions (V, 3), mean over volumes and noise; peak 1."""
    A, scores = BlobProjector(views, SIZE), []
    clean = A(volumes).astype(np.float64)
    for seed in range(seeds):
        random = np.random.default_rng([seed, len(views)])
        y = clean + NOISE * random.standard_normal(clean.shape)
        estimate = best_linear(A, y, power, NOISE, _STEPS)
        pairs = zip(estimate, volumes, strict=True)
        scores += [psnr(a, b, mask=A.inside) for a, b in pairs]
    return float(np.mean(scores))
