"""Depth of surfaces for placing cameras, from fitted splats or sparse points."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from rift_cl.cl.device import Device
from rift_cl.cl.discovery import open_device
from rift_cl.commands.cameras.camera_path import resized
from rift_cl.commands.inputs.opened_scene import OpenedScene
from rift_cl.commands.inputs.scene_input import SceneInput
from rift_cl.commands.pictures.depth_picture import depth_and_alpha
from rift_cl.commands.pictures.evenly_spaced import evenly
from rift_cl.geometry import Camera
from rift_cl.sampling.targets.free_space import DepthMap, FreeSpace, depth_of_points
from rift_cl.splat.renderer import Renderer

# Pictures that are asked, and the longer edge of their maps.
_PICTURES, _EDGE = 32, 96
# Alpha above which splats are something.
_SOLID = 0.5
# Fewer sparse points tell nothing of surfaces.
_POINTS = 64
_SCENE = "scene.ply"


def space_of(
    source: Path,
    cameras: Sequence[Camera],
    points: NDArray[np.float32] | None,
    device: str | None = None,
) -> tuple[FreeSpace | None, str]:
    """Free space of a scene, and a sentence on its source.

    Args:
        source: a capture, or the folder of a fit, whose splats tell more than sparse points.
        cameras: of its photographs.
        points: sparse points (P, 3), or None.
        device: that draws the depth of splats.

    Returns:
        None for the space where neither splats nor points tell.

    Raises:
        RiftError: the scene of the fit is damaged.
    """
    chosen = _few(cameras)
    if chosen and source.is_dir() and (source / _SCENE).is_file():
        scene = OpenedScene(SceneInput(source))
        maps = depth_maps(scene, cameras, open_device(device))
        return FreeSpace(maps), "the depth of the fitted splats"
    if chosen and points is not None and len(points) >= _POINTS:
        known = [one for one in (depth_of_points(c, points) for c in chosen) if one is not None]
        if known:
            return FreeSpace(known), "the sparse points"
    return None, ""


def depth_maps(scene: OpenedScene, cameras: Sequence[Camera], device: Device) -> list[DepthMap]:
    """How far off the splats are in some of the pictures, which are made small; evenly chosen.

    Args:
        scene: the splats.
        cameras: of the pictures; those that are no pinholes are left out.
        device: that draws.
    """
    renderer = Renderer(scene.rendering, device=device)
    splats = scene.splats.upload(device)
    maps = []
    for camera in _few(cameras):
        scale = min(1.0, _EDGE / max(camera.size))
        size = (max(1, round(camera.height * scale)), max(1, round(camera.width * scale)))
        small = resized(Camera(camera.size, camera.K, camera.view), size)
        depth, alpha = depth_and_alpha(renderer, splats, small)
        shown = (alpha > _SOLID) & (depth > 0)
        maps.append(DepthMap(small, np.where(shown, depth.astype(np.float64), np.inf)))
    return maps


def _few(cameras: Sequence[Camera]) -> list[Camera]:
    """The pinholes among some of the cameras, evenly chosen."""
    few = [cameras[place] for place in evenly(len(cameras), _PICTURES)]
    return [camera for camera in few if camera.model == "pinhole"]
