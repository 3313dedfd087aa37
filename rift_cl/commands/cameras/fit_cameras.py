"""A fit knows its cameras: those it was trained on, those it held out, and what they tell.

The folder of a fit holds ``transforms.json`` (nerfstudio's flavour; each frame says in ``split``
whether it was trained on, ``capture`` says what was found of the capture), ``sparse_pc.ply`` with
the sparse points, and ``cameras.json`` for viewers of splats. None of them names a folder of the
photographer's disk.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from rift_cl.commands.cameras.arc import Arc, arc_of
from rift_cl.commands.cameras.photograph_place import (
    are_those,
    kept_places,
    moved_place,
    names_of_masks,
    own_place,
)
from rift_cl.commands.inputs.scene_bounds import bounds_of_cameras
from rift_cl.commands.pictures.evenly_spaced import evenly
from rift_cl.errors import FileFormatError, InputError, RiftError
from rift_cl.geometry import Camera
from rift_cl.io.captures.capture import Capture, View
from rift_cl.io.captures.inria_cameras import inria_cameras
from rift_cl.io.captures.point_cloud import write_point_cloud
from rift_cl.io.captures.transforms_json import open_transforms
from rift_cl.io.captures.transforms_record import lens_fields, transforms_of
from rift_cl.io.json_fields import Fields, read_json_object
from rift_cl.io.output import write_json

Floats = NDArray[np.float64]

CAMERA_FILES = ("transforms.json", "cameras.json", "sparse_pc.ply")
_TRANSFORMS, _CAMERAS, _POINTS = CAMERA_FILES
# More sparse points are thinned out evenly: 15 MB of them tell as much.
_MOST_POINTS = 1 << 20
# The squares of larger coordinates would not be numbers in float32.
_FARTHEST = 1e15
_TRAINING, _TEST = "train", "test"


@dataclass(frozen=True, eq=False)
class FitCameras:
    """The cameras of a fit, and what they tell of the capture.

    Args:
        training_views: those that were trained on, in the capture's order, at the photographs'
            size.
        test_views: those that were held out.
        up: (3,) unit vector, the cameras' common up.
        focus: (3,) what the cameras look at.
        arc: from where they looked.
        points: sparse points of the scene, float32 (P, 3), or None.
        placed: how many photographs have a pose.
        photographs: of how many.
        reprojection_error: mean over the sparse points, in pixels; None where nobody says.
        reopened: the capture that the views make, without those that were neither trained on nor
            held out.
    """

    training_views: tuple[View, ...]
    test_views: tuple[View, ...]
    up: Floats
    focus: Floats
    arc: Arc
    points: NDArray[np.float32] | None
    placed: int
    photographs: int
    reprojection_error: float | None
    reopened: Capture

    @property
    def views(self) -> tuple[View, ...]:
        """All of them, in the capture's order."""
        return self.reopened.views

    def check_photographs(self, fit: Path) -> None:
        """Make sure that every photograph is where it was.

        Raises:
            InputError: one is not.
        """
        missing = [view for view in self.views if not view.image.is_file()]
        if missing:
            raise InputError(
                f"{fit}: {len(missing)} of its {len(self.views)} photographs have moved or are no "
                f"longer the same, such as {missing[0].name!r}: name their folder (--photographs)"
            )


def save_fit_cameras(
    fit: Path,
    capture: Capture,
    training_views: Sequence[View],
    test_views: Sequence[View],
    *,
    photographs: int | None = None,
) -> None:
    """Write what ``open_fit_cameras`` reads.

    Args:
        fit: the folder of the fit.
        capture: all that was opened.
        training_views: its views that are trained on, with poses as they were refined.
        test_views: those that are held out.
        photographs: how many there are, with those that have no pose; as many as views if not
            given.

    Raises:
        OutputError: a file cannot be written.
    """
    splits = {view.name: _TRAINING for view in training_views} | {
        view.name: _TEST for view in test_views
    }
    kept = {view.name: view for view in (*training_views, *test_views)}
    views = [kept[view.name] for view in capture.views if view.name in kept]
    cameras = [view.camera for view in views]
    bounds = bounds_of_cameras(cameras, points=capture.points)
    masks = names_of_masks(views)
    fields = [
        {
            "split": splits[view.name],
            **_turned(view),
            **mask,
            **lens_fields(view.lens, view.crop_radius),
        }
        for view, mask in zip(views, masks, strict=True)
    ]
    record = transforms_of(cameras, [view.name for view in views], fields)
    if capture.points is not None:
        count = len(capture.points)
        few = np.array(evenly(count, _MOST_POINTS) if count > _MOST_POINTS else range(count))
        colors = capture.point_colors
        write_point_cloud(
            fit / _POINTS, capture.points[few], None if colors is None else colors[few]
        )
        record["ply_file_path"] = _POINTS
    record["capture"] = {
        "up": bounds.up,
        "focus": bounds.center,
        **arc_of(cameras, bounds.center, bounds.up).record(),
        "placed": len(capture.views),
        "photographs": len(capture.views) if photographs is None else photographs,
        "reprojection_error": capture.reprojection_error,
    }
    write_json(fit / _CAMERAS, inria_cameras(views))
    write_json(fit / _TRANSFORMS, record)


