"""Additive splats before fixed cameras: linear in the coefficients, drawn by the X-ray kernels.

Every splat has density one; what it shows is a colour with Hermite modes (``Splats.color_modes``),
so that pictures are linear in the coefficients of all modes, the constant one included, and no
coefficient is divided by another. All that depends on the geometry alone is worked out once: where
splats are on the screen, their tile lists, and the matrices by which modes go there. That is for
races of a few hundred splats; ``rift_cl.train.xray.additive`` does the same for as many as fits
have, view by view.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from bases.mode_sets import ModeSet
from bases.mosaic import Mosaic
from rift_cl.cl.elementwise import copy
from rift_cl.errors import InputError
from rift_cl.geometry import Camera
from rift_cl.operators import LinearOperator
from rift_cl.splat import (
    Renderer,
    ScreenModes,
    ScreenSplats,
    SplatGradients,
    Splats,
    project,
    project_grad,
    raster_grad,
    rasterize,
    sum_slots,
)
from rift_cl.splat.orders import WHITENING
from rift_cl.splat.raster import MOMENTS, Raster
from rift_cl.splat.tile_lists import Tiles, tile_lists

Floats = NDArray[np.float64]
# Channels of a picture, and so columns that are drawn at once.
_AT_ONCE = 32


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


class Placed(LinearOperator):
    """Splats of one geometry, seen by all cameras at once (``bases.mosaic``).

    A linear map from coefficients (N, K, C) to pictures (V, height, width, C), in float64 where the
    device has it, since coefficients of nearly equal splats cancel; pictures are drawn in float32.

    Args:
        renderer: in xray mode.
        cameras: orthographic, of one size.
        modes: of the splats.
        geometry: of the splats.
        channels: of the pictures.
    """

    def __init__(
        self,
        renderer: Renderer,
        cameras: Sequence[Camera],
        modes: ModeSet,
        geometry: Geometry,
        channels: int,
    ) -> None:
        device, count = renderer.device, len(geometry.means)
        pictures = (len(cameras), *cameras[0].size, channels)
        dtype = np.float64 if device.traits.fp64 else np.float32
        super().__init__((count, modes.count, channels), pictures, device, dtype)
        self.renderer, self.modes = renderer, modes
        self._mosaic = Mosaic(cameras, renderer.settings.edge)
        self._camera, self._views = self._mosaic.camera, len(cameras)
        self._count, self._channels = count, channels
        self._scales = np.exp(geometry.log_scales)
        self._splats = self._everywhere(geometry)
        projected = project(self.device, self._splats, self._camera, renderer.settings)
        boxes = self.device.array(self._mosaic.cut_boxes(self.device.get(projected.boxes)))
        self._projected = replace(projected, boxes=boxes)
        tiles = Tiles.of(self._camera.size, renderer.settings.edge)
        self._lists = tile_lists(self.device, boxes, projected.depths, tiles, sort=False)
        self._whitening, self._to_screen = self._mode_maps()
        self._raster: Raster | None = None

    def _everywhere(self, geometry: Geometry) -> Splats:
        """The splats as all views see them, one beside the other, with modes of order one each.

        Their colours' modes are the unit vectors, one a channel: what becomes of those on the
        screen is the matrix by which any others go there.
        """
        means, quats = self._mosaic.placed(geometry.means, geometry.quats)
        rows, modes = len(means), len(self.modes.matrix) - 1
        given = {
            "means": means,
            "quats": quats,
            "scales": np.tile(self._scales, (self._views, 1)),
            "opacities": np.ones(rows),
        }
        given["colors"] = np.zeros((rows, max(modes, 1)))
        if modes:
            given["color_modes"] = np.broadcast_to(np.eye(modes), (rows, modes, modes))
        return Splats.upload(self.device, **given)

    def _mode_maps(self) -> tuple[NDArray[np.float32], Floats]:
        """Whitenings (V N, 3), and (N, V M, K) what own coefficients become on the screen."""
        views, count, matrix = self._views, self._count, self.modes.matrix
        constant = np.broadcast_to(matrix[:1], (views, count, 1, matrix.shape[1]))
        if not self.modal:
            flat = np.zeros((0, 3), np.float32)
            return flat, np.ascontiguousarray(constant[:, :, 0].transpose(1, 0, 2))
        assert self._projected.modes is not None
        table = self.device.get(self._projected.modes.table)
        modes = len(matrix) - 1
        units = table[:, WHITENING:].reshape(views, count, -1, modes).astype(np.float64)
        maps = np.concatenate([constant, units @ matrix[1:]], axis=2).transpose(1, 0, 2, 3)
        return table[:, :WHITENING], maps.reshape(count, -1, matrix.shape[1])

    @property
    def modal(self) -> bool:
        """Whether there are modes beside the constant."""
        return len(self.modes.matrix) > 1

    def _apply(self, x: Any, out: Any) -> None:
        pictures = self.render(self.device.get(x).astype(np.float64))
        copy(self.device, self.device.array(pictures, self.dtype), out)

    def _apply_adjoint(self, y: Any, out: Any) -> None:
        found = self.adjoint(self.device.get(y).astype(np.float64))
        copy(self.device, self.device.array(found, self.dtype), out)

    def render(self, coefficients: Floats) -> Floats:
        """Pictures (V, height, width, C) of coefficients (N, K, C)."""
        self._raster = self._drawn(coefficients)
        return self._mosaic.cut(self.device.get(self._raster.image))

    def columns(self, stack: int) -> Iterator[NDArray[np.float32]]:
        """What each coefficient shows alone, some at a time: (stack, rows, some).

        Args:
            stack: into how many parts of as many rows, and of as many splats one after the other,
                pictures fall that have nothing to do with each other; each has its own columns.

        Yields:
            Columns of the matrix from a part's coefficients (N / stack * K) to its pixels, of all
            views; the last ones may be fewer.
        """
        unknowns = self._count // stack * self.modes.count
        for first in range(0, unknowns, _AT_ONCE):
            some = min(_AT_ONCE, unknowns - first)
            units = np.zeros((stack, unknowns, _AT_ONCE))
            units[:, first + np.arange(some), np.arange(some)] = 1
            image = self._drawn(units.reshape(self._count, self.modes.count, -1)).image
            seen = self._mosaic.cut(self.device.get(image))[..., :some]
            parts = seen.reshape(self._views, stack, -1, some).swapaxes(0, 1)
            yield parts.reshape(stack, -1, some).astype(np.float32)

    def adjoint(self, pictures: Floats) -> Floats:
        """The transpose of ``render``: (V, height, width, C) to (N, K, C)."""
        zero = np.zeros((self._count, self.modes.count, self._channels))
        sums = self._sums(self._screen(zero), pictures)
        # Moments of the shape, which is a Gaussian, come first.
        own = np.asarray(self.device.get(sums), np.float64)[:, MOMENTS:]
        by_view = own.reshape(self._views, self._count, -1, self._channels).transpose(1, 0, 2, 3)
        flat = by_view.reshape(self._count, -1, self._channels)
        return np.asarray(self._to_screen.transpose(0, 2, 1) @ flat)

    def geometry_gradient(self, coefficients: Floats, grad_pictures: Floats) -> Floats:
        """dL/d geometry as ``Geometry.flat`` has it, at these coefficients."""
        screen, splats = self._screen(coefficients), self._coloured(coefficients)
        projection = replace(self._projected, splats=splats, modes=screen.modes)
        sums = self._sums(screen, grad_pictures)
        gradients = project_grad(projection, sums, with_camera=False)
        return self._pulled_back(gradients)

    def _pulled_back(self, gradients: SplatGradients) -> Floats:
        """Of splats in all views, to those that they are."""
        wanted = (gradients.means, gradients.quats, gradients.scales)
        means, quats, scales = (np.asarray(self.device.get(g), np.float64) for g in wanted)
        by_means, by_quats = self._mosaic.gathered(means, quats)
        by_scales = scales.reshape(self._views, self._count, 3).sum(axis=0)
        return np.concatenate([by_means, by_quats, by_scales * self._scales], axis=1)

    def _drawn(self, coefficients: Floats) -> Raster:
        screen, size = self._screen(coefficients), self._camera.size
        settings = self.renderer.settings
        return rasterize(self.device, screen, self._lists, size, settings=settings)

    def _screen(self, coefficients: Floats) -> ScreenSplats:
        """The splats on the screen with what these coefficients show there."""
        channels = coefficients.shape[-1]
        seen = (self._to_screen @ coefficients).astype(np.float32)
        seen = seen.reshape(self._count, self._views, -1, channels).transpose(1, 0, 2, 3)
        features = self.device.array(np.ascontiguousarray(seen[:, :, 0]).reshape(-1, channels))
        if not self.modal:
            return ScreenSplats(self._projected.screen, features)
        rest = seen[:, :, 1:].reshape(self._views * self._count, -1)
        table = self.device.array(np.concatenate([self._whitening, rest], axis=1))
        modes = ScreenModes(table, 0, self.modes.order, channels)
        return ScreenSplats(self._projected.screen, features, modes)

    def _coloured(self, coefficients: Floats) -> Splats:
        """The splats in all views with these coefficients, in space."""
        full = np.einsum("mk,nkc->nmc", self.modes.matrix, coefficients).astype(np.float32)
        full = np.tile(full, (self._views, 1, 1))
        colors = self.device.array(np.ascontiguousarray(full[:, 0]))
        modes = self.device.array(np.ascontiguousarray(full[:, 1:])) if self.modal else None
        return replace(self._splats, colors=colors, color_modes=modes)

    def _sums(self, screen: ScreenSplats, pictures: Floats) -> Any:
        """What the raster's gradient leaves of every splat in every view."""
        if self._raster is None:
            raise InputError("Placed: ask for pictures before their gradient")
        sent = self.device.array(self._mosaic.joined(pictures))
        records = raster_grad(
            self.device,
            *(screen, self._lists, self._raster, sent),
            settings=self.renderer.settings,
        )
        return sum_slots(self.device, self._lists.slots, records)

    def pairs_per_pixel(self) -> float:
        """How many splats' boxes a pixel lies in, on average over the views."""
        extents = np.asarray(self.device.get(self._projected.screen), np.float64)[:, 6:8]
        height, width = self._mosaic.cameras[0].size
        return float(4 * extents.prod(axis=1).sum() / (self._views * height * width))
