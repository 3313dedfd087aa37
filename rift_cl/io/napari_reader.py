"""Volumes and scenes of splats for napari, which finds this reader by ``napari.yaml``.

Nothing of napari is needed: a reader gives arrays and what the layers of them are called. A volume
becomes an image layer (z, y, x) with its spacing, its place and a range to display; a scene becomes
a layer of points at the splats' means, as wide as the splats and in their colours.
"""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rift_cl.io.images.display_light import to_display
from rift_cl.io.scenes.splat_activations import HARMONIC_0
from rift_cl.io.scenes.splat_scene import SplatScene
from rift_cl.io.volumes import read_volume, read_volume_place, suggested_window

Layer = tuple[NDArray[Any], dict[str, Any], str]

_VOLUMES, _SCENES = (".h5", ".zarr", ".mrc"), (".ply", ".splat", ".spz")
# Points that napari turns smoothly; of more splats those that are seen most are taken.
_MOST_POINTS = 100_000


def reader_of(path: str | list[str]) -> Callable[[str | list[str]], list[Layer]] | None:
    """The function that reads a path; None where it is none of ours, or several.

    Args:
        path: that a person opened.
    """
    if not isinstance(path, str) or Path(path).suffix.lower() not in (*_VOLUMES, *_SCENES):
        return None
    return layers_of


def layers_of(path: str | list[str]) -> list[Layer]:
    """The layer of a volume or a scene.

    Raises:
        RiftError: the file cannot be used; the sentence names it.
    """
    one = Path(path if isinstance(path, str) else path[0])
    return [_points(one) if one.suffix.lower() in _SCENES else _image(one)]


def _image(path: Path) -> Layer:
    volume, place = read_volume(path), read_volume_place(path)
    about: dict[str, Any] = {
        "name": path.stem,
        "scale": place.spacing,
        "translate": place.origin,
        "metadata": {"unit": place.unit},
    }
    if np.isfinite(volume).all():
        about["contrast_limits"] = suggested_window(volume)
    return volume, about, "image"


def _points(path: Path) -> Layer:
    scene = SplatScene.load(path)
    wide = np.exp(scene.log_scales.astype(np.float64))
    strength = scene.logit_opacities + 2 * scene.log_scales.mean(axis=1)
    kept = np.sort(np.argsort(-strength, kind="stable")[:_MOST_POINTS])
    opacity = 1.0 if scene.mode == "xray" else 1 / (1 + np.exp(-scene.logit_opacities[kept]))
    colors = np.ones((len(kept), 4))
    if scene.lobes is None:
        shown = np.clip(scene.sh[kept, 0] * HARMONIC_0 + 0.5, 0, 1).astype(np.float32)
        if scene.light == "linear":
            to_display(shown)
        colors[:, :3] = shown
    colors[:, 3] = opacity
    about = {
        "name": path.stem if len(kept) == len(scene) else f"{path.stem}, {len(kept)} splats",
        "size": 2 * wide[kept].mean(axis=1),
        "face_color": colors,
        "border_width": 0,
        "out_of_slice_display": True,
    }
    # napari's last axis is x.
    return scene.means[kept, ::-1].copy(), about, "points"
