"""Normals as a picture: red, green and blue are x, y and z of the scene, from -1 to 1.

A splat's normal is its shortest axis, on the side that the camera sees; a pixel's is the mean of
those of its splats by their weights, of length one (2D Gaussian splatting, Huang et al. 2024). It
tells of a surface where splats are flat, as the priors of ``SurfaceSettings`` make them.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from rift_cl.commands.export.axes import matrices_of
from rift_cl.commands.pictures.depth_picture import LEAST_ALPHA
from rift_cl.geometry import Camera
from rift_cl.io.scenes.splat_scene import SplatScene
from rift_cl.splat.renderer import Renderer
from rift_cl.splat.splats import Splats

Floats = NDArray[np.float32]


class NormalPictures:
    """Normals of a scene as cameras see them.

    Args:
        renderer: what draws the scene.
        scene: on the host.
        splats: the same on the renderer's device.
    """

    def __init__(self, renderer: Renderer, scene: SplatScene, splats: Splats) -> None:
        self._renderer, self._splats = renderer, splats
        self._means, self._axes = scene.means, shortest_axes(scene)

    def seen(self, camera: Camera) -> tuple[Floats, Floats]:
        """Unit normals in the scene's axes, (height, width, 3), 0 where nothing is, and alpha."""
        away = ((self._means - camera.center) * self._axes).sum(axis=1, keepdims=True) > 0
        facing = np.where(away, -self._axes, self._axes).astype(np.float32)
        drawn = replace(
            self._splats,
            colors=self._renderer.device.array(facing),
            sh=None,
            color_modes=None,
            lobes=None,
            normals=None,
            reflectance=None,
            environment=None,
        )
        image, rest = self._renderer.picture(drawn, camera)
        alpha = np.clip(1 - rest, 0, 1)
        length = np.linalg.norm(image, axis=-1, keepdims=True)
        told = (alpha[..., None] > LEAST_ALPHA) & (length > 0)
        return np.where(told, image / np.where(told, length, 1), 0).astype(np.float32), alpha


def shortest_axes(scene: SplatScene) -> NDArray[np.float64]:
    """(N, 3) unit axes along which splats are thinnest; z where a quaternion is no rotation."""
    with np.errstate(invalid="ignore", divide="ignore"):
        turns = matrices_of(scene.quats.astype(np.float64))
    axes = np.take_along_axis(turns, scene.log_scales.argmin(axis=1)[:, None, None], axis=2)[..., 0]
    return np.where(np.isfinite(axes), axes, [0.0, 0.0, 1.0])


def normal_picture(normals: Floats, alpha: Floats) -> Floats:
    """Colours of (height, width, 3) normals in display light, as dark as alpha is low.

    Whoever wants to compute with normals has them of length one beside the picture.
    """
    return np.asarray((normals + 1) / 2 * alpha[..., None], np.float32)
