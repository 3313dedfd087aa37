"""How well views know a target: one number for a set of cameras, and where it falls fastest."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any, Literal, NamedTuple, get_args

import numpy as np
from numpy.typing import ArrayLike

from rift_cl.errors import InputError, NonFiniteError, ShapeError, check_type
from rift_cl.geometry import Camera
from rift_cl.geometry.numbers import real_numbers
from rift_cl.sampling.coverage.host import host_coverage, host_coverage_grad
from rift_cl.sampling.criteria.exact import exact
from rift_cl.sampling.criteria.kriging import kriging
from rift_cl.sampling.criteria.optimality import Floats, Scored, scored
from rift_cl.sampling.criteria.surface import surface_criterion
from rift_cl.sampling.targets.camera_gradients import CameraGradients, camera_gradients
from rift_cl.sampling.targets.observations import Observations, ObservationsGradient
from rift_cl.sampling.targets.prior import checked_power

if TYPE_CHECKING:
    from rift_cl.cl import Device
    from rift_cl.sampling.targets.target import Target

# Those that are functions of coverage, with a gradient.
CoverageCriterion = Literal["wiener", "logdet", "worst"]
CriterionKind = Literal["wiener", "logdet", "worst", "kriging", "exact"]
# Products of views, points and frequencies from which a device is faster than the host.
_LARGE = 1 << 18


class Merit(NamedTuple):
    """A score of cameras.

    Args:
        value: lower is better.
        gradient: by what the cameras are; None for ``kriging`` and ``exact``.
    """

    value: float
    gradient: CameraGradients | None


def merit(
    cameras: Sequence[Camera],
    target: Target,
    kind: CriterionKind = "wiener",
    *,
    weights: ArrayLike | None = None,
    device: Device | None = None,
) -> Merit:
    """Score what cameras will know of a target.

    ``wiener``, the default, is the share of the target's power that stays unknown to the best
    linear estimator; ``logdet`` minus the bits per frequency; ``worst`` the unknown share of the
    worst seen direction. All three are functions of the coverage alone, and are for ranking: their
    values are optimistic where views tell the same twice, and for few even views at a high
    signal-to-noise ratio (about half of ``exact`` for 12 in the plane at 1e4), and pessimistic
    where views crowd in a sector.
    ``kriging`` and ``exact`` count correlated views as what they are; they have no gradient and
    take long. ``exact`` counts frequencies up to ``samples / (2 diameter)``, with 24 samples across
    a flat target and 10 across one in space, whatever the target's band. Where the target's
    frequencies were not given, the others are taken at those that plans are judged at, ten times as
    many as ``target.k``. A target that no camera sees is all unknown: 1, or no bits. A target of
    mode ``surface`` is scored by ``surface_merit``.

    Args:
        cameras: V views, at least one.
        target: what is looked at.
        kind: of the score; see above.
        weights: (V,) relative photons of the views; 1 each by default.
        device: where the coverage of a large problem is counted and passed back, in float32, so
            that value and gradient hold to 1e-3: one whose views times points times frequencies
            are over 260,000, some seven times faster than on the host even where the device is
            its CPU. Smaller ones, and all without a device, are counted in float64 on the host.

    Raises:
        ShapeError: there is no camera, or weights do not fit.
        InputError: what is given are no cameras, the kind is unknown or does not go with the
            target's mode, or the prior makes no sense.
    """
    if kind not in get_args(CriterionKind):
        raise InputError(
            f"merit: kind is {kind!r}, wanted one of {', '.join(get_args(CriterionKind))}"
        )
    # Imported when used: a target names the criteria that it takes.
    from rift_cl.sampling.targets.scattered import scattered
    from rift_cl.sampling.targets.target import Target

    check_type("merit", "target", target, Target)
    unweighted = Observations.of(cameras, target.points)
    observations = unweighted.weighted(weights)
    if kind == "kriging" or kind == "exact":  # noqa: PLR1714 - what is narrowed by its type
        if target.mode == "surface":
            raise InputError(f"merit: a surface has no {kind}; take wiener, logdet or worst")
        return Merit((kriging if kind == "kriging" else exact)(observations, target), None)
    if target.mode == "surface":
        value, by_observations = surface_criterion(observations, target, kind)
    else:
        value, by_observations = _volume(observations, scattered(target), kind, device)
    return Merit(value, camera_gradients(cameras, unweighted, by_observations))


def _volume(
    observations: Observations, target: Target, kind: CoverageCriterion, device: Device | None
) -> tuple[float, ObservationsGradient]:
    k, diameter = target.k, target.diameter
    if device is None or observations.weight.size * len(k) < _LARGE:
        scored = criterion_of_coverage(kind, host_coverage(observations, k, diameter), target)
        return scored.value, host_coverage_grad(observations, k, diameter, scored.gradient)
    from rift_cl.sampling.coverage.device import coverage, coverage_grad

    scored = criterion_of_coverage(kind, coverage(observations, target, device=device), target)
    return scored.value, coverage_grad(observations, target, scored.gradient, device=device)


def criterion_of_coverage(kind: CoverageCriterion, coverage: Any, target: Target) -> Scored:
    """Score the coverage of a target's frequencies.

    Args:
        kind: ``wiener``, ``logdet`` or ``worst``; see ``optimality``.
        coverage: (P, K) L at each of the target's points and frequencies ``target.k``.
        target: what is looked at: its prior and its signal-to-noise ratio count.

    Returns:
        The value, lower is better, and its derivative by the coverage (P, K).

    Raises:
        InputError: the kind is unknown, the prior makes no sense, or coverage is negative or does
            not fit.
    """
    known = _coverage(coverage, len(target.k))
    power = checked_power(target.prior, target.k, target.diameter)
    return scored(kind, known, power, target.snr, target.k)


def _coverage(values: Any, frequencies: int) -> Floats:
    known = real_numbers(values)
    if known is None or known.ndim != 2 or known.shape[1] != frequencies or not len(known):
        raise ShapeError(
            f"coverage has shape {np.shape(values)}, wanted (points, {frequencies}) real numbers"
        )
    if not np.isfinite(known).all():
        raise NonFiniteError("coverage holds NaN or infinity, wanted finite numbers")
    if known.min() < 0:
        raise InputError(f"coverage goes down to {known.min():g}, wanted zero or more")
    return known
