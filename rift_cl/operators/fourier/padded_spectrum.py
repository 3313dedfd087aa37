"""The spectrum of a padded image on a regular grid, and the image of a spectrum.

Of a real image's spectrum one half tells everything, so that only frequencies x >= 0 are stored.
The transform along x takes two rows of the image as the real and the imaginary part of one.
"""

from __future__ import annotations

from functools import cached_property

import numpy as np

from rift_cl.cl.array import DeviceArray
from rift_cl.cl.device import Device
from rift_cl.geometry import Grid, Parallel
from rift_cl.operators.fourier.block_transform import BLOCK, BlockTransform
from rift_cl.operators.fourier.column_transform import ColumnTransform
from rift_cl.operators.fourier.gridding import Gridding

# Cells before zero frequency and behind the last one: kernels/include/fourier/fourier_rays.h.
_MARGIN = 8
_STEP = 8


class PaddedSpectrum:
    """Transforms between images of one size and grids of frequencies.

    Args:
        device: where to work.
        grid: the image.
        scan: the scan, for the scale of a projector.
        gridding: the padding, and the kernel whose effect on the image is divided out.
        length: bins of a period of a view, for the scale.
    """

    def __init__(
        self, device: Device, grid: Grid, scan: Parallel, gridding: Gridding, length: int
    ) -> None:
        self.device, self._grid, self._gridding = device, grid, gridding
        self._edges = gridding.edges
        self._scale = grid.spacing[0] * grid.spacing[1] / (scan.pitch * length)
        self.pairs = BLOCK * -(-grid.shape[0] // (2 * BLOCK))
        self.width = self._edges[1] // 2 + 1
        self.across = 2 * _MARGIN + in_steps(self.width)
        if device.traits.is_cpu:
            self.width = BLOCK * -(-self.width // BLOCK)

    @cached_property
    def _weights(self) -> dict[str, DeviceArray]:
        rows, columns = (
            self._gridding.compensation(axis, np.arange(n, dtype=np.float64) - n // 2)
            for axis, n in enumerate(self._grid.shape)
        )
        return {"down": self.device.array(self._scale * rows), "across": self.device.array(columns)}

    @cached_property
    def _down(self) -> ColumnTransform:
        return ColumnTransform(self.device, self._edges[0])

    @cached_property
    def _along(self) -> ColumnTransform:
        return ColumnTransform(self.device, self._edges[1])

    @cached_property
    def _blocks(self) -> tuple[BlockTransform, BlockTransform]:
        down, along = self._edges
        return BlockTransform(self.device, down), BlockTransform(self.device, along)

    @property
    def nbytes(self) -> int:
        """Bytes that are kept on the device."""
        tables = 4 * sum(self._grid.shape) + 8 * sum(self._edges)
        if not self.device.traits.is_cpu:
            return tables
        return tables + sum(blocks.nbytes for blocks in self._blocks)

    @property
    def entries(self) -> int:
        """Numbers of a grid."""
        return 2 * self._edges[0] * self.across

    @property
    def scratch_entries(self) -> int:
        """Most numbers that a transform holds at a time, the grid included."""
        folded = 2 * self._edges[1] * self.pairs
        return max(2 * self.entries + folded, 2 * folded + self.entries)

    def empty_grid(self) -> DeviceArray:
        """A grid for ``crop``: cells are where kernels/include/fourier/fourier_rays.h puts them."""
        if self.device.traits.is_cpu:
            return self.device.empty((self.width // BLOCK, 2, self._edges[0], BLOCK))
        return self.device.empty((2, self._edges[0], self.across))

    def crop(self, grid: DeviceArray, image: DeviceArray, k: int) -> None:
        """Transform a grid back, and crop it to slice k of the image; the grid is written to."""
        edge, (height, width) = self._edges[1], image.shape[-2:]
        if self.device.traits.is_cpu:
            self._crop_blocks(grid, image, k)
            return
        grid, spare = self._down(grid, self.device.empty(grid.shape), inverse=True)
        fields = self.device.empty((2, edge, self.pairs))
        tiles = self._tiles(self.pairs, edge // 2 + 1)
        sizes = self._grid_sizes(height)
        self.device.launch("spectrum_fold_gpu", tiles, grid=grid, fields=fields, **sizes)
        del grid, spare
        fields = self._along(fields, self.device.empty(fields.shape), inverse=True)[0]
        size = (*self._tiles(width, self.pairs), 2)
        place = {"slice": k, "height": height, "width": width, "middle": width // 2, "edge": edge}
        self.device.launch(
            "slice_crop_gpu",
            size,
            fields=fields,
            image=image,
            **self._weights,
            **place,
            pairs=self.pairs,
        )

    def _crop_blocks(self, grid: DeviceArray, image: DeviceArray, k: int) -> None:
        (down, along), (height, width) = self._blocks, image.shape[-2:]
        edge, pairs = self._edges[1], self.pairs
        fields = self.device.empty((pairs // BLOCK, 2, edge, BLOCK))
        down.launch(
            "pairs_of_spectrum_cpu",
            self.width,
            grid=grid,
            fields=fields,
            height=height,
            middle=height // 2,
            edge=edge,
            pairs=pairs,
        )
        along.launch(
            "slice_of_pairs_cpu",
            pairs,
            fields=fields,
            image=image,
            **self._weights,
            slice=k,
            height=height,
            width=width,
            middle=width // 2,
            pairs=pairs,
        )

    def of(self, image: DeviceArray, k: int) -> DeviceArray:
        """The grid of slice k of the image, (2, rows, columns) with margins, to be read from."""
        (rows, edge), (height, width) = self._edges, image.shape[-2:]
        fields = self.device.empty((2, edge, self.pairs))
        spare = self.device.empty(fields.shape)
        size = (*self._tiles(self.pairs, edge), 2)
        place = {"slice": k, "height": height, "width": width, "middle": width // 2, "edge": edge}
        self.device.launch(
            "slice_place",
            size,
            image=image,
            fields=fields,
            **self._weights,
            **place,
            pairs=self.pairs,
        )
        fields, spare = self._along(fields, spare)
        grid = self.device.empty((2, rows, self.across))
        tiles = self._tiles(self.across, rows)
        sizes = self._grid_sizes(height)
        self.device.launch("spectrum_unfold", tiles, fields=fields, grid=grid, **sizes)
        del fields, spare
        return self._down(grid, self.device.empty(grid.shape))[0]

    def _grid_sizes(self, height: int) -> dict[str, int]:
        """Sizes of a grid with margins, of an image with so many rows, as kernels are told."""
        rows, edge = self._edges
        sizes = {"height": height, "middle": height // 2, "rows": rows, "columns": self.across}
        return sizes | {"edge": edge, "pairs": self.pairs}

    def _tiles(self, width: int, height: int) -> tuple[int, int]:
        lanes = self.device.traits.macros["LANES"]
        return -(-width // lanes), -(-height // lanes)


def in_steps(count: int) -> int:
    """A count in whole steps, so that blocks of lanes never overhang."""
    return -(-count // _STEP) * _STEP
