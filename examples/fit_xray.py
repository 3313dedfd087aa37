"""Fit splats to X-ray projections, and compare them with filtered backprojection.

A scan is 40 views of the Shepp-Logan head in a file of NumPy's, as ``rift reconstruct`` reads it
too. The splats are densities, in the scan's unit of length; the record has the scores of the views
that were held out. Run it with the number of steps, 500 if not given.
"""

import sys
import tempfile
from pathlib import Path

import numpy as np

import rift_cl as rift

steps = int(sys.argv[1]) if sys.argv[1:] else 500
grid, angles = rift.Grid((64, 64), spacing=0.5), np.arange(40) * np.pi / 40
sinogram = rift.phantom.shepp_logan_sinogram(grid, rift.Parallel(angles, bins=64, pitch=0.5))

with tempfile.TemporaryDirectory() as folder:
    scan = Path(folder, "scan.npz")
    np.savez(scan, sinogram=sinogram, angles=angles, pitch=0.5)
    fitted = rift.fit(scan, Path(folder, "fit"), steps=steps, splats=1000, center=31.5)
    scores = fitted.metrics["scores"]["held out"]
    print(f"{fitted.scene}, saved as {fitted.folder.name}/scene.ply")
    print(f"splats {scores['fit_psnr']:.1f} dB, backprojection {scores['fbp_psnr']:.1f} dB")
