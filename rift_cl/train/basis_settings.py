"""Splats that are more than Gaussians: which modes and lobes a fit gives them, and when.

Hermite-Gaussian splats (``hermite``) and Laguerre-Gaussian ones (``laguerre``) of the same total
order span the same functions, so that a fit of the one is a fit of the other, and both are kept as
Hermite modes; ``rift_cl.basis`` converts. Orders join one after the other, as degrees of harmonics
do: what is coarse should stand before what is fine begins to move.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal, get_args

from rift_cl.basis.angular import ANGULAR_BASES, angular_basis
from rift_cl.errors import InputError
from rift_cl.splat.orders import HIGHEST
from rift_cl.splat.settings import Activation, Angular
from rift_cl.train.ranges import check_choice, check_number, check_whole

BasisKind = Literal["gaussian", "hermite", "laguerre"]


@dataclass(frozen=True)
class BasisSettings:
    """Modes of the splats' shapes and colours.

    Args:
        kind: ``gaussian`` splats have none; ``hermite`` and ``laguerre`` are stored alike.
        order: highest total order of the shape's modes, 0 to 8.
        color_order: the same of the colours' modes; 0 for X-rays.
        activation: how densities become opacities; see ``SplatSettings``.
        first: share of the steps after which order 1 joins, with zeros.
        every: share of the steps between an order and the next.
        ridge: weight in the loss of the mean over splats of their modes' squares. Modes of orders
            1 and 2 of a shape do nearly what a shift and another covariance do, and polynomials
            of colours have no bound: without it they wander where nothing holds them.

    Raises:
        InputError: a number is out of its range, or a choice is unknown, or Gaussians have orders.
    """

    kind: BasisKind = "gaussian"
    order: int = 0
    color_order: int = 0
    activation: Activation = "clamp"
    first: float = 0.1
    every: float = 0.1
    ridge: float = 1e-3

    def __post_init__(self) -> None:
        """Check every number's range, and that they agree."""
        check_choice(self, "kind", get_args(BasisKind))
        check_choice(self, "activation", get_args(Activation))
        for name in ("order", "color_order"):
            check_whole(self, name, 0, HIGHEST)
            if self.kind == "gaussian" and getattr(self, name):
                raise InputError(
                    f"BasisSettings: {name} is {getattr(self, name)} and kind is 'gaussian', whose "
                    "splats have no orders: use 'hermite' or 'laguerre'"
                )
        for name in ("first", "every"):
            check_number(self, name, most=1)
        check_number(self, "ridge")

    @property
    def plain(self) -> bool:
        """Whether splats are Gaussians of one colour, drawn as they always were."""
        return not (self.order or self.color_order) and self.activation == "clamp"

    def order_at(self, step: int, steps: int) -> int:
        """The highest order that has joined by a step of a run, of shapes or colours."""
        highest, first = max(self.order, self.color_order), round(self.first * steps)
        if step < first or not highest:
            return 0
        between = round(self.every * steps)
        return min(highest, 1 + (step - first) // between) if between else highest


@dataclass(frozen=True)
class AngularSettings:
    """What colours vary in with the direction that they are seen from.

    Args:
        kind: spherical harmonics (``sh``), lobes with an axis and a width in Hermite- or
            Laguerre-Gaussian modes (``hg``, ``lg``), or isotropic or anisotropic spherical
            Gaussians (``sg``, ``asg``).
        modes: functions besides the constant: 1 to 35 modes or spherical Gaussians. Harmonics
            count by ``TrainSettings.sh_degree``.
        first: share of the steps after which they join, with coefficients of zero.

    Raises:
        InputError: a number is out of its range, or the kind is unknown.
    """

    kind: Angular = "sh"
    modes: int = 8
    first: float = 0.15

    def __post_init__(self) -> None:
        """Check every number's range."""
        check_choice(self, "kind", ANGULAR_BASES.names)
        check_whole(self, "modes", 1, 35)
        check_number(self, "first", most=1)

    @property
    def numbers(self) -> int:
        """What a splat's colour takes of lobes: coefficients of three channels, and geometry."""
        if self.kind == "sh":
            return 0
        basis = angular_basis(self.kind, 1 + self.modes)
        return 3 * basis.n_linear + basis.n_geometry
