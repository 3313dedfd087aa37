"""Objects of few materials from few directions: bounds, a support, and a directional variation.

    minimise  |W^(1/2) (A x - y)|^2 / 2 + weight * TV(x),    low <= x <= high inside the support,

x = low outside it, low and high the least and greatest level. Bounds are the convex half of "few
levels", and they do most of the work: what a missing wedge of directions leaves open is mostly
values that no material has. The problem stays convex, with one answer, whatever the start.

The other half is a pull of every pixel to its nearest level, the concave penalty ``(x - low)
(high - x) / 2`` between neighbouring levels. It sets in once the convex problem has settled, rises
slowly and stays weak, so that it decides what is nearly decided. A strong one loses more than it
gains, since it settles what the data leave open.

``disc_prior`` finds support and scale of a round object; ``direction_weights`` the variation that
knows the missing wedge. ``tools/limited_angle.py`` prints what each of them is worth.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from rift_cl.cl.elementwise import pull_to_levels
from rift_cl.errors import InputError, ShapeError
from rift_cl.geometry.numbers import one_number, real_numbers
from rift_cl.operators.linear import LinearOperator
from rift_cl.reconstruct.solvers.direction_weights import DirectionWeights
from rift_cl.reconstruct.solvers.pdhg import Pdhg

# Of 0.001 to 0.3 the best on wedges of 30 degrees, where A is so badly conditioned that the image
# takes long steps for the data to move at all.
_SIGMA = 0.003
# The best on discs with holes, with a wedge missing or few views all round, was 0.00003 to 0.0001.
_PULL = 3e-5
# Steps after which the pull sets in, and in which it rises.
_SETTLED, _RISING = 600, 400


class FewLevels(Pdhg):
    """A reconstruction of few levels that has begun.

    Args:
        A: any linear operator from images (y, x) or volumes (z, y, x).
        y: the data, of shape ``A.range``.
        weight: of the variation, see ``tv``.
        values: the levels, ascending, two or more; the image stays between the first and the last.
        support: share of each sample that the object may fill, an array of ``A.domain`` or (y, x)
            with numbers from 0 to 1 or booleans; everywhere if not given.
        direction_weights: how much a gradient counts by its direction; all alike if not given.
        start: image to begin from; zero, brought within the bounds, if not given.
        noise: standard deviation of the noise of a sample of y: the run ends once the residual is
            down to it. Where views are few that comes long before the bounds have done their work:
            better give none.
        weights: how much each sample counts, of the shape of y; 0 where nothing was measured.
        sigma: see ``Pdhg``.
        pull: strength of the pull to the levels, as a share of the greatest curvature of the data
            term. It sets in after 600 steps and is whole at 1,000: go for 1,200.

    Raises:
        InputError: an argument does not fit, or holds NaN or infinity.
    """

    def __init__(
        self,
        A: LinearOperator,
        y: Any,
        weight: float,
        values: Any = (0.0, 1.0),
        *,
        support: Any = None,
        direction_weights: DirectionWeights | None = None,
        start: Any = None,
        noise: float | None = None,
        weights: Any = None,
        sigma: float = _SIGMA,
        pull: float = _PULL,
    ) -> None:
        levels = real_numbers(values)
        if levels is None or levels.ndim != 1 or levels.size < 2 or not (np.diff(levels) > 0).all():
            raise InputError(f"values is {values!r}, wanted two or more levels, ascending")
        if not one_number(pull) >= 0:
            raise InputError(f"pull is {pull!r}, wanted a number, 0 or more")
        self.levels = levels
        filled = 1.0 if support is None else _support(support, A)
        super().__init__(
            A,
            y,
            weight,
            start=start,
            noise=noise,
            weights=weights,
            bounds=(levels[0], levels[0] + (levels[-1] - levels[0]) * filled),
            direction_weights=direction_weights,
            sigma=sigma,
        )
        self._pull = float(pull) * self._largest
        self._tau = 1 / (1 / self._tau + self._pull)
        self._steps = self.data.device.array(levels, self.data.dtype)

    def _add_pull(self, gradient: Any) -> None:
        strength = self._pull * min(max(self._now.step - _SETTLED, 0) / _RISING, 1.0)
        if strength > 0:
            pull_to_levels(self.data.device, self._steps, strength, self._now.image, gradient)

    def labels(self) -> NDArray[np.uint8]:
        """The level nearest to every sample of the image, by its number, on the host."""
        image = self.data.home.host(self.image)
        middle = (self.levels[1:] + self.levels[:-1]) / 2
        return np.searchsorted(middle, image).astype(np.uint8)


def _support(support: Any, A: LinearOperator) -> NDArray[np.float64]:
    if not isinstance(A, LinearOperator):
        raise InputError(f"A is a {type(A).__name__}, wanted a LinearOperator such as a Projector")
    shares = real_numbers(support)
    if shares is None or shares.shape not in (A.domain, A.domain[-2:]):
        shape = None if shares is None else shares.shape
        raise ShapeError(f"support has shape {shape}, wanted the image's {A.domain}")
    if not ((shares >= 0) & (shares <= 1)).all():
        raise InputError("support holds numbers that are no shares from 0 to 1")
    return shares
