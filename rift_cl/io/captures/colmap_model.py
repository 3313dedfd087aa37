"""Views from a COLMAP model: where its files lie, and cameras made of their records.

Poses are world-to-camera with OpenCV's axes and pixel centres are at one half, as everywhere here,
so that nothing has to be turned round.
"""

from __future__ import annotations

from contextlib import suppress
from dataclasses import replace
from pathlib import Path
from types import ModuleType

import numpy as np
from numpy.typing import NDArray

from rift_cl.errors import FileFormatError, RiftError
from rift_cl.geometry.camera import Camera
from rift_cl.geometry.lens_distortion import lens_of
from rift_cl.io.boundary import reading
from rift_cl.io.captures import colmap_binary, colmap_text
from rift_cl.io.captures.capture_notes import mask_notes, pose_notes
from rift_cl.io.captures.capture_paths import CaptureFolder, mask_of
from rift_cl.io.captures.colmap_records import CameraRecord, ImageRecord
from rift_cl.io.captures.pose_record import is_upright
from rift_cl.io.captures.poses import view_of_quaternion
from rift_cl.io.captures.view import Capture, View, check_views, finite_points, located

MODEL_FOLDERS = ("sparse/0", "sparse", ".")
# Numbers of a text and of a binary model that are so near are the same, written with few digits.
_SAME = 1e-4
_READERS: dict[str, ModuleType] = {".bin": colmap_binary, ".txt": colmap_text}


def find_model(folder: Path) -> tuple[Path, str] | None:
    """Folder of the COLMAP model that belongs to a capture's folder, and suffix of its files."""
    for name in MODEL_FOLDERS:
        for suffix in _READERS:
            if _has_model(folder / name, suffix):
                return folder / name, suffix
    return None


def _has_model(folder: Path, suffix: str) -> bool:
    return all((folder / (part + suffix)).is_file() for part in ("cameras", "images"))


def open_model(
    folder: Path,
    model: Path,
    suffix: str,
    images: CaptureFolder | None = None,
    *,
    photographs: bool = True,
) -> Capture:
    """Read the views of a COLMAP model; see ``open_capture``.

    Args:
        folder: the folder that was asked for.
        model: the folder of the model, which may be the same.
        suffix: the suffix of its files, ``.bin`` or ``.txt``.
        images: where the photographs are; looked for from ``folder`` on when not given.
        photographs: whether they have to be there.
    """
    reader = _READERS[suffix]
    cameras = _numbered(model / f"cameras{suffix}", reader.read_cameras(model / f"cameras{suffix}"))
    path = model / f"images{suffix}"
    records = sorted(reader.read_images(path), key=lambda record: record.name)
    images = replace(images or _images_folder(folder), complete=photographs)
    views = [_view(path, images, cameras, record) for record in records]
    if is_upright(model):
        views = [replace(view, upright=True) for view in views]
    checked = check_views(path, views)
    points, colors, error = _points(model / f"points3D{suffix}", reader)
    notes = [*mask_notes(images, checked), *_other_form_notes(model, suffix, cameras, records)]
    # Of poses that we had found ourselves, this was said then.
    if photographs and not is_upright(model):
        notes += [f"{note}{_others_in_words(model)}" for note in pose_notes(images, checked)]
    return Capture(checked, points, colors, model, error, tuple(notes))


def _other_form_notes(
    model: Path, suffix: str, cameras: dict[int, CameraRecord], records: list[ImageRecord]
) -> list[str]:
    """That the same folder has another model, as text beside binary files, which says otherwise."""
    other = next(form for form in _READERS if form != suffix)
    if not _has_model(model, other):
        return []
    # Damage in what is not used is no matter.
    with suppress(RiftError):
        reader = _READERS[other]
        found = {camera.number: camera for camera in reader.read_cameras(model / f"cameras{other}")}
        images = reader.read_images(model / f"images{other}")
        if not _agree(_said(cameras, records), _said(found, images)):
            return [
                f"{model} holds two models that differ: that of its {suffix} files is read, that "
                f"of its {other} files is left alone; keep the one that is meant"
            ]
    return []


