"""The table stage of an upright detector: views stretched to slab tables, and the transpose.

It stands between the data and the slabs, and is all that knows how a detector is placed: what else
fills tables and collects them with the same numbers takes its place.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from rift_cl.cl.array import DeviceArray
from rift_cl.cl.device import Device
from rift_cl.geometry import Cone
from rift_cl.operators.projector.slab_table import SlabTable, ray_lengths


class SlabStretch:
    """Fills the tables of runs of views, column by column, and collects them.

    Args:
        device: where it runs.
        scan: the scan.
        table: of the views that are walked alike.
        dtype: of data and tables.
    """

    def __init__(
        self,
        device: Device,
        scan: Cone,
        table: SlabTable,
        dtype: np.dtype[Any],
    ) -> None:
        self._device, self._table = device, table
        self._run = 1 << 30 if device.traits.is_cpu else 1
        self._shape = scan.rows, scan.bins
        self._arguments = {
            "lengths": device.array(ray_lengths(scan), dtype),
            "views": device.array(table.views),
            "firsts": device.array(table.firsts),
            "steps": device.array(table.steps, dtype),
            "gains": device.array(table.gains, dtype),
            "detector_rows": scan.rows,
            "bins": scan.bins,
            "rows": table.rows,
            "columns": table.columns,
            "pad": table.pad,
            "center": scan.center[0],
            "DOUBLE": int(dtype == np.float64),
            "WIDE": int(table.wide),
            "RUN": self._run,
        }

    def fill(self, data: DeviceArray, tables: DeviceArray, first: int, count: int) -> None:
        """Write the tables of ``count`` views from ``first`` on from all data."""
        items = self._items(self._table.columns)
        work = (items, self._table.rows, count)
        self._device.launch(
            "slab_stretch", work, data=data, table=tables, first=first, **self._arguments
        )

    def collect(self, tables: DeviceArray, data: DeviceArray, first: int, count: int) -> None:
        """Write these views of the data from their tables."""
        rows, bins = self._shape
        work = (self._items(bins), rows, count)
        self._device.launch(
            "slab_stretch_adjoint", work, data=data, table=tables, first=first, **self._arguments
        )

    def _items(self, length: int) -> int:
        return -(-length // self._run)
