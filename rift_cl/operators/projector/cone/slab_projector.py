"""Line integrals along the rays of a cone, and their exact adjoint, by slab tables.

Forward: volume -> slabs (y, x, z) -> slab tables -> detector. Adjoint: the same steps transposed,
in reverse, with the same numbers. ``kernels/include/cone/slab_table.h`` derives the method;
``rift_cl/reference/cone.py`` has the matrix.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from dataclasses import replace
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import DTypeLike

from rift_cl.cl.array import DeviceArray
from rift_cl.cl.device import Device
from rift_cl.geometry import Cone, Grid
from rift_cl.operators.projector.cone.slab_table import Samples, SlabTable, ray_lengths, slab_table
from rift_cl.operators.projector.footprint import check_depth_power, check_footprint
from rift_cl.operators.projector.volume_in_parts import VolumeInParts

# Tables and places of a run of views together: on a CPU they should stay in its caches.
_TABLE_BYTES = {"cpu": 8 << 20, "gpu": 64 << 20}
_FEWEST_VIEWS = 16
# What an item of a CPU takes: z at once, columns and views of the projector, and of the
# backprojector as many lines as are seen in so many columns.
_DEPTH, _COLUMNS, _GROUPED_VIEWS = 64, 64, 8
_WIDTHS, _LINES = (24, 48, 72, 96), (64, 32, 16, 8, 4, 2, 1)
# Numbers between lines and between slabs, so that they do not compete for the same cache lines.
_APART = 16
# Numbers in a view's forms.
_FORMS = 16


class SlabProjector(VolumeInParts):
    """Line integrals of a volume along the rays of a ``Cone``.

    A value of the range is that of the line integral, value times length, from the source through
    the centre of a bin. Sampled rays see a volume by the shadows of its samples:

    Args:
        grid: the grid of the volume, (nz, ny, nx).
        scan: source and detector.
        footprint: how a sample's shadow is shared among bins, along the detector's rows and its
            columns alike. ``strip``: by what of each bin it covers. ``linear``: by linear
            interpolation between the two bins about its centre; where bins are finer than the
            shadow the hat widens to that shadow. ``point``: by interpolation at its centre, linear
            between columns and cubic between rows, whatever the shadow: the sharpest adjoint, that
            of filtered backprojection. As a projector it leaves holes where bins are finer than
            shadows.
        device: the device to use; the default device if not given.
        dtype: ``float32``, or ``float64`` where the device has it.
        depth_power: of the inverse of the depth that a sample is weighted by. 2 is that of line
            integrals; 1 has another factor ``depth / source_to_axis``, as the filtered
            backprojection of helices wants it. On an arc the depth is the way from the source.

    The domain is ``grid.shape``; the range is (views, rows, bins).

    Between rows all of them go through Keys' cubic (kernels/include/cone/slab_table.h), whose
    weights are negative in part: the projection of ones is a few hundredths of its largest value
    below 0 in rows at the edge of the shadow. Methods that divide by it (SIRT, MLEM) leave out
    rays where it is small, as ``rift.sirt`` does.

    Raises:
        InputError: the grid is no volume, the footprint or the type is unknown, the source stands
            in the volume, the fan is wider than some 90 degrees, or bins and samples are of very
            different sizes.
        DeviceError: the device has no float64.
    """

    scan: Cone
    _settled = ("depth_power",)
    # The footprints of this beam, and what makes the table of one walk.
    _footprints: tuple[str, ...] = ("strip", "linear", "point")
    _table: Callable[..., SlabTable] = staticmethod(slab_table)

    def __init__(
        self,
        grid: Grid,
        scan: Cone,
        footprint: str = "strip",
        device: Device | None = None,
        dtype: DTypeLike = np.float32,
        *,
        depth_power: int = 2,
    ) -> None:
        super().__init__(grid, scan, device, dtype, rows=self._data_rows(scan))
        self.footprint = check_footprint(footprint, self._footprints)
        self.depth_power = check_depth_power(depth_power)
        self._tables = [
            self._table(self.grid, self._beam, footprint, depth_power, along_x=way)
            for way in (True, False)
        ]
        self._precision = {"DOUBLE": int(self.dtype == np.float64)}

    @staticmethod
    def _data_rows(scan: Any) -> int | None:
        """Rows of the data; as many as there are slices where it is None."""
        rows: int = scan.rows
        return rows

    def _facts(self) -> list[str]:
        scan = self.scan
        return [
            f"grid {' x '.join(map(str, self.grid.shape))}",
            f"{scan.views} cone views of {scan.rows} x {scan.bins} bins",
            f"magnification {scan.magnification:.3g}",
            f"footprint {self.footprint}",
        ]

    def _apply(self, x: DeviceArray, out: DeviceArray) -> None:
        slabs = self._layout.slabs(self.device, x)
        for walk in self._walks:
            for first, count in self._runs(walk):
                tables = self.device.empty(
                    (count, walk.table.rows * walk.table.columns), self.dtype
                )
                walk.project(slabs, tables, first, count)
                walk.stage.collect(tables, out, first, count)
                del tables

    def _apply_adjoint(self, y: DeviceArray, out: DeviceArray) -> None:
        slabs = self.device.empty(self._layout.size, self.dtype)
        add = False
        for walk in self._walks:
            for first, count in self._runs(walk):
                tables = self.device.empty(
                    (count, walk.table.rows * walk.table.columns), self.dtype
                )
                walk.stage.fill(y, tables, first, count)
                walk.backproject(tables, slabs, first, count, add=add)
                del tables
                add = True
        self._layout.volume(self.device, slabs, out)

    @property
    def _beam(self) -> Cone:
        """The rays as those of a cone."""
        return self.scan

    @cached_property
    def _column(self) -> Samples:
        """The samples along z, in the unit in which tables have them."""
        return Samples.of(self.grid, 0)

    @cached_property
    def _layout(self) -> _Layout:
        return _Layout.of(self.domain, self.device, self.dtype)

    @cached_property
    def _walks(self) -> list[_Walk]:
        return [
            _Walk(self, table, along_x=way)
            for way, table in zip((True, False), self._tables, strict=True)
        ]

    def _runs(self, walk: _Walk) -> Iterator[tuple[int, int]]:
        """Runs of views, first and count, whose tables exist at the same time."""
        each = self._each(walk.table, self._layout.depth)
        most = max(1, min(self._together(each), self.device.traits.allocation // each))
        total = len(walk.table.views)
        for first in range(0, total, most):
            yield first, min(most, total - first)

    def _together(self, each: int, *, sparing: bool | None = None) -> int:
        """Views whose tables exist at the same time, of so many bytes each."""
        if self._sparing if sparing is None else sparing:
            return _FEWEST_VIEWS
        kind = "cpu" if self.device.traits.is_cpu else "gpu"
        return max(_FEWEST_VIEWS, _TABLE_BYTES[kind] // each)

    def _each(self, table: SlabTable, depth: int) -> int:
        """Bytes of one view's table and places, of so many z."""
        return sum(self._arrays_of_a_view(table, depth))

    def _arrays_of_a_view(self, table: SlabTable, depth: int) -> list[int]:
        item, slabs = self.dtype.itemsize, table.slabs.count
        lines = slabs * _padded(table.lines.count, self.device)
        of_lines = 4 * lines, item * lines * (table.taps - 1)
        of_rows = 4 * slabs * depth, item * slabs * depth * (table.row_taps - 1)
        return [item * table.entries, *of_lines, *of_rows]

    def _need(self, slices: int, views: int, *, sparing: bool) -> tuple[int, int]:
        item, rows, bins = self.dtype.itemsize, self._rows(slices), self.range[2]
        layout = _Layout.of((slices, *self.domain[1:]), self.device, self.dtype)
        whole = [item * n for n in (slices * math.prod(self.domain[1:]), views * rows * bins)]
        whole.append(item * layout.size)
        tables, records, arrays = 0, 0, whole.copy()
        for table in self._tables:
            of_a_view = self._arrays_of_a_view(self._lower(table, slices), layout.depth)
            together = self._together(sum(of_a_view), sparing=sparing)
            tables = max(tables, min(views, len(table.views), together) * sum(of_a_view))
            numbers = _FORMS + table.slabs.count + 2 * table.columns
            records += min(views, len(table.views)) * (item * numbers + 8) + item * rows * bins
            arrays += of_a_view
        return sum(whole) + tables + records, max(arrays)

    def _part(self, z: slice, views: slice) -> SlabProjector:
        part = self._bare_part(z, views)
        slices, column = z.stop - z.start, self._column
        part._precision, part.depth_power = self._precision, self.depth_power
        part._tables = [self._lower(table.of_views(views), slices) for table in self._tables]
        part._column = replace(column, count=slices, first=column.first + z.start)
        return part

    def _lower(self, table: SlabTable, slices: int) -> SlabTable:
        """A table of views, for so many slices."""
        return table


