"""Reconstruct a slice from few projections: by a formula, by iterations, and how good each is.

A projector is a linear operator and its exact adjoint. Filtered backprojection inverts it by a
formula; CGLS, and total variation with its preference for flat regions, search for the slice whose
projections are the measured ones. Run it with the number of pixels along an edge, 256 if not given.
"""

import sys

import numpy as np

import rift_cl as rift

size = int(sys.argv[1]) if sys.argv[1:] else 256
grid = rift.Grid((size, size), spacing=0.1)
angles = np.linspace(0, np.pi, size // 4, endpoint=False)
scan = rift.Parallel(angles, bins=size * 3 // 2, pitch=0.1)
A = rift.Projector(grid, scan)
print(A)

truth = rift.phantom.shepp_logan(grid)
sinogram = rift.phantom.shepp_logan_sinogram(grid, scan)  # exact line integrals
slices = {
    "filtered backprojection": rift.fbp(A, sinogram, filter="hann"),
    "CGLS, 10 steps": rift.cgls(A, sinogram, steps=10),
    "total variation, 60 steps": rift.tv(A, sinogram, weight=0.2, steps=60),
}
for name, image in slices.items():
    print(f"{name}: {rift.metrics.psnr(image, truth, peak=truth.max()):.1f} dB")
print(f"The adjoint is exact to {rift.dot_test(A):.0e}.")
