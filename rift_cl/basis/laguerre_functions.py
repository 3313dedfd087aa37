"""Laguerre-Gaussian functions of the plane, in the two forms.

    std: (-1)^p sqrt(p! / (pi (p + |l|)!)) r^|l| L_p^|l|(r^2) exp(-r^2 / 2) exp(i l phi)
    der: (-1)^p sqrt(p! / (p + |l|)!) (r / sqrt 2)^|l| L_p^|l|(r^2 / 2) exp(-r^2 / 2) exp(i l phi)

``std`` is orthonormal (Beijersbergen et al. 1993; Massey and Refregier 2005, as polar shapelets);
``der`` holds the elegant modes, (D+)^n+ (D-)^n- exp(-r^2 / 2) / sqrt(n+! n-!) with D+- =
-(d/dx +- i d/dy) / sqrt 2, n+ = p + max(l, 0), n- = p + max(-l, 0). The (-1)^p is what makes the
matrix to the Hermite functions free of signs, and the same for both forms. They are computed here
by the recurrence of the Laguerre polynomials, so that the matrix can be checked against them.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rift_cl.basis.hermite_functions import Form, nearby


def radial_ladder(x: NDArray[Any], turns: int, count: int, form: Form) -> list[NDArray[Any]]:
    """The functions of l = ``turns`` >= 0 for p = 0..count - 1, complex, each (...).

    From (p + 1) L_(p+1) = (2 p + 1 + l - s) L_p - (p + l) L_(p-1) (Abramowitz and Stegun 22.7.12).

    Args:
        x: (..., 2) points.
        turns: l, how often the phase turns.
        count: how many.
        form: which of the two.
    """
    x = nearby(x)
    square = (x * x).sum(-1)
    s, step = (square / 2, math.sqrt(0.5)) if form == "der" else (square, 1.0)
    z = (x[..., 0] + 1j * x[..., 1]) * step
    first = np.exp(-square / 2) * (1.0 if form == "der" else math.pi**-0.5)
    for k in range(1, turns + 1):
        first = first * z / math.sqrt(k)
    table = [first + 0j]
    for p in range(count - 1):
        scale = math.sqrt((p + 1) * (p + 1 + turns))
        below = math.sqrt(p * (p + turns)) / scale * table[p - 1] if p else 0.0
        table.append((s - (2 * p + 1 + turns)) / scale * table[p] - below)
    return table


def functions(x: NDArray[Any], modes: NDArray[np.intp], form: Form, *, real: bool) -> NDArray[Any]:
    """Laguerre-Gaussian functions at points.

    Args:
        x: (..., 2).
        modes: (K, 2) of p and l, or for real ones (K, 3) of p, l >= 0 and 0 for the cosine (the
            sum of l and -l over sqrt 2) or 1 for the sine (their difference over i sqrt 2).
        form: which of the two.
        real: which of the modes.

    Returns:
        (..., K), float64 if ``real`` and else complex128.
    """
    values = np.empty((*x.shape[:-1], len(modes)), np.float64 if real else np.complex128)
    for turns in set(np.abs(modes[:, 1]).tolist()):
        chosen = np.flatnonzero(np.abs(modes[:, 1]) == turns)
        ladder = radial_ladder(x, turns, int(modes[chosen, 0].max()) + 1, form)
        for k in chosen:
            mode = ladder[modes[k, 0]]
            if real:
                part = mode.imag if modes[k, 2] else mode.real
                values[..., k] = part * (math.sqrt(2) if turns else 1.0)
            else:
                values[..., k] = mode if modes[k, 1] >= 0 else mode.conj()
    return values
