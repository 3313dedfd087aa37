"""How close an image is to the truth: PSNR, SSIM and FLIP, and where and how finely it errs."""

from rift_cl.metrics.bands import BAND_EDGES, band_power
from rift_cl.metrics.perceptual import flip, flip_pixels
from rift_cl.metrics.regions import REGIONS, photograph_regions
from rift_cl.metrics.scores import affine_fit, disc, psnr, ssim

__all__ = [
    "BAND_EDGES",
    "REGIONS",
    "affine_fit",
    "band_power",
    "disc",
    "flip",
    "flip_pixels",
    "photograph_regions",
    "psnr",
    "ssim",
]