def _said(
    cameras: dict[int, CameraRecord], records: list[ImageRecord]
) -> dict[str, tuple[str, NDArray[np.float64]]]:
    """Camera model, and all numbers of pose and camera, of each photograph."""
    taken = [(image, cameras[image.camera]) for image in records if image.camera in cameras]
    return {
        image.name: (
            camera.model,
            np.array(
                [
                    *view_of_quaternion(image.quaternion, image.shift).ravel(),
                    *(camera.width, camera.height, *camera.parameters),
                ]
            ),
        )
        for image, camera in taken
    }


def _agree(
    one: dict[str, tuple[str, NDArray[np.float64]]],
    other: dict[str, tuple[str, NDArray[np.float64]]],
) -> bool:
    """Whether two models say the same, but for digits that a text may lack."""
    if {name: model for name, (model, _) in one.items()} != {
        name: model for name, (model, _) in other.items()
    }:
        return False
    numbers = ([said[name][1] for name in one] for said in (one, other))
    first, second = (np.concatenate([np.empty(0), *arrays]) for arrays in numbers)
    return bool(np.allclose(first, second, rtol=_SAME, atol=_SAME))


def _others_in_words(model: Path) -> str:
    """What other models there are, as the end of a sentence; empty where there are none."""
    counts = ", ".join(f"{name} has {count}" for name, count in _other_models(model).items())
    return f"; {counts}: give that folder as the capture to use it instead" if counts else ""


def _other_models(model: Path) -> dict[str, int]:
    """Models beside one that COLMAP numbered, by their folders: how many photographs each has.

    COLMAP makes one of each part of the photographs that hangs together.
    """
    counts: dict[str, int] = {}
    if not model.name.isdecimal():
        return counts
    with reading(model.parent, "the folder"):
        folders = sorted(model.parent.iterdir())
    for folder in folders:
        other = find_model(folder) if folder.name.isdecimal() and folder != model else None
        # Damage in what is not asked for is no matter.
        if other is not None and other[0] == folder:
            with suppress(RiftError):
                images = _READERS[other[1]].read_images(folder / f"images{other[1]}")
                counts[f"{folder.parent.name}/{folder.name}"] = len(images)
    return counts


def _images_folder(folder: Path) -> CaptureFolder:
    """The folder ``images`` beside the model or above it, or else the folder itself."""
    above = [folder, folder.parent]
    if folder.parent.name == "sparse":
        above.append(folder.parent.parent)
    found = next((place for place in above if (place / "images").is_dir()), None)
    return CaptureFolder(folder) if found is None else CaptureFolder(found, "images")


def _numbered(path: Path, records: list[CameraRecord]) -> dict[int, CameraRecord]:
    cameras = {record.number: record for record in records}
    if len(cameras) < len(records):
        raise FileFormatError(f"{path}: two cameras have the same number")
    return cameras


def _view(
    path: Path, images: CaptureFolder, cameras: dict[int, CameraRecord], record: ImageRecord
) -> View:
    where = f"{path}: image {record.name[:80]!r}"
    camera = cameras.get(record.camera)
    if camera is None:
        raise FileFormatError(f"{where}: was taken by camera {record.camera}, which is not there")
    image = images.file(where, record.name)
    mask = mask_of(where, images, record.name)
    with located(where):
        view = view_of_quaternion(record.quaternion, record.shift)
        pinhole = Camera((camera.height, camera.width), camera.K, view)
        lens = lens_of(camera.model, camera.coefficients, camera.K)
    return View(record.name, pinhole, image, mask, lens)


def _points(
    path: Path, reader: ModuleType
) -> tuple[NDArray[np.float32] | None, NDArray[np.float32] | None, float | None]:
    """Sparse points, their colours, and the mean of the errors that are not -1, unknown."""
    if not path.is_file():
        return None, None, None
    records = reader.read_points(path)
    points = finite_points(str(path), records.positions)
    if points is None:
        return None, None, None
    known = records.errors[np.isfinite(records.errors) & (records.errors >= 0)]
    error = float(known.mean()) if known.size else None
    return points, np.asarray(records.colors, np.float32).reshape(-1, 3) / np.float32(255), error
