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

from rift_cl.cl.arithmetic import axpby, copy_columns
from rift_cl.cl.device import Device
from rift_cl.cl.elementwise import put, take
from rift_cl.geometry import Camera
from rift_cl.operators.linear import LinearOperator
from rift_cl.splat.projection import project_modes, project_modes_grad
from rift_cl.splat.raster import MOMENTS, rasterize
from rift_cl.splat.raster_pass import draw_grad
from rift_cl.splat.renderer import Frame, Renderer
from rift_cl.splat.settings import SplatSettings
from rift_cl.splat.splats import Splats

Floats = NDArray[np.float64]


class Additive(LinearOperator):
    """A linear map from coefficients (N, K, 1) to line integrals (V, height, width, 1).

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
        pictures = (len(cameras), *cameras[0].size, 1)
        super().__init__((len(splats), modes, 1), pictures, renderer.device)
        self.renderer, self.cameras = renderer, cameras
        self._shapes = (splats.means, splats.quats, splats.scales)
        self._ones = self.device.array(np.ones(len(splats), np.float32))
        self._black = self._colored(self.device.zeros(self.domain))
        self._kept: dict[int, Frame] = {}
        self._memory = self._keep_frames()

    def __reduce__(self) -> tuple[Any, ...]:
        shapes = tuple(self.device.get(array) for array in self._shapes if array is not None)
        settings, cameras = self.renderer.settings, tuple(self.cameras)
        return _of_settings, (settings, self.device, cameras, shapes, self.domain[1])

    def _facts(self) -> list[str]:
        return [f"{self.domain[0]} splats of {self.domain[1]} modes", f"{len(self.cameras)} views"]

    @property
    def scratch(self) -> int:
        """Bytes of the frames that are kept; others are rendered again within the budget."""
        return self._memory

    def _apply(self, x: Any, out: Any) -> None:
        splats = self._colored(x)
        for number in range(len(self.cameras)):
            put(self.device, self._drawn(splats, number), out, number)

    def _apply_adjoint(self, y: Any, out: Any) -> None:
        total: list[Any] = []
        picture = self.device.empty(self.range[1:])
        for number in range(len(self.cameras)):
            take(self.device, y, number, picture)
            parts = self._pulled_back(self._frame(number), picture)
            for before, part in zip(total, parts, strict=False):
                axpby(self.device, 1.0, part, 1.0, before)
            total = total or parts
        modes = self.domain[1]
        copy_columns(self.device, total[0], MOMENTS, out, 0, 1)
        if modes > 1:
            copy_columns(self.device, total[1], 0, out, 1, modes - 1)

    def energies(self) -> Floats:
        """(N,) about the squared norm of what the cameras see of each splat's constant.

        A Gaussian of peak w and conic (a, b; b, c) has w^2 pi / sqrt(a c - b^2) on a plane.
        """
        total = np.zeros(self.domain[0])
        for number in range(len(self.cameras)):
            screen = self.device.get(self._frame(number).projection.screen).astype(np.float64)
            conic = screen[:, 2] * screen[:, 4] - screen[:, 3] ** 2
            seen = conic > 0
            total[seen] += np.pi * screen[seen, 5] ** 2 / np.sqrt(conic[seen])
        return total

    def _keep_frames(self) -> int:
        """Keep the frames that there is room for; their bytes."""
        room, kept = self.device.budget // 2, 0
        for number in range(len(self.cameras)):
            frame = self._frame(number)
            memory, lists = frame.raster_pass.memory, frame.lists
            if lists is None:
                return kept
            one = memory.fixed + memory.lists(lists.n_entries, lists.tiles.count)
            if kept + one > room:
                return kept
            self._kept[number] = frame
            kept += one
        return kept

    def _frame(self, number: int) -> Frame:
        """What a camera sees of coefficients of zero."""
        found = self._kept.get(number)
        return found or self.renderer.forward(self._black, self.cameras[number])

    def _colored(self, coefficients: Any) -> Splats:
        """The splats in the colours that coefficients (N, K, 1) on the device give them."""
        splats, modes, _ = self.domain
        if modes == 1:
            return Splats(*self._shapes, self._ones, coefficients.reshape((splats, 1)))
        colors = self.device.empty((splats, 1))
        color_modes = self.device.empty((splats, modes - 1, 1))
        copy_columns(self.device, coefficients, 0, colors, 0, 1)
        copy_columns(self.device, coefficients, 1, color_modes, 0, modes - 1)
        return Splats(*self._shapes, self._ones, colors, color_modes=color_modes)

    def _drawn(self, splats: Splats, number: int) -> Any:
        """A picture, through the kept frame if there is one."""
        frame, modes = self._kept.get(number), None
        if frame is None:
            return self.renderer.forward(splats, self.cameras[number]).image
        settings, done = self.renderer.settings, frame.raster_pass
        if splats.color_modes is not None:
            modes = project_modes(replace(frame.projection, splats=splats))
        assert done.lists is not None and splats.colors is not None
        screen = replace(done.screen, features=splats.colors, modes=modes)
        size = done.size
        return rasterize(self.device, screen, done.lists, size, settings=settings).image

    def _pulled_back(self, frame: Frame, grad_image: Any) -> list[Any]:
        """The gradient by the constants, behind other sums, and by the modes if there are any."""
        sums = draw_grad(self.device, frame.raster_pass, grad_image)
        if frame.raster_pass.screen.modes is None:
            return [sums]
        found = project_modes_grad(frame.projection, sums)
        return [found.sums, found.color_modes]


def _of_settings(
    settings: SplatSettings,
    device: Device,
    cameras: Sequence[Camera],
    shapes: tuple[NDArray[np.float32], ...],
    modes: int,
) -> Additive:
    """The operator again, from what it was pickled as."""
    means, quats, scales = shapes
    ones = np.ones(len(means), np.float32)
    splats = Splats.upload(device, means=means, quats=quats, scales=scales, opacities=ones)
    return Additive(Renderer(settings, device=device), cameras, splats, modes=modes)
