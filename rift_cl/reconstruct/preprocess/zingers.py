"""Zingers removed: single pixels hit by a cosmic ray or a scattered X-ray photon.

A zinger stands in one view alone and far above its neighbours; in the slice it draws a streak
along its ray. A pixel is taken for one where it exceeds the median of its neighbourhood by so many
standard deviations of the noise of its own detector pixel, and where nothing near it in the views
before and after stands out half as far, as small bright details of the object would. It is replaced
by that median.

The noise of counts grows with their square root, and the roots of counts have the same noise
whatever the mean (Anscombe, Biometrika 35, 246 (1948)). So roots are compared, and the noise of a
detector pixel is one number for all views, bright or dark. It is measured by second differences
across bins, which slopes of the object leave at zero: by the median of their sizes over the views.
"""

from __future__ import annotations

from typing import Any, Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

from rift_cl.cl.budget import plan_chunks
from rift_cl.cl.device import Device
from rift_cl.cl.discovery import default_device
from rift_cl.errors import InputError, checked_flag
from rift_cl.reconstruct.preprocess.columns import FEWEST_VIEWS, DetectorColumns
from rift_cl.reconstruct.preprocess.projection_array import as_projections

Floats = NDArray[np.float32]

# From the median, and from the mean, of absolute deviations to the standard deviation.
_FROM_MEDIAN, _FROM_MEAN = 1.4826, 1.2533
# The sum of squares of a second difference's weights, 1, -2 and 1.
_SECOND_DIFFERENCE = 6
# Single photons have a median deviation of zero: the noise is at least this share of the mean one.
_MEAN_SHARE = 0.5
# A difference of less than this share of a row's mean is no zinger, however low the noise is.
_LEAST = 0.02
# Below this share of a row's mean the detector's own noise counts, which has no root in it.
_FLOOR = 0.01
# Noise is measured in so many views, and over bins enough for so many samples together; of very few
# views, over the whole row.
_NOISE_VIEWS, _NOISE_SAMPLES = 256, 256
# The rim of an object as wide as the detector moves between two of n views over half a turn by at
# most pi / 2n, rounded up to 2 / n, of the detector's width; and the most bins that it is followed.
_QUARTER_TURN, _MOST_BESIDE = 2, 8
# Line integrals beyond this are none in single precision.
_OPAQUE = 80.0
_CPU_RUN = 4096


def remove_zingers(
    stack: Any,
    *,
    sigma: float = 6.0,
    excess: float | None = None,
    size: Literal[3, 5] = 3,
    dark: bool = False,
    kind: Literal["transmission", "attenuation"] = "transmission",
    device: Device | None = None,
) -> tuple[Floats, int]:
    """Replace single outlying pixels of projections by the median of their neighbourhood.

    The neighbourhood is size x size pixels in a projection, or 3 views x size bins where the scan
    has one row. Rows of a slab are treated as those of the whole scan, except size // 2 rows at
    either edge, whose neighbours are missing: read so many more, and drop them.

    Args:
        stack: projections, (angle, row, bin) or (angle, bin).
        sigma: how far a pixel stands out, in standard deviations of its detector pixel's noise.
        excess: instead of ``sigma``, how far a pixel exceeds the median, in the unit of the
            projections; this test alone decides then. For attenuation: in transmission.
        size: of the neighbourhood, 3 or 5 pixels; take 5 where zingers cover more than 4 pixels.
        dark: replace pixels that are as far below, too.
        kind: whether the projections are counts or transmissions (both "transmission"), or line
            integrals, in which a zinger is a dip.
        device: where to compute; the default device if not given.

    Returns:
        float32 projections of the same shape, a new array, and the number of pixels replaced.

    Raises:
        ShapeError: the array has other axes.
        NonFiniteError: a value is NaN or infinite.
        InputError: an option has no meaning.
    """
    _check_options(sigma, excess, size, kind)
    values = as_projections(stack, name="stack")
    rule = _Rule(sigma, excess, size, checked_flag("remove_zingers", "dark", dark))
    projections = values if values.ndim == 3 else values[:, None]
    if kind == "attenuation":
        light = np.exp(-np.clip(projections, -_OPAQUE, _OPAQUE))
        clean = _cleaned(light, rule, device)
        replaced = clean != light
        out = projections.copy()
        out[replaced] = -np.log(np.maximum(clean[replaced], np.finfo(np.float32).tiny))
    else:
        out = _cleaned(projections, rule, device)
        replaced = out != projections
    return out.reshape(values.shape), int(np.count_nonzero(replaced))


class _Rule(NamedTuple):
    """What is replaced: see ``remove_zingers``."""

    sigma: float
    excess: float | None
    size: int
    dark: bool


