"""Figure 12: what the fits draw from few views and from many, beside the truth."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import binary_opening

from paper.fits import FIXED, OFF_PATH, Fitted, fitted
from paper.images import decode, encode
from paper.plan import Plan
from rift_cl import Device, Renderer
from rift_cl.commands.inputs.scene_input import SceneInput
from rift_cl.io import open_capture, read_view
from rift_cl.report.html_page import Page
from rift_cl.report.plot import figure_png, image_grid

NAME = "figure_12"
TITLE = "Figure 12: the ornament from few views and from many"

_SHOWN = {FIXED: "a view of the ring", OFF_PATH: "a view off the ring"}
# The detail is enlarged so many times; errors are shown so much brighter.
_ENLARGED, _GAIN = 4, 5.0
_WINDOW = (0.0, 1.0)
# What differs so much from the background is in front of it, and thin below so many pixels.
_FRONT, _THIN = 8 / 255, 4
_Image = NDArray[np.float32]


def settings(plan: Plan) -> dict[str, Any]:
    """What decides the result; which views are shown hangs on the smallest count."""
    return {**plan.size(), **plan.fits(), "seed": plan.seeds[0], "fewest": min(plan.counts)}


def compute(plan: Plan, device: Device, kept: dict[str, Any]) -> Iterator[dict[str, Any]]:
    """Two test views drawn by the fit to each number of views."""
    views = kept.get("views") or _chosen(fitted(plan, min(plan.counts)))
    earlier = [{row["count"]: row for row in view["rows"]} for view in views]
    for view in views:
        view["rows"] = []
    for count in plan.counts:
        for view, rows in zip(views, earlier, strict=True):
            view["rows"].append(rows.get(count) or _drawn(fitted(plan, count), view, device))
        yield {"views": views}


def _chosen(fit: Fitted) -> list[dict[str, Any]]:
    """Of each test set the picture of middling distance from those that the fit was trained on."""
    views = []
    for name, test in ((FIXED, fit.settings.test[1]), (OFF_PATH, fit.settings.test[2])):
        angles = [view["angle"] for view in fit.views(name)]
        number = int(np.argsort(angles, kind="stable")[len(angles) // 2])
        truth = _truth(test, number)
        views.append({
            "set": name,
            "number": number,
            "corner": list(_hairiest(truth)),
            "truth": encode(truth, _WINDOW),
            "rows": [],
        })  # fmt: skip
    return views


def _truth(capture: Any, number: int) -> _Image:
    return np.asarray(read_view(open_capture(capture).views[number])[..., :3], np.float32)


def _hairiest(image: _Image) -> tuple[int, int]:
    """The upper left corner of the detail: where most of what is in front is thin."""
    high, wide = (n // _ENLARGED for n in image.shape[:2])
    behind = np.median(np.concatenate([image[0], image[:, 0], image[:, -1]]), axis=0)
    front = np.abs(image - behind).max(axis=2) > _FRONT
    thin = front & ~binary_opening(front, np.ones((_THIN, _THIN)))
    sums = np.pad(thin.cumsum(axis=0).cumsum(axis=1), ((1, 0), (1, 0)))
    boxes = sums[high:, wide:] - sums[:-high, wide:] - sums[high:, :-wide] + sums[:-high, :-wide]
    row, column = np.unravel_index(int(boxes.argmax()), boxes.shape)
    return int(row), int(column)


def _drawn(fit: Fitted, view: dict[str, Any], device: Device) -> dict[str, Any]:
    """The picture that a fit draws."""
    test = dict(zip((FIXED, OFF_PATH), fit.settings.test[1:], strict=True))[view["set"]]
    scene = SceneInput(fit.settings.out).open_scene()
    camera = open_capture(test).views[view["number"]].camera
    renderer = Renderer(scene.rendering, device=device)
    splats = scene.splats.upload(device)
    frame = renderer.forward(splats, camera, background=device.array(scene.background))
    score = fit.views(view["set"])[view["number"]]
    return {
        "count": fit.count,
        "psnr": score["fit_psnr"],
        "degrees": score["angle"],
        "image": encode(device.get(frame.image), _WINDOW),
    }


def show(page: Page, result: dict[str, Any]) -> None:
    """Draw the pictures, their errors and details."""
    page.paragraph(
        "Test pictures that no fit saw, the same at every number of views: of each test set the "
        "one of middling distance from the views of the smallest fit. The detail lies where the "
        "truth has most hairs and fibres in front of the background."
    )
    for view in result["views"]:
        words = _SHOWN[view["set"]]
        page.figure(
            figure_png(_panels(view)),
            caption=f"{words.capitalize()}, its error {_GAIN:g} times brighter, a detail "
            f"{_ENLARGED} times larger, and that detail's error. PSNR is of the whole picture; "
            "degrees are to the nearest view that was trained on.",
            alt=f"{words}: truth, then drawn from growing numbers of views, with errors",
        )


def _panels(view: dict[str, Any]) -> Any:
    truth, rows = decode(view["truth"]), view["rows"]
    images = [truth, *(decode(row["image"]) for row in rows)]
    errors = [np.clip(np.abs(image - truth) * _GAIN, 0, 1) for image in images]
    corner = view["corner"]
    details = [[_detail(image, corner) for image in row] for row in (images, errors)]
    titles = [
        f"{row['count']} views\n{row['psnr']:.1f} dB, {row['degrees']:.1f}° away" for row in rows
    ]
    grid = [*images, *errors, *details[0], *details[1]]
    return image_grid(
        grid,
        titles=["truth", *titles] + [""] * (3 * len(images)),
        columns=len(images),
        window=_WINDOW,
        row_labels=["picture", "error", "detail", "detail's error"],
    )


def _detail(image: _Image, corner: list[int]) -> _Image:
    high, wide = (n // _ENLARGED for n in image.shape[:2])
    part = image[corner[0] : corner[0] + high, corner[1] : corner[1] + wide]
    return part.repeat(_ENLARGED, axis=0).repeat(_ENLARGED, axis=1)
