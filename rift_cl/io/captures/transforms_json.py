"""Views from a transforms.json: the flavours of NeRF's synthetic scenes, instant-ngp, nerfstudio.

Intrinsics stand once for all frames or in each of them, where they take precedence; focal lengths
are those of ``transforms_focal``. Poses are camera-to-world with OpenGL's axes. Coefficients of a
lens have their names, or stand in the list 'distortion_params' of nerfstudio, whose
'fisheye_crop_radius' is the circle that a fisheye fills. A lens with an opening has
'aperture_radius', 'focus_distance' (without it the focus is at infinity) and 'wavelength', in the
poses' unit. Fields that say nothing about where and through what lens a photograph was taken are
left alone, but for nerfstudio's lists of what is trained on and scored. Where photographs need not
be there, as along the path of a film, frames need not name one, and may be those of
``nerfstudio_path``.
"""

from __future__ import annotations

import math
import reprlib
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

from rift_cl.errors import FileFormatError, InputError
from rift_cl.geometry.aperture import Aperture
from rift_cl.geometry.camera import Camera
from rift_cl.geometry.lens_distortion import LENS_MODELS, lens_of
from rift_cl.io.captures.capture_notes import mask_notes
from rift_cl.io.captures.capture_paths import CaptureFolder, mask_of
from rift_cl.io.captures.nerfstudio_path import as_transforms, is_camera_path
from rift_cl.io.captures.point_cloud import read_point_cloud
from rift_cl.io.captures.poses import rigid_error, view_of_opengl
from rift_cl.io.captures.split_lists import split_by_lists
from rift_cl.io.captures.transforms_focal import focal_lengths
from rift_cl.io.captures.view import Capture, View, check_views, located
from rift_cl.io.images.read_picture import read_picture_header
from rift_cl.io.json_fields import Fields, read_json_object

_COEFFICIENTS = tuple(dict.fromkeys(name for names in LENS_MODELS.values() for name in names))
_MODELS = ("SIMPLE_PINHOLE", "PINHOLE", *LENS_MODELS)
# The order of nerfstudio's list of coefficients, of which a fisheye has the first four.
_LIST, _LISTED, _LISTED_OF_FISHEYE = "distortion_params", ("k1", "k2", "k3", "k4", "p1", "p2"), 4
_CROP = "fisheye_crop_radius"
# What instant-ngp says of cameras that are neither pinholes nor among the models, and how it calls
# them: truth values, and the first of the coefficients.
_OTHER_CAMERAS = {
    "latlong": "a panorama",
    "equirectangular": "a panorama",
    "orthographic": "an orthographic camera",
}
_FTHETA = tuple(f"ftheta_p{index}" for index in range(6))
_ALONG = {"w": "wide", "h": "high"}
# A principal point this share of the picture from its middle is doubted: that of a picture half as
# large lies at a quarter, those that calibrations find within a tenth.
_DOUBTED = 0.2
# What four digits behind the point leave of a rotation.
_FOUR_DIGITS = 2e-4


def open_transforms(
    path: Path, *, photographs: bool = True, images: CaptureFolder | None = None
) -> Capture:
    """Read the views of a transforms.json; see ``open_capture``.

    Args:
        path: the file.
        photographs: whether they have to be there.
        images: where the photographs are, if not beside the file.
    """
    top = _cameras_in(path, photographs=photographs)
    folder = CaptureFolder(path.parent, complete=photographs)
    place = folder if images is None else replace(images, complete=photographs)
    frames = list(top.objects("frames"))
    if not photographs:
        frames = [_named(frame, number) for number, frame in enumerate(frames)]
    # Where some masks are named, those that are not named are not meant.
    by_name = all(frame.values.get("mask_path") is None for frame in frames)
    views = [_view(place, frame, top, by_name) for frame in frames]
    checked, split_notes = split_by_lists(top, check_views(path, views))
    notes = (
        *(mask_notes(place, checked) if by_name else []),
        *split_notes,
        *_center_notes(path, checked),
        *_crop_notes(path, checked),
        *_digit_notes(path, frames),
    )
    ply = top.text("ply_file_path")
    if ply is None:
        return Capture(checked, None, None, path, notes=notes)
    points, colors = read_point_cloud(folder.file(f"{path}: 'ply_file_path'", ply))
    return Capture(checked, points, colors, path, notes=notes)


def _cameras_in(path: Path, *, photographs: bool) -> Fields:
    """The file's object, as a transforms.json.

    Raises:
        InputError: it is a path of cameras, and photographs are wanted.
    """
    top = read_json_object(path)
    if not is_camera_path(top):
        return top
    if photographs:
        raise InputError(
            f"{path}: is a camera path of nerfstudio, which has no photographs: 'rift render "
            "--path' draws its frames"
        )
    return as_transforms(top)


