"""The X-ray transform of a parallel scan and its exact adjoint, by phase tables.

Forward: image -> padded planes (by rows, by columns) -> phase tables -> bins. Adjoint: the same
steps transposed, in reverse, with the same numbers. ``kernels/include/tomo/phase_table.h`` derives
the method; ``rift_cl/reference/radon.py`` has the matrix that it approximates.

A slice on the host that is too large for the device is taken in parts, a band of rows of the image
and a run of views each. Bands are independent of each other in a backprojection and views in a
projection, so that those have the bits of the whole; what must be cut the other way as well is
added up in float, to the rounding of the sums.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import DTypeLike

from rift_cl.cl.array import DeviceArray
from rift_cl.cl.budget import cut_evenly, largest_pair, plan_chunks
from rift_cl.cl.device import Device
from rift_cl.errors import ResourceLimitError
from rift_cl.geometry import Grid, Parallel
from rift_cl.operators.linear import Chunk
from rift_cl.operators.projector.footprint import check_footprint
from rift_cl.operators.projector.parallel.parallel_projector import ParallelProjector
from rift_cl.operators.projector.parallel.phase_table import LOG2_PHASES, PhaseTable, phase_table
from rift_cl.operators.projector.projector import Projector

# Tables of a run of views together: on a CPU they should stay in its caches.
_TABLE_BYTES = {"cpu": 4 << 20, "gpu": 64 << 20}
_FEWEST_VIEWS = 16
# A CPU reads tables the more often from its cache the more rows it takes in a run.
_ROW_RUNS, _ITEMS_PER_UNIT = (64, 32, 16), 8
# An item of a GPU has so many columns of images that are wide enough, with those of others between:
# see ``kernels/include/tomo/phase_table.h``.
_GPU_WIDE, _GPU_STEP, _GPU_BLOCKS = 512, 64, 4
# Slices that are worked on together, which bounds the scratch memory of any volume.
_SLAB = 16
# Bytes of a view's records, besides the order of its rows.
_VIEW_BYTES = 160


class PhaseProjector(ParallelProjector, Projector):
    """Line integrals of an image, or of every slice of a volume, along parallel rays.

    Args:
        grid: the grid of the image, (ny, nx), or of the volume, (nz, ny, nx).
        scan: angles and detector.
        footprint: the projection of a pixel onto the detector. ``strip``: the area that the pixel
            shares with the strip of rays that a bin collects. Every view then holds the whole mass,
            and ``fbp(A, A(x))`` of a uniform object is flat. ``joseph``: rays through the bins'
            centres interpolate linearly between the pixels of each row or column they cross
            (Joseph 1982); the result is flat to about 1 %, and worse where bins are wider than
            samples, since rays miss what lies between them. ``linear``: the pixel is spread by
            linear interpolation over the two bins about its centre (pixel-driven); where bins are
            finer than its shadow the hat widens to that shadow. Its projections of a uniform
            object ripple in views near 45 and 135 degrees, and ``fbp(A, A(x))`` varies by
            several per cent; reconstructions of measured data do not suffer.
        device: the device to use; the default device if not given.
        dtype: ``float32``, or ``float64`` where the device has it: for an adjoint that is matched
            to 1e-15 and for solvers that run far. Both types read one geometry, in which a step
            from row to row is exact to 2^-33 of a column: projections are off by 2e-9 (smooth
            images) to 6e-8 (white noise) at 512 x 512, in proportion to its edge. And both blend
            8 phases to a column, whose error, near 1 % on white noise, float64 leaves as it is.

    Raises:
        InputError: the footprint or the type is unknown.
        DeviceError: the device has no float64.
    """

    def __init__(
        self,
        grid: Grid,
        scan: Parallel,
        footprint: str = "strip",
        device: Device | None = None,
        dtype: DTypeLike = np.float32,
    ) -> None:
        super().__init__(grid, scan, device, dtype)
        self.footprint = check_footprint(footprint)
        lanes = self.device.traits.macros["LANES"]
        step, blocks = lanes, 32 // self.dtype.itemsize if lanes > 1 else 1
        if not self.device.traits.is_cpu and min(grid.shape[-2:]) >= _GPU_WIDE:
            step, blocks = _GPU_STEP, _GPU_BLOCKS
        self._segment, self._columns_of_item = step * blocks, lanes * blocks
        self._table_bytes = _TABLE_BYTES["cpu" if self.device.traits.is_cpu else "gpu"]
        self._precision = {"DOUBLE": int(self.dtype == np.float64)}
        self._macros = {"LOG2_PHASES": LOG2_PHASES, **self._precision}
        self._layout = {"BLOCKS": blocks, "STEP": step, **self._macros}

    @cached_property
    def _tables(self) -> tuple[PhaseTable, PhaseTable]:
        plane, scan = self.grid.slice(), self.scan
        by_rows, by_columns = (
            phase_table(plane, scan, self.footprint, along_x=along_x, segment=self._segment)
            for along_x in (True, False)
        )
        return by_rows, by_columns

    @cached_property
    def _walks(self) -> tuple[_Walk, _Walk]:
        by_rows, by_columns = self._tables
        return _Walk(self.device, by_rows, self.dtype), _Walk(self.device, by_columns, self.dtype)

    def of_scan(self, scan: Parallel) -> PhaseProjector:
        """The projector of another scan, with this one's grid, footprint, device and type."""
        return PhaseProjector(self.grid, scan, self.footprint, self.device, self.dtype)

    def _facts(self) -> list[str]:
        return [*super()._facts(), f"footprint {self.footprint}"]

    def _apply(self, x: DeviceArray, out: DeviceArray) -> None:
        for slab in self._slabs(x):
            for transpose, walk in enumerate(self._walks):
                if walk.count:
                    plane = self._split(walk, x, slab, transpose)
                    for run in self._runs(walk, slab):
                        self._project(walk, plane, out, slab, run)

    def _split(self, walk: _Walk, image: DeviceArray, slab: _Slab, transpose: int) -> DeviceArray:
        table, margin = walk.table, self._segment
        shape = (slab.slices, table.rows, table.width + 2 * margin)
        plane = self.device.zeros(shape, self.dtype)
        tiles = (*self._tiles(table.width, table.rows), slab.slices)
        self.device.launch(
            "plane_split",
            tiles,
            image=image,
            plane=plane,
            slice0=slab.first,
            rows=table.rows,
            width=table.width,
            margin=margin,
            TRANSPOSE=transpose,
            **self._precision,
        )
        return plane

    def _project(
        self, walk: _Walk, plane: DeviceArray, out: DeviceArray, slab: _Slab, run: _Run
    ) -> None:
        table, (first, count) = walk.table, run
        entries = self.device.empty((slab.slices, count, table.entries), self.dtype)
        items = table.columns // self._columns_of_item
        work = (count, items) if self.device.traits.is_cpu else (items, count)
        self.device.launch(
            "radon_project",
            (*work, slab.slices),
            table=entries,
            plane=plane,
            geometry=walk.geometry,
            orders=walk.orders,
            all_starts=walk.starts,
            views=walk.views,
            first=first,
            count=count,
            columns=table.columns,
            rows=table.rows,
            width=table.width,
            **self._layout,
        )
        bins = 64 if self.device.traits.is_cpu else 1
        self.device.launch(
            f"{walk.resample}_adjoint",
            (-(-self.scan.bins // bins), count, slab.slices),
            sinogram=out,
            table=entries,
            first=first,
            count=count,
            **self._resampled(walk, slab),
            BINS=bins,
        )

    def _apply_adjoint(self, y: DeviceArray, out: DeviceArray) -> None:
        for slab in self._slabs(out):
            planes = [self._backproject(walk, y, slab) for walk in self._walks]
            ny, nx = self.grid.shape[-2:]
            tiles = (*self._tiles(nx, ny), slab.slices)
            by_rows, by_columns = self._walks
            self.device.launch(
                "plane_merge",
                tiles,
                by_rows=planes[0],
                by_columns=planes[1],
                image=out,
                slice0=slab.first,
                ny=ny,
                nx=nx,
                row_pitch=by_rows.table.padded,
                column_pitch=by_columns.table.padded,
                **self._precision,
            )

    def _backproject(self, walk: _Walk, y: DeviceArray, slab: _Slab) -> DeviceArray:
        table = walk.table
        shape = (slab.slices, table.rows, table.padded)
        plane = (self.device.empty if walk.count else self.device.zeros)(shape, self.dtype)
        rows = self._row_run(slab.slices, table)
        for first, count in self._runs(walk, slab):
            entries = self.device.empty((slab.slices, count, table.entries), self.dtype)
            self.device.launch(
                walk.resample,
                (table.columns // self.device.traits.macros["LANES"], count, slab.slices),
                sinogram=y,
                table=entries,
                first=first,
                count=count,
                **self._resampled(walk, slab),
            )
            self.device.launch(
                "radon_backproject",
                (table.padded // self._columns_of_item, -(-table.rows // rows), slab.slices),
                table=entries,
                plane=plane,
                geometry=walk.geometry,
                first=first,
                count=count,
                columns=table.columns,
                rows=table.rows,
                width=table.padded,
                add=first > 0,
                ROWS=rows,
                **self._layout,
            )
        return plane

    def _resampled(self, walk: _Walk, slab: _Slab) -> dict[str, DeviceArray | int]:
        """What resampling views to a phase table and its transpose are told alike."""
        return {
            "geometry": walk.geometry,
            "footprints": walk.footprints,
            "views": walk.views,
            "slice0": slab.first,
            "slices": slab.total,
            "bins": self.scan.bins,
            "columns": walk.table.columns,
            **self._macros,
            **({} if walk.by_edges else {"STRIP": int(self.footprint == "strip")}),
        }

    def _row_run(self, slices: int, table: PhaseTable) -> int:
        """Rows that one work-item backprojects onto: many, but work for every compute unit."""
        traits = self.device.traits
        if not traits.is_cpu:
            return 1
        runs = table.padded // self._segment * slices
        wanted = -(-_ITEMS_PER_UNIT * traits.compute_units // runs)
        return next((n for n in _ROW_RUNS if n * wanted <= table.rows), _ROW_RUNS[-1])

    def _tiles(self, width: int, rows: int) -> tuple[int, int]:
        tile = 16 if self.device.traits.is_cpu else 1
        return -(-width // tile), -(-rows // tile)

    def _runs(self, walk: _Walk, slab: _Slab) -> Iterator[_Run]:
        """Runs of views whose tables fit the table memory, but no fewer than a cache's worth.

        No table is larger than the device's largest buffer, however.
        """
        each = self.dtype.itemsize * walk.table.entries * slab.slices
        most = max(_FEWEST_VIEWS, self._table_bytes // each)
        most = max(1, min(most, self.device.traits.allocation // each))
        for first in range(0, walk.count, most):
            yield _Run(first, min(most, walk.count - first))

    def _slabs(self, image: DeviceArray) -> Iterator[_Slab]:
        """Slices that are worked on together, as many as bounded scratch and one buffer hold."""
        total = image.shape[0] if len(image.shape) == 3 else 1
        # One view's table is the other array of a slab that a buffer must hold.
        largest = max(*self._planes, *(table.entries for table in self._tables))
        fitting = self.device.traits.allocation // (self.dtype.itemsize * largest)
        most = max(1, min(_SLAB, fitting))
        for first in range(0, total, most):
            yield _Slab(first, min(most, total - first), total)

    @property
    def _planes(self) -> list[int]:
        """Numbers of a slice's padded planes, by rows and by columns."""
        return [table.rows * (table.width + 2 * self._segment) for table in self._tables]

    @property
    def scratch(self) -> int:
        """Bytes needed besides the arrays that go in and come out."""
        slices = min(_SLAB, self.grid.slices)
        tables = max(table.entries for table in self._tables) * _FEWEST_VIEWS
        records = sum(table.nbytes for table in self._tables)
        numbers = slices * (sum(self._planes) + tables)
        return self.dtype.itemsize * numbers + self._table_bytes + records

    @property
    def largest_scratch(self) -> int:
        """Bytes of the larger plane, or of the orders of rows."""
        planes = self.dtype.itemsize * max(self._planes)
        return max(planes, *(table.orders.nbytes for table in self._tables))

    def _chunks(self, budget: int) -> Iterable[Chunk]:
        try:
            return self.chunks(budget)
        except ResourceLimitError:
            rows, views = self._cut(budget, image_first=False)
            return self._parts([_Cut(band, run) for run in views for band in rows])

    def _adjoint_chunks(self, budget: int) -> Iterable[Chunk]:
        try:
            return [chunk.transposed for chunk in self.chunks(budget)]
        except ResourceLimitError:
            rows, views = self._cut(budget, image_first=True)
            parts = self._parts([_Cut(band, run) for band in rows for run in views])
            return (chunk.transposed for chunk in parts)

    def _parts(self, cuts: list[_Cut]) -> Iterator[Chunk]:
        """Parts of every slice; their tables are there while they are worked on."""
        stack = len(self.grid.shape) == 3
        for k in range(self.grid.slices):
            alone = (slice(k, k + 1),) if stack else ()
            for rows, views in cuts:
                yield Chunk((*alone, rows), (views, *alone), self._part(rows, views))

    def _part(self, rows: slice, views: slice) -> PhaseProjector:
        """The projector of a band of a slice and a run of views, with the numbers of the whole."""
        plane, scan, one = self.grid.slice(), self.scan, self.grid.shape[:-2] and (1,)
        (ny, nx), spacing = plane.shape, plane.spacing
        middle = plane.center[0] + ((rows.start + rows.stop) - ny) / 2 * spacing[0]
        between = self.grid.spacing[:-2], self.grid.center[:-2]
        grid = Grid(
            (*one, rows.stop - rows.start, nx),
            (*between[0], *spacing),
            (*between[1], middle, plane.center[1]),
        )
        seen = scan.subset(np.arange(views.start, views.stop))
        part = PhaseProjector(grid, seen, self.footprint, self.device, self.dtype)
        part._table_bytes = 0
        part._segment, part._columns_of_item = self._segment, self._columns_of_item
        part._layout = self._layout
        by_rows, by_columns = self._tables
        part._tables = (
            by_rows.part(views, rows, slice(0, nx), self._segment),
            by_columns.part(views, slice(0, nx), rows, self._segment),
        )
        return part

    def _cut(self, budget: int, *, image_first: bool) -> tuple[list[slice], list[slice]]:
        """Bands of rows and runs of views of which any two fit, one or the other cut first.

        Raises:
            ResourceLimitError: not even the least of them do.
        """
        rows, segment = self.grid.shape[-2], self._segment
        bands, views = -(-rows // segment), len(self.scan.angles)
        largest = self.device.traits.allocation

        def fits(bands: int, views: int) -> bool:
            need, array = self._part_need(min(bands * segment, rows), views)
            return need <= budget and array <= largest

        if image_first:
            bands, views = largest_pair(fits, bands, views)
        else:
            views, bands = largest_pair(lambda views, bands: fits(bands, views), views, bands)
        need, array = self._part_need(min(bands * segment, rows), views)
        what = f"part of a slice ({min(bands * segment, rows)} rows in {views} views)"
        plan_chunks(1, need, 0, budget, what=what, array=array, largest=largest)
        starts = cut_evenly(-(-rows // segment), bands)
        cut = [slice(segment * at.start, min(segment * at.stop, rows)) for at in starts]
        return cut, cut_evenly(len(self.scan.angles), views)

    def _part_need(self, rows: int, views: int) -> tuple[int, int]:
        """Bytes that a part of a slice takes, and those of its largest array."""
        width, segment, each = self.grid.shape[-1], self._segment, self.dtype.itemsize
        padded = -(-rows // segment) * segment
        planes = rows * (width + 2 * segment), width * (padded + 2 * segment)
        table = each * max(table.entries for table in self._tables)
        tables = table * min(views, _FEWEST_VIEWS)
        orders = 4 * max(rows, width) * views
        arrays = [each * n for n in (rows * width, views * self.scan.bins, *planes)]
        need = sum(arrays) + tables + orders + views * _VIEW_BYTES
        return need, max(*arrays, orders, table)


class _Walk:
    """A phase table and the device's copy of its records."""

    def __init__(self, device: Device, table: PhaseTable, dtype: np.dtype[Any]) -> None:
        self.table = table
        self.count = len(table.views)
        self.by_edges = table.footprints.by_edges
        self.resample = "radon_resample_edges" if self.by_edges else "radon_resample"
        self.views = device.array(table.views)
        self.geometry = device.array(table.geometry)
        self.footprints = device.array(table.footprints.records, dtype)
        self.orders = device.array(table.orders)
        self.starts = device.array(table.starts)


class _Cut(NamedTuple):
    """A part of a slice: rows of the image, and views."""

    rows: slice
    views: slice


class _Slab(NamedTuple):
    """Slices that are worked on together: ``slices`` of ``total``, from ``first``."""

    first: int
    slices: int
    total: int


class _Run(NamedTuple):
    """Views whose tables exist at the same time."""

    first: int
    views: int
