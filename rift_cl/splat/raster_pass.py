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
from rift_cl.splat.bands import FrameMemory, PictureMemory, plan_bands
from rift_cl.splat.given_up import give_up
from rift_cl.splat.raster import (
    Raster,
    ScreenSplats,
    packed,
    raster_grad,
    rasterize,
    sum_slots,
    unpack,
)
from rift_cl.splat.settings import SplatSettings
from rift_cl.splat.tile_lists import (
    Ellipses,
    TileLists,
    Tiles,
    count_tiles,
    list_tiles,
    seen_slots,
    tile_lists,
)

# Bytes of the gradient's records from which on it pays to leave out those of hidden entries.
_LARGE_RECORDS = 1 << 26


@dataclass(frozen=True, eq=False)
class RasterPass:
    """One rasterization, with what its gradient needs; arrays are device arrays.

    Args:
        screen: the splats on the screen, and what they show.
        boxes: (N, 4) int32, their tiles; see ``Projection``.
        depths: (N,) along the camera's axis.
        size: (height, width) in pixels.
        settings: how it was drawn, its tiles' edge chosen.
        background: (D,) or None.
        memory: what it takes.
        lists: the tile lists; None where they did not fit and the image was drawn in bands, and
            where the gradient has used them up.
        raster: the image, and what the raster left for its gradient.
    """

    screen: ScreenSplats
    boxes: DeviceArray
    depths: DeviceArray
    size: tuple[int, int]
    settings: SplatSettings
    background: DeviceArray | None
    memory: FrameMemory
    lists: TileLists | None
    raster: Raster

    @property
    def tiles(self) -> Tiles:
        """All tiles of the image."""
        return Tiles.of(self.size, self.settings.edge)


def draw(
    device: Device,
    screen: ScreenSplats,
    boxes: DeviceArray,
    depths: DeviceArray,
    size: tuple[int, int],
    *,
    settings: SplatSettings,
    memory: FrameMemory,
    background: DeviceArray | None = None,
) -> RasterPass:
    """Rasterize splats, at once if they fit the memory, else in bands.

    Args:
        device: where the arrays are.
        screen: the splats on the screen, and what they show.
        boxes: (N, 4) int32, their tiles; see ``Projection``.
        depths: (N,) along the camera's axis.
        size: (height, width) in pixels.
        settings: how to draw.
        memory: what a frame takes.
        background: (D,); black if not given.

    Raises:
        ResourceLimitError: not even one row of tiles fits the budget.
    """
    settings = settings.for_image(size, cpu=device.traits.is_cpu)
    tiles, sort = Tiles.of(size, settings.edge), settings.mode == "light"
    ellipses = Ellipses(screen.screen, settings.edge)
    counts = count_tiles(device, boxes, depths, tiles, ellipses=ellipses, sort=sort)
    screen = packed(device, screen)
    lists, raster = None, None
    if memory.fits(counts.n_entries, tiles.count, device.budget, device.traits.allocation):
        lists = list_tiles(device, counts)
        del counts
        raster = rasterize(device, screen, lists, size, settings=settings, background=background)
        return RasterPass(screen, boxes, depths, size, settings, background, memory, lists, raster)
    del counts
    for band in _bands(device, boxes, depths, tiles, memory, ellipses=ellipses, sort=sort):
        raster = rasterize(
            device, screen, band, size, settings=settings, background=background, into=raster
        )
        # Gone before the next one is made.
        del band
    assert raster is not None
    return RasterPass(screen, boxes, depths, size, settings, background, memory, None, raster)


def draw_bands(
    device: Device,
    screen: ScreenSplats,
    boxes: DeviceArray,
    depths: DeviceArray,
    size: tuple[int, int],
    *,
    settings: SplatSettings,
    memory: PictureMemory,
    background: DeviceArray | None = None,
) -> Iterator[Raster]:
    """Rasterize splats in bands of rows that are on the device one at a time, from above.

    Arguments and errors are those of ``draw``.
    """
    edge = settings.edge
    tiles, sort = Tiles.of(size, edge), settings.mode == "light"
    screen, ellipses = packed(device, screen), Ellipses(screen.screen, edge)
    for lists in _bands(device, boxes, depths, tiles, memory, ellipses=ellipses, sort=sort):
        above = lists.tiles.first_row * edge
        rows = min(lists.tiles.rows * edge, size[0] - above)
        band = Raster.empty(device, (rows, size[1]), memory.channels, above)
        yield rasterize(
            device, screen, lists, size, settings=settings, background=background, into=band
        )
        # Gone before the next ones are made.
        del band, lists


