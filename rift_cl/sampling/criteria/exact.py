"""What stays unknown to the best linear estimator, without approximation, on a small grid.

The oracle that the other merits are held against: the whole covariance of the target's samples,
and the whole matrix that maps them to the views' samples.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from rift_cl.errors import InputError, ResourceLimitError
from rift_cl.optics.optical_transfer import Floats, optical_transfer
from rift_cl.sampling.targets.observations import Observations
from rift_cl.sampling.targets.prior import checked_power

if TYPE_CHECKING:
    from rift_cl.sampling.targets.target import Target

# Samples across the target's diameter, in the plane and in space.
_IN_PLANE, _IN_SPACE = 24, 10
# Samples whose matrices still fit a small computer.
_MOST = 8192
_IN_THE_PLANE = 1e-6
# Columns of a matrix that are held at once.
_COLUMNS = 4096
# Views reach beyond the target by this, so that its samples do not alias.
_WIDER = 1.25


def exact(observations: Observations, target: Target, samples: int | None = None) -> float:
    """Posterior variance over prior variance: ``tr(C - C M' (M C M' + N)^-1 M C) / tr(C)``.

    C is the covariance by the prior of samples in the target's disc or ball, M projects them along
    every view's direction and passes the frequencies that a view's optics pass, and N is white,
    of the density that gives a view the target's signal-to-noise ratio at one cycle per diameter:
    ``volume / (snr * shadow)``. Frequencies go up to ``samples / (2 diameter)``, whatever the
    target's band.

    Args:
        observations: V views of the target's points; the mean over points is taken.
        target: its prior, diameter and signal-to-noise ratio count. A flat one is taken in the
            plane z = 0.
        samples: across the diameter; 24 in the plane and 10 in space by default.

    Raises:
        ResourceLimitError: that makes over 8192 samples.
        InputError: a view of a flat target looks along another direction than one in its plane, or
            there is so much more signal than noise that rounding hides what stays.
    """
    axes = 2 if target.is_flat else 3
    if axes == 2 and np.abs(observations.direction[..., 2]).max() > _IN_THE_PLANE:
        raise InputError("exact: the target is flat, wanted views along its plane z = 0")
    count = (_IN_PLANE if axes == 2 else _IN_SPACE) if samples is None else samples
    if not 1 <= count**axes <= _MOST:
        raise ResourceLimitError(f"exact: {count} samples across, too many for whole matrices")
    step = target.diameter / count
    across = (np.arange(count) + 0.5 - count / 2) * step
    grid = np.stack(np.meshgrid(*[across] * axes, indexing="ij"), -1).reshape(-1, axes)
    x = np.zeros((len(grid), 3))
    x[:, :axes] = grid
    inside = np.linalg.norm(x, axis=1) <= target.diameter / 2
    within = _covariance(target, count, axes)[np.ix_(inside, inside)]
    root = np.asarray(np.linalg.cholesky(within), np.float64)
    points = range(observations.weight.shape[1])
    left = [
        _left(root, _information(observations, point, target, x[inside], step)) for point in points
    ]
    return float(np.mean(left) / (root**2).sum())


def _left(root: Floats, information: Floats) -> float:
    """Trace of ``(C^-1 + information)^-1`` with ``C = root root'``."""
    from scipy.linalg import cho_factor, cho_solve

    whole = np.eye(len(root)) + root.T @ information @ root
    try:
        return float((root.T * cho_solve(cho_factor(whole), root.T)).sum())
    except np.linalg.LinAlgError as error:
        raise InputError(
            "exact: the target's signal to noise is so high that rounding hides what stays unknown;"
            " take a lower snr"
        ) from error


def _covariance(target: Target, count: int, axes: int) -> Floats:
    """Of all samples of the grid, (n, n), from the spectrum on a grid of twice its size."""
    double = 2 * count
    line = np.fft.fftfreq(double, target.diameter / count)
    k = np.zeros((double**axes, 3))
    k[:, :axes] = np.stack(np.meshgrid(*[line] * axes, indexing="ij"), -1).reshape(-1, axes)
    power = checked_power(target.prior, k, target.diameter).reshape((double,) * axes)
    by_offset = np.fft.ifftn(power).real * (count / target.diameter) ** axes
    place = np.stack(np.unravel_index(np.arange(count**axes), (count,) * axes))
    offset = (place[:, :, None] - place[:, None]) % double
    covariance = by_offset[tuple(offset)]
    # Rounding alone must not make it indefinite.
    covariance[np.diag_indices(len(covariance))] *= 1 + 1e-9
    return np.asarray(covariance)


def _information(
    observations: Observations, point: int, target: Target, x: Floats, step: float
) -> Floats:
    """``M' N^-1 M``, (n, n), summed over the views of one point."""
    axes, diameter = (2 if target.is_flat else 3), target.diameter
    width = _WIDER * diameter
    reach = np.arange(-int(width / (2 * step)), int(width / (2 * step)) + 1) / width
    q = np.stack(np.meshgrid(*[reach] * (axes - 1), indexing="ij"), -1).reshape(-1, axes - 1)
    q = q[np.linalg.norm(q, axis=1) <= 0.5 / step]
    # Volume over shadow: pi D / 4 of a disc, 2 D / 3 of a ball.
    density = (np.pi / 4 if axes == 2 else 2 / 3) * diameter / target.snr
    scale = step ** (2 * axes) / (density * width ** (axes - 1))
    at_once = max(_COLUMNS // (2 * len(q)), 1)
    total = np.zeros((len(x), len(x)))
    for first in range(0, len(observations.weight), at_once):
        views = range(first, min(first + at_once, len(observations.weight)))
        columns = [_columns(observations, view, point, x, q) for view in views]
        every = np.concatenate(columns, axis=1)
        total += scale * (every @ every.T)
    return total


def _columns(observations: Observations, view: int, point: int, x: Floats, q: Floats) -> Floats:
    """What each sample adds to one view's spectrum, cosines and sines, (n, 2 frequencies)."""
    optics = (
        values[view, point]
        for values in (observations.pixel, observations.cutoff, observations.blur)
    )
    passed = optical_transfer(np.linalg.norm(q, axis=1), *optics).value
    passed = passed * np.sqrt(observations.weight[view, point])
    phase = 2 * np.pi * (x @ _across(observations.direction[view, point], q.shape[1] + 1)) @ q.T
    return np.concatenate([np.cos(phase) * passed, np.sin(phase) * passed], axis=1)


def _across(direction: Floats, axes: int) -> Floats:
    """Unit vectors (3, axes - 1) across a direction; in the plane z = 0 where there is but one."""
    other = np.array([0.0, 0, 1]) if axes == 2 else np.eye(3)[np.argmin(np.abs(direction))]
    first = np.cross(other, direction)
    first /= np.linalg.norm(first)
    return np.stack([first, np.cross(direction, first)][: axes - 1], axis=1)
