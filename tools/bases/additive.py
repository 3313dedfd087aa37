"""Additive splats before fixed cameras: linear in the coefficients, drawn by the X-ray kernels.

Every splat has density one; what it shows is a colour with Hermite modes (``Splats.color_modes``),
so that pictures are linear in the coefficients of all modes, the constant one included, and no
coefficient is divided by another. While only coefficients change, the splats' places on the screen
and their tile lists are kept.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from bases.mode_sets import ModeSet
from rift_cl.cl import Device
from rift_cl.cl.arithmetic import axpby
from rift_cl.geometry import Camera
from rift_cl.splat.drawing import draw_grad
from rift_cl.splat.frame import Frame
from rift_cl.splat.hermite import project_modes, project_modes_grad
from rift_cl.splat.projection import MOMENTS
from rift_cl.splat.raster import rasterize
from rift_cl.splat.renderer import Renderer
from rift_cl.splat.settings import SplatSettings
from rift_cl.splat.splats import Splats

Floats = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Geometry:
    """Where splats are.

    Args:
        means: (N, 3).
        quats: (N, 4), of unit length.
        log_scales: (N, 3).
    """

    means: Floats
    quats: Floats
    log_scales: Floats

    def flat(self) -> Floats:
        """All of it, (N, 10)."""
        return np.concatenate([self.means, self.quats, self.log_scales], axis=1)

    @classmethod
    def of_flat(cls, numbers: Floats) -> Geometry:
        """Undo ``flat``; quaternions are made unit."""
        quats = numbers[:, 3:7] / np.linalg.norm(numbers[:, 3:7], axis=1, keepdims=True)
        return cls(numbers[:, :3], quats, numbers[:, 7:])


class Placed:
    """Splats of one geometry, seen by all cameras.

    Args:
        renderer: in xray mode.
        cameras: of one size.
        modes: of the splats.
        geometry: of the splats.
        coefficients: (N, K, C) to begin with.
    """

    def __init__(
        self,
        renderer: Renderer,
        cameras: Sequence[Camera],
        modes: ModeSet,
        geometry: Geometry,
        coefficients: Floats,
    ) -> None:
        self.renderer, self.device, self.modes = renderer, renderer.device, modes
        count = len(geometry.means)
        self._shapes = {
            "means": geometry.means,
            "quats": geometry.quats,
            "scales": np.exp(geometry.log_scales),
            "opacities": np.ones(count),
        }
        splats = Splats.upload(self.device, **self._shapes, **self._colors(coefficients))
        self.frames = [renderer.forward(splats, camera) for camera in cameras]
        self._scales = self._shapes["scales"]

    def _colors(self, coefficients: Floats) -> dict[str, NDArray[np.float32]]:
        full = np.einsum("mk,nkc->nmc", self.modes.matrix, coefficients).astype(np.float32)
        colors = {"colors": np.ascontiguousarray(full[:, 0])}
        return colors | ({"color_modes": np.ascontiguousarray(full[:, 1:])} if self.modal else {})

    @property
    def modal(self) -> bool:
        """Whether there are modes beside the constant."""
        return self.modes.order > 0

    def pictures(self) -> Floats:
        """Of the coefficients that it began with, (V, height, width, C)."""
        return np.stack([self.device.get(f.image) for f in self.frames]).astype(np.float64)

    def render(self, coefficients: Floats) -> Floats:
        """Pictures (V, height, width, C) of coefficients (N, K, C)."""
        drawn = [
            rasterize(
                self.device,
                frame.drawing.screen,
                frame.drawing.lists,
                frame.camera.size,
                settings=self.renderer.settings,
            ).image
            for frame in self._recoloured(coefficients)
        ]
        return np.stack([self.device.get(image) for image in drawn]).astype(np.float64)

    def adjoint(self, pictures: Floats) -> Floats:
        """The transpose of ``render``: (V, height, width, C) to (N, K, C)."""
        total: list[Any] = []
        for frame, picture in zip(self.frames, pictures, strict=True):
            parts = self._linear_grad(frame, self._sent(picture))
            for before, part in zip(total, parts, strict=False):
                axpby(self.device, 1.0, part, 1.0, before)
            total = total or parts
        sums, *rest = (np.asarray(self.device.get(part), np.float64) for part in total)
        full = np.concatenate([sums[:, None, MOMENTS:], *rest], axis=1)
        return np.asarray(np.einsum("mk,nmc->nkc", self.modes.matrix, full))

    def _linear_grad(self, frame: Frame, grad_image: Any) -> list[Any]:
        sums = draw_grad(self.device, frame.drawing, grad_image)
        if not self.modal:
            return [sums]
        found = project_modes_grad(
            self.device,
            *(frame.splats, frame.camera, self.renderer.settings),
            projected=frame.projected,
            modes=frame.drawing.modes,
            moments=sums,
            channels=frame.channels.total,
        )
        return [found.sums, found.color_modes]

    def geometry_gradient(self, coefficients: Floats, grad_pictures: Floats) -> Floats:
        """dL/d geometry as ``Geometry.flat`` has it, at these coefficients."""
        total: list[Any] = []
        for frame, picture in zip(self._recoloured(coefficients), grad_pictures, strict=True):
            found = self.renderer.backward(frame, self._sent(picture)).splats
            parts = [found.means, found.quats, found.scales]
            for before, part in zip(total, parts, strict=False):
                axpby(self.device, 1.0, part, 1.0, before)
            total = total or parts
        means, quats, scales = (np.asarray(self.device.get(part), np.float64) for part in total)
        return np.concatenate([means, quats, scales * self._scales], axis=1)

    def _recoloured(self, coefficients: Floats) -> list[Frame]:
        device = self.device
        sent = {k: device.array(v) for k, v in self._colors(coefficients).items()}
        splats = replace(self.frames[0].splats, **sent)
        return [self._recoloured_frame(frame, splats) for frame in self.frames]

    def _recoloured_frame(self, frame: Frame, splats: Splats) -> Frame:
        modes = None
        if self.modal:
            given = (self.device, splats, frame.camera, self.renderer.settings)
            modes = project_modes(*given, frame.projected)
        drawing = replace(frame.drawing, features=splats.colors, modes=modes)
        return replace(frame, splats=splats, drawing=drawing)

    def _sent(self, picture: Floats) -> Any:
        return self.device.array(np.ascontiguousarray(picture, np.float32))

    def pairs_per_pixel(self) -> float:
        """How many splats' boxes a pixel lies in, on average over the views."""
        found = []
        for frame in self.frames:
            extents = np.asarray(self.device.get(frame.projected.screen), np.float64)[:, 6:8]
            pixels = frame.camera.height * frame.camera.width
            found.append(4 * extents.prod(axis=1).sum() / pixels)
        return float(np.mean(found))


def additive_renderer(device: Device, *, tile: int, eps2d: float) -> Renderer:
    """A renderer that adds splats, in front of the camera or behind it."""
    settings = SplatSettings(mode="xray", near=-1e6, eps2d=eps2d, tile=tile)
    return Renderer(settings, device=device)


def upright_camera(height: int, width: int) -> Camera:
    """A camera that sees the plane z = 0 pixel by pixel, x to the right and y downwards."""
    K = [[1, 0, width / 2], [0, 1, height / 2], [0, 0, 1]]
    return Camera((height, width), K, np.eye(4), "ortho")


def turned_cameras(height: int, width: int, angles: Floats) -> list[Camera]:
    """Cameras of a parallel scan: x along (cos, sin, 0) of each angle, y along z."""
    K = [[1, 0, width / 2], [0, 1, height / 2], [0, 0, 1]]
    views = []
    for angle in angles:
        c, s = np.cos(angle), np.sin(angle)
        view = np.eye(4)
        view[:3, :3] = [[c, s, 0], [0, 0, 1], [s, -c, 0]]
        views.append(Camera((height, width), K, view, "ortho"))
    return views
