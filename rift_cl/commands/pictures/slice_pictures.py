"""Slices of a volume as a report shows them: one at a time, through z, and along the axis."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from rift_cl.report.html_page import Page
from rift_cl.report.plot import framed

# Slices that a slider goes through, at most, and samples along a side of those.
FRAMES, SIDE = 32, 640
# Planes along the axis that a slider goes through, and slices from which there is one.
UPRIGHT, ENOUGH = 12, 16
# The display window leaves out this share of the darkest and of the brightest samples, in percent.
_TAIL = 0.5
# Samples along a side of an image that stand for all, at most.
THINNED = 1024

Floats = NDArray[np.float32]


def display_window(images: Sequence[Floats]) -> tuple[float, float]:
    """Black and white for some images, less the samples that would take all the contrast."""
    deciding = np.concatenate([thinned(image).ravel() for image in images])
    low, high = np.percentile(deciding, [_TAIL, 100 - _TAIL])
    return float(low), float(high) if high > low else float(low) + 1


def thinned(image: Floats) -> Floats:
    """Samples that stand for all where values are counted or sorted: a lattice of them."""
    return image[tuple(slice(None, None, -(-n // THINNED)) for n in image.shape)]


def smaller(image: Floats, axes: tuple[int, ...] = (0, 1)) -> Floats:
    """Means over blocks of an image, so that no side has more than ``SIDE`` samples.

    What is left over at the end of an axis, less than one block, is left out.
    """
    for axis in axes:
        block = -(-image.shape[axis] // SIDE)
        count = image.shape[axis] // block
        kept = np.moveaxis(image, axis, 0)[: count * block]
        means = kept.reshape(count, block, *kept.shape[1:]).mean(axis=1, dtype=np.float32)
        image = np.moveaxis(means, 0, axis)
    return np.ascontiguousarray(image, np.float32)


def show_slices(
    page: Page,
    images: Sequence[Floats],
    *,
    labels: Sequence[str],
    window: tuple[float, float],
    what: str,
) -> None:
    """Add a slider to a page that begins in the middle.

    Args:
        page: the report.
        images: the slices, all of one shape.
        labels: a text for each.
        window: values that are black and white.
        what: what the pictures show, the beginning of the caption.
    """
    files, (high, wide) = framed(images, window=window)
    page.slider(
        files,
        labels=labels,
        start=len(files) // 2,
        caption=f"{what}; {len(files)} of them at {high} x {wide} pixels, display window "
        f"{window[0]:.4g} to {window[1]:.4g}.",
        alt=what,
    )
