"""How many Hermite modes an order has, and which order a number of modes belongs to.

Arrays of coefficients say by their length what order they are of; a length that is none, or one
that the kernels are not made for, is refused here, by one sentence for all who read such arrays.
Here as well: how many numbers the kernels keep of splats with modes of some orders.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Protocol

from rift_cl.basis.indices import n_coeff
from rift_cl.basis.numbers import whole
from rift_cl.errors import InputError

# What the kernels are made for, and tested to.
HIGHEST = 8
# The rows of L^-1 come before the modes: i00, i10, i11.
WHITENING = 3


class Modal(Protocol):
    """Splats that may have modes: on a device, or as a scene on the host."""

    @property
    def shape_modes(self) -> Any:
        """(N, K - 1), or None."""

    @property
    def color_modes(self) -> Any:
        """(N, K - 1, C), or None."""

    def __len__(self) -> int:
        """Number of splats."""


@dataclass(frozen=True)
class ModeOrders:
    """What modes splats have, and what the kernels keep of them.

    Args:
        shape: highest order of the polynomials of opacity or density.
        color: the same of the colours' polynomials.
        channels: how many channels have polynomials.
    """

    shape: int = 0
    color: int = 0
    channels: int = 0

    @classmethod
    def of(cls, splats: Modal) -> ModeOrders:
        """The orders of these splats' modes.

        Raises:
            InputError: a number of modes belongs to no order.
        """
        shape, color = splats.shape_modes, splats.color_modes
        return cls(
            0 if shape is None else order_of(shape.shape[1] + 1),
            0 if color is None else order_of(color.shape[1] + 1),
            0 if color is None else color.shape[2],
        )

    @property
    def row_length(self) -> int:
        """Numbers of a splat on the screen: see ``ScreenModes.table``."""
        return WHITENING + n_coeff(self.shape, 2) - 1 + self._color_numbers

    def record_length(self, channels: int) -> int:
        """Floats of one gradient record, for an image of a number of channels.

        ``kernels/include/raster/hermite_slots.h`` says what they are; a gradient by the place has
        moments of two orders more than the polynomial.
        """
        return n_coeff(self.shape + 2, 2) + channels + self._color_numbers

    @property
    def _color_numbers(self) -> int:
        return (n_coeff(self.color, 2) - 1) * self.channels


def check_order(order: int, name: str = "order") -> int:
    """Read an order.

    Raises:
        InputError: it is out of range.
    """
    return whole(order, name, 0, HIGHEST)


def count_of(order: int, dim: int = 3) -> int:
    """Modes to a total order, the constant among them: 1, 4, 10, 20, 35.. in space.

    Args:
        order: 0 to 8.
        dim: 3 in space, 2 on the screen.

    Raises:
        InputError: the order is out of range.
    """
    return n_coeff(check_order(order), dim)


def order_of(count: int, dim: int = 3) -> int:
    """The order that has this many modes, the constant among them; undoes ``count_of``.

    Raises:
        InputError: no order up to 8 has so many.
    """
    counts = [count_of(order, dim) for order in range(HIGHEST + 1)]
    if count not in counts:
        raise InputError(
            f"{count!r} modes belong to no order: wanted {', '.join(map(str, counts[:-1]))} or "
            f"{counts[-1]} in {dim} dimensions, for the orders 0 to {HIGHEST}"
        )
    return counts.index(count)
