"""A step of training beside drawing: the loss, Adam, the random walk, and what each has to do."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING, Any

import numpy as np

from bench.costs import Cost
from rift_cl.train.image_loss import ImageLoss
from rift_cl.train.parameters import Parameters

if TYPE_CHECKING:
    from bench.splats import SplatCase

_RATES = {"means": 1e-4, "quats": 1e-3, "log_scales": 5e-3, "logits": 5e-2, "sh": 2.5e-3}
# Parameters of a splat with harmonics of degree 3.
_PARAMETERS = 11 + 48


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

    return {"loss": lambda: loss(device, case.frame.image, target), "update": update}


def _per(
    unit: str, count: Callable[[SplatCase], float], each: int, what: str, flops: int = 0
) -> Cost:
    work = f"{flops} flop per {unit}; " if flops else ""
    formula = f"{work}bytes: {each} per {unit} ({what})"
    return Cost(unit, flops, count, lambda case: each * count(case), formula)


def _splats(case: SplatCase) -> float:
    return case.count


def _numbers(case: SplatCase) -> float:
    return _PARAMETERS * case.count


def _samples(case: SplatCase) -> float:
    return 3 * case.pixels


TRAINING_COSTS: dict[str, Cost] = {
    "adam": _per("parameter", _numbers, 28, "value, moments, gradient in; value, moments out"),
    "splat_activate": _per("splat", _splats, 32, "scales and opacity in and out"),
    "splat_activate_grad": _per("splat", _splats, 48, "scales, opacity, gradients in and out"),
    "splat_noise": _per("splat", _splats, 56, "the splat in, its place out"),
    "ssim_map": _per("sample", _samples, 20, "two images in, three maps out", 215),
    "loss_grad": _per("sample", _samples, 24, "two images and three maps in, gradient out", 145),
}
