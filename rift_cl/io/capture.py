"""Opens a capture, posed photographs of one scene, whatever program posed them."""

from __future__ import annotations

import os
from pathlib import Path

from rift_cl.errors import InputError
from rift_cl.io.boundary import reading
from rift_cl.io.colmap_model import MODEL_FOLDERS, find_model, open_model
from rift_cl.io.transforms_json import open_transforms
from rift_cl.io.view import Capture, View, camera_at
from rift_cl.io.view_image import read_view

__all__ = ["Capture", "View", "camera_at", "open_capture", "read_view"]

# NeRF's synthetic scenes have a file for each part; the first is what is trained on.
_TRANSFORMS = ("transforms.json", "transforms_train.json")


def open_capture(path: str | os.PathLike[str]) -> Capture:
    """Find the posed photographs of a capture; the photographs themselves are not read.

    Args:
        path: a ``transforms.json`` of any name, in the flavours of NeRF's synthetic scenes,
            instant-ngp and nerfstudio; or a folder with one; or a folder with a COLMAP model
            in ``sparse/0``, in ``sparse`` or in itself, binary or text, and the photographs in
            ``images`` there or above. Masks of a COLMAP model lie in ``masks`` beside ``images``.

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
        path = Path(path).absolute()
        # What lies above the folder is looked at too, so that its name has to be a plain one.
        path = path.resolve() if ".." in path.parts else path
        if not path.exists():
            raise InputError(f"{path}: there is no such file or folder")
        if not path.is_dir():
            if path.suffix.lower() != ".json":
                raise InputError(f"{path}: a capture is a .json file or a folder")
            return open_transforms(path)
        for name in _TRANSFORMS:
            if (path / name).is_file():
                return open_transforms(path / name)
        model = find_model(path)
    if model is None:
        raise InputError(
            f"{path}: holds no capture; looked for {' and '.join(_TRANSFORMS)}, and for cameras "
            f"and images, .bin or .txt, of a COLMAP model in {', '.join(MODEL_FOLDERS)}"
        )
    return open_model(path, *model)
