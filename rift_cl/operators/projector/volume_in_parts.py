"""Volumes and projections that a device cannot hold at once, in parts from the host.

A part is some slices of the volume and a run of views. Slices are independent of each other in a
backprojection and views in a projection, so that those have the bits of the whole; what must be cut
the other way as well is added up in float, to the rounding of the sums.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import DTypeLike

from rift_cl.cl.budget import cut_evenly, largest_pair, plan_chunks
from rift_cl.cl.device import Device
from rift_cl.cl.discovery import default_device
from rift_cl.errors import InputError
from rift_cl.geometry import Grid
from rift_cl.operators.linear import Chunk, LinearOperator
from rift_cl.operators.projector.projector import Projector

if TYPE_CHECKING:
    from typing_extensions import Self

# A volume is cut between whole lanes of any device.
_SLICES = 8


class VolumeInParts(Projector):
    """A projector of a volume that knows what memory a part of its work takes."""

    scan: Any
    # Whether only the fewest views have scratch memory at a time.
    _sparing = False

    def __init__(
        self,
        grid: Grid,
        scan: Any,
        device: Device | None,
        dtype: DTypeLike,
        *,
        rows: int | None = None,
    ) -> None:
        """Check the grid.

        Args:
            grid: of the volume.
            scan: where source and detector are.
            device: the default device if not given.
            dtype: of its arrays.
            rows: of the data; as many as there are slices if not given.
        """
        if not isinstance(grid, Grid) or len(grid.shape) != 3:
            raise InputError(
                f"grid is {grid!r:.60}, wanted a grid of three axes (z, y, x), such as "
                f"Grid((256, 256, 256)), for a {type(scan).__name__} measures a volume"
            )
        shape = scan.views, grid.slices if rows is None else rows, scan.bins
        super().__init__(grid.shape, shape, device or default_device(), dtype)
        self.grid, self.scan = grid, scan

    def _need(self, slices: int, views: int, *, sparing: bool) -> tuple[int, int]:
        """Bytes that so many slices and views take with all their records, and the largest array.

        Args:
            slices: of the volume.
            views: of the scan.
            sparing: whether only the fewest views have scratch memory at a time.
        """
        raise NotImplementedError

    def _part(self, z: slice, views: slice) -> VolumeInParts:
        """The projector of some slices and a run of views, with the numbers of the whole."""
        raise NotImplementedError

    def _bare_part(self, z: slice, views: slice) -> Self:
        """A part that has grid, scan and shapes alone."""
        part, grid, count = object.__new__(type(self)), self.grid, z.stop - z.start
        domain = count, *self.domain[1:]
        seen = views.stop - views.start, self._rows(count), self.range[2]
        LinearOperator.__init__(part, domain, seen, self.device, self.dtype)
        middle = grid.center[0] + (z.start + z.stop - grid.shape[0]) / 2 * grid.spacing[0]
        part.grid = Grid(domain, grid.spacing, (middle, *grid.center[1:]))
        part.scan = self.scan.subset(np.arange(views.start, views.stop))
        part.footprint, part._sparing = self.footprint, True
        return part

    @property
    def block(self) -> int:
        """Slices that are not cut between."""
        return _SLICES

    def of_slices(self, z: slice) -> VolumeInParts:
        """The projector of some slices in all views, whose adjoint has the bits of the whole.

        Args:
            z: first slice and the one after the last, either at an end or between blocks.
        """
        whole = (z.start, z.stop) == (0, self.domain[0])
        return self if whole else self._part(z, slice(0, self.range[0]))

    def _rows(self, slices: int) -> int:
        """Rows of the data that so many slices are seen in."""
        return self.range[1]

    def _seen(self, z: slice, views: slice) -> tuple[slice, ...]:
        """Where in the data some slices are seen by a run of views."""
        return (views,)

    @property
    def scratch(self) -> int:
        """Bytes needed besides the arrays that go in and come out."""
        need, _ = self._need(self.domain[0], self.range[0], sparing=self._sparing)
        return need - self.dtype.itemsize * sum(self.shape)

    @property
    def largest_scratch(self) -> int:
        """Bytes of the largest array."""
        return self._need(self.domain[0], self.range[0], sparing=self._sparing)[1]

    def _chunks(self, budget: int) -> Iterable[Chunk]:
        return self._within(budget, volume_first=False)

    def _adjoint_chunks(self, budget: int) -> Iterable[Chunk]:
        return (chunk.transposed for chunk in self._within(budget, volume_first=True))

    def _within(self, budget: int, *, volume_first: bool) -> Iterator[Chunk]:
        """Parts that fit, and are there while they are worked on; the whole where that does.

        Args:
            budget: bytes that there are.
            volume_first: whether rather slices are cut than views.

        Raises:
            ResourceLimitError: not even the least part fits.
        """
        (slices, *_), (views, *_) = self.domain, self.range
        largest = self.device.traits.allocation
        need, array = self._need(slices, views, sparing=self._sparing)
        if need <= budget and array <= largest:
            yield Chunk((), ())
            return
        runs_of_z, runs_of_views = self._cut(budget, volume_first=volume_first)
        pairs = [(z, run) for z in runs_of_z for run in runs_of_views]
        if not volume_first:
            pairs = [(z, run) for run in runs_of_views for z in runs_of_z]
        for z, run in pairs:
            yield Chunk((z,), self._seen(z, run), self._part(z, run))

    def _cut(self, budget: int, *, volume_first: bool) -> tuple[list[slice], list[slice]]:
        """Runs of slices and of views of which any two fit, one or the other cut first."""
        (slices, *_), (views, *_) = self.domain, self.range
        each, largest = self.block, self.device.traits.allocation
        blocks = -(-slices // each)

        def needs(blocks: int, views: int) -> tuple[int, int]:
            return self._need(min(blocks * each, slices), views, sparing=True)

        def fits(blocks: int, views: int) -> bool:
            need, array = needs(blocks, views)
            return need <= budget and array <= largest

        if volume_first:
            most, run = largest_pair(fits, blocks, views)
        else:
            run, most = largest_pair(lambda views, blocks: fits(blocks, views), views, blocks)
        need, array = needs(most, run)
        what = f"part of a volume ({min(most * each, slices)} slices in {run} views)"
        plan_chunks(1, need, 0, budget, what=what, array=array, largest=largest)
        cuts = cut_evenly(blocks, most)
        cut = [slice(each * at.start, min(each * at.stop, slices)) for at in cuts]
        return cut, cut_evenly(views, run)
