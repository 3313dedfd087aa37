"""How good a fit to X-rays is: projections that it never saw, beside what needs no fit.

Two baselines: the filtered backprojection of the training views, projected again, and the mean of
the two training views nearest in angle. Where no formula takes the views of a cone, as over a part
of a turn, or along a helix of which some are held out, conjugate gradients stand in for the first.
The peak of PSNR is the largest value of the scan's projections; the relative error is the norm of
the difference over that of the truth.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rift_cl.cl.device import Device
from rift_cl.commands.fit_photos.scores import ViewScore
from rift_cl.commands.fit_xray.input import Projections, flipped
from rift_cl.errors import InputError
from rift_cl.geometry import Camera, Cone, Parallel
from rift_cl.metrics import psnr
from rift_cl.operators import Projector
from rift_cl.reconstruct import cgls, fbp
from rift_cl.reconstruct.direct.filtered_backprojection import filtered_backprojection
from rift_cl.reconstruct.direct.offset_axis import (
    is_full_turn,
    is_weighed,
    offset_weights,
    sees_further,
)
from rift_cl.reconstruct.direct.padding import is_truncated
from rift_cl.reconstruct.direct.redundancy import ITERATE
from rift_cl.splat.renderer import Renderer
from rift_cl.splat.splats import Splats

# Steps of conjugate gradients, where no formula takes the views.
_STEPS = 20

SCORING = (
    "Line integrals of projections that were not trained on, means over them. PSNR in dB, its peak "
    "the scan's largest line integral; the error is relative, in L2. 'fbp' is the filtered "
    "backprojection of the training views, or what stands in for it, projected again, 'blend' the "
    "mean of the two training views nearest in angle."
)
COLUMNS = ("pictures", "score", "fit", "fbp", "blend")

Floats = NDArray[np.float32]


def score_table(metrics: Mapping[str, Any]) -> tuple[Sequence[str], list[tuple[Any, ...]], str]:
    """Columns and rows of mean scores, and a caption."""
    rows = [
        (group, label, *(values[f"{name}_{kind}"] for name in COLUMNS[2:]))
        for group, values in metrics["scores"].items()
        for kind, label in (("psnr", "PSNR"), ("error", "error"))
    ]
    return COLUMNS, rows, SCORING


def backprojected(device: Device, training: Projections, filter: str = "ram-lak") -> Floats:
    """The filtered backprojection of some views, zero where not every view sees.

    Least squares by conjugate gradients, without a filter, where it does not take them.
    """
    A = Projector(training.grid, training.scan, device=device)
    refused = refusal(device, training)
    volume = np.asarray(
        cgls(A, training.values, _STEPS) if refused else fbp(A, training.values, filter)
    )
    y, x = np.meshgrid(*(training.grid.coordinates(axis) for axis in (1, 2)), indexing="ij")
    return np.where(np.hypot(x, y) <= training.reach, volume, 0).astype(np.float32)


def refusal(device: Device, training: Projections) -> str:
    """Why filtered backprojection does not take some views; empty where it does."""
    scan = training.scan
    if isinstance(scan, Parallel):
        return ""
    A = Projector(training.grid, scan, device=device)
    try:
        filtered_backprojection(A)
    except InputError as error:
        return str(error).removesuffix(f"; {ITERATE}")
    one_sided = isinstance(scan, Cone) and sees_further(scan.center[1], scan.bins)
    if one_sided and not is_full_turn(training.angles) and is_truncated(training.values):
        return (
            "the object reaches beyond the shorter side of the detector, and the views do not go "
            "all round"
        )
    return ""


def stand_in_note(device: Device, training: Projections) -> list[str]:
    """What stands in for filtered backprojection where it does not take the training views."""
    refused = refusal(device, training)
    if not refused:
        return []
    return [
        f"Filtered backprojection does not take the views that are trained on ({refused}): "
        f"{_STEPS} steps of conjugate gradients stand in for it as what the fit begins with, and "
        "as 'fbp' in scores and report."
    ]


def first_volume(device: Device, training: Projections) -> NDArray[np.float64]:
    """What a fit begins with: smoothed, nowhere negative, and of the mass that was measured."""
    volume = np.maximum(backprojected(device, training, "hann"), 0)
    # Without what was negative there is too much of it: as much as the projections say.
    if isinstance(training.scan, Parallel):
        masses = np.maximum(_masses(training.scan, training.values), 0)
        volume *= (masses / np.maximum(volume.sum(axis=(1, 2)), 1e-12))[:, None, None]
    else:
        again = Projector(training.grid, training.scan, device=device)(volume)
        mass = max(float(training.values.sum(dtype=float)), 0.0)
        volume *= mass / max(float(np.sum(again, dtype=float)), 1e-12)
    return volume.astype(np.float64)


def _masses(scan: Parallel, values: Floats) -> NDArray[np.float64]:
    """(rows,) what each row of a detector measures of the object, as a mean over views."""
    if not is_weighed(scan):
        return np.asarray(values.sum(axis=2, dtype=float).mean(axis=0))
    # Of a half acquisition a view sees one side alone, and its opposite the other.
    return np.asarray((values @ offset_weights(scan)).mean(axis=0))


def drawn(renderer: Renderer, splats: Splats, camera: Camera) -> Floats:
    """What a camera sees of splats, (rows, bins)."""
    return np.asarray(renderer.picture(splats, camera).image[..., 0])


def score_projections(
    renderer: Renderer, splats: Splats, test: Projections, training: Projections, volume: Floats
) -> Iterator[ViewScore]:
    """Render and score every view of ``test``; ``volume`` is the reconstruction of ``training``."""
    A = Projector(test.grid, test.scan, device=renderer.device)
    again = np.asarray(A(volume))
    peak = float(max(test.values.max(), training.values.max()))
    for number, (camera, reverse) in enumerate(zip(*test.views, strict=True)):
        truth, angle = test.values[number], test.angles[number]
        turned = np.mod(training.angles - angle + np.pi, 2 * np.pi) - np.pi
        nearest = np.argsort(np.abs(turned), kind="stable")[:2]
        images = {
            "fit": flipped(drawn(renderer, splats, camera), reverse),
            "fbp": again[number],
            "blend": training.values[nearest].mean(axis=0),
        }
        values = {}
        for name, image in images.items():
            values[f"{name}_psnr"] = psnr(image, truth, peak=peak)
            values[f"{name}_error"] = relative_error(image, truth)
        degrees = float(np.degrees(np.abs(turned[nearest[0]])))
        name = f"{np.degrees(angle):.2f} degrees"
        yield ViewScore(name, degrees, values, truth * test.scale, images["fit"] * test.scale)


def relative_error(image: Floats, truth: Floats) -> float:
    """Norm of the difference over that of the truth; infinity where the truth is nothing."""
    norm = float(np.linalg.norm(truth.astype(float)))
    away = float(np.linalg.norm(image.astype(float) - truth))
    return away / norm if norm else float("inf")
