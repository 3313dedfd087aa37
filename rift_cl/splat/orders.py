"""How many Hermite modes an order has, and which order a number of modes belongs to.

Arrays of coefficients say by their length what order they are of; a length that is none, or one
that the kernels are not made for, is refused here, by one sentence for all who read such arrays.
"""

from __future__ import annotations

from rift_cl.basis.indices import n_coeff
from rift_cl.errors import InputError

# What the kernels are made for, and tested to.
HIGHEST = 8


def count_of(order: int, dim: int = 3) -> int:
    """Modes to a total order, the constant among them: 1, 4, 10, 20, 35.. in space.

    Args:
        order: 0 to 8.
        dim: 3 in space, 2 on the screen.

    Raises:
        InputError: the order is out of range.
    """
    if order not in range(HIGHEST + 1):
        raise InputError(f"order is {order!r}, wanted a whole number from 0 to {HIGHEST}")
    return n_coeff(order, dim)


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
