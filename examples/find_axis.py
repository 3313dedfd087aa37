"""Find the rotation axis of a scan from its sinogram, with a confidence interval.

The axis is a bin of the detector, and a wrong one doubles every edge of a slice. Each bin averages
16 rays, as a detector's does: edges of single rays alias and move the axis. In a notebook the
estimate shows the curve of how likely each bin is. Run it with the number of bins, 192 if none.
"""

import sys

import numpy as np

import rift_cl as rift

RAYS = 16

bins = int(sys.argv[1]) if sys.argv[1:] else 192
grid, angles = rift.Grid((bins // 2, bins // 2)), np.linspace(0, np.pi, bins, endpoint=False)
truth = rift.Parallel(angles, bins, center=bins / 2 + 3.4)
among_rays = RAYS * truth.center + (RAYS - 1) / 2
rays = rift.Parallel(angles, RAYS * bins, pitch=1 / RAYS, center=among_rays)
sinogram = rift.phantom.shepp_logan_sinogram(grid, rays).reshape(bins, bins, RAYS).mean(axis=2)
sinogram += 0.01 * sinogram.max() * np.random.default_rng(0).normal(size=sinogram.shape)

found = rift.find_center(sinogram, angles)
print(f"found {found.in_words()}; it is at bin {truth.center:.2f}")
A = rift.Projector(grid, rift.Parallel(angles, bins, center=found.center))
image, head = rift.fbp(A, sinogram, "hann"), rift.phantom.shepp_logan(grid)
print(f"{rift.metrics.psnr(image, head, peak=head.max()):.1f} dB")
