"""A capture as values: posed photographs, and the sparse points that came with them."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from rift_cl.errors import FileFormatError, InputError, NonFiniteError, RiftError
from rift_cl.geometry.camera import Camera
from rift_cl.geometry.lens_distortion import Lens
from rift_cl.geometry.numbers import one_number

Split = Literal["", "train", "test", "none"]


@dataclass(frozen=True, eq=False)
class View:
    """One posed photograph; its pixels are read by ``read_view``.

    Args:
        name: what the capture calls it, unique there.
        camera: what would have seen the photograph without its lens's distortion.
        image: the photograph.
        mask: an image of the same size, white where the photograph counts; or None.
        lens: what the photograph was distorted by; None where it is a pinhole's already.
        upright: the camera's pixels are those of the photograph as EXIF wants it shown, and not as
            it is stored.
        split: what the capture wants of it: to be trained on ("train"), to be scored ("test"),
            neither ("none"); empty where it says nothing.
        crop_radius: how far from the middle of the photograph, through its lens, it shows anything,
            in its pixels, as fisheyes that fill a circle do; None where it does everywhere.
    """

    name: str
    camera: Camera
    image: Path
    mask: Path | None
    lens: Lens | None
    upright: bool = False
    split: Split = ""
    crop_radius: float | None = None


@dataclass(frozen=True, eq=False, repr=False)
class Capture:
    """Posed photographs of one scene.

    Args:
        views: the photographs; never empty.
        points: sparse points of the scene, float32 (P, 3) in world coordinates, or None.
        point_colors: their colours in display light, float32 (P, 3) in [0, 1], or None.
        path: the file, or the folder of the COLMAP model, that the views were found in.
        reprojection_error: how far from where a photograph shows them the sparse points are
            seen, in pixels of the photographs, the mean over the points; None where nobody says.
        notes: what of the capture is not used, or may not be meant, a sentence each.
    """

    views: tuple[View, ...]
    points: NDArray[np.float32] | None
    point_colors: NDArray[np.float32] | None
    path: Path
    reprojection_error: float | None = None
    notes: tuple[str, ...] = ()

    def __repr__(self) -> str:
        first, others = self.views[0].camera, self.views[1:]
        size = f"{first.width} x {first.height} pixels"
        alike = all(view.camera.size == first.size for view in others)
        points = 0 if self.points is None else len(self.points)
        return (
            f"<Capture in {self.path}: {len(self.views)} photographs"
            f"{f' of {size}' if alike else f', the first of {size}'}, {points} sparse points>"
        )


def camera_at(view: View, downscale: int) -> Camera:
    """The camera of a view whose image was made smaller by a whole factor.

    Rows and columns at the lower and right edge that fill no whole pixel are left out.

    Raises:
        InputError: the factor is no positive whole number, or larger than the image.
    """
    camera, factor = view.camera, one_number(downscale)
    if not (factor.is_integer() and 1 <= factor <= min(camera.size)):
        raise InputError(
            f"downscale is {downscale!r}, wanted a whole number from 1 to {min(camera.size)}, "
            f"the shorter edge of view {view.name!r}"
        )
    return camera.shrunk(int(factor))


def as_pinholes(capture: Capture) -> Capture:
    """The same views, as if no lens had had an opening."""
    views = tuple(replace(view, camera=_pinhole(view.camera)) for view in capture.views)
    return replace(capture, views=views)


def _pinhole(camera: Camera) -> Camera:
    return Camera(camera.size, camera.K, camera.view, camera.model)


@contextmanager
def located(where: str) -> Iterator[None]:
    """Name the place in every error of ours that is raised inside."""
    try:
        yield
    except RiftError as error:
        raise type(error)(f"{where}: {error}") from error


def check_views(path: Path, views: Sequence[View]) -> tuple[View, ...]:
    """Make sure that there are views, each with a name of its own.

    Raises:
        FileFormatError: there are none, or two have the same name.
    """
    if not views:
        raise FileFormatError(f"{path}: holds no views, not one posed photograph")
    seen: dict[str, int] = {}
    for index, view in enumerate(views):
        first = seen.setdefault(view.name, index)
        if first != index:
            raise FileFormatError(
                f"{path}: frames {first} and {index} have the same image, {view.name!r}; leave "
                "one out"
            )
    return tuple(views)


def finite_points(where: str, points: ArrayLike) -> NDArray[np.float32] | None:
    """Sparse points as float32 (P, 3); None where there are none.

    Raises:
        NonFiniteError: a coordinate is NaN, or too large for float32.
    """
    with np.errstate(all="ignore"):
        values = np.array(points, dtype=np.float32).reshape(-1, 3)
    bad = np.flatnonzero(~np.isfinite(values).all(axis=1))
    if bad.size:
        raise NonFiniteError(f"{where}: point {bad[0]} is not finite; leave it out")
    return values if len(values) else None
