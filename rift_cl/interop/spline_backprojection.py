"""Backprojection that interpolates between bins as a caller of another package asked for.

A projector's own adjoint interpolates linearly, and has to: it must match the projector. Packages
that offer other interpolations mean splines through the bins, which this evaluates at every pixel
of every view.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from rift_cl.operators.projector.parallel.parallel_projector import ParallelProjector


def backproject_spline(
    A: ParallelProjector, sinogram: NDArray[np.float32], degree: int
) -> NDArray[np.float32]:
    """Sum the views' splines at every pixel.

    Args:
        A: what describes the image (ny, nx), the scan and the device.
        sinogram: (angles, bins) in C order.
        degree: 0 takes the nearest bin, 3 is the cubic spline through the bins whose slope
            vanishes at the detector's ends.

    Returns:
        (ny, nx) image in the unit of ``sinogram``.
    """
    device, (ny, nx) = A.device, A.domain
    views, bins = sinogram.shape
    image = device.empty(A.domain)
    lanes = device.traits.macros["LANES"]
    device.launch(
        "backproject_spline",
        (-(-nx // lanes), ny),
        coefficients=device.array(_coefficients(sinogram, degree)),
        lines=device.array(_lines(A)),
        image=image,
        views=views,
        bins=bins,
        nx=nx,
        DEGREE=degree,
    )
    return device.get(image)


def _coefficients(sinogram: NDArray[np.float32], degree: int) -> NDArray[Any]:
    """The B-splines' factors, mirrored beyond the ends by the one and the two that reach in."""
    if degree == 0:
        return np.pad(sinogram, ((0, 0), (1, 2)))
    from scipy.ndimage import spline_filter1d

    factors = spline_filter1d(sinogram.astype(np.float64), order=degree, axis=1, mode="mirror")
    return np.pad(factors, ((0, 0), (1, 2)), mode="reflect")


def _lines(A: ParallelProjector) -> NDArray[np.float64]:
    """Where a view sees the first pixel, and how far a row and a column are apart: (angles, 3)."""
    y, x = A.grid.coordinates(0)[0], A.grid.coordinates(1)[0]
    dy, dx = A.grid.spacing
    cosine, sine = np.cos(A.scan.angles), np.sin(A.scan.angles)
    lines = np.stack([x * cosine + y * sine, dy * sine, dx * cosine], axis=1) / A.scan.pitch
    lines[:, 0] += A.scan.center
    return lines
