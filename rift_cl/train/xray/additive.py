"""Line integrals of splats whose places and shapes stay: linear in the densities of all modes.

A density with modes is a density of one that shows a colour with Hermite modes
(``Splats.color_modes``), where no coefficient is divided by another, and the constant is one of
them. While only coefficients change, the splats' places on the screen and their tile lists stay, so
that a least-squares solver draws many pictures of one geometry for little.

It goes view by view, on the device and within its memory budget. (``tools/bases`` draws all views
at once, which is faster for tiny pictures, and keeps matrices of all splats' modes in all views.)
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rift_cl.cl.arithmetic import axpby
from rift_cl.geometry import Camera
from rift_cl.splat.drawing import draw_grad
from rift_cl.splat.frame import Frame
from rift_cl.splat.hermite import project_modes, project_modes_grad
from rift_cl.splat.projection import MOMENTS
from rift_cl.splat.raster import rasterize
from rift_cl.splat.renderer import Renderer
from rift_cl.splat.splats import Splats

Floats = NDArray[np.float64]


class Additive:
    """A linear map from coefficients to line integrals, and its transpose.

    Frames are kept while they take no more than half of the device's memory budget; others are
    drawn anew for each picture, to the same bits.

    Args:
        renderer: in xray mode.
        cameras: V of one size.
        splats: whose means, quaternions and scales are taken, and nothing else.
        modes: K graded modes of each splat, the constant included: 1, 4, 10, 20..
    """

    def __init__(
        self, renderer: Renderer, cameras: Sequence[Camera], splats: Splats, *, modes: int = 1
    ) -> None:
        self.renderer, self.device, self.cameras = renderer, renderer.device, cameras
        self.shape = (len(splats), modes, 1)
        self._shapes = (splats.means, splats.quats, splats.scales)
        self._ones = self.device.array(np.ones(len(splats), np.float32))
        self._black = self._colored(np.zeros(self.shape))
        self._kept: dict[int, Frame] = {}
        self._keep_frames()

    def render(self, coefficients: Floats) -> Floats:
        """Pictures (V, height, width, 1) of coefficients (N, K, 1)."""
        splats = self._colored(coefficients)
        drawn = [self._drawn(splats, number) for number in range(len(self.cameras))]
        return np.stack([self.device.get(image) for image in drawn]).astype(np.float64)

    def adjoint(self, pictures: Floats) -> Floats:
        """The transpose of ``render``: (V, height, width, 1) to (N, K, 1)."""
        total: list[Any] = []
        for number, picture in enumerate(pictures):
            parts = self._pulled_back(self._frame(number), self._sent(picture))
            for before, part in zip(total, parts, strict=False):
                axpby(self.device, 1.0, part, 1.0, before)
            total = total or parts
        sums, *rest = (np.asarray(self.device.get(part), np.float64) for part in total)
        return np.concatenate([sums[:, None, MOMENTS:], *rest], axis=1)

    def energies(self) -> Floats:
        """(N,) about the squared norm of what the cameras see of each splat's constant.

        A Gaussian of peak w and conic (a, b; b, c) has w^2 pi / sqrt(a c - b^2) on a plane.
        """
        total = np.zeros(self.shape[0])
        for number in range(len(self.cameras)):
            screen = self.device.get(self._frame(number).projected.screen).astype(np.float64)
            conic = screen[:, 2] * screen[:, 4] - screen[:, 3] ** 2
            seen = conic > 0
            total[seen] += np.pi * screen[seen, 5] ** 2 / np.sqrt(conic[seen])
        return total

    def _keep_frames(self) -> None:
        room = self.device.budget // 2
        for number in range(len(self.cameras)):
            frame = self._frame(number)
            if frame.lists is None:
                return
            memory, lists = frame.drawing.memory, frame.lists
            room -= memory.fixed + memory.lists(lists.n_entries, lists.tiles.count)
            if room < 0:
                return
            self._kept[number] = frame

    def _frame(self, number: int) -> Frame:
        """What a camera sees of coefficients of zero."""
        found = self._kept.get(number)
        return found or self.renderer.forward(self._black, self.cameras[number])

    def _colored(self, coefficients: Floats) -> Splats:
        colors = {"colors": self._sent(coefficients[:, 0])}
        if self.shape[1] > 1:
            colors["color_modes"] = self._sent(coefficients[:, 1:])
        return Splats(*self._shapes, self._ones, **colors)

    def _drawn(self, splats: Splats, number: int) -> Any:
        """A picture, through the kept frame if there is one."""
        frame, modes = self._kept.get(number), None
        if frame is None:
            return self.renderer.forward(splats, self.cameras[number]).image
        settings, drawing = self.renderer.settings, frame.drawing
        if splats.color_modes is not None:
            modes = project_modes(self.device, splats, frame.camera, settings, frame.projected)
        assert drawing.lists is not None and splats.colors is not None
        screen = replace(drawing.screen, features=splats.colors, modes=modes)
        size = drawing.size
        return rasterize(self.device, screen, drawing.lists, size, settings=settings).image

    def _pulled_back(self, frame: Frame, grad_image: Any) -> list[Any]:
        """The gradient by the constants, behind other sums, and by the modes if there are any."""
        sums = draw_grad(self.device, frame.drawing, grad_image)
        if frame.drawing.modes is None:
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

    def _sent(self, values: Floats) -> Any:
        return self.device.array(np.ascontiguousarray(values, np.float32))
