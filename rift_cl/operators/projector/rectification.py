"""What tilted detectors read of upright ones, on the device: interpolation and its transpose."""

from __future__ import annotations

from typing import Any

import numpy as np

from rift_cl.cl.array import DeviceArray
from rift_cl.cl.device import Device
from rift_cl.geometry import Vectors
from rift_cl.operators.projector.upright import Rectified


class Rectification:
    """The map from upright views to those of a ``Vectors`` scan, by Keys' cubic.

    Args:
        device: where it runs.
        scan: the scan.
        rectified: some of its views, and their upright detectors.
        dtype: of all arrays.
    """

    def __init__(
        self, device: Device, scan: Vectors, rectified: Rectified, dtype: np.dtype[Any]
    ) -> None:
        self._device, self._rows, self._bins = device, scan.rows, scan.bins
        self._upright = rectified.upright
        self._forms = device.array(rectified.forms, dtype)
        self._views = device.array(rectified.views)
        self._double = int(dtype == np.float64)

    @property
    def nbytes(self) -> int:
        """Bytes of the device that the records take."""
        return int(self._forms.nbytes + self._views.nbytes)

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
        self._launch("upright_read", upright, data, first, work, SLOPE=slope)

    def spread(self, data: DeviceArray, upright: DeviceArray, first: int, count: int) -> None:
        """The transpose: write the upright views of a run."""
        work = self._upright.bins, self._upright.rows, count
        self._launch("upright_spread", upright, data, first, work)

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
            upright_rows=self._upright.rows,
            upright_bins=self._upright.bins,
            DOUBLE=self._double,
            **macros,
        )
