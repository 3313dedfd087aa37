"""Faded splats begin again where others have much to do, and the set grows to its size.

3D Gaussian Splatting as Markov Chain Monte Carlo (Kheradmand et al. 2024): a faded splat is put on
top of one that is drawn by chance, in proportion to its opacity. The picture must not jump, so the
k splats that now share a place get the opacity and scale with which they look together like the
one before:

    o' = 1 - (1 - o)^(1/k),    s' = s o / sum over i = 1..k, j = 0..i-1 of
                                         binomial(i-1, j) (-1)^j o'^(j+1) / sqrt(j+1).

It happens seldom, on the host, in NumPy; what is random comes from (seed, step) alone.
"""

from __future__ import annotations

from math import comb

import numpy as np
from numpy.typing import NDArray

from rift_cl.train.parameters import GROUPS, Parameters
from rift_cl.train.settings import Renewal

# More splats than this in one place share it like so many.
_MOST_IN_PLACE = 51
_OPACITY_EDGE = 1e-6

Floats = NDArray[np.float64]


def renew(
    parameters: Parameters, settings: Renewal, *, most: int, seed: int, grow: bool
) -> Parameters:
    """Relocate faded splats and add new ones.

    Args:
        parameters: the splats; they are not changed.
        settings: how often, and what counts as faded.
        most: splats there may be.
        seed: of the drawing by chance, with the step.
        grow: whether splats are added.

    Returns:
        Parameters in which Adam's moments of all splats that were touched are zero.
    """
    raw, first, second = parameters.host()
    random = np.random.default_rng((seed, parameters.step, 0xA11))
    opacities = _sigmoid(raw["logits"].astype(float))
    faded = np.flatnonzero(opacities <= settings.faint)
    alive = np.flatnonzero(opacities > settings.faint)
    if alive.size == 0:
        return parameters
    wanted = int(len(parameters) * settings.growth) if grow else 0
    added = min(wanted, most - len(parameters))
    chance = opacities[alive] / opacities[alive].sum()
    chosen = alive[random.choice(alive.size, faded.size + max(added, 0), p=chance)]
    shared = np.bincount(chosen, minlength=len(parameters))
    _share(raw, opacities, shared)
    places = np.concatenate([faded, np.arange(len(parameters), len(parameters) + max(added, 0))])
    touched = np.concatenate([places, np.flatnonzero(shared)])
    for name in GROUPS:
        raw[name] = _extended(raw[name], max(added, 0))
        raw[name][places] = raw[name][chosen]
        for moments in (first, second):
            moments[name] = _extended(moments[name], max(added, 0))
            moments[name][touched] = 0
    return parameters.replaced(raw, first, second)


def _share(
    raw: dict[str, NDArray[np.float32]], opacities: Floats, shared: NDArray[np.int64]
) -> None:
    """Make splats share their place with as many others as fell on it."""
    hosts = np.flatnonzero(shared)
    count = np.minimum(shared[hosts] + 1, _MOST_IN_PLACE)
    opacity = opacities[hosts]
    each = 1 - (1 - opacity) ** (1 / count)
    scale = opacity / np.array([_overlap(o, k) for o, k in zip(each, count, strict=True)])
    each = np.clip(each, _OPACITY_EDGE, 1 - _OPACITY_EDGE)
    raw["logits"][hosts] = np.log(each / (1 - each))
    raw["log_scales"][hosts] += np.log(scale)[:, None]


def _overlap(opacity: float, count: int) -> float:
    """The double sum above: what ``count`` splats in one place hide on the whole."""
    terms = (
        comb(i - 1, j) * (-1) ** j * opacity ** (j + 1) / np.sqrt(j + 1)
        for i in range(1, count + 1)
        for j in range(i)
    )
    return float(sum(terms))


def _extended(array: NDArray[np.float32], more: int) -> NDArray[np.float32]:
    return np.concatenate([array, np.zeros((more, *array.shape[1:]), np.float32)])


def _sigmoid(x: Floats) -> Floats:
    return np.asarray(1 / (1 + np.exp(-x)))
