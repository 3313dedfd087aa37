"""Planned directions against even ones, in the plane: part of ``planned_views``.

Objects and protocol are those of ``merit_study``: a known spectrum, noise on ray sums, conjugate
gradients and the best linear estimate.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from paper.merit_study import NOISE, SIZE, Objects, best_linear
from paper.random_objects import RADIUS
from rift_cl import Camera, Device, Grid, Parallel, Projector, cgls
from rift_cl.geometry import look_at
from rift_cl.metrics import disc, psnr
from rift_cl.sampling import Constraints, Pilot, Target, half_disc, next_views, plan

METHODS = ("CGLS", "MAP")
# Views of the first look, from which the rest are planned.
PILOT = {12: 4, 24: 8}
_STEPS = 30
_PLANE = Constraints(elevation=(0, 0))

Floats = NDArray[np.float64]


def flat_case(kind: str, views: int, count: int, seeds: int, device: Device) -> dict[str, Any]:
    """PSNR by set of views and method, mean over objects and seeds; and what the planner says."""
    objects = Objects(kind, count)
    planned = plan(objects.target, views, _PLANE)
    scores: dict[str, list[dict[str, float]]] = {}
    for seed in range(seeds):
        phase = (seed + 0.5) / seeds
        even = {n: (np.arange(n) + phase) * np.pi / n for n in (views, 2 * views)}
        sets = {
            f"even {views}": even[views],
            f"even {2 * views}": even[2 * views],
            f"planned {views}": scan_angles(planned.directions),
        }
        for name, angles in sets.items():
            found = _scores(objects, np.tile(angles, (count, 1)), seed, device)
            scores.setdefault(name, []).append(found)
        name = f"planned {views}, pilot of {PILOT[views]}"
        piloted = _piloted(objects, views, phase, seed, device)
        scores.setdefault(name, []).append(_scores(objects, piloted, seed, device))
    return {
        "kind": kind,
        "views": views,
        "verdict": planned.verdict(),
        "merit": {"planned": planned.elsewhere, "bound": planned.bound}
        | {name: one.elsewhere for name, one in planned.baselines.items()},
        "angles": (scan_angles(planned.directions) % np.pi).tolist(),
        "psnr": {
            name: {m: float(np.mean([one[m] for one in found])) for m in METHODS}
            for name, found in scores.items()
        },
    }


def scan_angles(directions: Floats) -> Floats:
    """Angles of the parallel scan whose rays run along directions (V, 3) in the plane."""
    return np.arctan2(directions[:, 1], directions[:, 0]) - np.pi / 2


def _piloted(objects: Objects, views: int, phase: float, seed: int, device: Device) -> Floats:
    """(objects, views) a few even angles, and those planned from a reconstruction by them."""
    first = (np.arange(PILOT[views]) + phase) * np.pi / PILOT[views]
    target, found = objects.target, []
    observations = _images(objects, np.tile(first, (len(objects.truth), 1)), seed, device)["CGLS"]
    for image in observations:
        prior = Pilot(image, 1.0)
        band = _audible(prior, target)
        known = Target.flat(
            target.diameter,
            prior=prior,
            snr=target.snr,
            band=band,
            frequencies=half_disc(band, len(target.k)),
        )
        rest = next_views([_camera(a) for a in first], known, views - len(first), _PLANE)
        found.append(np.concatenate([first, scan_angles(rest.directions)]))
    return np.array(found)


def _audible(prior: Pilot, target: Target) -> float:
    """The frequency up to which a prior's power, mean over directions, is above the noise's."""
    radii = np.linspace(1 / target.diameter, target.highest, 60)
    angles = np.arange(60) * np.pi / 60
    ring = np.stack([np.cos(angles), np.sin(angles), np.zeros(60)], axis=1)
    power = [prior.power(radius * ring, target.diameter).mean() for radius in radii]
    heard = np.flatnonzero(target.snr * np.array(power) >= 1)
    return float(radii[heard.max(initial=0)])


def _camera(angle: float) -> Camera:
    """A camera of parallel rays that sees what a view of the scan sees."""
    along = np.array([-np.sin(angle), np.cos(angle), 0])
    view = look_at(along * SIZE, np.zeros(3), (0, 0, 1))
    return Camera((8, SIZE), [[1, 0, SIZE / 2], [0, 1, 4], [0, 0, 1]], view, "ortho")


def _scores(objects: Objects, angles: Floats, seed: int, device: Device) -> dict[str, float]:
    """PSNR in the disc by method, mean over objects; peak 1."""
    inside = disc(Grid((SIZE, SIZE)), radius=RADIUS * SIZE)
    return {
        name: float(
            np.mean([psnr(a, b, mask=inside) for a, b in zip(images, objects.truth, strict=True)])
        )
        for name, images in _images(objects, angles, seed, device).items()
    }


def _images(objects: Objects, angles: Floats, seed: int, device: Device) -> dict[str, Floats]:
    """Reconstructions (objects, y, x) by method; objects seen along the same angles at once."""
    found = {name: np.empty_like(objects.truth) for name in METHODS}
    rows, group = np.unique(angles, axis=0, return_inverse=True)
    for index, own in enumerate(rows):
        which = np.flatnonzero(group.ravel() == index)
        scan, count = Parallel(own, SIZE), len(which)
        A = Projector(Grid((count, SIZE, SIZE)), scan, device=device)
        source = Grid((count, 2 * SIZE, 2 * SIZE), (1, 0.5, 0.5))
        y = Projector(source, scan, device=device)(objects.fine[which]).astype(np.float64)
        random = np.random.default_rng([seed, len(own), int(which[0])])
        y += NOISE * random.standard_normal(y.shape)
        found["CGLS"][which] = cgls(A, y, _STEPS, noise=NOISE)
        found["MAP"][which] = best_linear(A, y, objects.power)
    return found
