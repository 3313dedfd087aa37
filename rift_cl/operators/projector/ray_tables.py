"""The device's copy of what the fast projector knows beforehand."""

from __future__ import annotations

import numpy as np

from rift_cl.cl.array import DeviceArray
from rift_cl.cl.device import Device
from rift_cl.operators.fourier.block_transform import BlockTransform
from rift_cl.operators.fourier.column_transform import ColumnTransform
from rift_cl.operators.fourier.gridding import Gridding
from rift_cl.operators.projector.ray_geometry import Rays, fixed_steps, inverse_steps, tile_visits

_TILE = {"cpu": 48, "gpu": 4}


class RayTables:
    """Rays, gridding kernel and tiles, on the device.

    Args:
        device: where to keep them.
        rays: of the scan.
        gridding: the kernel.
        columns: that pairs of views are laid out in.
        samples: of a ray, with those behind the last that is kept.
    """

    def __init__(
        self,
        device: Device,
        rays: Rays,
        gridding: Gridding,
        columns: int,
        samples: int,
    ) -> None:
        self.tile = _TILE["cpu" if device.traits.is_cpu else "gpu"]
        steps = fixed_steps(rays, gridding.edges)
        visits, tiles = tile_visits(steps, rays.ends, gridding.edges, gridding.width, self.tile)
        self.order, self.starts = device.array(rays.order), device.array(rays.starts)
        self.ends = device.array(rays.ends)
        padding = (0, 2 * columns - len(rays.order))
        self.factors = {
            "turns": device.array(np.pad(rays.turns, padding)),
            "shadows": device.array(np.pad(rays.shadows, ((0, 0), padding))),
            "signs": device.array(np.pad(rays.signs, padding)),
            "bins": device.array(np.sinc(np.arange(samples) / rays.length)),
        }
        self.steps, self.inverses = device.array(steps), device.array(inverse_steps(steps))
        self.visits, self.tiles = device.array(visits), device.array(tiles)
        self.kernel = device.array(gridding.table())
        self.views = ColumnTransform(device, rays.length)
        cpu = device.traits.is_cpu
        self.blocks = BlockTransform(device, rays.length) if cpu else None

    @property
    def nbytes(self) -> int:
        """Bytes of the device that these take."""
        arrays: list[DeviceArray] = [
            self.order,
            self.starts,
            self.ends,
            *self.factors.values(),
            self.steps,
            self.inverses,
        ]
        arrays += [self.visits, self.tiles, self.kernel]
        blocks = 0 if self.blocks is None else self.blocks.nbytes
        return sum(int(array.nbytes) for array in arrays) + self.views.nbytes + blocks
