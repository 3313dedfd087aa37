"""What the raster kernels read of splats that carry Hermite polynomials: their modes on the screen.

``hermite_project.cl`` writes the table and reads the moments that come back; the kernels
``hermite_raster_cpu.cl`` and ``hermite_raster_grad_cpu.cl`` say what each number means.
"""

from __future__ import annotations

from dataclasses import dataclass

from rift_cl.cl.array import DeviceArray
from rift_cl.errors import InputError, ShapeError
from rift_cl.geometry.numbers import one_number
from rift_cl.splat.orders import ModeOrders, check_order
from rift_cl.splat.settings import Activation, SplatSettings

# The most channels that the kernels are made for.
_CHANNELS = 32
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
        """Numbers that the gradient has for each splat: ``kernels/include/hermite_slots.h``.

        Args:
            features: channels that are drawn.
            settings: how they are drawn.

        Raises:
            InputError: magnitudes of gradients are asked for.
        """
        if settings.absgrad:
            raise InputError(
                "SplatSettings: absgrad is for Gaussians alone, these splats have modes: leave it "
                "off"
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
