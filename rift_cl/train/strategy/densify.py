"""Splats are cloned and split where the picture pulls at them, and pruned where they do nothing.

The densification of 3D Gaussian Splatting (Kerbl et al. 2023) as gsplat 1.5 does it. Of the splats
whose mean gradient on the screen is large, a small one leaves a copy of itself in its place, and a
large one gives way to two that are drawn from its own Gaussian, with scales 1.6 times smaller.
Faint splats go, and later those that have become too large. Copies and halves keep the modes and
lobes of the splat that they come from, in coordinates of their own.

It happens seldom, on the host, in NumPy; what is random comes from (seed, step) alone.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import log

import numpy as np
from numpy.typing import NDArray

from rift_cl.train.parameters import Parameters
from rift_cl.train.settings import Densification
from rift_cl.train.views.quaternions import rotated

_SPLIT_SHRINK = 1.6
# ln of the largest scale that is drawn; see kernels/splat/splat_activate.cl.
_MOST_LOG = 30.0

Floats = NDArray[np.float64]
Chosen = NDArray[np.bool_]
Raw = dict[str, NDArray[np.float32]]


@dataclass(frozen=True)
class _Fates:
    """What becomes of each splat; indices in ascending order.

    Args:
        kept: stay as they are.
        cloned: of those, the ones that leave a copy.
        split: give way to two.
    """

    kept: NDArray[np.intp]
    cloned: NDArray[np.intp]
    split: NDArray[np.intp]


def densify(
    parameters: Parameters,
    statistics: NDArray[np.float32],
    settings: Densification,
    *,
    extent: float,
    most: int,
    seed: int,
    prune_large: bool,
) -> Parameters:
    """Clone, split and prune.

    Args:
        parameters: N splats; they are not changed.
        statistics: (N, 3), what ``ScreenStatistics`` gathered since the last time.
        settings: from where on.
        extent: of the scene, in its units.
        most: splats there may be: where there is no room for all, those with the largest mean
            gradients are cloned or split. Splats that are more from the start become no more.
        seed: of the drawing by chance, with the step.
        prune_large: whether splats that are too large are pruned.

    Returns:
        The splats that stay in their order and with Adam's moments, then the copies, then both
        halves of those that were split, with moments of zero. Where nothing would stay, the
        parameters as they were.
    """
    raw, first, second = parameters.host()
    fates = _fates(raw, statistics, settings, extent=extent, most=most, prune_large=prune_large)
    if fates.kept.size + fates.split.size == 0:
        return parameters
    order = np.concatenate([fates.kept, fates.cloned, fates.split, fates.split])
    random = np.random.default_rng((seed, parameters.step, 0xDE5))
    if settings.revised_opacity:
        doubled = np.concatenate([fates.cloned, fates.split])
        raw["logits"][doubled] = _shared_logits(raw["logits"][doubled])
    after = {name: array[order] for name, array in raw.items()}
    halves = order.size - 2 * fates.split.size
    after["means"][halves:] += _samples(raw, fates.split, random)
    after["log_scales"][halves:] -= np.float32(log(_SPLIT_SHRINK))
    for group in (first, second):
        for name in raw:
            group[name] = group[name][order]
            group[name][fates.kept.size :] = 0
    return parameters.replaced(after, first, second)


def reset_opacities(parameters: Parameters, most: float) -> Parameters:
    """Splats of which none has an opacity above ``most``, and Adam's moments of logits are zero."""
    raw, first, second = parameters.host()
    raw["logits"] = np.minimum(raw["logits"], np.float32(_logit(most)))
    for moments in (first, second):
        moments["logits"] = np.zeros_like(moments["logits"])
    return parameters.replaced(raw, first, second)


def _fates(
    raw: Raw,
    statistics: NDArray[np.float32],
    settings: Densification,
    *,
    extent: float,
    most: int,
    prune_large: bool,
) -> _Fates:
    gradient = statistics[:, 0].astype(float) / np.maximum(statistics[:, 1], 1)
    # Sizes and opacities are compared as they are trained, where nothing overflows.
    size = raw["log_scales"].max(axis=1).astype(float) - log(extent)
    doomed = ~_usable(raw) | (raw["logits"] < _logit(settings.faint))
    too_large = np.zeros(len(size), bool)
    if prune_large:
        too_large = size > log(settings.large)
        if settings.large_on_screen is not None:
            doomed |= statistics[:, 2] > settings.large_on_screen
    pulled = np.isfinite(gradient) & (gradient > settings.threshold) & ~doomed
    small = size <= log(settings.small)
    # One that is too large may be split, if its halves are not too large as well.
    wide = pulled & ~small
    if prune_large:
        wide &= size - log(_SPLIT_SHRINK) <= log(settings.large)
    pruned = doomed | too_large
    room = most - int(np.count_nonzero(~pruned))
    grown = _strongest(gradient, pulled & small | wide, 1 + pruned, room)
    split = grown & ~small
    return _Fates(
        np.flatnonzero(~pruned & ~split), np.flatnonzero(grown & small), np.flatnonzero(split)
    )


def _usable(raw: Raw) -> Chosen:
    """Splats that can be drawn: finite, with a quaternion that is a rotation."""
    usable = np.asarray(raw["quats"].any(axis=1))
    for array in raw.values():
        usable &= np.isfinite(array).reshape(len(usable), -1).all(axis=1)
    return usable


def _strongest(gradient: Floats, wanted: Chosen, cost: NDArray[np.int64], room: int) -> Chosen:
    """Those of the wanted with the largest gradients, as many as there is room for.

    Args:
        gradient: (N,) finite where wanted.
        wanted: (N,).
        cost: (N,) by how much the set grows for each.
        room: by how much it may grow.
    """
    candidates = np.flatnonzero(wanted)
    ranked = candidates[np.argsort(-gradient[candidates], kind="stable")]
    chosen = np.zeros(len(wanted), bool)
    chosen[ranked[np.cumsum(cost[ranked]) <= room]] = True
    return chosen


def _samples(raw: Raw, split: NDArray[np.intp], random: np.random.Generator) -> Floats:
    """Where the halves of S splats lie, seen from their middle: drawn from it, (2S, 3)."""
    twice = np.concatenate([split, split])
    scales = np.exp(np.minimum(raw["log_scales"][twice].astype(float), _MOST_LOG))
    along = scales * random.standard_normal(scales.shape)
    return rotated(raw["quats"][twice].astype(float), along)


def _shared_logits(logits: NDArray[np.float32]) -> NDArray[np.float32]:
    """Logits of 1 - sqrt(1 - o): of two splats in one place that hide together what one did."""
    log_root = -0.5 * np.logaddexp(0, logits.astype(float))
    return np.asarray(np.log(-np.expm1(log_root)) - log_root, np.float32)


def _logit(opacity: float) -> float:
    return log(opacity / (1 - opacity))