def _cleaned(stack: Floats, rule: _Rule, device: Device | None) -> Floats:
    """Projections (view, row, bin) without zingers, as many rows at a time as the device holds."""
    views, rows, bins = stack.shape
    away = rule.size // 2
    if bins < rule.size or max(rows, views) < rule.size or not stack.size:
        return stack.copy()
    device = device or default_device()
    out = np.empty(stack.shape, np.float32)
    array, beside = 4 * views * bins, 0 if rows == 1 else 2 * away
    fitting = plan_chunks(
        rows,
        3 * array,
        beside * 3 * array,
        device.budget,
        what="row of the projections",
        array=array,
        largest=device.traits.allocation - beside * array,
    )
    for chunk in fitting:
        first = max(0, chunk.start - away)
        slab = np.ascontiguousarray(stack[:, first : chunk.stop + away])
        inner = slice(chunk.start - first, chunk.stop - first)
        out[:, chunk] = _cleaned_slab(slab, rule, device, sinogram=rows == 1)[:, inner]
    return out


def _cleaned_slab(slab: Floats, rule: _Rule, device: Device, *, sinogram: bool) -> Floats:
    views, rows, bins = slab.shape
    run = _CPU_RUN if device.traits.is_cpu else 1
    size, away = (-(-bins // run), rows, views), rule.size // 2
    x, medians = device.array(slab), device.empty(slab.shape)
    reach = {"VIEWS_AWAY": int(sinogram), "ROWS_AWAY": 0 if sinogram else away, "BINS_AWAY": away}
    shape = {"views": views, "rows": rows, "bins": bins}
    device.launch("local_median", size, x=x, out=medians, **shape, RUN=run, **reach)
    if rule.excess is None:
        some = slice(None, None, -(-views // _NOISE_VIEWS))
        levels = _row_means(slab[some])[:, None] * np.array([_LEAST, _FLOOR])
        noise = _noise(slab[some], device.get(medians)[some], levels[:, 1], device)
        limits = rule.sigma / 2 * noise
    else:
        levels = np.repeat([[rule.excess, 0.0]], rows, axis=0)
        limits = np.zeros((rows, bins))
    out = device.empty(slab.shape)
    device.launch(
        "zinger_replace",
        size,
        x=x,
        medians=medians,
        limits=device.array(limits, np.float32),
        levels=device.array(levels, np.float32),
        out=out,
        **shape,
        DARK=int(rule.dark),
        ALONE=int(rule.excess is None),
        BINS_BESIDE=_bins_beside(views, bins),
        RUN=run,
    )
    found: Floats = device.get(out)
    return found


def _noise(
    stack: Floats, medians: Floats, floors: NDArray[np.float64], device: Device
) -> NDArray[np.float64]:
    """Noise of each detector pixel in units of the root of the median, (row, bin)."""
    from scipy.ndimage import uniform_filter1d

    root = np.sqrt(np.maximum(medians[:, :, 1:-1], floors[:, None].astype(np.float32)))
    curved = np.abs(np.diff(stack, 2, axis=2)) / np.sqrt(np.float32(_SECOND_DIFFERENCE))
    # A row that is zero throughout has no noise, and no level to measure it by.
    away = np.divide(curved, root, out=np.zeros_like(curved), where=root > 0)
    if len(stack) < FEWEST_VIEWS:
        whole = _deviation(np.median(away, axis=(0, 2)), _row_means(away))
        return np.broadcast_to(whole[:, None], stack.shape[1:])
    columns = DetectorColumns(device, away)
    columns.sort()
    middle = columns.levels((columns.views - 1) // 2)
    pixels = _deviation(middle, away.mean(axis=0, dtype=np.float64))
    bins = min(stack.shape[2], -(-_NOISE_SAMPLES // len(stack)))
    smooth = uniform_filter1d(pixels, bins, axis=1, mode="reflect")
    return np.pad(smooth, ((0, 0), (1, 1)), mode="edge")


def _deviation(median: NDArray[Any], mean: NDArray[np.float64]) -> NDArray[np.float64]:
    """The standard deviation from the median and the mean of absolute deviations."""
    return np.maximum(_FROM_MEDIAN * median, _MEAN_SHARE * _FROM_MEAN * mean)


def _bins_beside(views: int, bins: int) -> int:
    """How far the object may move between views, over half a turn, and one bin more."""
    return 1 + min(_MOST_BESIDE, -(-_QUARTER_TURN * bins // views))


def _row_means(stack: Floats) -> NDArray[np.float64]:
    """The mean of the absolute values of each row; of copies, as sums follow the strides."""
    rows = (np.ascontiguousarray(stack[:, row]) for row in range(stack.shape[1]))
    return np.array([np.abs(row).mean(dtype=np.float64) for row in rows])


def _check_options(sigma: float, excess: float | None, size: int, kind: str) -> None:
    if not _is_positive(sigma):
        raise InputError(f"sigma is {sigma!r}, wanted a positive number of standard deviations")
    if excess is not None and not _is_positive(excess):
        raise InputError(f"excess is {excess!r}, wanted a positive number in the projections' unit")
    if size not in (3, 5):
        raise InputError(f"size is {size}, wanted 3 or 5 pixels")
    if kind not in ("transmission", "attenuation"):
        raise InputError(f"kind is {kind!r}, wanted 'transmission' or 'attenuation'")


def _is_positive(value: Any) -> bool:
    is_number = isinstance(value, (int, float, np.floating, np.integer))
    return is_number and bool(0 < value < np.inf)
