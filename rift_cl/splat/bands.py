"""Rendering within a memory budget: how much it takes, and which rows of tiles at a time.

Tile lists and the gradient's records grow with the number of (splat, tile) pairs, which can be
any multiple of the number of splats. Where they do not fit, the image is drawn in bands of whole
rows of tiles, one after the other. Each tile's list is the same in every band, and a splat's
records are summed in the order of the tiles whatever the band, so that every bit stays the same.
A picture for the host need not be on the device at once either: of ``PictureMemory`` a band brings
its pixels along.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, NoReturn

import numpy as np
from numpy.typing import NDArray

from rift_cl.cl.budget import check_array, format_bytes
from rift_cl.errors import ResourceLimitError
from rift_cl.splat.environment import ARRIVAL, CHUNK
from rift_cl.splat.orders import Modal, ModeOrders
from rift_cl.splat.projection import is_modal
from rift_cl.splat.raster import MOMENTS
from rift_cl.splat.settings import SplatSettings
from rift_cl.splat.tile_lists import Tiles, tile_lists_bytes

# Bytes of a splat on the screen: screen, packed record, depth, box, code; and what the span of its
# tiles has room for beside what it needs.
_PROJECTED = 32 + 64 + 4 + 16 + 1 + 48
# Bytes of a splat's part in the gradient by the camera and its aperture, and of what does not grow.
_CAMERA, _SMALL = 72, 4096
# Bytes of a lobe of a shared light: axis, radiance, row, and the last part of its gradient.
_LIGHT = 4 * (3 + 3 + 8 + 3) + 4 * 3 * 4


@dataclass(frozen=True)
class FrameMemory:
    """Bytes that one frame takes on the device.

    Args:
        splats: number of splats.
        parameters: floats that one splat is described by.
        pixels: of the image.
        channels: of the image.
        gradient: whether its gradient is wanted as well.
        absgrad: whether that has the magnitudes.
        modes: orders of the modes, all 0 where another activation alone asks for their kernels;
            None for plain splats.
        environment: lobes of the light that splats share; 0 without one.
    """

    splats: int
    parameters: int
    pixels: int
    channels: int
    gradient: bool = False
    absgrad: bool = False
    modes: ModeOrders | None = None
    environment: int = 0

    @classmethod
    def of(
        cls,
        splats: Modal,
        size: tuple[int, int],
        channels: int,
        settings: SplatSettings,
    ) -> FrameMemory:
        """What a frame of these splats takes, without its gradient.

        The splats may be on a device, or a scene on the host that is yet to be uploaded.
        """
        light = getattr(splats, "environment", None)
        floats = sum(getattr(array, "size", 0) for array in vars(splats).values())
        floats -= 0 if light is None else light.size
        parameters = -(-floats // max(len(splats), 1))
        pixels = size[0] * size[1]
        modes = ModeOrders.of(splats) if is_modal(splats, settings) else None
        absgrad = settings.absgrad
        return cls(
            *(len(splats), parameters, pixels, channels),
            absgrad=absgrad,
            modes=modes,
            environment=0 if light is None else light.shape[0],
        )

    @property
    def record(self) -> int:
        """Floats of a (splat, tile) pair's record."""
        if self.modes is not None:
            return self.modes.record_length(self.channels)
        return MOMENTS + self.channels + 2 * self.absgrad

    @property
    def fixed(self) -> int:
        """Bytes that are taken however the image is cut: parameters, screen, image."""
        table = 0 if self.modes is None else self.modes.row_length
        splat = 4 * (self.parameters + table) + _PROJECTED + 4 * self.channels
        pixel = 4 * self.channels + 8
        if self.gradient:
            splat += 4 * (self.parameters + self.record + self.channels + 4) + _CAMERA
            if self.modes is not None:
                # What the moments of modes become before they are gradients.
                splat += 4 * (MOMENTS + self.channels + 6)
            if self.environment:
                # What the light's gradient is summed from, and its parts.
                splat += 4 * ARRIVAL + 4 * 3 * self.environment // CHUNK + 1
            # The gradients that come in, those of expected depth, the background's parts.
            pixel += 12 * self.channels + 16
        # Sums over columns leave their first level, a part of what they add up.
        summed = 4 * self.pixels * self.channels + self.splats * _CAMERA if self.gradient else 0
        light = _LIGHT * self.environment
        return self.splats * splat + self.pixels * pixel + summed // 32 + light + _SMALL

    def lists(self, entries: int, tiles: int) -> int:
        """Bytes of tile lists, with the gradient's records."""
        records = (4 * self.record + 1) * entries if self.gradient else 0
        return tile_lists_bytes(self.splats, entries, tiles=tiles) + records

    def longest(self, entries: int) -> int:
        """Bytes of the largest single array of these lists: the records, or the pairs."""
        return max(8, 4 * self.record * self.gradient) * entries

    def fits(self, entries: int, tiles: int, budget: int, largest: int) -> bool:
        """Whether a frame with such lists fits a budget, and each of them the largest buffer."""
        within = self.longest(entries) <= largest
        return within and self.fixed + self.lists(entries, tiles) <= budget


