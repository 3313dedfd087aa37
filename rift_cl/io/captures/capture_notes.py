"""What is said of the photographs of a capture once its views are known, a sentence each.

None of it makes a capture unusable, and all of it may be meant: masks that no photograph has,
photographs without a pose, colours that are not sRGB's, files that are scored if they are named.
"""

from __future__ import annotations

import shlex
from collections.abc import Sequence
from contextlib import suppress
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from rift_cl.errors import RiftError
from rift_cl.geometry.lens_distortion import Lens
from rift_cl.io.captures.capture_paths import MASK_FOLDERS, CaptureFolder, masks_named
from rift_cl.io.captures.photograph_folder import photograph_names
from rift_cl.io.captures.view import View
from rift_cl.io.captures.view_image import read_view
from rift_cl.io.images.display_light import LightKind
from rift_cl.io.images.picture_header import PictureHeader
from rift_cl.io.images.read_picture import read_picture_header

# What lies beside the training file of NeRF's synthetic scenes.
_SCORED = ("transforms_val.json", "transforms_test.json")
# Photographs whose headers are read for their colours, and whose numbers are for their range.
_LOOKED_AT, _READ = 8, 2
# Cells along each edge of a picture whose areas are added up, and the least share of a photograph
# that is used without a word.
_CELLS, _NOTABLE = 64, 0.8
# Suffixes of a format that other programs also write display light in, as floating-point numbers.
_TIFF = (".tif", ".tiff")


def part_notes(file: Path) -> list[str]:
    """Which files beside a ``transforms_train.json`` have photographs to score, and how.

    Args:
        file: what was taken of a folder.
    """
    others = [path for name in _SCORED if (path := file.parent / name).is_file()]
    if not others:
        return []
    names = " and ".join(path.name for path in others)
    given = " ".join(shlex.quote(str(path)) for path in others)
    return [
        f"{file.name} is taken of {file.parent}, and {names} beside it is left alone: 'rift fit' "
        f"scores its photographs if it is told --test {given} --hold-out 0"
    ]


def pose_notes(images: CaptureFolder, views: Sequence[View]) -> list[str]:
    """How many photographs have a pose, unless all have one.

    Args:
        images: the folder of the photographs.
        views: those that have a pose; what lies in their folders counts.
    """
    posed = {view.image for view in views}
    found = {
        place / name
        for place in {image.parent for image in posed}
        for name in photograph_names(CaptureFolder(place))
    }
    if found <= posed:
        return []
    return [f"{len(posed)} of {len(found | posed)} photographs in {images.path} have a pose"]


def mask_notes(images: CaptureFolder, views: Sequence[View]) -> list[str]:
    """Which photographs have no mask, although there is a folder of masks.

    Args:
        images: the folder of the photographs.
        views: all of them, with the masks that were found by name.
    """
    folders = (images.root / name for name in MASK_FOLDERS)
    folder = next((folder for folder in folders if folder.is_dir()), None)
    bare = [view.name for view in views if view.mask is None]
    if folder is None or not bare:
        return []
    if len(bare) == len(views):
        wanted = " or ".join(masks_named(bare[0])[:2])
        return [
            f"{folder} holds no mask that is called as a photograph is, and is not used: that of "
            f"{bare[0]} would be {wanted} there"
        ]
    return [
        f"{len(bare)} of {len(views)} photographs, such as {bare[0]}, have no mask in {folder}: "
        "the whole of each is used"
    ]


def color_notes(views: Sequence[View]) -> list[str]:
    """What is made of colours that are not sRGB's, by the headers of a few photographs."""
    notes: dict[tuple[str, bool], str] = {}
    for view in _some(views):
        # Whoever reads the photograph is told what is wrong with it.
        with suppress(RiftError):
            header = read_picture_header(view.image)
            if sentence := _color_sentence(view.image, header):
                notes.setdefault((header.profile, header.floating), sentence)
    return list(notes.values())


