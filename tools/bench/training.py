"""A step of training beside rendering, and what each part of it has to do.

The loss, plain and homogenised, Adam, the random walk, the limit of the splats' band, what
densification gathers of a frame, and a photograph's exposure.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING, Any

import numpy as np

from bench.costs import Cost
from bench.row_filters import ROW_COSTS
from bench.transform_work import transform_bytes, transform_flops
from rift_cl.operators.fourier.spectrum import padded_length
from rift_cl.train import Homogenisation, ImageLoss, Parameters
from rift_cl.train.band_limit import Detail, camera_table
from rift_cl.train.loss.homogenised_loss import HomogenisedLoss
from rift_cl.train.per_view.exposures import Exposures
from rift_cl.train.per_view.octaves import shrunk
from rift_cl.train.strategy.residual import Contributions
from rift_cl.train.strategy.screen_statistics import ScreenStatistics

if TYPE_CHECKING:
    from bench.splats import SplatCase

_RATES = {"means": 1e-4, "quats": 1e-3, "log_scales": 5e-3, "logits": 5e-2, "sh": 2.5e-3}
# Harmonics of a splat, of degree 3; cameras whose resolution limits splats.
_HARMONICS, _VIEWS = 48, 100


def training_operations(case: SplatCase) -> dict[str, Callable[[], Any]]:
    """The operations by name, on device arrays."""
    device, given = case.device, case.parameters
    raw = {
        "means": given["means"],
        "quats": given["quats"],
        "log_scales": np.log(given["scales"]),
        "logits": np.log(given["opacities"] / (1 - given["opacities"])),
        "sh": given["sh"],
    }
    parameters = Parameters.of(device, raw)
    target = device.array(np.roll(device.get(case.frame.image), 3, axis=1))
    loss, penalties = ImageLoss(), {"opacity_penalty": 0.01, "scale_penalty": 0.01}

    def update() -> None:
        parameters.update(case.gradients, _RATES, sh_rest=0.2, **penalties)
        parameters.shake(1.0, 0)

    statistics = ScreenStatistics(device, case.count)
    contributions = Contributions(device, case.count)
    homogenised = HomogenisedLoss(device, Homogenisation(0.5), ssim_weight=0.2, kind="l1")
    cameras = device.array(camera_table([case.camera] * _VIEWS))
    limited, detail = Parameters.of(device, raw), Detail(2.0, 1000.0)
    exposures = Exposures(device, 1)

    def expose() -> None:
        exposed = exposures.applied(case.frame.image, 0)
        exposures.gradient(exposed, 0)
        exposures.fit(case.frame.image, target, None, 0)

    return {
        "loss": lambda: loss(device, case.frame.image, target),
        "update": update,
        "statistics": lambda: statistics.add(case.frame, case.gradients),
        "contributions": lambda: contributions.add(case.frame, case.frame.image, target, None),
        "halved image": lambda: shrunk(device, target, None, 2),
        "homogenised loss": lambda: homogenised(case.frame.image, target),
        "band limit": lambda: limited.limit_band(cameras, near=0.01, unseen=1.0),
        "band limit by coverage": lambda: limited.limit_band(
            cameras, near=0.01, unseen=1.0, detail=detail
        ),
        "exposure": expose,
    }


def _per(
    unit: str, count: Callable[[SplatCase], float], each: int, what: str, flops: int = 0
) -> Cost:
    work = f"{flops} flop per {unit}; " if flops else ""
    formula = f"{work}bytes: {each} per {unit} ({what})"
    return Cost(unit, flops, count, lambda case: each * count(case), formula)


def _splats(case: SplatCase) -> float:
    return case.count


def _numbers(case: SplatCase) -> float:
    return _HARMONICS * case.count


def _samples(case: SplatCase) -> float:
    return 3 * case.pixels


def _padded(case: SplatCase) -> float:
    """Samples of all planes of the padded transform: two fields, real and imaginary."""
    return 4 * padded_length(case.size) ** 2


def _transforms(work: Callable[[int], float]) -> Callable[[SplatCase], float]:
    """The work of four transforms of every column of two fields."""

    def total(case: SplatCase) -> float:
        edge = padded_length(case.size)
        return 4 * 2 * edge * work(edge)

    return total


TRAINING_COSTS: dict[str, Cost] = {
    "adam": _per("harmonic", _numbers, 28, "value, moments, gradient in; value, moments out"),
    "splat_update": _per(
        "splat", _splats, 11 * 28 + 16, "11 parameters as harmonics; scales and opacity out"
    ),
    "splat_activate": _per("splat", _splats, 32, "scales and opacity in and out"),
    "splat_noise": _per("splat", _splats, 56, "the splat in, its place out"),
    "splat_statistics": _per(
        "splat", _splats, 41, "gradient, extents, code in; statistics both", 8
    ),
    "residual_image": _per("sample", _samples, 12, "two images in, residual out", 3),
    "image_shrink": _per("sample", _samples, 5, "image in, a quarter of it out", 2),
    "residual_statistics": _per("splat", _splats, 33, "sums and code in; statistics both", 3),
    "splat_band": _per("splat", _splats, 16, "place in, length out; 100 cameras", 22 * _VIEWS),
    "splat_band_coverage": _per(
        "splat", _splats, 16, "place in, length out; 100 cameras, 8 halvings", 8 * 60 * _VIEWS
    ),
    "fft_pack": _per("padded sample", _padded, 4, "planes out; the image in is less"),
    "fft_pass": ROW_COSTS["fft_pass"]._replace(
        units=_transforms(transform_flops), bytes=_transforms(transform_bytes)
    ),
    "fft_transpose": _per("padded sample", lambda case: 2 * _padded(case), 8, "in and out, twice"),
    "fft_unpack": _per("sample", _samples, 8, "plane in, image out", 3),
    "keep_norm": _per("sample", _samples, 8, "in and out", 1),
    "axpby": _per("sample", _samples, 12, "two in, one out", 3),
    "expose": _per("sample", _samples, 8, "in and out", 2),
    "expose_grad": _per("sample", _samples, 8, "in and out", 1),
    "expose_moments": _per("sample", _samples, 25, "image and photograph in, parts out", 2),
    "ssim_map": _per("sample", _samples, 20, "two images in, three maps out", 215),
    "loss_grad": _per("sample", _samples, 24, "two images and three maps in, gradient out", 145),
}
