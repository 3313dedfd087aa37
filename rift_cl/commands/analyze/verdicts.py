"""Predictors of the error of a novel view of an opaque target.

A predictor is reported only if it ranks held-out photographs by their error: that is checked by
``tools/check_verdicts.py``, and what does not hold there is not reported.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from rift_cl.commands.analyze.suggestions import usual_distance
from rift_cl.commands.inputs.surfaces import SQUARE, surface_of
from rift_cl.commands.inputs.view_set import Floats, ViewSet
from rift_cl.geometry import Camera
from rift_cl.sampling.coverage.host import host_coverage
from rift_cl.sampling.criteria.appearance import appearance_error
from rift_cl.sampling.criteria.optimality import wiener
from rift_cl.sampling.targets.observations import Observations
from rift_cl.sampling.targets.target import Target, half_disc

# The verdicts that held, Spearman with the errors of held-out photographs on the fox, the ornament
# and two rendered one-sided captures, a shelf and a wall: angle .47 .87 .39 .57; pixel .55 on the
# fox, where alone distances differ. Withheld: appearance .61 .63 -.02 .69; sides .26 .48 .63 .83;
# parallax .17 .07 .94 .57. (slices, .46 .38 .84 .81, is of what is seen through: it follows the
# angle, but the length that it names is none of a surface.)
HELD = ("angle", "pixel")
# Cosine from which a side is looked at.
_FACING = 0.3


def said(sentences: Mapping[str, str]) -> list[str]:
    """Those sentences, by the names of their predictors, that are reported."""
    return [sentence for name, sentence in sentences.items() if name in HELD]


def foretold(sampled: ViewSet, cameras: Sequence[Camera]) -> dict[str, Floats]:
    """What verdicts say of views (V,), by name; more is worse.

    ``angle``: radians to the nearest view that was taken; ``appearance``: what is unknown of
    brightness towards the view; ``sides``: share of the sides it faces that few views see square
    on; ``pixel``: a pixel of the middle one of the views taken, in its own; ``parallax``: pixels of
    depth, in pixels of the picture, by the views that share its side; ``slices``: what a target
    that is seen through would keep unknown on the view's own slice, which is what the number of
    views limits.

    Args:
        sampled: the views that were taken.
        cameras: others.
    """
    target = surface_of(sampled, usual_distance(sampled))
    center = sampled.target.center
    taken, asked = (
        Observations.of(group, center[None]) for group in (sampled.cameras, list(cameras))
    )
    ways, sides = taken.direction[:, 0], asked.direction[:, 0]
    apart = np.arccos(np.clip(sides @ ways.T, -1, 1))
    observations = sampled.observations(target.points)
    normals = np.asarray(target.normals)
    square = np.einsum("vpd,pd->vp", observations.direction, normals) >= math.cos(
        math.radians(SQUARE)
    )
    count = (square & (observations.weight > 0)).sum(axis=0)
    facing = np.maximum(sides @ normals.T - _FACING, 0)
    few = (facing / (1 + count)).sum(1) / np.maximum(facing.sum(1), 1e-12)
    pixel = np.median(taken.pixel[:, 0]) / asked.pixel[:, 0]
    return {
        "angle": apart.min(axis=1),
        "appearance": np.array([_appearance(observations, target, side) for side in sides]),
        "sides": few,
        "pixel": pixel,
        "parallax": np.array([_parallax(ways[near]) for near in apart < math.radians(SQUARE)]),
        "slices": np.array([_on_slice(taken, sampled.target, side) for side in sides]),
    }


def _on_slice(taken: Observations, target: Target, side: Floats) -> float:
    """Posterior variance on the slice across a line of sight, as a fraction of the power."""
    first = np.cross(side, np.eye(3)[np.argmin(np.abs(side))])
    first /= np.linalg.norm(first)
    plane = half_disc(target.highest)
    k = plane[:, :1] * first + plane[:, 1:2] * np.cross(side, first)
    power = target.prior.power(k, target.diameter)
    return wiener(host_coverage(taken, k, target.diameter), power, target.snr).value


def _appearance(observations: Observations, target: Target, side: Floats) -> float:
    """What is unknown of the brightness of all points towards one side."""
    toward = replace(target, seen_from=side[None])
    return float(appearance_error(observations, toward, np.asarray(toward.normals), "wiener")[0])


def _parallax(ways: Floats) -> float:
    """Pixels of depth that a pixel of parallax is, by views from these sides."""
    if len(ways) < 2:
        return 1e6
    angle = float(np.arccos(np.clip((ways @ ways.T).min(), -1, 1)))
    return 1 / max(2 * math.tan(min(angle, math.pi / 2) / 2), 1e-6)
