"""All views of a parallel scan as one picture, so that a device is asked once and not view by view.

Small pictures, one call each, take longer to be asked for than to be drawn. Parallel views differ
only in where the splats are, so splats are turned for every view and put into a cell of their own,
in a grid of cells that begin and end with tiles; boxes of tiles are cut at their cell, so that no
splat is seen next door. A mosaic is about square, which keeps coordinates small and exact.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from rift_cl.errors import InputError
from rift_cl.geometry import Camera

Floats = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Mosaic:
    """Where views are in the mosaic.

    Args:
        cameras: orthographic ones of one size and one matrix K.
        tile: edge of a tile in pixels.

    Raises:
        InputError: the cameras do not fit beside each other.
    """

    cameras: Sequence[Camera]
    tile: int

    def __post_init__(self) -> None:
        """Check that views differ in their places alone."""
        first = self.cameras[0]
        for camera in self.cameras:
            if camera.model != "ortho" or camera.size != first.size:
                raise InputError("Mosaic: wanted orthographic cameras of one size")
            if not np.array_equal(camera.intrinsics, first.intrinsics):
                raise InputError("Mosaic: wanted cameras of one matrix K")

    @property
    def camera(self) -> Camera:
        """What sees all cells, from where coordinates are those of the views' own cameras."""
        first, (down, across) = self.cameras[0], self._cell
        rows = -(-len(self.cameras) // self._columns)
        return Camera((rows * down, self._columns * across), first.K, np.eye(4), "ortho")

    def placed(self, means: Floats, quats: Floats) -> tuple[Floats, Floats]:
        """Splats (N, 3), (N, 4) as every view sees them, (V N, 3), (V N, 4), view after view."""
        there = np.einsum("vij,nj->vni", self._turns, means) + self._shifts[:, None]
        turned = np.einsum("vij,nj->vni", self._turning_quats, quats)
        return there.reshape(-1, 3), turned.reshape(-1, 4)

    def gathered(self, by_means: Floats, by_quats: Floats) -> tuple[Floats, Floats]:
        """The transpose of ``placed``, for gradients."""
        views = len(self.cameras)
        means = np.einsum("vij,vni->nj", self._turns, by_means.reshape(views, -1, 3))
        quats = np.einsum("vij,vni->nj", self._turning_quats, by_quats.reshape(views, -1, 4))
        return np.asarray(means), np.asarray(quats)

    def cut_boxes(self, boxes: NDArray[np.int32]) -> NDArray[np.int32]:
        """Boxes (V N, 4) of tiles, cut at the cells of their views; empty ones become zeros."""
        shape = boxes.shape
        edges = np.array(self._cell[::-1]) // self.tile
        low = (self._corners[:, ::-1] // self.tile)[:, None]
        cut = boxes.reshape(len(self.cameras), -1, 2, 2)
        cut = cut.clip(low[:, :, None], (low + edges)[:, :, None])
        empty = (cut[:, :, 1] <= cut[:, :, 0]).any(axis=-1)
        cut[empty] = 0
        return np.ascontiguousarray(cut.reshape(shape), np.int32)

    def cut(self, picture: NDArray[np.float32]) -> Floats:
        """The views (V, height, width, C) of a mosaic."""
        height, width = self.cameras[0].size
        views = [picture[y : y + height, x : x + width] for y, x in self._corners]
        return np.stack(views).astype(np.float64)

    def joined(self, views: Floats) -> NDArray[np.float32]:
        """The mosaic of views, with zeros between them: the transpose of ``cut``."""
        height, width = self.cameras[0].size
        picture = np.zeros((*self.camera.size, views.shape[-1]), np.float32)
        for (y, x), view in zip(self._corners, views, strict=True):
            picture[y : y + height, x : x + width] = view
        return picture

    @property
    def _columns(self) -> int:
        down, across = self._cell
        return max(1, min(len(self.cameras), round(np.sqrt(len(self.cameras) * down / across))))

    @property
    def _cell(self) -> tuple[int, int]:
        """Height and width of a cell: whole tiles."""
        height, width = self.cameras[0].size
        return -(-height // self.tile) * self.tile, -(-width // self.tile) * self.tile

    @property
    def _corners(self) -> NDArray[np.int64]:
        """(V, 2) first row and column of every cell."""
        rows, columns = np.divmod(np.arange(len(self.cameras)), self._columns)
        return np.stack([rows, columns], axis=1) * np.array(self._cell)

    @property
    def _turns(self) -> Floats:
        return np.stack([camera.view[:3, :3] for camera in self.cameras])

    @property
    def _shifts(self) -> Floats:
        """(V, 3) what is added to turned places: the view's own shift, and its cell's."""
        fx, fy = self.cameras[0].intrinsics[:2]
        cells = self._corners[:, ::-1] / np.array([fx, fy])
        return np.stack([c.view[:3, 3] for c in self.cameras]) + np.pad(cells, ((0, 0), (0, 1)))

    @property
    def _turning_quats(self) -> Floats:
        """(V, 4, 4) matrices by which quaternions are turned: products from the left."""
        return np.stack([left_product(quaternion_of(turn)) for turn in self._turns])


def quaternion_of(turn: Floats) -> Floats:
    """The unit quaternion (w, x, y, z) of a rotation matrix.

    The eigenvector of Bar-Itzhack's symmetric matrix (J. Guidance 23, 2000), stable for all turns.
    """
    (a, b, c), (d, e, f), (g, h, i) = turn
    upper = [
        [a + e + i, h - f, c - g, d - b],
        [0, a - e - i, b + d, c + g],
        [0, 0, e - a - i, f + h],
        [0, 0, 0, i - a - e],
    ]
    found: Floats = np.linalg.eigh(np.array(upper).T)[1][:, -1]
    return found


def left_product(q: Floats) -> Floats:
    """(4, 4) matrix of r -> q r."""
    w, x, y, z = q
    return np.array([[w, -x, -y, -z], [x, w, -z, y], [y, z, w, -x], [z, -y, x, w]])
