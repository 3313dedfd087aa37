"""How far each ray can be trusted, by the quanta that arrived (penalised weighted least squares).

A ray of line integral p arrives with ``N = I0 exp(-p)`` of its I0 quanta. N is a Poisson number,
and to first order the variance of ``p = -log(N / I0)`` is 1 / N; a detector that adds noise of its
own, of standard deviation s in quanta, makes that ``(N + s^2) / N^2``. Least squares weigh each ray
by the inverse of its variance (Sauer and Bouman, IEEE Trans. Signal Process. 41, 1993; Thibault et
al., Med. Phys. 34, 2007), so that a ray starved by metal no longer draws a streak.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from rift_cl.cl.host_arrays import as_real_array
from rift_cl.errors import InputError, ShapeError
from rift_cl.geometry.numbers import one_number


class RayWeights(NamedTuple):
    """Weights of rays, and the noise that goes with them.

    Args:
        weights: relative inverse variances, float32, of the data's shape; their mean over the
            measured rays is 1, so that the weight of a total variation means what it does without
            them. 0 where nothing was measured.
        noise: standard deviation of the noise of a ray of weight 1, which is what the solvers'
            ``noise`` is compared with; right as far as ``flat_counts`` are quanta.
    """

    weights: NDArray[np.float32]
    noise: float


def poisson_weights(
    line_integrals: ArrayLike, flat_counts: ArrayLike = 1.0, *, read_noise: float = 0.0
) -> RayWeights:
    """Weights by counts.

    Args:
        line_integrals: data, (angle, bin) or (angle, row, bin); NaN or infinite where nothing was
            measured. Detectors that count nothing give a very large one, and next to no weight.
        flat_counts: quanta without a sample, after the dark level is subtracted: a number, or an
            array such as (bin,) or (row, bin) that fits the data's last axes. Only ratios matter
            to the weights, only the level to ``noise``.
        read_noise: standard deviation of what the detector adds, in quanta.

    Raises:
        ShapeError: ``flat_counts`` do not fit the data.
        InputError: ``flat_counts`` are not positive, ``read_noise`` is negative, or no ray arrived.
    """
    p = as_real_array(line_integrals, name="line_integrals").astype(np.float64)
    flat = as_real_array(flat_counts, name="flat_counts").astype(np.float64)
    if not (np.isfinite(flat).all() and (flat > 0).all()):
        raise InputError("flat_counts hold numbers that are not positive and finite: quanta wanted")
    if not one_number(read_noise) >= 0:
        raise InputError(f"read_noise is {read_noise!r}, wanted a standard deviation, 0 or more")
    try:
        flat = np.broadcast_to(flat, p.shape)
    except ValueError:
        raise ShapeError(
            f"flat_counts have shape {flat.shape}, which does not fit the data's {p.shape}"
        ) from None
    measured = np.isfinite(p)
    # Beyond these the exponential is no number any more.
    counts = flat * np.exp(-np.clip(np.where(measured, p, 0.0), -300, 300))
    certainty = np.where(measured, counts / (1 + read_noise**2 / counts), 0.0)
    mean = certainty[measured].mean() if measured.any() else 0.0
    if not mean > 0:
        raise InputError("line_integrals hold no measured ray: nothing to weigh")
    weights = (certainty / mean).astype(np.float32)
    return RayWeights(weights, float(1 / np.sqrt(mean)))