def _named(frame: Fields, number: int) -> Fields:
    """A frame with the name of a photograph, which is not there if none is said."""
    if "file_path" in frame:
        return frame
    return Fields(frame.where, {**frame.values, "file_path": f"frame {number:04}"})


def _center_notes(path: Path, views: Sequence[View]) -> list[str]:
    """A principal point far from the middle: right in a crop, and wrong after a change of size."""
    far = [view for view in views if _off_middle(view.camera) > _DOUBTED]
    if not far:
        return []
    camera = far[0].camera
    _, _, cx, cy = camera.intrinsics
    return [
        f"{path}: the principal point of {len(far)} of {len(views)} photographs is far from the "
        f"middle, such as ({cx:g}, {cy:g}) in the {camera.width} x {camera.height} pixels of "
        f"{far[0].name}: unless these are crops, the intrinsics are those of another size"
    ]


def _crop_notes(path: Path, views: Sequence[View]) -> list[str]:
    """What of fisheyes is not used because it lies outside of the circle that they fill."""
    cropped = [view for view in views if view.crop_radius is not None]
    if not cropped:
        return []
    return [
        f"{path}: {_CROP!r} leaves out of {len(cropped)} of {len(views)} photographs what is "
        f"farther from their middle, more than {cropped[0].crop_radius:g} pixels in "
        f"{cropped[0].name}"
    ]


def _digit_notes(path: Path, frames: Sequence[Fields]) -> list[str]:
    """That poses are less exact than their photographs, because of how they are written."""
    errors = [rigid_error(frame.pose("transform_matrix")[:, :3]) for frame in frames]
    few = [error for error in errors if error > _FOUR_DIGITS]
    if not few:
        return []
    return [
        f"{path}: the poses of {len(few)} of {len(frames)} photographs have few digits, which "
        f"leave their rotations off by up to {max(few):.1g}: the nearest rotations are taken, and "
        "'rift fit --refine-poses' can make up for it"
    ]


def _off_middle(camera: Camera) -> float:
    """How far the principal point is from the middle, as a share of the picture."""
    _, _, cx, cy = camera.intrinsics
    return max(abs(cx / camera.width - 0.5), abs(cy / camera.height - 0.5))


def _view(folder: CaptureFolder, frame: Fields, top: Fields, by_name: bool) -> View:
    name = frame.text("file_path")
    if name is None:
        raise FileFormatError(f"{frame.where}: has no 'file_path', no photograph belongs to it")
    where = f"{frame.where} ({reprlib.repr(name)})"
    own = Fields(where, frame.values)
    fields = own.within(top)
    image = folder.image(where, name)
    mask = own.text("mask_path")
    size = _size(fields, image)
    K = _intrinsics(own, top, size)
    pose = own.pose("transform_matrix")
    model, coefficients = _distortion(own, top)
    aperture = _aperture(fields)
    with located(where):
        camera = Camera(size, K, view_of_opengl(pose), aperture=aperture)
        lens = lens_of(model, coefficients, K)
    found = None if mask is None else folder.file(where, mask)
    if by_name:
        found = mask_of(where, folder, folder.name_of(image))
    return View(
        folder.name_of(image),
        camera,
        image,
        found,
        lens,
        own.flag("upright"),
        crop_radius=_crop_radius(fields, model),
    )


def _size(fields: Fields, image: Path) -> tuple[int, int]:
    height, width = fields.whole("h"), fields.whole("w")
    if (height is None or width is None) and not image.exists():
        raise InputError(
            f"{fields.where}: has no 'w' and 'h', and the image {image} that would tell is not "
            "there"
        )
    if height is None or width is None:
        with located(fields.where):
            header = read_picture_header(image)
        height, width = height or header.size[0], width or header.size[1]
    return height, width


def _intrinsics(own: Fields, top: Fields, size: tuple[int, int]) -> list[list[float]]:
    fx, fy = focal_lengths(own, top, size)
    fields = own.within(top)
    cx, cy = _center(fields, "cx", "w", size[1]), _center(fields, "cy", "h", size[0])
    return [[fx, 0, cx], [0, fy, cy], [0, 0, 1]]


def _center(fields: Fields, name: str, edge: str, extent: int) -> float:
    """Principal point along an edge in pixels; the middle where nothing is said."""
    center = fields.number(name)
    if center is None:
        return extent / 2
    if edge not in fields and not 0 < center < extent:
        raise InputError(
            f"{fields.where}: {name!r} is {center:g}, outside of the picture, which is {extent} "
            f"pixels {_ALONG[edge]}: the intrinsics are probably those of pictures of another "
            "size. Scale 'fl_x', 'fl_y', 'cx' and 'cy' to this one; if they belong to it, say so "
            "in 'w' and 'h'"
        )
    return center