def with_poses(views: Sequence[View], cameras: Sequence[Camera]) -> tuple[View, ...]:
    """The same views with the poses of other cameras, one for each."""
    moved = []
    for view, other in zip(views, cameras, strict=True):
        own = view.camera
        camera = Camera(own.size, own.K, other.view, own.model, own.aperture)
        moved.append(replace(view, camera=camera))
    return tuple(moved)


def _turned(view: View) -> dict[str, bool]:
    """What a frame says of its photograph where that is not as it is stored."""
    return {"upright": True} if view.upright else {}


def open_fit_cameras(fit: Path, *, photographs: Path | None = None) -> FitCameras | None:
    """The cameras of a fit; None where it is no fit's folder, or an older version wrote it.

    Photographs need not be there: see ``FitCameras.check_photographs``.

    Args:
        fit: the folder of the fit.
        photographs: the folder of its photographs, if they have moved.

    Raises:
        RiftError: a file is damaged.
    """
    config, file = fit / "config.json", fit / _TRANSFORMS
    if not (config.is_file() and file.is_file()):
        return None
    kept, record = read_json_object(config), read_json_object(file)
    facts = record.values.get("capture")
    if kept.text("job") != "fit photos" or not isinstance(facts, dict):
        return None
    frames = list(record.objects("frames"))
    splits = [frame.text("split") for frame in frames]
    if photographs is None:
        capture = _found_again(file, kept, fit)
    else:
        place = moved_place(photographs, frames[0].text("file_path") or "" if frames else "")
        capture = open_transforms(file.absolute(), photographs=False, images=place)
    return _cameras_of(capture, splits, Fields(f"{file}: capture", facts))


def _found_again(file: Path, config: Fields, fit: Path) -> Capture:
    """The views with their photographs where those are; in the fit if they are nowhere."""
    for place in kept_places(config, fit):
        # A place that is closed to us, or that no path leads to, is one where they are not.
        with suppress(RiftError, OSError):
            capture = open_transforms(file.absolute(), photographs=False, images=place)
            if are_those(capture.views, config):
                return capture
    with suppress(RiftError, OSError):
        place = own_place(config, fit)
        return open_transforms(file.absolute(), photographs=False, images=place)
    return open_transforms(file.absolute(), photographs=False)


def _cameras_of(capture: Capture, splits: Sequence[str | None], facts: Fields) -> FitCameras:
    views = list(zip(capture.views, splits, strict=True))
    training_views = tuple(view for view, split in views if split == _TRAINING)
    if not training_views:
        raise FileFormatError(f"{facts.where}: no frame says that it was trained on")
    up, focus = _vector(facts, "up"), _vector(facts, "focus")
    length = math.hypot(*up)
    if not 0 < length < math.inf:
        raise FileFormatError(f"{facts.where}: 'up' is no direction")
    if np.abs(focus).max() > _FARTHEST:
        raise FileFormatError(f"{facts.where}: 'focus' is farther off than {_FARTHEST:g} units")
    count = len(capture.views)
    return FitCameras(
        training_views=training_views,
        test_views=tuple(view for view, split in views if split == _TEST),
        up=up / length,
        focus=focus,
        arc=arc_of([view.camera for view in capture.views], focus, up / length),
        points=capture.points,
        placed=facts.whole("placed") or count,
        photographs=facts.whole("photographs") or count,
        reprojection_error=facts.number("reprojection_error"),
        reopened=capture,
    )


def _vector(facts: Fields, name: str) -> Floats:
    """Three finite numbers."""
    values = facts.values.get(name)
    entries = values if isinstance(values, list) else []
    numbers = [Fields(f"{facts.where}: {name}", {"": entry}).number("") for entry in entries]
    found = np.array([number for number in numbers if number is not None])
    if len(entries) != 3 or len(found) != 3:
        raise FileFormatError(f"{facts.where}: {name!r} is not three numbers")
    return found
