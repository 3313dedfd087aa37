"""How well views sample each frequency, on the host in float64, with its derivatives.

A view along n is a projection, and so knows the plane n . k = 0 of the target's spectrum (the slice
theorem); a target of diameter D smears that plane to a slab about 1 / D thick, and optics weaken
what lies far out in it. All views together have at k the coverage

    L(k) = sum_j w_j MTF_j(|k_perp|)^2 rho(n_j . k)^2,       k_perp^2 = k^2 - (n . k)^2,

with rho(u) = exp(-(u / SD)^2), SD = 0.5 / D, a smooth stand-in for the spectrum of the target's
window. It is taken at a point of the target, since directions, distances and blur of a perspective
camera differ from point to point.

View planning optimizes small problems with these functions; ``device`` does the same in float32 for
large ones.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from rift_cl.optics.optical_transfer import Floats, Transfer, optical_transfer
from rift_cl.sampling.targets.observations import Observations, ObservationsGradient

# Exponents of rho^2 beyond which nothing is left: exp(-30) is 1e-13.
_FAR = 30.0
# Least share of a frequency's square across the line of sight: rounding leaves that much, and
# gradients are divided by it.
_ACROSS = 1e-14


def host_coverage(observations: Observations, k: ArrayLike, diameter: float) -> Floats:
    """The coverage L, (P, K), of frequencies (K, 3) by views of a target of that diameter.

    Args:
        observations: V views of P points.
        k: (K, 3) frequencies in cycles per unit of the world.
        diameter: of the target, in that unit.
    """
    return np.stack(
        [_near(observations, p, k, diameter).coverage() for p in range(observations.points)]
    )


def host_coverage_grad(
    observations: Observations, k: ArrayLike, diameter: float, grad: ArrayLike
) -> ObservationsGradient:
    """The gradient of a number E by the observations, from ``grad`` = dE/dL, (P, K)."""
    upstream = np.asarray(grad, np.float64)
    by_point = [
        _near(observations, p, k, diameter).gradient(upstream[p])
        for p in range(observations.points)
    ]
    return ObservationsGradient(*(np.stack(parts, axis=1) for parts in zip(*by_point, strict=True)))


class _Near(NamedTuple):
    """The pairs of a view and a frequency in its slab, for one point; N of them.

    Args:
        k: (K, 3) all frequencies.
        normals: (V, 3) all directions.
        view: (N,) which view.
        place: (N,) which frequency.
        u: (N,) n . k.
        steepness: 2 / SD^2, of rho^2 = exp(-steepness u^2).
        window: (N,) rho^2.
        weight: (N,) of the view.
        transfer: (N,) of its optics.
    """

    k: Floats
    normals: Floats
    view: NDArray[np.intp]
    place: NDArray[np.intp]
    u: Floats
    steepness: float
    window: Floats
    weight: Floats
    transfer: Transfer

    def coverage(self) -> Floats:
        parts = self.weight * self.window * self.transfer.value**2
        return _summed(self.place, parts, len(self.k))

    def gradient(self, upstream: Floats) -> tuple[Floats, Floats, Floats, Floats, Floats]:
        """By direction (V, 3), weight, pixel, cutoff and blur (V,)."""
        passed, g = self.transfer, upstream[self.place] * self.window
        by_value = 2 * g * self.weight * passed.value
        # k_perp^2 falls by 2 u du as the slab turns towards k.
        by_u = -2 * self.u * (by_value * passed.square)
        by_u -= 2 * self.u * self.steepness * g * self.weight * passed.value**2
        across = self.k[self.place] - self.u[:, None] * self.normals[self.view]
        turned = by_u[:, None] * across
        return (
            np.stack([self._by_view(turned[:, axis]) for axis in range(3)], axis=1),
            self._by_view(g * passed.value**2),
            self._by_view(by_value * passed.pixel),
            self._by_view(by_value * passed.cutoff),
            self._by_view(by_value * passed.blur),
        )

    def _by_view(self, values: Floats) -> Floats:
        return _summed(self.view, values, len(self.normals))


def _near(observations: Observations, point: int, frequencies: ArrayLike, diameter: float) -> _Near:
    k, normals = np.asarray(frequencies, np.float64), observations.direction[:, point]
    steepness = 2 * (diameter / 0.5) ** 2
    products = normals @ k.T
    view, place = np.nonzero(steepness * products**2 < _FAR)
    u = products[view, place]
    square = (k**2).sum(1)[place]
    k_perp = np.sqrt(np.maximum(square - u**2, _ACROSS * square))
    optics = (observations.pixel, observations.cutoff, observations.blur)
    transfer = optical_transfer(k_perp, *(values[view, point] for values in optics))
    window, weight = np.exp(-steepness * u**2), observations.weight[view, point]
    return _Near(k, normals, view, place, u, steepness, window, weight, transfer)


def _summed(group: NDArray[np.intp], values: Floats, count: int) -> Floats:
    return np.bincount(group, values, minlength=count).astype(np.float64, copy=False)
