"""How many passes a Fourier transform takes, and the operations in them.

A pass of radix 9, 8, 4, 3 or 2 (kernels/include/fourier/butterfly.h) adds up the samples of a
butterfly and turns all results but the first: 8 complex additions and 3 complex products for 4
samples, and so on. Nine samples are six transforms of three with four products between them; eight
are two transforms of four, two turns of an eighth and eight additions. A complex addition is 2
flop, a complex product 6.
"""

from __future__ import annotations

# Flop of a butterfly: additions and factors, then the products.
_BUTTERFLY = {9: 6 * 16 + 4 * 6 + 48, 8: 2 * 16 + 8 + 16 + 42, 4: 16 + 18, 3: 16 + 12, 2: 4 + 6}


def radices(length: int) -> list[int]:
    """The radices of the passes, in their order."""
    found = []
    while length > 1:
        found.append(next(radix for radix in _BUTTERFLY if length % radix == 0))
        length //= found[-1]
    return found


def transform_flops(length: int) -> float:
    """Flop of one complex transform."""
    return length * sum(_BUTTERFLY[radix] / radix for radix in radices(length))


def transform_bytes(length: int, itemsize: int = 4) -> float:
    """Bytes of one complex transform: every pass reads and writes all its samples."""
    return 4.0 * itemsize * length * len(radices(length))