class _Layout(NamedTuple):
    """A volume in slabs, (y, x, z), z padded to whole runs.

    Args:
        shape: of the volume, (nz, ny, nx).
        run: z that an item of a CPU takes at once.
        depth: z with the padding.
        strides: numbers from y to y and from x to x.
        size: numbers in all.
        double: whether they are float64.
    """

    shape: tuple[int, ...]
    run: int
    depth: int
    strides: tuple[int, int]
    size: int
    double: int

    @classmethod
    def of(cls, shape: tuple[int, ...], device: Device, dtype: np.dtype[Any]) -> _Layout:
        nz, ny, nx = shape
        lanes = device.traits.macros["LANES"]
        runs = -(-nz // _DEPTH) if lanes > 1 else nz
        run = -(-nz // (runs * lanes)) * lanes
        along_x = runs * run + _APART
        along_y = nx * along_x + _APART
        double = int(dtype == np.float64)
        return cls(shape, run, runs * run, (along_y, along_x), ny * along_y, double)

    def slabs(self, device: Device, volume: DeviceArray) -> DeviceArray:
        """The volume in slabs."""
        slabs = device.empty(self.size, volume.dtype)
        self._turn(device, volume, slabs, back=0)
        return slabs

    def volume(self, device: Device, slabs: DeviceArray, out: DeviceArray) -> None:
        """Write slabs to a volume."""
        self._turn(device, out, slabs, back=1)

    def _turn(self, device: Device, volume: DeviceArray, slabs: DeviceArray, *, back: int) -> None:
        nz, ny, nx = self.shape
        tile = 16 if device.traits.is_cpu else 1
        device.launch(
            "volume_turn",
            (-(-nx // tile), -(-self.depth // tile), ny),
            volume=volume,
            slabs=slabs,
            lines=nx,
            depth=nz,
            padded_depth=self.depth,
            volume_i=nx,
            volume_j=1,
            volume_k=ny * nx,
            slab_stride=self.strides[0],
            line_stride=self.strides[1],
            TILE=tile,
            BACK=back,
            DOUBLE=self.double,
        )


class _Walk:
    """Views that are walked alike: their records on the device, and the kernels' launches."""

    def __init__(self, projector: SlabProjector, table: SlabTable, *, along_x: bool) -> None:
        self._device, self._dtype = projector.device, projector.dtype
        self._layout, self._column = projector._layout, projector._column
        self._strip = int(projector.footprint == "strip")
        self._point = int(projector.footprint == "point")
        self._arc = int(projector._beam.curved)
        self._precision = projector._precision
        self.table = table
        self.stage = _Stretch(
            self._device, projector._beam, table, self._dtype, continued=bool(self._point)
        )
        self._column_forms = self._device.array(table.column_forms, self._dtype)
        self._row_forms = self._device.array(table.row_forms, self._dtype)
        self._amplitudes = self._device.array(table.amplitudes, self._dtype)
        strides = self._layout.strides
        self._slab_stride, self._line_stride = strides if along_x else reversed(strides)
        self._padded_lines = _padded(table.lines.count, self._device)

    def project(self, slabs: DeviceArray, tables: DeviceArray, first: int, count: int) -> None:
        """Write the tables of a run of views."""
        table, on_cpu = self.table, self._device.traits.is_cpu
        given = self._given(tables, slabs, first, count)
        if on_cpu:
            groups = -(-count // _GROUPED_VIEWS)
            work = (-(-self._seen_columns // _COLUMNS), groups)
            more = {"pad": table.pad, "DEPTH": self._layout.run}
            more |= {"WIDTH": _COLUMNS, "VIEWS": _GROUPED_VIEWS, "lines": table.lines.count}
            self._device.launch("slab_project_cpu", work, **given, **more)
        else:
            everything = (table.rows, table.columns, count)
            self._device.launch("slab_project_gpu", everything, **given, lines=table.lines.count)

    @property
    def _seen_columns(self) -> int:
        return self.table.columns - self.table.pad

    def backproject(
        self, tables: DeviceArray, slabs: DeviceArray, first: int, count: int, *, add: bool
    ) -> None:
        """Write or add what the tables of a run of views give to the volume."""
        table, layout = self.table, self._layout
        given = self._given(tables, slabs, first, count)
        if self._device.traits.is_cpu:
            lines, width = self._tile
            work = (-(-table.lines.count // lines), table.slabs.count, layout.depth // layout.run)
            more = {"DEPTH": layout.run, "LINES": lines, "WIDTH": width}
            self._device.launch(
                "slab_backproject_cpu", work, **given, **more, add=add, lines=table.lines.count
            )
        else:
            work = (layout.depth, table.lines.count, table.slabs.count)
            self._device.launch("slab_backproject_gpu", work, **given, add=add)

    @property
    def _tile(self) -> tuple[int, int]:
        """Lines of an item, and columns that they are seen in at most."""
        table = self.table
        for lines in _LINES:
            columns = math.ceil((lines - 1) * table.widest) + table.taps + 8
            width = next((w for w in _WIDTHS if w >= columns), None)
            if width is not None:
                break
        return lines, width or -(-columns // 8) * 8

    def _given(
        self, tables: DeviceArray, slabs: DeviceArray, first: int, count: int
    ) -> dict[str, Any]:
        """What both halves of the pair are told alike."""
        table = self.table
        places, shares = self._places(
            self._column_forms,
            table.lines,
            self._padded_lines,
            table.columns,
            first,
            count,
            TAPS=table.taps,
            ARC=self._arc,
        )
        row_places, row_shares = self._places(
            self._row_forms,
            self._column,
            self._layout.depth,
            table.rows,
            first,
            count,
            TAPS=table.row_taps,
            ARC=0,
        )
        return {
            "table": tables,
            "volume": slabs,
            "places": places,
            "shares": shares,
            "row_places": row_places,
            "row_shares": row_shares,
            "amplitudes": self._amplitudes,
            "first": first,
            "count": count,
            "rows": table.rows,
            "columns": table.columns,
            "padded_lines": self._padded_lines,
            "slabs": table.slabs.count,
            "depth": self._layout.depth,
            "slab_stride": self._slab_stride,
            "line_stride": self._line_stride,
            "TAPS": table.taps,
            "ROW_TAPS": table.row_taps,
            **self._precision,
        }

    def _places(
        self,
        forms: DeviceArray,
        samples: Samples,
        padded: int,
        entries: int,
        first: int,
        count: int,
        **macros: int,
    ) -> tuple[DeviceArray, DeviceArray]:
        """Where samples are seen in the tables of a run of views, and their shares."""
        slabs = self.table.slabs
        shape = count, slabs.count, padded
        places = self._device.empty(shape, np.int32)
        shares = self._device.empty((*shape, macros["TAPS"] - 1), self._dtype)
        run = padded if self._device.traits.is_cpu else 1
        self._device.launch(
            "slab_places",
            (padded // run, slabs.count, count),
            places=places,
            shares=shares,
            forms=forms,
            first=first,
            samples=padded,
            slabs=slabs.count,
            entries=entries,
            sample0=samples.first,
            a0=samples.start,
            da=samples.step,
            b0=slabs.start,
            db=slabs.step,
            RUN=run,
            STRIP=self._strip,
            POINT=self._point,
            **macros,
            **self._precision,
        )
        return places, shares


class _Stretch:
    """Fills the tables of runs of views, column by column, and collects them.

    It stands between the data and the slabs, and is all that knows how a detector is placed.

    Args:
        device: where it runs.
        scan: the scan.
        table: of the views that are walked alike.
        dtype: of data and tables.
        continued: whether the cubic between rows takes a straight line beyond the detector's ends.
    """

    def __init__(
        self,
        device: Device,
        scan: Cone,
        table: SlabTable,
        dtype: np.dtype[Any],
        *,
        continued: bool,
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
            "CONTINUED": int(continued),
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


def _padded(lines: int, device: Device) -> int:
    """Lines in whole lanes."""
    lanes = device.traits.macros["LANES"]
    return -(-lines // lanes) * lanes
