"""Magnetic resonance of a phantom: radial lines of its k-space, and the projections behind them.

A scanner reads k-space line by line. Here every line passes through the axis of k-space in one
of the slices' planes kz (a stack of stars), in the directions of a parallel scan. By the Fourier
slice theorem the inverse transform of the lines of one direction is that direction's projection,
limited to the frequencies that were read.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from rift_cl import Grid, Parallel
from rift_cl.phantom import Ellipsoid, spectrum


def radial_lines(
    ellipsoids: Sequence[Ellipsoid], grid: Grid, scan: Parallel, angle: float
) -> NDArray[np.complex128]:
    """The samples of one direction, (kz, kr), both in the order of ``numpy.fft.fftfreq``.

    Frequencies reach the Nyquist limits of the grid's slices and of the scan's bins.
    """
    kz = np.fft.fftfreq(grid.shape[0], grid.spacing[0])[:, None]
    kr = np.fft.fftfreq(scan.bins, scan.pitch)
    along = np.broadcast_arrays(kz, kr * np.sin(angle), kr * np.cos(angle))
    return spectrum(ellipsoids, np.stack(along, axis=-1))


def projection(samples: NDArray[np.complex128], grid: Grid, scan: Parallel) -> NDArray[np.float64]:
    """The projection, (row, bin), whose transform has the samples of one direction."""
    # The first row and the first bin stand where their coordinates say, not at zero.
    kz, kr = (
        np.fft.fftfreq(n, d) for n, d in ((grid.shape[0], grid.spacing[0]), (scan.bins, scan.pitch))
    )
    z, t = grid.coordinates(0)[0], scan.coordinates()[0]
    turned = samples * np.exp(2j * np.pi * (kz[:, None] * z + kr * t))
    return np.real(np.fft.ifft2(turned)) / (grid.spacing[0] * scan.pitch)


def measure(ellipsoids: Sequence[Ellipsoid], grid: Grid, scan: Parallel) -> NDArray[np.float32]:
    """The projections (angle, row, bin) behind the radial lines of all directions of a scan."""
    views = np.empty((len(scan.angles), grid.shape[0], scan.bins), np.float32)
    for view, angle in zip(views, scan.angles, strict=True):
        view[:] = projection(radial_lines(ellipsoids, grid, scan, angle), grid, scan)
    return views
