"""Faded splats begin again where others have much to do, and the set grows to its size.

3D Gaussian Splatting as Markov Chain Monte Carlo (Kheradmand et al. 2024): a faded splat is put on
top of one that is drawn by chance, in proportion to its opacity. The picture must not jump, so the
k splats that now share a place get the opacity and scale with which they look together like the
one before:

    o' = 1 - (1 - o)^(1/k),    s' = s o / sum over i = 1..k, j = 0..i-1 of
                                         binomial(i-1, j) (-1)^j o'^(j+1) / sqrt(j+1).

Where densities are drawn as optical depths (``SplatSettings.activation``) depths add up: each of
the k gets one k-th, which is the same o', and keeps its scale, whatever its modes. That is exact.

Densities of X-rays add up, nothing hides anything: there a faint splat takes over one half of a
splat that the projections pull at. Mass m, mean and covariance of the two together stay what they
were, by shifts along the longest axis,

    m' = m / 2,    mean' = mean +- a s e,    s' = s sqrt(1 - a^2)  along e.

Hermite modes are derivatives of the Gaussian in units of its axes, and both halves keep the same
derivatives: a mode of order n along e is divided by (1 - a^2)^(n/2). So moments of the two together
are those of the splat before up to the third, as without modes; higher ones are not.

It happens seldom, on the host, in NumPy; what is random comes from (seed, step) alone.
"""

from __future__ import annotations

from math import comb

import numpy as np
from numpy.typing import NDArray

from rift_cl.basis.indices import graded
from rift_cl.errors import InputError
from rift_cl.splat.orders import order_of
from rift_cl.train.parameters import Parameters
from rift_cl.train.settings import Relocation
from rift_cl.train.views.quaternions import rotated

# More splats than this in one place share it like so many.
_MOST_IN_PLACE = 51
_OPACITY_EDGE = 1e-6
# Shift of the halves of a splat, in standard deviations.
_APART = 0.5

Floats = NDArray[np.float64]


def relocate(
    parameters: Parameters, settings: Relocation, *, most: int, seed: int, growth: float
) -> Parameters:
    """Relocate faded splats and add new ones.

    Args:
        parameters: the splats; they are not changed.
        settings: how often, and what counts as faded.
        most: splats there may be.
        seed: of the drawing by chance, with the step.
        growth: share by which their number grows, up to the most there may be.

    Returns:
        Parameters in which Adam's moments of all splats that were touched are zero.

    Raises:
        InputError: the splats have densities; ``relocate_densities`` is for them.
    """
    if parameters.density:
        raise InputError("renew: these splats have densities, wanted opacities")
    raw, first, second = parameters.host()
    random = np.random.default_rng((seed, parameters.step, 0xA11))
    opacities = _sigmoid(raw["logits"].astype(float))
    faded = np.flatnonzero(opacities <= settings.faint)
    alive = np.flatnonzero(opacities > settings.faint)
    if alive.size == 0:
        return parameters
    added = grown(len(parameters), growth, most)
    chance = opacities[alive] / opacities[alive].sum()
    chosen = alive[random.choice(alive.size, faded.size + added, p=chance)]
    shared = np.bincount(chosen, minlength=len(parameters))
    _share(raw, opacities, shared, depths=parameters.amplitude)
    places = np.concatenate([faded, np.arange(len(parameters), len(parameters) + added)])
    touched = np.concatenate([places, np.flatnonzero(shared)])
    for name in parameters.groups:
        raw[name] = _extended(raw[name], added)
        raw[name][places] = raw[name][chosen]
        for moments in (first, second):
            moments[name] = _extended(moments[name], added)
            moments[name][touched] = 0
    return parameters.replaced(raw, first, second)


def grown(count: int, growth: float, most: int) -> int:
    """Splats that a renewal adds to so many."""
    return max(0, min(round(count * growth), most - count))


def relocate_densities(
    parameters: Parameters, settings: Relocation, pull: NDArray[np.float32], *, seed: int
) -> Parameters:
    """Relocate splats of hardly any mass into the halves of others.

    Args:
        parameters: the splats; they are not changed.
        settings: ``faint`` is the share of the mean mass up to which a splat counts as faded.
        pull: (N,) how much the projections want of each splat: what is split is drawn by it.
        seed: of the drawing by chance, with the step.

    Returns:
        As many splats, in which Adam's moments of all that were touched are zero. The mass of
        those that were faded is lost.

    Raises:
        InputError: the splats have opacities; ``relocate`` is for them.
    """
    if not parameters.density:
        raise InputError("renew_densities: these splats have opacities, wanted densities")
    raw, first, second = parameters.host()
    random = np.random.default_rng((seed, parameters.step, 0xA12))
    masses = raw["logits"].astype(float) + raw["log_scales"].sum(axis=1, dtype=float)
    masses = np.exp(masses - masses.max())
    faded = masses <= settings.faint * masses.mean()
    chance = np.where(faded | ~np.isfinite(pull), 0, pull.astype(float))
    places = np.flatnonzero(faded)[: np.count_nonzero(chance)]
    if places.size == 0:
        return parameters
    hosts = random.choice(len(parameters), places.size, replace=False, p=chance / chance.sum())
    for name in parameters.groups:
        raw[name][places] = raw[name][hosts]
        for moments in (first, second):
            moments[name][places] = moments[name][hosts] = 0
    _halve(raw, hosts, places)
    return parameters.replaced(raw, first, second)


def _halve(
    raw: dict[str, NDArray[np.float32]], hosts: NDArray[np.intp], places: NDArray[np.intp]
) -> None:
    """Make two halves of each host and the copy of it at the same index of ``places``."""
    rows = np.arange(hosts.size)
    longest = raw["log_scales"][hosts].argmax(axis=1)
    along = np.zeros((hosts.size, 3))
    along[rows, longest] = _APART * np.exp(raw["log_scales"][hosts, longest].astype(float))
    shift = rotated(raw["quats"][hosts].astype(float), along)
    shrink = np.float32(0.5 * np.log(1 - _APART**2))
    for halves, side in ((hosts, 1), (places, -1)):
        raw["means"][halves] += side * shift
        raw["log_scales"][halves, longest] += shrink
        # Half of the mass, in a volume that has shrunk.
        raw["logits"][halves] -= np.float32(np.log(2)) + shrink
        if "shape_modes" in raw:
            modes = raw["shape_modes"]
            powers = graded(order_of(modes.shape[1] + 1), 3)[1:, longest].T
            modes[halves] *= np.exp(-shrink * powers).astype(np.float32)


def _share(
    raw: dict[str, NDArray[np.float32]],
    opacities: Floats,
    shared: NDArray[np.int64],
    *,
    depths: bool,
) -> None:
    """Make splats share their place with as many others as fell on it."""
    hosts = np.flatnonzero(shared)
    count = np.minimum(shared[hosts] + 1, _MOST_IN_PLACE)
    opacity = opacities[hosts]
    each = 1 - (1 - opacity) ** (1 / count)
    if not depths:
        scale = opacity / np.array([_overlap(o, k) for o, k in zip(each, count, strict=True)])
        raw["log_scales"][hosts] += np.log(scale)[:, None]
    each = np.clip(each, _OPACITY_EDGE, 1 - _OPACITY_EDGE)
    raw["logits"][hosts] = np.log(each / (1 - each))


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