@dataclass(frozen=True)
class PictureMemory(FrameMemory):
    """Bytes that a picture takes of which one band at a time is on the device.

    Args:
        tile: pixels of a tile.
    """

    tile: int = 0

    @classmethod
    def within(cls, frame: FrameMemory, tile: int) -> PictureMemory:
        """The same splats and channels, without the pixels of the whole image."""
        return cls(**{**vars(frame), "pixels": 0}, tile=tile)

    def lists(self, entries: int, tiles: int) -> int:
        """Bytes of tile lists and of the band's pixels."""
        return super().lists(entries, tiles) + tiles * self.tile * (4 * self.channels + 8)

    def fits(self, entries: int, tiles: int, budget: int, largest: int) -> bool:
        """Whether such a band fits a budget, and its pixels and lists the largest buffer."""
        image = 4 * tiles * self.tile * self.channels
        return image <= largest and super().fits(entries, tiles, budget, largest)


def check_fixed(memory: FrameMemory, budget: int, largest: int) -> None:
    """Raise an error if a frame does not fit the memory in any number of bands.

    Args:
        memory: what it takes.
        budget: bytes there are.
        largest: bytes of the largest array that the device takes.

    Raises:
        ResourceLimitError: what is taken however the image is cut does not fit the budget, or the
            image is larger than the device takes in one piece.
    """
    image = 4 * memory.pixels * memory.channels
    what = f"an image of {memory.pixels} pixels with {memory.channels} channels"
    check_array(image, largest, what=what, instead="draw a smaller image, or fewer channels")
    if memory.fixed > budget:
        drawn, fewer = f"{memory.splats} splats", "fewer splats"
        if memory.pixels:
            drawn, fewer = f"{drawn} and {what}", f"{fewer} or a smaller image"
        if memory.gradient:
            drawn += ", with the gradient,"
        raise ResourceLimitError(
            f"{drawn} need {format_bytes(memory.fixed)}, the memory budget is "
            f"{format_bytes(budget)}: raise the budget (RIFT_MEMORY or --memory), use a device "
            f"with more memory, or draw {fewer}"
        )


def plan_bands(
    boxes: NDArray[np.int32], tiles: Tiles, memory: FrameMemory, budget: int, largest: int
) -> list[Tiles]:
    """Cut an image into as few bands as fit the budget and the largest buffer.

    Args:
        boxes: (N, 4) the splats' tiles, on the host.
        tiles: all tiles of the image.
        memory: what a frame takes.
        budget: bytes there are.
        largest: bytes of the largest array that the device takes.

    Raises:
        ResourceLimitError: not even one row of tiles fits.
    """
    per_row = entries_per_row(boxes, tiles)
    bands: list[Tiles] = []
    first, entries = 0, 0
    for row, more in enumerate(per_row.tolist()):
        count = (row + 1 - first) * tiles.across
        if row > first and not memory.fits(entries + more, count, budget, largest):
            bands.append(Tiles(tiles.across, row - first, first))
            first, entries = row, 0
        entries += more
        if row == first and not memory.fits(entries, tiles.across, budget, largest):
            _refuse(memory, entries, tiles.across, budget, largest)
    return [*bands, Tiles(tiles.across, tiles.rows - first, first)]


def _refuse(memory: FrameMemory, entries: int, tiles: int, budget: int, largest: int) -> NoReturn:
    """Say why one row of tiles does not fit."""
    check_fixed(memory, budget, largest)
    what = f"one row of tiles ({entries} splat and tile pairs)"
    check_array(memory.longest(entries), largest, what=f"a list of {what}")
    if isinstance(memory, PictureMemory):
        row = 4 * tiles * memory.tile * memory.channels
        check_array(row, largest, what="one row of tiles of the picture")
    raise ResourceLimitError(
        f"{what} needs {format_bytes(memory.fixed + memory.lists(entries, tiles))}, the memory "
        f"budget is {format_bytes(budget)}: raise the budget (RIFT_MEMORY or --memory), "
        "use a device with more memory, or draw fewer or smaller splats"
    )


def entries_per_row(boxes: NDArray[Any], tiles: Tiles) -> NDArray[np.int64]:
    """(splat, tile) pairs in each row of tiles."""
    clipped = np.clip(boxes.astype(np.int64), 0, [tiles.across, tiles.rows] * 2)
    x0, y0, x1, y1 = clipped.T
    widths = np.where(y1 > y0, np.maximum(x1 - x0, 0), 0)
    steps = np.zeros(tiles.rows + 1, np.int64)
    np.add.at(steps, y0, widths)
    np.add.at(steps, y1, -widths)
    return np.cumsum(steps)[:-1]
