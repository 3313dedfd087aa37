"""Splats that are more than Gaussians: which modes and lobes a fit gives them, and when.

Hermite-Gaussian splats (``hermite``) and Laguerre-Gaussian ones (``laguerre``) of the same total
order span the same functions, so that a fit of the one is a fit of the other, and both are kept as
Hermite modes; ``rift_cl.basis`` converts. Orders join one after the other, as degrees of harmonics
do: what is coarse should stand before what is fine begins to move.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Annotated, Literal, get_args

from tyro.conf import arg

from rift_cl.basis.angular import ANGULAR_BASES, angular_basis
from rift_cl.errors import SettingError
from rift_cl.option_marks import Expert, Short, ShortAuto
from rift_cl.splat.orders import HIGHEST
from rift_cl.splat.settings import Activation
from rift_cl.train.ranges import check_choice, check_number, check_registered, check_whole

BasisKind = Literal["gaussian", "hermite", "laguerre"]


# Order of the modes where a kind that has some is chosen, and no order.
_USUAL_ORDER = 1


@dataclass(frozen=True)
class BasisSettings:
    """Hermite modes of the splats' shapes and colours.

    Raises:
        InputError: a number is out of its range, or a choice is unknown, or Gaussians have orders.
    """

    kind: Annotated[BasisKind, arg(name="basis", prefix_name=False)] = "gaussian"
    """Kind of splats: plain (gaussian), or with Hermite- or Laguerre-Gaussian modes up to --order,
    which span the same functions and are stored alike."""
    order: ShortAuto[int] = 0
    """Highest total order of the modes of a splat's shape, 0 to 8. Default: 1 with --basis hermite
    or laguerre."""
    color_order: ShortAuto[int] = 0
    """Highest total order of the modes of a splat's colour, 0 to 8. Default: that of --order."""
    activation: Short[Activation] = "clamp"
    """How a splat's density E becomes its alpha: max(E, 0) (clamp), 1 - exp(-max(E, 0)) (exp), or
    1 - exp(-E) with the polynomial squared, so that E is never negative (square)."""
    first: Expert[float] = 0.1
    """Fraction of the run after which order 1 is added, with coefficients of zero."""
    every: Expert[float] = 0.1
    """Fraction of the run between one order and the next."""
    # Modes of orders 1 and 2 of a shape do nearly what a shift and another covariance do, and
    # polynomials of colours have no bound: without it they wander where nothing holds them.
    ridge: Expert[float] = 1e-3
    """Weight in the loss of the sum of the modes' squares, averaged over splats."""

    def __post_init__(self) -> None:
        """Check every number's range, and that they agree."""
        check_choice(self, "kind", get_args(BasisKind))
        check_choice(self, "activation", get_args(Activation))
        for name in ("order", "color_order"):
            if getattr(self, name) is not None:
                check_whole(self, name, 0, HIGHEST)
            if self.kind == "gaussian" and getattr(self, name):
                raise SettingError(
                    self,
                    name,
                    f"is {getattr(self, name)} and kind is 'gaussian', whose splats have no "
                    "orders: use 'hermite' or 'laguerre'",
                )
        for name in ("first", "every"):
            check_number(self, name, most=1)
        check_number(self, "ridge")

    @property
    def plain(self) -> bool:
        """Whether splats are plain Gaussians of one colour with the activation ``clamp``."""
        return not any(self.orders) and self.activation == "clamp"

    @property
    def orders(self) -> tuple[int, int]:
        """Orders of shape and colour; of what is None, those that are usual."""
        usual = 0 if self.kind == "gaussian" else _USUAL_ORDER
        order = usual if self.order is None else self.order
        return order, order if self.color_order is None else self.color_order

    def decided(self) -> BasisSettings:
        """These settings, with a value for what was left open."""
        order, color_order = self.orders
        return replace(self, order=order, color_order=color_order)

    def order_at(self, step: int, steps: int) -> int:
        """The highest order that has joined by a step of a run, of shapes or colours."""
        highest, first = max(self.orders), round(self.first * steps)
        if step < first or not highest:
            return 0
        between = round(self.every * steps)
        return min(highest, 1 + (step - first) // between) if between else highest


@dataclass(frozen=True)
class AngularSettings:
    """Functions of the viewing direction that colours are made of.

    Raises:
        InputError: a number is out of its range, or the kind is unknown.
    """

    kind: Annotated[str, arg(name="angular", prefix_name=False)] = "sh"
    """Functions of the viewing direction for colours: spherical harmonics (sh), Hermite- or
    Laguerre-Gaussian lobes with an axis and a width (hg, lg), or isotropic or anisotropic spherical
    Gaussians (sg, asg), or the name of a registered basis
    (rift_cl.basis.register_angular_basis)."""
    modes: Short[int] = 8
    """Number of lobe modes or spherical Gaussians besides the constant, 1 to 35; not for sh."""
    first: Expert[float] = 0.05
    """Fraction of the run after which lobes or spherical Gaussians are added, with coefficients of
    zero; not for sh."""

    def __post_init__(self) -> None:
        """Check every number's range."""
        check_registered(self, "kind", ANGULAR_BASES)
        check_whole(self, "modes", 1, 35)
        check_number(self, "first", most=1)

    @property
    def numbers(self) -> int:
        """What a splat's colour takes of lobes: coefficients of three channels, and geometry."""
        if self.kind == "sh":
            return 0
        basis = angular_basis(self.kind, 1 + self.modes)
        return 3 * basis.n_linear + basis.n_geometry
