"""Projections on a device as detector columns: what each bin of each row saw, view by view.

A faulty bin is told from its neighbours by its column, and mended by it: columns are sorted along
the views, compared across bins, and sorted back. For that they are contiguous in memory, (row, bin,
view), where projections are (view, row, bin).
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rift_cl.cl.array import DeviceArray
from rift_cl.cl.budget import plan_chunks
from rift_cl.cl.device import Device

Floats = NDArray[np.float32]
Mask = NDArray[np.bool_]

# The fewest views that a column may have: the vectors of a CPU, and the window of roughness.
FEWEST_VIEWS = 16
# Bins that one work-item takes a median across, views and bins that one moves when axes change.
_CPU_SEGMENT, _GPU_SEGMENT, _CPU_STRIP, _GPU_STRIP = 256, 64, 64, 16
# Views that one work-item of a CPU goes through, columns that one sorts.
_CPU_RUN, _CPU_COLUMNS = 4096, 16
# Bytes that a CPU works on at a time, or a row: more rows at a time are not faster there.
_CPU_BYTES = 128 << 20


class DetectorColumns:
    """The columns of some rows.

    Args:
        device: where they are.
        projections: (view, row, bin), at least 16 views.
    """

    def __init__(self, device: Device, projections: Floats) -> None:
        self.device = device
        self.views, self.rows, self.bins = projections.shape
        self._values = self._empty()
        self._other: DeviceArray | None = None
        self._order: DeviceArray | None = None
        row, projection = self.bins * self.views, self.rows * self.bins
        pitches = (projection, self.bins, self.views, row)
        stack = device.array(np.ascontiguousarray(projections))
        self._transpose(stack, self._values, (self.views, self.bins), pitches)

    @staticmethod
    def nbytes(device: Device, views: int, bins: int) -> int:
        """Bytes of the device that one row needs: projections, columns, their copy, their order."""
        return 4 * 4 * views * bins + DetectorColumns._sort_bytes(device, views, bins)

    @staticmethod
    def largest(device: Device, views: int, bins: int) -> int:
        """Bytes that one row takes of the largest of these arrays."""
        return max(4 * views * bins, DetectorColumns._sort_bytes(device, views, bins))

    @staticmethod
    def _sort_bytes(device: Device, views: int, bins: int) -> int:
        """Bytes of the lists that sort one row's columns."""
        return (16 // _CPU_COLUMNS if device.traits.is_cpu else 16) * views * bins

    def projections(self) -> Floats:
        """The columns as projections on the host, (view, row, bin)."""
        stack = self.device.empty((self.views, self.rows, self.bins))
        row, projection = self.bins * self.views, self.rows * self.bins
        pitches = (self.views, row, projection, self.bins)
        self._transpose(self._values, stack, (self.bins, self.views), pitches)
        found: Floats = self.device.get(stack)
        return found

    def roughness(self) -> Floats:
        """Mean distance of each column from its running mean over ten views, (row, bin)."""
        found = self.device.empty((self.rows, self.bins))
        self._profile("column_roughness", values=self._values, rough=found)
        return self.device.get(found)

    def levels(self, dropped: int) -> Floats:
        """Trimmed mean of each sorted column, (row, bin)."""
        found = self.device.empty((self.rows, self.bins))
        self._profile("column_level", ranked=self._values, level=found, dropped=dropped)
        return self.device.get(found)

    def sort(self) -> None:
        """Sort every column, stably; ``unsort`` puts the values back to their views."""
        columns = self.rows * self.bins
        run = _CPU_COLUMNS if self.device.traits.is_cpu else 1
        items = -(-columns // run)
        lists = self.device.empty((items, 2, self.views, 2), np.uint32)
        self._order = self._empty(np.int32)
        self.device.launch(
            "column_sort",
            (items,),
            values=self._values,
            ranked=self._values,
            order=self._order,
            spare=lists,
            columns=columns,
            views=self.views,
            RUN=run,
        )

    def unsort(self) -> None:
        """Put ranked values back to the views that ``sort`` took them from."""
        run = _CPU_RUN if self.device.traits.is_cpu else 1
        size = (-(-self.views // run), self.bins, self.rows)
        other = self._spare()
        self.device.launch(
            "column_unsort",
            size,
            ranked=self._values,
            order=self._order,
            values=other,
            bins=self.bins,
            views=self.views,
            RUN=run,
        )
        self._values, self._other, self._order = other, self._values, None

    def median(self, window: int) -> None:
        """Median filter across an odd number of bins.

        Beyond the detector's ends the bins are mirrored.
        """
        traits = self.device.traits
        segment = _CPU_SEGMENT if traits.is_cpu else _GPU_SEGMENT
        blocks, segments = -(-self.views // traits.macros["LANES"]), -(-self.bins // segment)
        other = self._spare()
        self.device.launch(
            "column_median",
            (blocks, segments, self.rows),
            source=self._values,
            out=other,
            bins=self.bins,
            ranks=self.views,
            WINDOW=window,
            SEGMENT=segment,
        )
        self._values, self._other = other, self._values

    def interpolate(self, bad: Mask) -> None:
        """Fill bad columns of each row from the nearest good ones, along straight lines.

        Args:
            bad: (row, bin); the first and the last bin of a row are good.
        """
        holes, lefts, rights, shares = _neighbours(bad)
        if not holes.size:
            return
        table = np.ascontiguousarray(np.stack([holes, lefts, rights], axis=1), np.int32)
        run = _CPU_RUN if self.device.traits.is_cpu else 1
        self.device.launch(
            "column_blend",
            (-(-self.views // run), holes.size),
            x=self._values,
            table=self.device.array(table),
            shares=self.device.array(shares),
            views=self.views,
            RUN=run,
        )

    def subtract(self, levels: NDArray[Any]) -> None:
        """Subtract a number from each column, (row, bin)."""
        run = _CPU_RUN if self.device.traits.is_cpu else 1
        self.device.launch(
            "column_shift",
            (-(-self.views // run), self.bins, self.rows),
            x=self._values,
            shift=self.device.array(levels, np.float32),
            bins=self.bins,
            views=self.views,
            RUN=run,
        )

    def _profile(self, kernel: str, **given: DeviceArray | int) -> None:
        """Reduce every column to a number."""
        columns = self.rows * self.bins
        self.device.launch(kernel, (columns,), **given, columns=columns, views=self.views)

    def _transpose(
        self,
        source: DeviceArray,
        target: DeviceArray,
        shape: tuple[int, int],
        pitches: tuple[int, ...],
    ) -> None:
        cpu = self.device.traits.is_cpu
        strips = -(-shape[1] // _CPU_STRIP) if cpu else shape[1]
        strip = _CPU_STRIP if cpu else _GPU_STRIP
        size = (strips, -(-shape[0] // strip), self.rows)
        names = ("in_pitch", "in_slice", "out_pitch", "out_slice")
        self.device.launch(
            "stack_transpose",
            size,
            source=source,
            out=target,
            ni=shape[0],
            nj=shape[1],
            **dict(zip(names, pitches, strict=True)),
            STRIP=_CPU_STRIP,
            DEEP=_GPU_STRIP,
        )

    def _empty(self, dtype: type = np.float32) -> DeviceArray:
        return self.device.empty((self.rows, self.bins, self.views), dtype)

    def _spare(self) -> DeviceArray:
        if self._other is None:
            self._other = self._empty()
        return self._other


def mend_columns(
    projections: Floats, device: Device, mend: Callable[[DetectorColumns], None]
) -> Floats:
    """Mend the columns of projections, as many rows at a time as the device holds.

    Args:
        projections: (view, row, bin).
        device: where it is done.
        mend: what to do to columns; no row may depend on another.

    Returns:
        The mended projections, a new array.
    """
    views, rows, bins = projections.shape
    out = np.empty(projections.shape, np.float32)
    each = DetectorColumns.nbytes(device, views, bins)
    most = max(each, _CPU_BYTES) if device.traits.is_cpu else device.budget
    budget = min(device.budget, most)
    fitting = plan_chunks(
        rows,
        each,
        0,
        budget,
        what="row of the projections",
        array=DetectorColumns.largest(device, views, bins),
        largest=device.traits.allocation,
    )
    for chunk in fitting:
        columns = DetectorColumns(device, projections[:, chunk])
        mend(columns)
        out[:, chunk] = columns.projections()
    return out


def _neighbours(bad: Mask) -> tuple[NDArray[Any], ...]:
    """Numbers of bad columns, of the good ones on either side, and the shares of the right one."""
    flat = bad.ravel()
    good, holes = np.flatnonzero(~flat), np.flatnonzero(flat)
    after = np.searchsorted(good, holes)
    left, right = good[after - 1], good[np.minimum(after, good.size - 1)]
    shares = ((holes - left) / (right - left)).astype(np.float32)
    return holes, left, right, shares