def _aperture(fields: Fields) -> Aperture | None:
    """The opening of the lens; None for a pinhole, whose radius is 0 or not there."""
    radius = fields.number("aperture_radius") or 0.0
    focus, wavelength = fields.number("focus_distance"), fields.number("wavelength") or 0.0
    for name, value, fits, wanted in (
        ("aperture_radius", radius, radius >= 0, "a length, 0 for a pinhole"),
        ("focus_distance", focus, focus is None or focus > 0, "a positive distance"),
        ("wavelength", wavelength, wavelength >= 0, "a length, 0 for no diffraction"),
    ):
        if radius and not fits:
            raise InputError(f"{fields.where}: {name!r} is {value:g}, wanted {wanted}")
    return Aperture(radius, math.inf if focus is None else focus, wavelength) if radius else None


def _crop_radius(fields: Fields, model: str) -> float | None:
    """The circle that a fisheye fills; of other lenses nerfstudio does not heed it either."""
    radius = fields.number(_CROP)
    if radius is None or not model.endswith("FISHEYE"):
        return None
    if radius <= 0:
        raise InputError(
            f"{fields.where}: {_CROP!r} is {radius:g}, wanted a radius in pixels of the photograph"
        )
    return radius


def _distortion(own: Fields, top: Fields) -> tuple[str, list[float]]:
    """The camera model by its name in COLMAP, and its coefficients."""
    fields = own.within(top)
    model = _model(fields)
    found = {**dict.fromkeys(_COEFFICIENTS, 0.0), **_said(top, model), **_said(own, model)}
    # OpenCV's five numbers are written under the name of COLMAP's four.
    takes = (*LENS_MODELS.get(model, ()), *(("k3",) if model == "OPENCV" else ()))
    extra = [name for name, value in found.items() if value and name not in takes]
    if extra:
        raise FileFormatError(
            f"{fields.where}: {extra[0]!r} is {found[extra[0]]:g}, which the camera model {model} "
            "does not have; name the model that it belongs to in 'camera_model'"
        )
    if model == "OPENCV" and found["k3"]:
        model = "FULL_OPENCV"
    return model, [found[name] for name in LENS_MODELS.get(model, ())]


def _model(fields: Fields) -> str:
    """The camera model by its name in COLMAP.

    Raises:
        FileFormatError: it is none of ours, or two fields disagree about it.
    """
    _demand_known_camera(fields)
    model, fisheye = fields.text("camera_model"), fields.flag("is_fisheye")
    if model is None:
        return "OPENCV_FISHEYE" if fisheye else "OPENCV"
    if model not in _MODELS:
        raise FileFormatError(
            f"{fields.where}: 'camera_model' is {reprlib.repr(model)}, known are "
            f"{', '.join(_MODELS)}"
        )
    if "is_fisheye" in fields and fisheye != model.endswith("FISHEYE"):
        raise FileFormatError(
            f"{fields.where}: 'camera_model' is {model} and 'is_fisheye' {str(fisheye).lower()}, "
            "which contradict each other; leave out the wrong one"
        )
    return model


def _demand_known_camera(fields: Fields) -> None:
    """Refuse what instant-ngp calls cameras that are not among the models."""
    for name, what in _OTHER_CAMERAS.items():
        if fields.flag(name):
            raise FileFormatError(
                f"{fields.where}: {name!r} says that this is {what}, which is not read; make "
                "pictures of pinholes of it"
            )
    found = [name for name in _FTHETA if name in fields]
    if found:
        raise FileFormatError(
            f"{fields.where}: has {found[0]!r}, of instant-ngp's f-theta lens, which is not read; "
            f"known are {', '.join(LENS_MODELS)}"
        )


def _said(source: Fields, model: str) -> dict[str, float]:
    """The coefficients that one object holds, by name and in nerfstudio's list.

    Raises:
        FileFormatError: the list is of another length, or contradicts a name beside it.
    """
    numbers = ((name, source.number(name)) for name in _COEFFICIENTS)
    named = {name: number for name, number in numbers if number is not None}
    values = source.numbers(_LIST)
    if values is None:
        return named
    lengths = [len(_LISTED)] + ([_LISTED_OF_FISHEYE] if model == "OPENCV_FISHEYE" else [])
    if len(values) not in lengths:
        raise FileFormatError(
            f"{source.where}: {_LIST!r} holds {len(values)} numbers, wanted {len(_LISTED)}: "
            f"{', '.join(_LISTED)}"
        )
    listed = dict(zip(_LISTED, values, strict=False))
    for name, value in listed.items():
        if named.get(name, value) != value:
            raise FileFormatError(
                f"{source.where}: {name!r} is {named[name]:g} and {value:g} in {_LIST!r}, which "
                "contradict each other; leave out the wrong one"
            )
    return {**named, **listed}
