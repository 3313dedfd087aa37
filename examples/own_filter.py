"""A filter of your own: a function of frequency gets a name.

``rift.register_filter`` makes the name known to ``rift.fbp``, to ``rift.reconstruct_scan`` and to
``rift reconstruct --filter`` in this process. Run it with the number of pixels along an
edge, or give it to ``rift --load``.
"""

import sys

import numpy as np

import rift_cl as rift


def butterworth(frequency):
    """The ramp, rolled off at half the detector's Nyquist frequency, the largest that comes."""
    return frequency / (1 + (frequency / frequency.max() / 0.5) ** 8)


rift.register_filter("butterworth", butterworth)


def main():
    """Reconstruct a noisy head with the ramp and with this filter."""
    size = int(sys.argv[1]) if sys.argv[1:] else 256
    grid = rift.Grid((size, size))
    scan = rift.Parallel(np.linspace(0, np.pi, size, endpoint=False), bins=size * 3 // 2)
    A = rift.Projector(grid, scan)
    truth = rift.phantom.shepp_logan(grid)
    sinogram = rift.phantom.shepp_logan_sinogram(grid, scan)
    noisy = sinogram + 0.02 * sinogram.max() * np.random.default_rng(0).normal(size=sinogram.shape)
    for name in ("ram-lak", "butterworth"):
        image = rift.fbp(A, noisy, filter=name)
        print(f"{name}: {rift.metrics.psnr(image, truth, peak=truth.max()):.1f} dB")


if __name__ == "__main__":
    main()
