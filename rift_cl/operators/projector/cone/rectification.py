"""What tilted detectors read of upright ones, on the device: interpolation and its transpose."""

from __future__ import annotations

from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rift_cl.cl.array import DeviceArray
from rift_cl.cl.device import Device


class Rectification:
    """The map from upright views to those of tilted detectors.

    Keys' cubic reads sixteen samples. The cubic spline through all of them keeps waves of three
    samples at 7/8 of their height where that keeps 11/16, for a pass along rows and columns before.
    Projectors want shares of few samples, filtered backprojection wants sharp views.

    Args:
        device: where it runs.
        tilted: (rows, bins) of the detectors that read.
        upright: (rows, bins) of those that are read.
        views: (n,) int32, which views of the tilted data they are.
        forms: (n, 18), as ``kernels/include/cone/upright.h`` reads them.
        dtype: of all arrays.
        spline: interpolate by the cubic spline in the place of Keys' cubic.
    """

    def __init__(
        self,
        device: Device,
        tilted: tuple[int, int],
        upright: tuple[int, int],
        views: NDArray[np.int32],
        forms: NDArray[np.float64],
        dtype: np.dtype[Any],
        *,
        spline: bool = False,
    ) -> None:
        self._device, (self._rows, self._bins), self._upright = device, tilted, upright
        self._host, self._dtype = (views, forms), dtype
        self._double, self._spline = int(dtype == np.float64), spline

    @cached_property
    def _forms(self) -> DeviceArray:
        return self._device.array(self._host[1], self._dtype)

    @cached_property
    def _views(self) -> DeviceArray:
        return self._device.array(self._host[0])

    @property
    def shape(self) -> tuple[int, int]:
        """Rows and bins of the detectors that read."""
        return self._rows, self._bins

    @property
    def nbytes(self) -> int:
        """Bytes of the device that the records take."""
        views, forms = self._host
        return views.nbytes + self._dtype.itemsize * forms.size

    def of_views(self, run: slice) -> Rectification:
        """That of a run of the tilted views."""
        views, forms = self._host
        chosen = (views >= run.start) & (views < run.stop)
        return Rectification(
            self._device,
            (self._rows, self._bins),
            self._upright,
            (views[chosen] - run.start).astype(np.int32),
            forms[chosen],
            self._dtype,
            spline=self._spline,
        )

    def read(
        self, upright: DeviceArray, data: DeviceArray, first: int, count: int, slope: int = 0
    ) -> None:
        """Write the views of a run, from their upright ones, (count, rows, bins).

        Args:
            upright: the upright views of the run.
            data: all views.
            first: view of the run.
            count: of views.
            slope: 1 for derivatives by the upright views' column, 2 for those by their row.
        """
        work = self._bins, self._rows, count
        if self._spline:
            upright = self._filtered(self._filtered(upright, down=0), down=1)
        self._launch("upright_read", upright, data, first, work, SLOPE=slope)

    def spread(self, data: DeviceArray, upright: DeviceArray, first: int, count: int) -> None:
        """The transpose: write the upright views of a run."""
        rows, bins = self._upright
        work = bins, rows, count
        self._launch("upright_spread", upright, data, first, work)
        if self._spline:
            down = self._filtered(upright, down=1)
            self._filter(down, upright, down=0)

    def _filtered(self, samples: DeviceArray, *, down: int) -> DeviceArray:
        factors = self._device.empty(samples.shape, self._dtype)
        self._filter(samples, factors, down=down)
        return factors

    def _filter(self, samples: DeviceArray, factors: DeviceArray, *, down: int) -> None:
        """Write the B-splines' factors of upright views along an axis; its own transpose."""
        count, rows, columns = samples.shape
        lanes = self._device.traits.macros["LANES"]
        self._device.launch(
            "spline_coefficients",
            (-(-columns // lanes), rows, count),
            factors=factors,
            samples=samples,
            rows=rows,
            columns=columns,
            DOWN=down,
            DOUBLE=self._double,
        )

    def _launch(
        self,
        kernel: str,
        upright: DeviceArray,
        data: DeviceArray,
        first: int,
        work: tuple[int, int, int],
        **macros: int,
    ) -> None:
        lanes = self._device.traits.macros["LANES"]
        self._device.launch(
            kernel,
            (-(-work[0] // lanes), *work[1:]),
            data=data,
            upright=upright,
            forms=self._forms,
            views=self._views,
            first=first,
            rows=self._rows,
            bins=self._bins,
            upright_rows=self._upright[0],
            upright_bins=self._upright[1],
            SPLINE=int(self._spline),
            DOUBLE=self._double,
            **macros,
        )