def lens_notes(views: Sequence[View]) -> list[str]:
    """How much of their photographs the widest lenses lose, if that is notable.

    A pinhole of the same size and focal length, which a photograph is turned into, sees less than
    a wide fisheye does.
    """
    through = [(view.lens, view.camera.size, view.crop_radius) for view in views]
    shares = {key: 1.0 if key[0] is None else _share_used(key[0], *key[1:]) for key in set(through)}
    found = [(shares[key], view.name) for key, view in zip(through, views, strict=True)]
    losing = [one for one in found if one[0] < _NOTABLE]
    if not losing:
        return []
    share, name = min(losing)
    return [
        f"{len(losing)} of {len(views)} photographs lose what a pinhole of their size and focal "
        f"length does not see once the lens is undone: {100 * share:.0f} % of the pixels of {name} "
        "are used. To use more, undistort them to wider pinholes first, as COLMAP's "
        "image_undistorter does"
    ]


def _share_used(lens: Lens, size: tuple[int, int], crop_radius: float | None) -> float:
    """Which share of what a photograph shows is seen by the pinhole that it is turned into.

    The pinhole's picture is cut into cells, whose areas in the photograph are added up.
    """
    high, wide = size
    x, y = np.linspace(0, wide, _CELLS + 1), np.linspace(0, high, _CELLS + 1)
    corners = np.stack(np.meshgrid(x, y), axis=-1)
    places = lens.distort(corners)
    seen = np.all((places >= 0) & (places <= (wide, high)), axis=-1)
    shown = float(wide * high)
    if crop_radius is not None:
        middle = (wide / 2, high / 2)
        seen &= np.hypot(*np.moveaxis(places - middle, -1, 0)) < crop_radius
        shown *= np.mean(np.hypot(*np.moveaxis(corners - middle, -1, 0)) < crop_radius)
    whole = seen[1:, 1:] & seen[1:, :-1] & seen[:-1, 1:] & seen[:-1, :-1]
    # Half the cross product of a cell's diagonals.
    down, up = places[1:, 1:] - places[:-1, :-1], places[:-1, 1:] - places[1:, :-1]
    areas = np.abs(down[..., 0] * up[..., 1] - down[..., 1] * up[..., 0]) / 2
    return float(areas[whole].sum()) / shown if shown else 0.0


def range_notes(views: Sequence[View], *, downscale: int, light: LightKind) -> list[str]:
    """A sentence about floating-point photographs that hold less than black or more than white.

    Args:
        views: those of a capture; the numbers of two photographs are read.
        downscale: as it is fitted.
        light: that it is fitted in, "display" or "linear".
    """
    numbers = list[NDArray[np.float32]]()
    for view in _some(views):
        with suppress(RiftError):
            if len(numbers) < _READ and read_picture_header(view.image).floating:
                image = read_view(view, downscale=downscale, light=light)
                seen = image[..., 3:].all(axis=-1)
                numbers.append(image[seen, :3].ravel())
    found = np.concatenate([*numbers, np.empty(0, np.float32)])
    least, most = float(found.min(initial=0)), float(found.max(initial=0))
    if least >= 0 and most <= 1:
        return []
    share = 100 * np.count_nonzero((found < 0) | (found > 1)) / found.size
    return [
        f"{share:.3g} % of the numbers of floating-point photographs lie beyond 0 to 1 in {light} "
        f"light, from {least:.3g} to {most:.3g}: a fit takes them as they are, scores take them as "
        "a screen shows them, clipped to 0 to 1 in display light"
    ]


def _some(views: Sequence[View]) -> Sequence[View]:
    """A few views, spread over all."""
    return views[:: max(1, len(views) // _LOOKED_AT)]


def _color_sentence(path: Path, header: PictureHeader) -> str:
    if header.profile:
        taken = "linear sRGB" if header.linear else "sRGB"
        return (
            f"{path.name} has the colour profile {header.profile!r}, which is not applied: colours "
            f"are taken as {taken}"
        )
    if header.linear and not header.floating:
        return f"{path.name} says that its codes are linear light (gamma 1), and is read so"
    if header.floating and path.suffix.lower() in _TIFF:
        return (
            f"{path.name} holds floating-point numbers, which are taken as linear light: write "
            "display light (sRGB) as whole numbers of 16 bits"
        )
    return ""
