"""Projected splats to pixels within a memory budget, and back to each splat's sums.

The whole image at once where its tile lists fit; otherwise band by band, to the same bits (see
``rift_cl.splat.bands``).
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from rift_cl.cl.array import DeviceArray
from rift_cl.cl.device import Device
from rift_cl.splat.bands import FrameMemory, plan_bands
from rift_cl.splat.projected import Projected
from rift_cl.splat.raster import Raster, ScreenSplats, raster_grad, rasterize, sum_slots
from rift_cl.splat.screen_modes import ScreenModes
from rift_cl.splat.settings import SplatSettings
from rift_cl.splat.tile_lists import TileLists, count_tiles, list_tiles, tile_lists
from rift_cl.splat.tiles import Tiles


@dataclass(frozen=True, eq=False)
class Drawing:
    """What was drawn, with what its gradient needs; arrays are device arrays.

    Args:
        projected: the splats on the screen.
        features: (N, D) what they show.
        size: (height, width) in pixels.
        settings: how it was drawn.
        background: (D,) or None.
        memory: what it takes.
        lists: the tile lists; None where they did not fit and the image was drawn in bands.
        raster: the image, and what the raster left for its gradient.
        modes: the splats' polynomials on the screen; None for plain splats.
    """

    projected: Projected
    features: DeviceArray
    size: tuple[int, int]
    settings: SplatSettings
    background: DeviceArray | None
    memory: FrameMemory
    lists: TileLists | None
    raster: Raster
    modes: ScreenModes | None = None

    @property
    def tiles(self) -> Tiles:
        """All tiles of the image."""
        return Tiles.of(self.size, self.settings.tile)

    @property
    def screen(self) -> ScreenSplats:
        """The splats as the raster takes them."""
        return ScreenSplats(self.projected.screen, self.features, self.modes)


def draw(
    device: Device,
    projected: Projected,
    features: DeviceArray,
    size: tuple[int, int],
    *,
    settings: SplatSettings,
    memory: FrameMemory,
    background: DeviceArray | None = None,
    modes: ScreenModes | None = None,
) -> Drawing:
    """Draw splats, at once if they fit the budget.

    Args:
        device: where the arrays are.
        projected: the splats on the screen; what was culled is not asked for.
        features: (N, D) what they show.
        size: (height, width) in pixels.
        settings: how to draw.
        memory: what a frame takes.
        background: (D,); black if not given.
        modes: the splats' polynomials on the screen, if they have any.

    Raises:
        ResourceLimitError: not even one row of tiles fits the budget.
    """
    tiles, sort = Tiles.of(size, settings.tile), settings.mode == "light"
    screen = ScreenSplats(projected.screen, features, modes)
    counts = count_tiles(device, projected.boxes, projected.depths, tiles)
    lists, raster = None, None
    if _fits(memory, counts.n_entries, tiles, device.budget):
        lists = list_tiles(device, counts, sort=sort)
        raster = rasterize(device, screen, lists, size, settings=settings, background=background)
        return Drawing(
            projected, features, size, settings, background, memory, lists, raster, modes
        )
    del counts
    for band in _bands(device, projected, tiles, memory, sort=sort):
        raster = rasterize(
            device, screen, band, size, settings=settings, background=background, into=raster
        )
    assert raster is not None
    return Drawing(projected, features, size, settings, background, memory, None, raster, modes)


def draw_grad(
    device: Device,
    drawing: Drawing,
    grad_image: DeviceArray,
    grad_transmittance: DeviceArray | None = None,
) -> DeviceArray:
    """Each splat's sums over its tiles of what the raster's gradient leaves.

    (N, 6 + D [+ 2]), or with modes (N, P): see ``raster_grad``.

    Args:
        device: where the arrays are.
        drawing: what ``draw`` returned.
        grad_image: dL/d image, (height, width, D) device array.
        grad_transmittance: dL/d transmittance, (height, width); zero if not given.

    Raises:
        ShapeError: a gradient does not fit the image.
        ResourceLimitError: not even one row of tiles fits the budget.
    """
    sums: DeviceArray | None = None
    for lists in _lists_again(device, drawing):
        records = raster_grad(
            device,
            *(drawing.screen, lists, drawing.raster, grad_image, grad_transmittance),
            settings=drawing.settings,
            background=drawing.background,
        )
        sums = sum_slots(device, lists, records, onto=sums)
    assert sums is not None
    return sums


def listed(
    device: Device, drawing: Drawing
) -> tuple[NDArray[np.int32], NDArray[np.int32], NDArray[np.int32]]:
    """The tile lists on the host, of all bands.

    Returns:
        Tiles of every splat (N,), the splats of all entries (M,), and where each tile's entries
        begin (tiles,).
    """
    sort, memory = drawing.settings.mode == "light", drawing.memory
    kept = [drawing.lists] if drawing.lists else None
    bands = kept or _bands(device, drawing.projected, drawing.tiles, memory, sort=sort)
    of_each = np.zeros(len(drawing.features), np.int32)
    owners, begins, before = [], [], 0
    for lists in bands:
        of_each += np.diff(device.get(lists.slots))
        owners.append(device.get(lists.entries)[:, 0])
        begins.append(device.get(lists.starts)[:-1] + before)
        before += lists.n_entries
    return of_each, np.concatenate(owners), np.concatenate(begins)


def _fits(memory: FrameMemory, entries: int, tiles: Tiles, budget: int) -> bool:
    return memory.fixed + memory.lists(entries, tiles.count) <= budget


def _bands(
    device: Device, projected: Projected, tiles: Tiles, memory: FrameMemory, *, sort: bool
) -> Iterator[TileLists]:
    for band in plan_bands(device.get(projected.boxes), tiles, memory, device.budget):
        yield tile_lists(device, projected.boxes, projected.depths, band, sort=sort)


def _lists_again(device: Device, drawing: Drawing) -> Iterator[TileLists]:
    """The lists that were kept, or of one band after the other, as the records fit."""
    memory = replace(drawing.memory, gradient=True)
    kept = drawing.lists
    if kept is not None and _fits(memory, kept.n_entries, drawing.tiles, device.budget):
        yield kept
        return
    sort = drawing.settings.mode == "light"
    yield from _bands(device, drawing.projected, drawing.tiles, memory, sort=sort)
