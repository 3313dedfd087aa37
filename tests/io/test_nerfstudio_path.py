"""Camera paths of nerfstudio's viewer: the cameras that its own renderer draws."""

from __future__ import annotations

import json
import math
from pathlib import Path
from typing import Any

import capture_files as made
import numpy as np
import pytest

from rift_cl.errors import FileFormatError, InputError
from rift_cl.io import open_capture


def flat(number: int) -> list[float]:
    return np.ravel(made.opengl(number)).tolist()


def path_file(folder: Path, **changes: Any) -> Path:
    cameras = [{"camera_to_world": flat(k), "fov": 40.0 + k, "aspect": 3.0} for k in range(3)]
    size = {"render_width": 64, "render_height": 48}
    record = {"camera_type": "perspective", **size, "seconds": 2, "fps": 24, "keyframes": []}
    file = folder / "path.json"
    file.write_text(json.dumps(record | {"camera_path": cameras} | changes))
    return file


def test_a_camera_path_has_the_cameras_that_nerfstudio_draws(tmp_path: Path) -> None:
    views = open_capture(path_file(tmp_path), photographs=False).views
    assert len({view.name for view in views}) == 3
    for number, view in enumerate(views):
        place, axes = made.stand(number)
        np.testing.assert_allclose(view.camera.center, place, atol=1e-9)
        np.testing.assert_allclose(view.camera.view[:3, :3], axes, atol=1e-9)
        focal = 24 / math.tan(math.radians(40 + number) / 2)
        assert view.camera.size == (48, 64) and view.lens is None
        np.testing.assert_allclose(view.camera.intrinsics, (focal, focal, 32, 24))


def test_a_camera_path_has_no_photographs(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"path\.json: is a camera path of nerfstudio"):
        open_capture(path_file(tmp_path))


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"camera_type": "equirectangular"}, "'camera_type' is 'equirectangular'"),
        ({"camera_path": [{"fov": 50}]}, r"camera_path\[0\]: 'camera_to_world' has 0 numbers"),
        ({"camera_path": [{"camera_to_world": [1] * 12, "fov": 50}]}, "has 12 numbers"),
        ({"camera_path": [{"camera_to_world": flat(0)}]}, "focal length"),
        ({"camera_path": 3}, "wanted a list"),
        ({"render_width": None}, "has no 'w' and 'h'"),
    ],
)
def test_what_a_camera_path_lacks_is_named(
    tmp_path: Path, changes: dict[str, Any], words: str
) -> None:
    with pytest.raises((FileFormatError, InputError), match=words):
        open_capture(path_file(tmp_path, **changes), photographs=False)


def test_frames_of_a_path_need_no_photograph(tmp_path: Path) -> None:
    file = made.transforms(tmp_path)
    record = json.loads(file.read_text())
    for frame in record["frames"][:2]:
        del frame["file_path"]
    file.write_text(json.dumps(record | {"w": made.WIDTH, "h": made.HEIGHT}))
    views = open_capture(file, photographs=False).views
    assert len({view.name for view in views}) == 3
    np.testing.assert_allclose(views[1].camera.center, made.stand(1)[0], atol=1e-9)
    with pytest.raises(FileFormatError, match=r"frames\[0\]: has no 'file_path'"):
        open_capture(file)
