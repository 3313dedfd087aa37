"""Opens a capture, posed photographs of one scene, whatever program posed them."""

from __future__ import annotations

import os
from dataclasses import replace
from pathlib import Path

from rift_cl.errors import InputError
from rift_cl.io.boundary import reading
from rift_cl.io.captures.capture_notes import color_notes, lens_notes, part_notes
from rift_cl.io.captures.colmap_model import MODEL_FOLDERS, find_model, open_model
from rift_cl.io.captures.other_cameras import other_cameras, other_program, way_out
from rift_cl.io.captures.photograph_folder import (
    other_files,
    photograph_names,
    photographs_in,
    unread_photographs,
)
from rift_cl.io.captures.transforms_json import open_transforms
from rift_cl.io.captures.video import is_video
from rift_cl.io.captures.view import Capture, View, as_pinholes, camera_at
from rift_cl.io.captures.view_image import read_known_view, read_view

__all__ = [
    "Capture",
    "View",
    "as_pinholes",
    "camera_at",
    "capture_name",
    "holds_bare_photographs",
    "holds_capture",
    "open_capture",
    "read_known_view",
    "read_view",
]

# NeRF's synthetic scenes have a file for each part; the first is what is trained on.
_TRANSFORMS = ("transforms.json", "transforms_train.json")


def open_capture(
    path: str | os.PathLike[str],
    *,
    images: str | os.PathLike[str] | None = None,
    photographs: bool = True,
) -> Capture:
    """Find the posed photographs of a capture; of the photographs, headers alone are read.

    Args:
        path: a ``transforms.json`` of any name, in the flavours of NeRF's synthetic scenes,
            instant-ngp and nerfstudio; or a folder with one; or a folder with a COLMAP model
            in ``sparse/0``, in ``sparse`` or in itself, binary or text, and the photographs in
            ``images`` there or above. Masks lie in ``masks`` beside ``images`` (see ``mask_of``).
        images: the folder of the photographs, or the one that has them in ``images``, where a
            COLMAP model lies somewhere else; masks lie in ``masks`` there.
        photographs: whether they have to be there; without them, views can be counted with but
            not read, and a ``transforms.json``, which may then be a camera path of nerfstudio,
            must say how large they are.

    Returns:
        Views in the order of the file, or in that of their names where they are COLMAP's.

    Raises:
        InputError: there is no such file, no capture in it, or an image is missing; a pose is no
            rigid motion, or intrinsics are singular.
        FileFormatError: a file is damaged or claims more than it holds, a field has the wrong
            type, a camera model is unknown, an image is listed twice, or none is.
        NonFiniteError: a pose, an intrinsic or a point is NaN or infinite.
        PathEscapeError: a path in the capture leads outside its folder.
        ResourceLimitError: a list of views or points is larger than the memory allows.
    """
    with reading(Path(path), "the capture"):
        path = _absolute(path)
        file = _transforms(path)
        if file is not None and images is None:
            capture = open_transforms(file, photographs=photographs)
            if file != path:
                notes = part_notes(file) if file.name == _TRANSFORMS[1] else []
                capture = replace(capture, notes=(*capture.notes, *notes, *_model_notes(file)))
            return _told(capture, photographs)
        model = find_model(path)
    if model is not None:
        folder = None if images is None else photographs_in(Path(images))
        return _told(open_model(path, *model, folder, photographs=photographs), photographs)
    if images is not None:
        raise InputError(f"{path}: holds no COLMAP model, to which images= could belong")
    bare = photograph_names(photographs_in(path))
    hint = f"; the poses of its {len(bare)} bare photographs can be found by 'rift fit'"
    video = next((name for name in other_files(photographs_in(path)) if is_video(name)), None)
    if not bare and video is not None:
        bare, hint = [video], f"; 'rift fit' takes the video {video} itself"
    elif not bare and (unread := unread_photographs(photographs_in(path))):
        bare = unread
        hint = f"; {unread[0]} is of a format that is not read: convert photographs to PNG or JPEG"
    raise InputError(
        f"{path}: holds no capture; looked for {' and '.join(_TRANSFORMS)}, and for cameras "
        f"and images, .bin or .txt, of a COLMAP model in {', '.join(MODEL_FOLDERS)}"
        f"{hint if bare else ''}{''.join(f'; {note}' for note in other_cameras(path))}"
    )


def _model_notes(file: Path) -> list[str]:
    """That a COLMAP model lies beside the transforms.json that was taken of a folder."""
    model = find_model(file.parent)
    if model is None:
        return []
    way = "move that file away" if model[0].samefile(file.parent) else "name its folder"
    return [
        f"{file.name} is taken of {file.parent}, and the COLMAP model in {model[0]} is left alone, "
        f"its sparse points too: {way} to use it instead"
    ]


def _told(capture: Capture, photographs: bool) -> Capture:
    """With what is to be said of the photographs' colours and lenses, if they are there."""
    if not photographs:
        return capture
    more = *lens_notes(capture.views), *color_notes(capture.views)
    return replace(capture, notes=(*capture.notes, *more))


def capture_name(path: Path) -> str:
    """How a capture is called: its folder, or a file that is not named transforms."""
    path = path.resolve()
    return path.parent.name if path.name == "transforms.json" else path.stem


def holds_bare_photographs(path: str | os.PathLike[str]) -> bool:
    """Whether a path is a folder with photographs that nobody has posed; see ``photographs``."""
    with reading(Path(path), "the capture"):
        path = _absolute(path)
        if not path.is_dir() or _transforms(path) is not None or find_model(path) is not None:
            return False
    return bool(photograph_names(photographs_in(path)))


def holds_capture(path: str | os.PathLike[str]) -> bool:
    """Whether a path is a .json file, or a folder with posed photographs.

    Raises:
        InputError: there is no such path.
    """
    with reading(Path(path), "the capture"):
        path = _absolute(path)
        if not path.exists():
            raise InputError(f"{path}: there is no such file or folder")
        if not path.is_dir():
            return path.suffix.lower() == ".json"
        return _transforms(path) is not None or find_model(path) is not None


def _absolute(path: str | os.PathLike[str]) -> Path:
    path = Path(path).absolute()
    # What lies above the folder is looked at too, so that its name has to be a plain one.
    return path.resolve() if ".." in path.parts else path


def _transforms(path: Path) -> Path | None:
    """The transforms.json that a path is, or that lies in it; None where it may hold a model.

    Raises:
        InputError: there is no such path, or it can be no capture.
    """
    if not path.exists():
        raise InputError(f"{path}: there is no such file or folder")
    if not path.is_dir():
        if program := other_program(path):
            raise InputError(
                f"{path}: holds cameras of {program.name}, which are not read; to use them, "
                f"{program.way}"
            )
        if path.suffix.lower() != ".json":
            raise InputError(f"{path}: a capture is a .json file or a folder{way_out(path)}")
        return path
    return next((path / name for name in _TRANSFORMS if (path / name).is_file()), None)
