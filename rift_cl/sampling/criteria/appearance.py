"""Appearance: what views know of how a surface's brightness changes with the direction.

The brightness of a point is taken for a Gaussian process on the sphere of directions: spherical
harmonics to a degree, with independent coefficients whose variances fall with the level l like
1 / (1 + (l / 2)^2), rough enough that views farther apart than a lobe is wide tell nothing of what
lies between them. By the addition theorem the covariance K of two directions is a sum of Legendre
polynomials of the angle between them. V views of the point, each with light l, leave at a direction
d of the variance (Rasmussen and Williams 2006, equation 2.26)

    K(d, d) - c' X c,     c = K(views, d),     X = snr (1 + snr L K)^-1 L,     L = diag(l),

and the error is the mean of that over the directions from which the target will be looked at, all
of them as long as nobody says, each as far as it shows the point.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.polynomial import legendre
from numpy.typing import NDArray

from rift_cl.sampling.targets.observations import Observations
from rift_cl.sampling.targets.prior import directions_for

if TYPE_CHECKING:
    from rift_cl.sampling.targets.target import Target

Floats = NDArray[np.float64]
# Where variances begin to fall, and directions that stand for a half of all.
_LEVEL, _HALF = 2.0, 200
_PIECE = 1 << 14


class _Views(NamedTuple):
    """The views of P points.

    Args:
        v: (P, V, 3) directions.
        light: (P, V) as ``light_of`` has it.
        kernel: (P, V, V) K.
        left: (P, V, V) (1 + snr L K)^-1.
    """

    v: Floats
    light: Floats
    kernel: Floats
    left: Floats


class _Score(NamedTuple):
    """An error and its derivatives by light (P, V), kernel (P, V, V) and direction (P, V, 3)."""

    value: float
    light: Floats
    kernel: Floats
    direction: Floats


def appearance_error(
    observations: Observations, target: Target, normals: Floats, kind: str
) -> tuple[float, Floats, Floats]:
    """Posterior variance of the radiance as a fraction of the prior's, averaged over points.

    Args:
        observations: V views of the target's P points.
        target: its degree, its ratio of signal to noise, and from where it will be looked at.
        normals: (P, 3).
        kind: ``logdet`` for minus the bits per harmonic, from wherever it will be looked at;
            another for the error.

    Returns:
        The value, and its derivatives by the views' directions (V, P, 3) and weights (V, P).
    """
    v = observations.direction.transpose(1, 0, 2)
    cosine = np.einsum("pvd,pd->pv", v, normals)
    light, kernel = light_of(observations, normals), covariance(v, v, target.degree)
    left = np.linalg.inv(np.eye(v.shape[1]) + target.snr * light[:, :, None] * kernel)
    views = _Views(v, light, kernel, np.asarray(left, np.float64))
    score = _bits(views, target) if kind == "logdet" else _variance(views, target, normals)
    slopes = covariance(v, v, target.degree, slope=True)
    by_between = (score.kernel + score.kernel.transpose(0, 2, 1)) * slopes
    by_cosine = score.light * observations.weight.T * (cosine > 0)
    by_direction = by_between @ v + by_cosine[..., None] * normals[:, None] + score.direction
    across = by_direction - (by_direction * v).sum(2, keepdims=True) * v
    by_weight = score.light * np.maximum(cosine, 0)
    return score.value, across.transpose(1, 0, 2), by_weight.T


def light_of(observations: Observations, normals: Floats) -> Floats:
    """(P, V) weights of views times the cosines to the normals (P, 3), 0 from behind."""
    cosine = np.einsum("vpd,pd->pv", observations.direction, normals)
    return np.asarray(observations.weight.T * np.maximum(cosine, 0))


def wanted_of(target: Target) -> Floats:
    """(D, 3) viewing directions in which the surface's appearance counts."""
    if target.seen_from is not None:
        return target.seen_from
    half = directions_for(3, _HALF)
    return np.concatenate([half, -half])


def shown(target: Target, normals: Floats) -> Floats:
    """How much each of these directions counts for each point, (D, P), with a mean of 1.

    That is its cosine to the normal; 0 for points that none of those directions shows.
    """
    cosine = np.maximum(wanted_of(target) @ normals.T, 0)
    mean = cosine.mean(axis=0)
    return np.asarray(cosine / np.where(mean > 0, mean, 1))


def covariance(one: Floats, other: Floats, degree: int, *, slope: bool = False) -> Floats:
    """K of brightness in two sets of directions, (..., V, 3) and (..., W, 3): (..., V, W).

    Args:
        one: unit vectors.
        other: unit vectors.
        degree: of the harmonics.
        slope: give the derivative by the cosine of the angle between them in its place.
    """
    falling = (2 * np.arange(degree + 1) + 1) * variances(degree)
    series = np.asarray(legendre.legder(falling) if slope else falling)
    cosine = np.ascontiguousarray(one @ np.swapaxes(other, -1, -2))
    found, given = np.empty_like(cosine), cosine.reshape(-1)
    # In pieces that stay in a cache through all the terms.
    for begin in range(0, given.size, _PIECE):
        piece = slice(begin, begin + _PIECE)
        found.reshape(-1)[piece] = legendre.legval(given[piece], series)
    return found


def variances(degree: int) -> Floats:
    """(degree + 1,) of harmonics of mean square 1 at each level; K(d, d) is 1."""
    level = np.arange(degree + 1)
    falling = 1 / (1 + (level / _LEVEL) ** 2)
    return np.asarray(falling / ((2 * level + 1) * falling).sum())


def _bits(views: _Views, target: Target) -> _Score:
    count, points = (target.degree + 1) ** 2, len(views.v)
    value = np.linalg.slogdet(views.left)[1].mean() / (count * np.log(2))
    scale = -target.snr / (count * np.log(2) * points)
    by_light = scale * np.einsum("pvw,pwv->pv", views.kernel, views.left)
    by_kernel = scale * views.left.transpose(0, 2, 1) * views.light[:, :, None]
    return _Score(float(value), by_light, by_kernel, np.zeros_like(views.v))


def _variance(views: _Views, target: Target, normals: Floats) -> _Score:
    """The mean over wanted directions; dX = snr Y dL Y' - X dK X with Y = (1 + snr L K)^-1."""
    wanted = wanted_of(target)
    share = shown(target, normals).T / (len(wanted) * len(views.v))
    c = covariance(views.v, wanted, target.degree)
    left = views.left
    x = target.snr * left * views.light[:, None, :]
    spread = c * share[:, None]
    known = spread @ c.transpose(0, 2, 1)
    value = share.sum() - (x * known).sum()
    by_light = -target.snr * (left * (known @ left)).sum(axis=1)
    by_toward = -2 * (x @ spread) * covariance(views.v, wanted, target.degree, slope=True)
    return _Score(float(value), by_light, x @ known @ x, by_toward @ wanted)