def draw_grad(
    device: Device,
    done: RasterPass,
    grad_image: DeviceArray,
    grad_transmittance: DeviceArray | None = None,
    *,
    last: bool = False,
) -> DeviceArray:
    """Each splat's sums over its tiles of what the raster's gradient leaves.

    (N, 6 + D [+ 2]), or with modes (N, P): see ``raster_grad``.

    Args:
        device: where the arrays are.
        done: what ``draw`` returned.
        grad_image: dL/d image, (height, width, D) device array.
        grad_transmittance: dL/d transmittance, (height, width); zero if not given.
        last: whether ``done`` is not wanted any more: all but features and transmittance is given
            up as soon as it is not needed.

    Raises:
        ShapeError: a gradient does not fit the image.
        ResourceLimitError: not even one row of tiles fits the budget.
    """
    sums: DeviceArray | None = None
    screen = packed(device, done.screen)
    if last:
        give_up(done.raster, "image")
    for lists in _lists_again(device, done, last=last):
        records = raster_grad(
            device,
            *(screen, lists, done.raster, grad_image, grad_transmittance),
            settings=done.settings,
            background=done.background,
        )
        slots, whole = lists.slots, lists.tiles == done.tiles
        # Gone before the sums and the next ones are made.
        del lists
        if last and whole:
            unpack(screen)
            give_up(done.raster, "last")
        sums = sum_slots(device, slots, records, onto=sums)
        del slots, records
    assert sums is not None
    return sums


def listed(
    device: Device, done: RasterPass
) -> tuple[NDArray[np.int32], NDArray[np.int32], NDArray[np.int32]]:
    """Lists of the tiles that splats' boxes touch, as gsplat tells them, on the host.

    Those that were drawn leave out what ellipses do not reach.

    Returns:
        Tiles of every splat (N,), the splats of all entries (M,), and where each tile's entries
        begin (tiles,).
    """
    bands = _bands_of(device, done, done.memory, ellipses=None)
    of_each = np.zeros(len(done.depths), np.int32)
    owners, begins, before = [], [], 0
    for lists in bands:
        of_each += np.diff(device.get(lists.slots))
        owners.append(device.get(lists.entries)[:, 0])
        begins.append(device.get(lists.starts)[:-1] + before)
        before += lists.n_entries
    return of_each, np.concatenate(owners), np.concatenate(begins)


def _bands(
    device: Device,
    boxes: DeviceArray,
    depths: DeviceArray,
    tiles: Tiles,
    memory: FrameMemory,
    *,
    ellipses: Ellipses | None,
    sort: bool,
) -> Iterator[TileLists]:
    room = device.budget, device.traits.allocation
    for band in plan_bands(device.get(boxes), tiles, memory, *room):
        yield tile_lists(device, boxes, depths, band, ellipses=ellipses, sort=sort)


def _bands_of(
    device: Device, done: RasterPass, memory: FrameMemory, *, ellipses: Ellipses | None
) -> Iterator[TileLists]:
    where, sort = (done.boxes, done.depths, done.tiles), done.settings.mode == "light"
    return _bands(device, *where, memory, ellipses=ellipses, sort=sort)


def _lists_again(device: Device, done: RasterPass, *, last: bool) -> Iterator[TileLists]:
    """The lists that were kept, or of one band after the other, as the records fit."""
    memory = replace(done.memory, gradient=True)
    kept = done.lists
    room = device.budget, device.traits.allocation
    if kept is not None and memory.fits(kept.n_entries, done.tiles.count, *room):
        hidden = _mostly_hidden(device, done, memory)
        if last or hidden:
            # Another gradient of this frame would make the lists again.
            object.__setattr__(done, "lists", None)
        if last:
            give_up(done, "boxes", "depths")
            give_up(done.screen, "screen")
        if hidden:
            kept = seen_slots(device, kept, done.raster.last, done.size, done.settings.edge)
        handed = [kept]
        # The one who gets them says when they go.
        del kept
        yield handed.pop()
        return
    ellipses = Ellipses(done.screen.screen, done.settings.edge)
    yield from _bands_of(device, done, memory, ellipses=ellipses)


def _mostly_hidden(device: Device, done: RasterPass, memory: FrameMemory) -> bool:
    """Whether records are large enough to look first which of them there will be.

    Where X-rays pass, nothing is hidden.
    """
    assert done.lists is not None
    light = done.settings.mode == "light" and device.traits.is_cpu
    return light and memory.longest(done.lists.n_entries) > _LARGE_RECORDS
