"""Factors of rays, on the device: products of one for each pixel and one for each bin of a view."""

from __future__ import annotations

import math
from functools import cached_property

import numpy as np
from numpy.typing import DTypeLike, NDArray

from rift_cl.cl.array import DeviceArray
from rift_cl.cl.device import Device

Floats = NDArray[np.float64]

# Bins and rows that one work-item of a CPU goes through.
_CPU_BINS, _CPU_ROWS = 1024, 16


class RayFactors:
    """Multiplies projections by factors, laying them onto a wider detector or back.

    Args:
        device: where the projections are.
        dtype: of the projections.
        pixels: (rows, bins) factors of the wider detector's pixels, or (1, bins) for all rows.
        views: (views, bins) factors of its bins, or (1, bins) for all views.
        before: bins of the wider detector before the first one of the narrower.
    """

    def __init__(
        self, device: Device, dtype: DTypeLike, pixels: Floats, views: Floats, before: int = 0
    ) -> None:
        self.device, self._before, self._dtype = device, before, np.dtype(dtype)
        self._host = pixels, views

    @cached_property
    def _pixels(self) -> DeviceArray:
        return self.device.array(self._host[0], self._dtype)

    @cached_property
    def _views(self) -> DeviceArray:
        return self.device.array(self._host[1], self._dtype)

    @property
    def nbytes(self) -> int:
        """Bytes of the factors."""
        return self._dtype.itemsize * sum(factors.size for factors in self._host)

    def of_views(self, run: slice) -> RayFactors:
        """The factors of some views."""
        pixels, views = self._host
        views = views[run] if len(views) > 1 else views
        return RayFactors(self.device, self._dtype, pixels, views, self._before)

    def of_rows(self, run: slice) -> RayFactors:
        """The factors of some rows of every view."""
        pixels, views = self._host
        pixels = pixels[run] if len(pixels) > 1 else pixels
        return RayFactors(self.device, self._dtype, pixels, views, self._before)

    def widen(self, narrow: DeviceArray, wide: DeviceArray) -> None:
        """Fill ``wide`` with the factors times ``narrow``, 0 where that has no bin."""
        self._launch(narrow, wide, -self._before, 0)

    def narrow(self, wide: DeviceArray, narrow: DeviceArray) -> None:
        """The transpose: fill ``narrow`` with the factors times its part of ``wide``."""
        self._launch(wide, narrow, self._before, self._before)

    def _launch(self, x: DeviceArray, out: DeviceArray, shift: int, weight_shift: int) -> None:
        lines, bins = math.prod(out.shape[:-1]), out.shape[-1]
        cpu = self.device.traits.is_cpu
        block, run = (_CPU_BINS, _CPU_ROWS) if cpu else (1, 1)
        self.device.launch(
            "rays_weigh",
            (-(-bins // block), -(-lines // run)),
            x=x,
            out=out,
            pixels=self._pixels,
            views=self._views,
            lines=lines,
            rows=lines // out.shape[0],
            x_bins=x.shape[-1],
            bins=bins,
            pixel_stride=_stride(self._pixels),
            view_stride=_stride(self._views),
            shift=shift,
            weight_shift=weight_shift,
            BINS=block,
            RUN=run,
            DOUBLE=int(out.dtype == np.float64),
        )


def _stride(factors: DeviceArray) -> int:
    return int(factors.shape[1]) if factors.shape[0] > 1 else 0
