"""What a browser draws by itself: Gaussians of one colour each, as viser takes them.

A splat's colour is the mean of what the cameras saw that have it in front of them, which is nearer
to the photographs than the mean over all directions. Covariances are sent as half floats: in a unit
of which a camera stands ten off, they lie where half floats are exact to a thousandth.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rift_cl.basis.angular import SphericalHarmonics
from rift_cl.commands.export.axes import matrices_of
from rift_cl.commands.pictures.evenly_spaced import evenly
from rift_cl.commands.view.crop import Crop
from rift_cl.geometry import Camera
from rift_cl.io.scenes.splat_activations import opacities_of
from rift_cl.io.scenes.splat_scene import SplatScene

Floats = NDArray[np.float64]

# How far a camera stands from what it looks at, in the unit that is sent.
AWAY = 10.0
# Cameras that colours are averaged over, and splats at a time.
_CAMERAS, _BLOCK = 32, 8192
# Largest standard deviation in the unit that is sent: its square is a half float, below 65504.
_WIDEST = 250.0


def browser_can(scene: SplatScene) -> bool:
    """Whether a browser draws these splats: no modes, lobes, optical depths or shared light."""
    bent = (scene.shape_modes, scene.color_modes, scene.lobes, scene.environment)
    plain = scene.mode == "light" and scene.activation == "clamp"
    return plain and all(part is None for part in bent)


def browser_splats(scene: SplatScene, cameras: Sequence[Camera], unit: float) -> dict[str, Any]:
    """The arguments of viser's ``add_gaussian_splats``.

    Args:
        scene: that ``browser_can`` draw, in display light.
        cameras: that colours are averaged over; one or more.
        unit: that lengths are multiplied by.
    """
    rotations = matrices_of(scene.quats.astype(np.float64))
    log_scales = np.minimum(scene.log_scales.astype(np.float64) + np.log(unit), np.log(_WIDEST))
    frames = rotations * np.exp(log_scales)[:, None, :]
    return {
        "centers": scene.means.astype(np.float64) * unit,
        "covariances": frames @ np.swapaxes(frames, 1, 2),
        "rgbs": seen_colors(scene, cameras),
        "opacities": opacities_of(scene.logit_opacities)[:, None],
    }


class MovingSplats:
    """The splats that browsers draw while their cameras move, made once for all pages.

    Args:
        scene: that ``browser_can`` draw, in display light.
        cameras: that colours are averaged over; one or more.
        reach: how far a camera stands from what it looks at, in scene units.
    """

    def __init__(self, scene: SplatScene, cameras: Sequence[Camera], reach: float) -> None:
        unit = AWAY / reach
        self._means, self._scale = scene.means, 1 / unit
        self._arrays = browser_splats(scene, cameras, unit)

    def give(self, client: Any, crop: Crop | None) -> Any:
        """Put them into the scene of one page, unseen; gives viser's handle."""
        inside = slice(None) if crop is None else crop.holds(self._means)
        arrays = {name: array[inside] for name, array in self._arrays.items()}
        return client.scene.add_gaussian_splats(
            "/splats", **arrays, scale=self._scale, visible=False
        )


def seen_colors(scene: SplatScene, cameras: Sequence[Camera]) -> Floats:
    """(N, 3) means from 0 to 1 of the colours that cameras see which have a splat before them."""
    basis, means = SphericalHarmonics(scene.degree), scene.means.astype(np.float64)
    chosen = [cameras[number] for number in evenly(len(cameras), _CAMERAS)]
    colors = np.empty((len(scene), 3))
    for start in range(0, len(scene), _BLOCK):
        here = slice(start, start + _BLOCK)
        total, facing = np.zeros((len(means[here]), 3)), np.zeros(len(means[here]))
        for camera in chosen:
            away = means[here] - camera.center
            before = away @ camera.view[2, :3] > 0
            color = np.einsum("nk,nkc->nc", basis.functions(None, away), scene.sh[here]) + 0.5
            total += np.where(before[:, None], np.clip(color, 0, 1), 0)
            facing += before
        constant = np.clip(0.5 + basis.functions(None, [0, 0, 1])[0] * scene.sh[here, 0], 0, 1)
        colors[here] = np.where(
            facing[:, None] > 0, total / np.maximum(facing, 1)[:, None], constant
        )
    return colors
