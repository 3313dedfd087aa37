"""Opaque targets: what views tell about the texture and the appearance of a surface.

A picture of a surface is no projection of a volume, so the slice theorem says nothing about it. At
each point, the texture of the tangent plane has frequencies of its own; a view at an angle squeezes
them along its tilt, gets the less light the more it grazes, and sees nothing from behind. How
brightness changes with the direction needs views from several sides of each point.

That other parts of the target stand in the way is not known here; points are seen by their normals.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from rift_cl.errors import InputError
from rift_cl.optics.optical_transfer import Floats, Transfer, optical_transfer
from rift_cl.sampling.criteria import optimality as criteria
from rift_cl.sampling.criteria.appearance import appearance_error
from rift_cl.sampling.targets.observations import Observations, ObservationsGradient
from rift_cl.sampling.targets.prior import checked_power

if TYPE_CHECKING:
    from rift_cl.sampling.targets.target import Target

# Frequencies of a tangent plane.
_TEXTURE = 150


class _Observed(NamedTuple):
    """Texture frequencies of one point, as V views see them; arrays (V, K) unless said.

    Args:
        q: (K, 3) in the tangent plane.
        cosine: (V, 1) of the angle to the normal, 0 from behind.
        along: ``q . v / cosine``, what the tilt adds to the frequency.
        transfer: at the frequency across the line of sight.
    """

    q: Floats
    cosine: Floats
    along: Floats
    transfer: Transfer


def surface_criterion(
    observations: Observations, target: Target, kind: str = "wiener"
) -> tuple[float, ObservationsGradient]:
    """Errors of a surface's texture and of its appearance, added; each from 0 to 1.

    The texture's coverage is ``sum w cos MTF^2``, scored by ``optimality``; the posterior
    variance of the appearance is that of ``rift_cl.sampling.criteria.appearance``.

    Args:
        observations: V views of the target's points.
        target: of mode ``surface``; the prior is taken in the tangent planes' own axes.
        kind: ``wiener``, ``logdet`` or ``worst``, the last for the texture alone.

    Returns:
        The value, lower is better, and its derivative by the looks.

    Raises:
        InputError: the target has no normals, or the kind is unknown.
    """
    if target.normals is None:
        raise InputError("surface_merit: the target has no normals, wanted one for each point")
    texture, gradient = _texture(observations, target, target.normals, kind)
    appearance, by_direction, by_weight = appearance_error(
        observations, target, target.normals, kind
    )
    whole = gradient._replace(
        direction=gradient.direction + by_direction, weight=gradient.weight + by_weight
    )
    return texture + appearance, whole


def texture_coverage(observations: Observations, target: Target) -> Floats:
    """Coverage (P, K) of the frequencies of each point's tangent plane."""
    points = range(observations.weight.shape[1])
    normals = np.zeros((len(points), 3)) if target.normals is None else target.normals
    return np.stack(
        [
            _sum(observations, p, _observed(observations, p, normals[p], _plane(target)))
            for p in points
        ]
    )


def _plane(target: Target) -> Floats:
    from rift_cl.sampling.targets.target import half_disc

    return half_disc(target.highest, _TEXTURE)


def _texture(
    observations: Observations, target: Target, normals: Floats, kind: str
) -> tuple[float, ObservationsGradient]:
    plane = _plane(target)
    power = checked_power(target.prior, plane, target.diameter)
    observed = [_observed(observations, p, normal, plane) for p, normal in enumerate(normals)]
    coverage = np.stack([_sum(observations, p, one) for p, one in enumerate(observed)])
    scored = criteria.scored(kind, coverage, power, target.snr, plane)
    parts = [
        _gradient(observations, p, normals[p], one, scored.gradient[p])
        for p, one in enumerate(observed)
    ]
    return scored.value, ObservationsGradient(
        *(np.stack(values, axis=1) for values in zip(*parts, strict=True))
    )


def _observed(observations: Observations, point: int, normal: Floats, plane: Floats) -> _Observed:
    axis = np.eye(3)[np.argmin(np.abs(normal))]
    first = np.cross(axis, normal)
    first /= np.linalg.norm(first)
    q = plane[:, :1] * first + plane[:, 1:2] * np.cross(normal, first)
    direction = observations.direction[:, point]
    cosine = np.maximum(direction @ normal, 0)[:, None]
    along = (direction @ q.T) / np.maximum(cosine, 1e-9)
    k = np.sqrt((q**2).sum(1) + along**2)
    optics = (observations.pixel, observations.cutoff, observations.blur)
    transfer = optical_transfer(k, *(values[:, point, None] for values in optics))
    return _Observed(q, cosine, along, transfer)


def _sum(observations: Observations, point: int, observed: _Observed) -> Floats:
    light = observations.weight[:, point, None] * observed.cosine
    return np.asarray((light * observed.transfer.value**2).sum(0))


def _gradient(
    observations: Observations, point: int, normal: Floats, observed: _Observed, upstream: Floats
) -> tuple[Any, ...]:
    """Of one point: by direction (V, 3), weight, pixel, cutoff and blur (V,)."""
    passed, weight = observed.transfer, observations.weight[:, point, None]
    by_light = (upstream * passed.value**2).sum(1)
    by_value = 2 * upstream * weight * observed.cosine * passed.value
    # The frequency's square is |q|^2 + along^2, and along is q . v / n . v.
    by_along = 2 * by_value * passed.square * observed.along / np.maximum(observed.cosine, 1e-9)
    by_cosine = by_light * weight[:, 0] - (by_along * observed.along).sum(1)
    by_direction = (
        by_along @ observed.q + (by_cosine * (observed.cosine[:, 0] > 0))[:, None] * normal
    )
    optics = [(by_value * part).sum(1) for part in (passed.pixel, passed.cutoff, passed.blur)]
    direction = _tangential(by_direction, observations.direction[:, point])
    return direction, by_light * observed.cosine[:, 0], *optics


def _tangential(vectors: Floats, direction: Floats) -> Floats:
    return np.asarray(vectors - (vectors * direction).sum(1, keepdims=True) * direction)
