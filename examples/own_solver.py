"""A solver of your own: anything that needs ``A(x)`` and ``A.T(y)`` alone.

Here the method of Barzilai and Borwein (1988), gradient descent whose step size comes from the last
two gradients, with negative values cut off. Operators are combined as matrices are, and SciPy and
PyLops take them through ``rift_cl.interop.scipy``. Run it with the number of pixels along an edge.
"""

import sys

import numpy as np
from scipy.sparse.linalg import lsqr

import rift_cl as rift
from rift_cl.interop.scipy import aslinearoperator


def barzilai_borwein(A, y, steps):
    """Minimize |A x - y|^2 over x >= 0."""
    normal, target = A.T @ A, A.T(y)
    x, gradient, step = np.zeros(A.domain, np.float32), -target, 0.0
    for _ in range(steps):
        step = step or (gradient**2).sum() / (gradient * normal(gradient)).sum()
        moved = np.maximum(x - step * gradient, 0)
        change, before = moved - x, gradient
        x, gradient = moved, normal(moved) - target
        step = (change**2).sum() / (change * (gradient - before)).sum()
    return x


size = int(sys.argv[1]) if sys.argv[1:] else 128
grid = rift.Grid((size, size))
scan = rift.Parallel(np.linspace(0, np.pi, size, endpoint=False), bins=size * 3 // 2)
A = rift.Projector(grid, scan)
truth = rift.phantom.shepp_logan(grid)
y = A(truth)
flat = lsqr(aslinearoperator(A), y.ravel(), iter_lim=15)[0]
for name, image in (
    ("Barzilai-Borwein", barzilai_borwein(A, y, 30)),
    ("SciPy's LSQR", flat.reshape(A.domain)),
):
    print(f"{name}: {rift.metrics.psnr(image, truth, peak=truth.max()):.1f} dB")
