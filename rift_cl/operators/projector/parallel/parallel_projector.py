"""The base class of parallel-beam projectors: geometry, shapes, and the cutting of stacks."""

from __future__ import annotations

import math
from abc import abstractmethod
from collections.abc import Iterable

import numpy as np
from numpy.typing import DTypeLike

from rift_cl.cl.budget import plan_chunks
from rift_cl.cl.device import Device
from rift_cl.cl.discovery import default_device
from rift_cl.errors import InputError
from rift_cl.geometry import FanBeam, Grid, Parallel
from rift_cl.operators.linear import Chunk, LinearOperator


class ParallelProjector(LinearOperator):
    """Line integrals of an image, or of every slice of a volume independently.

    Args:
        grid: the grid of the image, (ny, nx), or of the volume, (nz, ny, nx).
        scan: angles and detector.
        device: the device to use; the default device if not given.
        dtype: type of its arrays.

    The domain is ``grid.shape``; the range is (angles, bins), or (angles, nz, bins) for a volume.
    Values of the range are in the image's unit times the grid's unit of length.

    Raises:
        InputError: ``grid`` is no ``Grid``, or ``scan`` no ``Parallel``.
    """

    grid: Grid
    scan: Parallel
    # What a refusal says of a slice that is too large for this projector.
    _instead = ""

    def __init__(
        self,
        grid: Grid,
        scan: Parallel,
        device: Device | None = None,
        dtype: DTypeLike = np.float32,
    ) -> None:
        if not isinstance(grid, Grid):
            raise InputError(f"grid is {grid!r:.60}, wanted a Grid such as Grid((256, 256))")
        if isinstance(scan, FanBeam):
            raise InputError(
                "scan is a FanBeam, and this projector's rays are parallel: resample its views "
                "by rift_cl.reconstruct.rebin_fan first"
            )
        if not isinstance(scan, Parallel):
            raise InputError(f"scan is {scan!r:.60}, wanted a Parallel(angles, bins)")
        shape = (len(scan.angles), *grid.shape[:-2], scan.bins)
        super().__init__(grid.shape, shape, device or default_device(), dtype)
        self.grid, self.scan = grid, scan

    @abstractmethod
    def of_scan(self, scan: Parallel) -> ParallelProjector:
        """The projector of another scan that is like this one in all else."""

    def _facts(self) -> list[str]:
        lengths = self.grid.spacing if len(set(self.grid.spacing)) > 1 else self.grid.spacing[:1]
        return [
            f"grid {' x '.join(map(str, self.grid.shape))}",
            f"spacing {' x '.join(f'{length:g}' for length in lengths)}",
            f"{len(self.scan.angles)} parallel views of {self.scan.bins} bins",
            f"pitch {self.scan.pitch:g}",
        ]

    def _chunks(self, budget: int) -> Iterable[Chunk]:
        return self.chunks(budget)

    def chunks(self, budget: int, *, sinograms: int = 1, fixed: int = 0) -> list[Chunk]:
        """Chunks of slices that fit a budget in bytes.

        Args:
            budget: bytes of memory available.
            sinograms: sinograms that a slice needs at the same time.
            fixed: further bytes needed, whatever the number of slices.
        """
        views, bins = len(self.scan.angles), self.scan.bins
        image, sinogram = math.prod(self.grid.shape[-2:]), views * bins
        chunks = plan_chunks(
            self.grid.slices,
            self.dtype.itemsize * (image + sinograms * sinogram),
            self.scratch + fixed,
            budget,
            what="slice",
            array=max(self.dtype.itemsize * max(image, sinogram), self.largest_scratch),
            largest=self.device.traits.allocation,
            instead=self._instead,
        )
        if len(self.grid.shape) == 2:
            return [Chunk((), ())]
        return [Chunk((chunk,), (slice(None), chunk)) for chunk in chunks]
