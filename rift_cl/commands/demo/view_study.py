"""Reconstruction quality against the number of views, unfiltered and filtered.

This is the experiment of the RiFT paper's Figures 5 and 6: a phantom whose projections are known
exactly is reconstructed from few views and from many, by plain backprojection and with the ramp.
Unfiltered slices have no scale of their own, so they are scored after the affine fit (gain and
offset) that serves them best; filtered ones are scored as they are.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from rift_cl.cl.device import Device
from rift_cl.geometry import Grid, Parallel
from rift_cl.metrics import affine_fit, disc, psnr, ssim
from rift_cl.operators import ParallelProjector, Projector
from rift_cl.phantom import shepp_logan, shepp_logan_sinogram
from rift_cl.reconstruct import backproject, fbp

Image = NDArray[np.float32]


@dataclass(frozen=True)
class ViewScore:
    """One number of views.

    Args:
        views: how many, evenly over pi.
        unfiltered, filtered: the slices, or volumes; the first after its affine fit.
        scores: PSNR in dB (peak 1) and SSIM of both, where the mask is true.
    """

    views: int
    unfiltered: Image
    filtered: Image
    scores: dict[str, float]


def view_study(size: int, counts: Sequence[int], device: Device) -> Iterator[ViewScore]:
    """Score the Shepp-Logan phantom for several numbers of views.

    Args:
        size: samples along each side of the slice.
        counts: the numbers of views.
        device: where to work.
    """
    grid = Grid((size, size))
    truth, mask = shepp_logan(grid), disc(grid)
    for views in counts:
        angles = np.arange(views) * np.pi / views
        scan = Parallel(angles, bins=detector_bins(size))
        A = Projector(grid, scan, device=device)
        y = shepp_logan_sinogram(grid, scan)
        yield score_views(A, y, truth, mask)


def score_views(
    A: ParallelProjector, y: Image, truth: Image, mask: NDArray[np.bool_] | None = None
) -> ViewScore:
    """Reconstruct unfiltered and filtered, and score both.

    Args:
        A: the projector.
        y: the measurement, of shape ``A.range``.
        truth: what it is of, of shape ``A.domain``.
        mask: samples that count; all if not given.
    """
    filtered = np.asarray(fbp(A, y))
    fitted, _, _ = affine_fit(backproject(A, y), truth, mask=mask)
    unfiltered = fitted.astype(np.float32)
    scores = {
        f"{metric.__name__}_{name}": metric(image, truth, mask=mask)
        for name, image in (("unfiltered", unfiltered), ("filtered", filtered))
        for metric in (psnr, ssim)
    }
    return ViewScore(len(A.scan.angles), unfiltered, filtered, scores)


def detector_bins(size: int) -> int:
    """Bins that see the whole diagonal of a slice, with one to spare at each end."""
    return int(np.ceil(size * np.sqrt(2))) + 2
