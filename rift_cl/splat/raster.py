"""Splats on the screen to pixels, and the gradient back: the drivers of the raster kernels.

``kernels/splat/splat_raster_cpu.cl`` says what is computed, for Gaussians and for splats with
Hermite modes, and ``kernels/splat/splat_raster_grad_cpu.cl`` how it is differentiated.
How a GPU's group shares a tile stands in ``kernels/include/raster/group_tile.h``. Features of more
than 32 channels are drawn 32 at a time, on a GPU 8 at a time; without modes alone.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field, replace

import numpy as np

from rift_cl.basis.indices import n_coeff
from rift_cl.cl.array import DeviceArray
from rift_cl.cl.device import Device
from rift_cl.cl.host_arrays import as_device_array
from rift_cl.cl.traits import smaller_group
from rift_cl.errors import InputError, SettingError, ShapeError
from rift_cl.geometry.numbers import one_number
from rift_cl.splat.orders import ModeOrders, check_order
from rift_cl.splat.settings import Activation, SplatSettings
from rift_cl.splat.tile_lists import TileLists, Tiles

# Moments of dL/dsigma that stand before the features' gradients in a record.
MOMENTS = 6
# Numbers of a splat's packed record, and features that have a place in it.
RECORD_NUMBERS, RECORD_FEATURES = 16, 5
# The most channels that the kernels are made for.
_CHANNELS = 32
# Those of one launch for Gaussians on a GPU, where registers are few; and its largest group.
_GROUP_CHANNELS, _GROUP = 8, 256
_TILES = (8, 16, 32)
_ACTIVATIONS: dict[Activation, int] = {"clamp": 0, "exp": 1, "square": 2}


@dataclass(frozen=True, eq=False)
class ScreenModes:
    """Polynomials of projected splats.

    Args:
        table: (N, width) float32 device array. A row is i00, i10, i11 of L^-1 (whitened place
            u' = (i00 dx, i10 dx + i11 dy) with dx, dy = pixel - mean), then the shape's modes
            s_m (graded, without the constant), then the colours' t_mc, mode after mode, each with
            its ``channels`` numbers.
        shape_order: order of the polynomial of opacity or density, 0 to 8.
        color_order: order of the colours' polynomials, 0 to 8.
        channels: how many of the features, from the first on, have a polynomial.

    Raises:
        InputError: an order is out of range.
        ShapeError: the table's rows are not as long as the orders say.
    """

    table: DeviceArray
    shape_order: int
    color_order: int = 0
    channels: int = 0

    def __post_init__(self) -> None:
        """Check the orders against the table."""
        for name in ("shape_order", "color_order"):
            check_order(getattr(self, name), f"ScreenModes: {name}")
        if not (one_number(self.channels) >= 0 and float(self.channels).is_integer()):
            raise InputError(f"ScreenModes: channels is {self.channels!r}, wanted 0 or more")
        shape = tuple(self.table.shape)
        if len(shape) != 2 or shape[1] != self.width:
            raise ShapeError(
                f"ScreenModes: table has shape {shape}, wanted (splats, {self.width}) for shape "
                f"order {self.shape_order}, colour order {self.color_order} and "
                f"{self.channels} channels"
            )

    @property
    def width(self) -> int:
        """Numbers in a row of the table."""
        return self._orders.row_length

    def record_length(self, features: int, settings: SplatSettings) -> int:
        """Numbers that the gradient has for each splat: ``kernels/include/raster/hermite_slots.h``.

        Args:
            features: channels that are drawn.
            settings: how they are drawn.

        Raises:
            InputError: magnitudes of gradients are asked for.
        """
        if settings.absgrad:
            raise SettingError(
                settings, "absgrad", "is for Gaussians alone, these splats have modes: leave it off"
            )
        return self._orders.record_length(features)

    def check_fit(self, count: int, features: int) -> None:
        """Check that the modes belong to ``count`` splats with ``features`` channels.

        Raises:
            InputError: there are more channels than the kernels are made for.
            ShapeError: the table has other rows, or colours more channels than there are.
        """
        if features > _CHANNELS:
            raise InputError(
                f"features have {features} channels, splats with modes are drawn with at most "
                f"{_CHANNELS}: draw the others apart"
            )
        if len(self.table) != count:
            raise ShapeError(
                f"ScreenModes: table has {len(self.table)} rows, wanted {count}, one for each splat"
            )
        if self.channels > features:
            raise ShapeError(
                f"ScreenModes: channels is {self.channels}, more than the {features} features"
            )

    def macros(self, settings: SplatSettings) -> dict[str, int]:
        """What the kernels are told about the modes when they are built."""
        return {
            "SHAPE_ORDER": self.shape_order,
            "COLOR_ORDER": self.color_order,
            "COLORED": self.channels,
            "ACTIVATION": _ACTIVATIONS[settings.activation],
        }

    @property
    def _orders(self) -> ModeOrders:
        return ModeOrders(self.shape_order, self.color_order, int(self.channels))


@dataclass(frozen=True, eq=False)
class ScreenSplats:
    """Projected splats with what they show; device arrays.

    Args:
        screen: (N, 8): mean x, mean y, conic a, b, c, weight, extent x, extent y.
        features: (N, D), the channels that are drawn.
        modes: the polynomials of splats that have some; None for Gaussians.
        median: whether a pixel's last channel is no sum but the feature of the splat that leaves
            half of the light, or of the last one where none does. It has no gradient.

    ``records``, (N, 16), hold what tiles want of them in one line each, see
    ``kernels/include/raster/screen_record.h``; they are None until ``packed`` makes them and after
    ``unpack``, and in a copy with other arrays, which they would not be of.
    """

    screen: DeviceArray
    features: DeviceArray
    modes: ScreenModes | None = None
    median: bool = False
    records: DeviceArray | None = field(default=None, init=False)

    @property
    def first_feature(self) -> int:
        """Column of each splat's sums at which the gradient by its features begins."""
        return MOMENTS if self.modes is None else n_coeff(self.modes.shape_order + 2, 2)


@dataclass(frozen=True, eq=False)
class SlotRecords:
    """What the gradient leaves in the slots of (splat, tile) pairs; device arrays.

    Args:
        numbers: (M, P), a record for each slot: see ``kernels/include/raster/splat_slots.h``, for
            splats with modes ``kernels/include/raster/hermite_slots.h``.
        live: (M,) uint8, which of them hold one; the numbers of others mean nothing.
    """

    numbers: DeviceArray
    live: DeviceArray


@dataclass(frozen=True, eq=False)
class Raster:
    """A rendered image or a band of its rows, and what its gradient needs; device arrays.

    Args:
        image: (height, width, D), with the background.
        transmittance: (height, width), what of the background is seen.
        last: (height, width) int32, how many of its tile's entries the gradient looks at.
        above: rows of the image above those that are here; 0 in a whole image, which alone has a
            gradient.
    """

    image: DeviceArray
    transmittance: DeviceArray
    last: DeviceArray
    above: int = 0

    @classmethod
    def empty(cls, device: Device, size: tuple[int, int], channels: int, above: int = 0) -> Raster:
        """Room for so many rows and columns, not drawn yet."""
        pixels, codes = device.empty(size), device.empty(size, np.int32)
        return cls(device.empty((*size, channels)), pixels, codes, above)


def packed(device: Device, splats: ScreenSplats) -> ScreenSplats:
    """The splats with their packed records, which are made where they are not there yet."""
    if splats.records is not None:
        return splats
    count, modes = len(splats.screen), splats.modes
    records = device.empty((count, RECORD_NUMBERS))
    device.launch(
        "splat_pack",
        (device.traits.runs(count),),
        screen=splats.screen,
        features=splats.features,
        packed=records,
        count=count,
        modes=modes.table if modes else None,
        row=modes.width if modes else None,
        RUN=device.traits.run,
        CHANNELS=splats.features.shape[1],
        MODAL=modes is not None,
    )
    found = replace(splats)
    object.__setattr__(found, "records", records)
    return found


def unpack(splats: ScreenSplats) -> None:
    """Give up the packed records, the largest array of the screen; ``packed`` makes them again."""
    object.__setattr__(splats, "records", None)


def rasterize(
    device: Device,
    splats: ScreenSplats,
    lists: TileLists,
    size: tuple[int, int],
    *,
    settings: SplatSettings,
    background: DeviceArray | None = None,
    into: Raster | None = None,
) -> Raster:
    """Rasterize projected splats.

    Args:
        device: where the arrays are.
        splats: the projected splats.
        lists: which splats each tile draws; they may be those of some rows of tiles.
        size: (height, width) of the image in pixels.
        settings: how to draw.
        background: (D,) device array; black if not given. In xray mode there is none.
        into: a raster whose rows are drawn; a new one if not given.

    Raises:
        InputError: the tile size is none that the kernels are made for, or splats with modes
            have more than 32 channels.
        ShapeError: features, modes or background do not fit.
    """
    settings = settings.for_image(size, cpu=device.traits.is_cpu)
    _check(splats, lists, size, settings)
    splats = packed(device, splats)
    channels = splats.features.shape[1]
    background = _background(device, background, channels)
    raster = into or Raster.empty(device, size, channels)
    for first, count in _channel_runs(device, splats):
        device.launch(
            _kernel(device, "raster"),
            _work(device, lists, settings),
            image=raster.image,
            transmittance=raster.transmittance,
            last=raster.last,
            above=raster.above,
            **_drawn(device, splats, background, lists, size, settings),
            **_channels(splats, first, count),
            **_macros(device, splats, settings, count),
            **({"MEDIAN": 1} if splats.median and first + count == channels else {}),
        )
    return raster


def raster_grad(
    device: Device,
    splats: ScreenSplats,
    lists: TileLists,
    raster: Raster,
    grad_image: DeviceArray,
    grad_transmittance: DeviceArray | None = None,
    *,
    settings: SplatSettings,
    background: DeviceArray | None = None,
) -> SlotRecords:
    """The gradient of a loss, as a record for every (splat, tile) pair that was seen.

    Args:
        device: where the arrays are.
        splats: as given to ``rasterize``.
        lists: as given to ``rasterize``.
        raster: what it returned.
        grad_image: dL/d image, (height, width, D) device array.
        grad_transmittance: dL/d transmittance, (height, width); zero if not given.
        settings: as given to ``rasterize``.
        background: as given to ``rasterize``.

    Returns:
        (M, 6 + D [+ 2]) numbers, slot by slot; for splats with modes (M, P).

    Raises:
        InputError: magnitudes of gradients are asked for splats with modes.
    """
    splats = packed(device, splats)
    (height, width), channels = raster.transmittance.shape, splats.features.shape[1]
    settings = settings.for_image((height, width), cpu=device.traits.is_cpu)
    as_device_array(device, grad_image, (height, width, channels), name="grad_image")
    if grad_transmittance is None:
        grad_transmittance = device.zeros((height, width))
    as_device_array(device, grad_transmittance, (height, width), name="grad_transmittance")
    background = _background(device, background, channels)
    record = MOMENTS + channels + 2 * settings.absgrad
    if splats.modes is not None:
        record = splats.modes.record_length(channels, settings)
    slots = device.empty((lists.n_slots, record))
    live = device.zeros(lists.n_slots, np.uint8)
    nothing = device.zeros((height, width)) if channels > _GROUP_CHANNELS else grad_transmittance
    for first, count in _channel_runs(device, splats):
        device.launch(
            _kernel(device, "raster_grad"),
            _work(device, lists, settings, group=_group(device, settings, count)),
            slots=slots,
            live=live,
            grad_image=grad_image,
            grad_transmittance=nothing if first else grad_transmittance,
            transmittance=raster.transmittance,
            last=raster.last,
            **_drawn(device, splats, background, lists, (height, width), settings),
            **_channels(splats, first, count),
            **_macros(device, splats, settings, count),
            ABSGRAD=int(settings.absgrad),
        )
    return SlotRecords(slots, live)


def sum_slots(
    device: Device, slots: DeviceArray, records: SlotRecords, *, onto: DeviceArray | None = None
) -> DeviceArray:
    """Sum each splat's records over its tiles: (N, 6 + D [+ 2]), or (N, P) with modes.

    Args:
        device: where the arrays are.
        slots: (N + 1,) int32, those of the lists that the records are of.
        records: what ``raster_grad`` returned for them.
        onto: sums of the rows of tiles above, which these are added to; zero if not given.
    """
    count, record = slots.size - 1, records.numbers.shape[1]
    sums = device.empty((count, record)) if onto is None else onto
    device.launch(
        "splat_sum_slots",
        (count,),
        slots=slots,
        records=records.numbers,
        live=records.live,
        sums=sums,
        count=count,
        RECORD=record,
        CONTINUED=onto is not None,
    )
    return sums


def _check(
    splats: ScreenSplats, lists: TileLists, size: tuple[int, int], settings: SplatSettings
) -> None:
    if settings.tile not in _TILES:
        raise InputError(f"tile is {settings.tile}, wanted one of {_TILES}")
    whole, listed = Tiles.of(size, settings.edge), lists.tiles
    if listed.across != whole.across or listed.first_row + listed.rows > whole.rows:
        raise ShapeError(
            f"lists have tiles {listed.across} x {listed.first_row + listed.rows}, an image of "
            f"{size} pixels has {whole.across} x {whole.rows}"
        )
    if len(splats.features.shape) != 2 or len(splats.features) != len(splats.screen):
        raise ShapeError(
            f"features have shape {splats.features.shape}, wanted ({len(splats.screen)}, channels)"
        )
    if splats.modes is not None:
        splats.modes.check_fit(*splats.features.shape)


def _background(device: Device, background: DeviceArray | None, channels: int) -> DeviceArray:
    if background is None:
        return device.zeros(channels)
    return as_device_array(device, background, (channels,), name="background")


def _channel_runs(device: Device, splats: ScreenSplats) -> Iterator[tuple[int, int]]:
    """The first channel and the number of channels of each launch."""
    channels = splats.features.shape[1]
    few = not device.traits.is_cpu and splats.modes is None
    most = _GROUP_CHANNELS if few else _CHANNELS
    for first in range(0, channels, most):
        yield first, min(most, channels - first)


def _kernel(device: Device, name: str) -> str:
    return f"splat_{name}_{'cpu' if device.traits.is_cpu else 'gpu'}"


def _work(
    device: Device, lists: TileLists, settings: SplatSettings, group: int | None = None
) -> tuple[int]:
    """Work-items: a CPU takes one for a tile; a GPU one for a pixel, or a group for a tile."""
    of_tile = 1 if device.traits.is_cpu else group or settings.edge**2
    return (lists.tiles.count * of_tile,)


def _group(device: Device, settings: SplatSettings, channels: int) -> int:
    """Work-items of a GPU's group: one for each pixel of a tile, or of a part of one.

    More channels than one launch of Gaussians has take local memory for as many more pixels.
    """
    room = _GROUP * _GROUP_CHANNELS // max(channels, _GROUP_CHANNELS)
    return smaller_group(min(room, settings.edge**2, device.traits.group))


def _drawn(
    device: Device,
    splats: ScreenSplats,
    background: DeviceArray,
    lists: TileLists,
    size: tuple[int, int],
    settings: SplatSettings,
) -> dict[str, DeviceArray | float | None]:
    """The arguments that compositing and its gradient share."""
    return {
        "packed": splats.records,
        "modes": splats.modes.table if splats.modes else None,
        "features": splats.features,
        "background": background,
        "entries": lists.entries,
        "starts": lists.starts,
        "height": size[0],
        "width": size[1],
        "tiles_x": lists.tiles.across,
        "first_tile_row": lists.tiles.first_row,
        "tiles": None if device.traits.is_cpu else lists.tiles.count,
        "cap": settings.alpha_cap,
    }


def _channels(splats: ScreenSplats, first: int, count: int) -> dict[str, int]:
    """Which channels a launch does of those that the splats have."""
    channels = splats.features.shape[1]
    inside = int(channels <= RECORD_FEATURES)
    return {"stride": channels, "first": first, "CHANNELS": count, "PACKED": inside}


def _macros(
    device: Device, splats: ScreenSplats, settings: SplatSettings, channels: int
) -> dict[str, int]:
    macros = {
        "TILE": settings.edge,
        "ADDITIVE": int(settings.mode == "xray"),
        "SMOOTH": int(settings.smooth_cutoff),
        "MODAL": int(splats.modes is not None),
    }
    if not device.traits.is_cpu:
        macros["GROUP"] = _group(device, settings, channels)
    return macros | (splats.modes.macros(settings) if splats.modes else {})
