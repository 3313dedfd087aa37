"""The loss of a fit: pixel differences, SSIM, and spectral homogenisation."""
