"""Photographs beside what is drawn: where they were taken, and how they are laid over a picture."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from rift_cl.commands.fit_photos.pictures import CapturePictures
from rift_cl.geometry import Camera
from rift_cl.io.captures.capture import View, read_view

Floats = NDArray[np.float32]
Comparison = Literal["off", "wipe", "blend"]
COMPARISONS: tuple[Comparison, ...] = ("off", "wipe", "blend")

# A camera stands where a photograph was taken if it is so near, relative to what both look at.
_NEAR = 1e-3
# The line between photograph and picture, in display light.
_LINE = 1.0


@dataclass(frozen=True, eq=False)
class Photograph:
    """A photograph that may be looked at again.

    Args:
        name: what people call it.
        camera: a pinhole that took it.
        read: gives it, (height, width, 3 or 4) in display light, alpha straight; raises a
            ``RiftError`` where it is gone.
    """

    name: str
    camera: Camera
    read: Callable[[], Floats]


def photographs_of(views: Sequence[View]) -> list[Photograph]:
    """The photographs of a capture, read from disk as they are looked at."""
    return [
        Photograph(view.name, view.camera, lambda view=view: read_view(view))  # type: ignore[misc]
        for view in views
    ]


def photographs_in_work(pictures: CapturePictures) -> list[Photograph]:
    """The photographs of a fit that runs, as it sees them."""

    def read(number: int) -> Floats:
        picture, known = pictures.over(number, pictures.behind), pictures.known(number)
        shown = pictures.shown(picture)
        return shown if known is None else np.dstack([shown, known])

    return [
        Photograph(view.name, camera, lambda number=number: read(number))  # type: ignore[misc]
        for number, (view, camera) in enumerate(zip(pictures.views, pictures.cameras, strict=True))
    ]


def nearest_one(photographs: Sequence[Photograph], camera: Camera) -> int:
    """The number of the photograph that was taken nearest to a camera; 0 where there is none."""
    ways = [float(np.linalg.norm(p.camera.center - camera.center)) for p in photographs]
    return int(np.argmin(ways)) if ways else 0


def taken_from(photograph: Photograph, camera: Camera, reach: float) -> bool:
    """Whether a camera is at a photograph's position.

    Args:
        photograph: that may be compared with.
        camera: of the page.
        reach: distance to what both look at, in scene units.
    """
    away = float(np.linalg.norm(photograph.camera.center - camera.center))
    return away <= _NEAR * reach


def compared(
    drawn: Floats, observed: Floats, known: NDArray[np.bool_], how: Comparison, share: float
) -> Floats:
    """What is drawn with a photograph over it.

    Args:
        drawn: (height, width, 3) in display light.
        observed: the photograph as the same camera sees it, as ``seen_by`` gives it.
        known: where it shows anything.
        how: ``wipe`` shows it left of a line, ``blend`` mixes it in.
        share: of the photograph, 0 to 1.
    """
    if how == "blend":
        return np.where(known[..., None], drawn + share * (observed - drawn), drawn)
    # The line runs through the photograph from edge to edge, whatever is beside it.
    columns = np.flatnonzero(known.any(axis=0))
    if not len(columns):
        return drawn
    first, last = int(columns[0]), int(columns[-1]) + 1
    line = round(first + share * (last - first))
    left = known & (np.arange(known.shape[1]) < line)
    picture = np.where(left[..., None], observed, drawn)
    if first < line < last:
        picture[:, line - 1 : line + 1] = _LINE
    return np.asarray(picture, np.float32)


def seen_by(photograph: Photograph, camera: Camera) -> tuple[Floats, NDArray[np.bool_]]:
    """A photograph as a camera sees it that stands in the same place.

    Two pinholes in one place see the same rays, so that a homography takes the pixels of one to
    those of the other (Hartley and Zisserman 2004, section 8.4).

    Returns:
        (height, width, 3) in display light and (height, width), where the photograph shows
        anything.

    Raises:
        RiftError: the photograph cannot be read.
    """
    from skimage.transform import downscale_local_mean, warp

    image = photograph.read()
    alpha = image[..., 3:] if image.shape[2] == 4 else np.ones_like(image[..., :1])
    laid = np.concatenate([image[..., :3] * alpha, alpha], axis=2)
    # Photographs are finer than windows: pixels are averaged first, or fine detail would flicker.
    many = max(1, int(photograph.camera.intrinsics[1] / camera.intrinsics[1]))
    laid = downscale_local_mean(laid, (many, many, 1))
    turn = photograph.camera.view[:3, :3] @ camera.view[:3, :3].T
    across = photograph.camera.K @ turn @ np.linalg.inv(camera.K)
    across = np.diag([1 / many, 1 / many, 1]) @ across
    # Our pixels have their centres at halves, those of scikit-image at whole numbers.
    half = np.array([[1, 0, 0.5], [0, 1, 0.5], [0, 0, 1]])
    inverse = np.linalg.inv(half) @ across @ half
    warped = warp(laid, inverse, output_shape=camera.size, order=1, mode="constant", cval=0.0)
    shown = warped[..., :3] / np.maximum(warped[..., 3:], 1e-6)
    rows, columns = np.indices(camera.size)
    ahead = across[2, 0] * columns + across[2, 1] * rows + across[2, 2] > 0
    return np.asarray(shown, np.float32), np.asarray((warped[..., 3] > 0.5) & ahead)
