"""The X-ray transform of a parallel scan by the Fourier slice theorem, to a given error.

The transform of a view is the image's spectrum along a ray (R. N. Bracewell, Australian J. Physics
9, 198, 1956). So a projection is a transform of the padded image, a reading of its rays between the
grid's points, and a transform of each ray; backprojection is the same steps transposed, in reverse,
with the same numbers. That costs N^2 log N for the transforms and a constant for each sample of a
view, where every pixel of every view costs ``Projector`` something.

``rift_cl/reference/band_limited.py`` has the matrix that this approximates.
"""

from __future__ import annotations

import math
from functools import cached_property, partial
from typing import Any

import numpy as np

from rift_cl.cl.array import DeviceArray
from rift_cl.cl.budget import check_array
from rift_cl.cl.device import Device
from rift_cl.errors import InputError
from rift_cl.geometry import Grid, Parallel
from rift_cl.geometry.numbers import one_number
from rift_cl.operators.fourier.block_transform import BLOCK, BlockTransform
from rift_cl.operators.fourier.column_transform import ColumnTransform
from rift_cl.operators.fourier.gridding import LOG2_ROWS, Gridding, choose
from rift_cl.operators.fourier.padded_spectrum import PaddedSpectrum, in_steps
from rift_cl.operators.projector.parallel.parallel_projector import ParallelProjector
from rift_cl.operators.projector.parallel.ray_geometry import (
    IMAGE,
    Rays,
    fixed_steps,
    inverse_steps,
    rays,
    tile_visits,
)

_TILE = {"cpu": 48, "gpu": 4}


class RayTables:
    """Rays, gridding kernel and tiles, on the device.

    Args:
        device: where to keep them.
        rays: of the scan.
        gridding: the kernel.
        columns: that pairs of views are laid out in.
        samples: of a ray, with those behind the last that is kept.
    """

    def __init__(
        self,
        device: Device,
        rays: Rays,
        gridding: Gridding,
        columns: int,
        samples: int,
    ) -> None:
        self.tile = _TILE["cpu" if device.traits.is_cpu else "gpu"]
        steps = fixed_steps(rays, gridding.edges)
        visits, tiles = tile_visits(steps, rays.ends, gridding.edges, gridding.width, self.tile)
        self.order, self.starts = device.array(rays.order), device.array(rays.starts)
        self.ends = device.array(rays.ends)
        padding = (0, 2 * columns - len(rays.order))
        self.factors = {
            "turns": device.array(np.pad(rays.turns, padding)),
            "shadows": device.array(np.pad(rays.shadows, ((0, 0), padding))),
            "signs": device.array(np.pad(rays.signs, padding)),
            "bins": device.array(np.sinc(np.arange(samples) / rays.length)),
        }
        self.steps, self.inverses = device.array(steps), device.array(inverse_steps(steps))
        self.visits, self.tiles = device.array(visits), device.array(tiles)
        self.kernel = device.array(gridding.table())
        self.views = ColumnTransform(device, rays.length)
        cpu = device.traits.is_cpu
        self.blocks = BlockTransform(device, rays.length) if cpu else None

    @property
    def nbytes(self) -> int:
        """Bytes of the device that these take."""
        arrays: list[DeviceArray] = [
            self.order,
            self.starts,
            self.ends,
            *self.factors.values(),
            self.steps,
            self.inverses,
        ]
        arrays += [self.visits, self.tiles, self.kernel]
        blocks = 0 if self.blocks is None else self.blocks.nbytes
        return sum(int(array.nbytes) for array in arrays) + self.views.nbytes + blocks


_MOST_LOBES = 8
# Slices that a CPU spreads at once (kernels/fourier/rays_spread_stack_cpu.cl), and the bytes of
# rays and grids that they may take.
_TOGETHER, _TOGETHER_BYTES = 4, 512 << 20


class FastProjector(ParallelProjector):
    """Line integrals of an image, or of every slice of a volume, to a given relative error.

    It approximates the transform with the footprint ``strip`` of ``Projector``, which counts the
    area that pixel and bin share. The spectrum of that never ends: that of the bins, repeated,
    under the sinc of the bin and those of the pixel's two edges. Here it ends where the image has
    no more to show: along either axis at 0.55 cycles per sample of the image, of which 1/2 can be
    told apart (0.71 where bins are finer than samples), or at 0.85 as far as that lies below the
    detector's own Nyquist frequency. What lies beyond would fold back into the image. By that the
    two projectors differ on sharp data; reconstructions are as good.

    Args:
        grid: the grid of the image, (ny, nx), or of the volume, (nz, ny, nx).
        scan: angles and detector.
        error: largest difference from that transform, the norm of the difference over the norm of
            the result: for data as rough as white noise or smoother, on a detector that covers the
            image. Rougher data (a checkerboard, a single corner pixel) may differ by a little more,
            and float32 rounds at 1e-6.
        lobes: ``image``, or how many lobes of the bin's sinc are kept, folded or not. 0: nothing
            beyond the detector's Nyquist frequency; edges ring. 3: nearly the values that
            phase tables give.
        device: the device to use; the default device if not given.

    Bins farther from the image's shadow than a pixel's shadow and eight bins are set to zero.

    Raises:
        InputError: the error is smaller than this method allows, or bins are very much finer than
            samples.
    """

    _instead = "FastProjector cannot take a slice in parts, rift.Projector can"

    def __init__(
        self,
        grid: Grid,
        scan: Parallel,
        error: float = 1e-3,
        *,
        lobes: int | str = IMAGE,
        device: Device | None = None,
    ) -> None:
        if not 0 < one_number(error) <= 0.1:
            raise InputError(f"error is {error!r}, wanted a number from 1e-6 to 0.1")
        if lobes != IMAGE and one_number(lobes) not in range(_MOST_LOBES + 1):
            raise InputError(
                f"lobes is {lobes!r}, wanted a whole number from 0 to {_MOST_LOBES}, or {IMAGE!r}"
            )
        super().__init__(grid, scan, device)
        self.error, self.lobes = float(error), IMAGE if lobes == IMAGE else int(lobes)
        self._rays = found = rays(grid.slice(), scan, lobes)
        self._samples = in_steps(int(found.ends.max()))
        spread = int(found.ends.sum())
        self.gridding = choose((grid.shape[-2], grid.shape[-1]), spread, float(error))
        self._columns = BLOCK * -(-len(scan.angles) // (2 * BLOCK))
        self._spectrum = PaddedSpectrum(
            self.device, grid.slice(), scan, self.gridding, found.length
        )
        self._together = min(self._slices_together(), grid.slices)

    def prepare(self) -> None:
        """Build the tables now instead of at the first application."""
        _ = self._tables.nbytes

    @property
    def samples(self) -> tuple[int, ...]:
        """Samples that are kept of each view's transform, zero frequency included."""
        kept = np.empty_like(self._rays.ends)
        kept[self._rays.order] = self._rays.ends
        return tuple(kept.tolist())

    @property
    def period(self) -> int:
        """Bins after which a view's continuation repeats itself."""
        return self._rays.length

    def of_scan(self, scan: Parallel) -> FastProjector:
        """The projector of another scan, with this one's grid, error, lobes and device."""
        return FastProjector(self.grid, scan, self.error, lobes=self.lobes, device=self.device)

    def __reduce__(self) -> tuple[Any, ...]:
        make = partial(FastProjector, lobes=self.lobes, device=self.device)
        return make, (self.grid, self.scan, self.error)

    def _facts(self) -> list[str]:
        return [*super()._facts(), f"error {self.error:g}", f"lobes {self.lobes}"]

    @cached_property
    def _tables(self) -> RayTables:
        # Before any of them is made; how much memory there is tells ``chunks``.
        largest, what = self.device.traits.allocation, "an array of one slice"
        check_array(4 * self._largest, largest, what=what, instead=self._instead)
        return RayTables(self.device, self._rays, self.gridding, self._columns, self._samples)

    def _apply(self, x: DeviceArray, out: DeviceArray) -> None:
        for k in range(x.shape[0] if len(x.shape) == 3 else 1):
            grid = self._spectrum.of(x, k)
            values = self._read(grid)
            del grid
            self._views_of(values, out, k)

    def _apply_adjoint(self, y: DeviceArray, out: DeviceArray) -> None:
        slices = out.shape[0] if len(out.shape) == 3 else 1
        for first in range(0, slices, self._together):
            run = range(first, min(first + self._together, slices))
            values = [self._rays_of(y, k) for k in run]
            grids = self._spread(values)
            del values
            for k in run:
                self._spectrum.crop(grids.pop(0), out, k)

    def _rays_of(self, views: DeviceArray, k: int) -> DeviceArray:
        """Transforms of the views of slice k, as rays (2, n, samples)."""
        found, tables, device = self._rays, self._tables, self.device
        count, length, columns = len(found.order), found.length, self._columns
        values = device.empty((2, count, self._samples))
        if tables.blocks is not None:
            tables.blocks.launch(
                "rays_of_views_cpu",
                columns,
                views=views,
                rays=values,
                **self._places(views, k),
                offsets=tables.factors["turns"],
                shadows=tables.factors["shadows"],
                signs=tables.factors["signs"],
                bin_response=tables.factors["bins"],
                ends=tables.ends,
                count=count,
                samples=self._samples,
            )
            return values
        fields, spare = self._planes(length, columns)
        device.launch(
            "rays_pack_gpu",
            (*self._blocks(columns, length), 2),
            views=views,
            fields=fields,
            **self._places(views, k),
            rays=count,
            length=length,
        )
        fields, spare = tables.views(fields, spare)
        device.launch(
            "rays_weigh_gpu",
            (*self._blocks(columns, self._samples), 2),
            fields=fields,
            rays=values,
            **tables.factors,
            ends=tables.ends,
            count=count,
            samples=self._samples,
            length=length,
            columns=columns,
        )
        return values

    def _views_of(self, values: DeviceArray, views: DeviceArray, k: int) -> None:
        """The transpose of ``_rays_of``."""
        found, tables, device = self._rays, self._tables, self.device
        count, length, columns = len(found.order), found.length, self._columns
        fields, spare = self._planes(length, columns)
        device.launch(
            "rays_unweigh",
            self._blocks(columns, length // 2 + 1),
            rays=values,
            fields=fields,
            **tables.factors,
            count=count,
            samples=self._samples,
            length=length,
            columns=columns,
            RUN=self._run,
        )
        fields, spare = tables.views(fields, spare, inverse=True)
        device.launch(
            "rays_unpack",
            (*self._blocks(columns, found.window), 2),
            fields=fields,
            views=views,
            **self._places(views, k),
            rays=count,
            length=length,
            RUN=self._run,
        )

    def _places(self, views: DeviceArray, k: int) -> dict[str, DeviceArray | int]:
        """Where the rays of slice k are among the views, and where they are laid out."""
        return {
            "order": self._tables.order,
            "starts": self._tables.starts,
            "slice": k,
            "slices": views.shape[1] if len(views.shape) == 3 else 1,
            "bins": self.scan.bins,
            "window": self._rays.window,
            "columns": self._columns,
        }

    def _spread(self, values: list[DeviceArray]) -> list[DeviceArray]:
        """Rays of some slices to grids of frequencies, as ``crop`` takes them."""
        tables, (rows, edge) = self._tables, self.gridding.edges
        across, tiles = self._spectrum.across, len(tables.tiles) - 1
        grids = [self._spectrum.empty_grid() for _ in values]
        macros = {**self._macros, "TILE": tables.tile}
        kernel, slices = "rays_spread", {"rays": values[0], "grid": grids[0]}
        if len(values) > 1:
            kernel, macros["SLICES"] = "rays_spread_stack_cpu", len(values)
            spare = _TOGETHER - len(values)
            rays, cells = [*values, *values[:1] * spare], [*grids, *grids[:1] * spare]
            slices = {f"rays{i}": array for i, array in enumerate(rays)}
            slices |= {f"grid{i}": array for i, array in enumerate(cells)}
        self.device.launch(
            kernel,
            (tiles,),
            **slices,
            table=tables.kernel,
            steps=tables.steps,
            inverses=tables.inverses,
            ends=tables.ends,
            visits=tables.visits,
            starts=tables.tiles,
            count=values[0].shape[1],
            samples=values[0].shape[2],
            tiles=tiles,
            across=-(-(edge // 2 + 1) // tables.tile),
            width=self._spectrum.width,
            rows=rows,
            columns=across,
            **macros,
        )
        return grids

    def _read(self, grid: DeviceArray) -> DeviceArray:
        """The transpose of ``_spread``."""
        tables, (rows, edge) = self._tables, self.gridding.edges
        values = self.device.empty((2, len(self._rays.order), self._samples))
        count, samples = values.shape[1:]
        width = self.gridding.width
        sizes = {"rows": rows, "columns": self._spectrum.across, "edge": edge}
        self.device.launch("spectrum_mirror", (rows, 2 * width), grid=grid, **sizes)
        cpu = self.device.traits.is_cpu
        run = 64 if cpu else 1
        runs = -(-samples // run)
        self.device.launch(
            "rays_read",
            (count, runs) if cpu else (runs, count),
            grid=grid,
            rays=values,
            table=tables.kernel,
            steps=tables.steps,
            ends=tables.ends,
            count=count,
            samples=samples,
            **sizes,
            RUN=run,
            **self._macros,
        )
        return values

    def _planes(self, rows: int, columns: int) -> tuple[DeviceArray, DeviceArray]:
        shape = (2, rows, columns)
        return self.device.empty(shape), self.device.empty(shape)

    @property
    def _macros(self) -> dict[str, int]:
        return {"WIDTH": self.gridding.width, "LOG2_ROWS": LOG2_ROWS}

    @property
    def _run(self) -> int:
        """Rows of a block of columns that a work-item goes through."""
        return 256 if self.device.traits.is_cpu else 1

    def _blocks(self, columns: int, rows: int) -> tuple[int, int]:
        return columns // self.device.traits.macros["LANES"], -(-rows // self._run)

    @property
    def scratch(self) -> int:
        """Bytes needed besides the arrays that go in and come out."""
        return self._working + self._tables.nbytes + self._spectrum.nbytes

    @property
    def _working(self) -> int:
        """Bytes of scratch memory besides what is kept."""
        found = self._rays
        fields = 2 * found.length * self._columns
        grid, transform = self._spectrum.entries, self._spectrum.scratch_entries
        more = self._together - 1
        spreading = self._together * (self._ray_entries + grid)
        transforming = more * max(self._ray_entries, grid) + max(
            2 * fields + self._ray_entries, transform
        )
        return 4 * max(spreading, transforming)

    @property
    def fits(self) -> bool:
        """Whether a slice fits the device now, told before any table is made."""
        cpu = self.device.traits.is_cpu
        blocks = BlockTransform(self.device, self.period).nbytes if cpu else 0
        need = self._working + 4 * sum(self._slice) + self._spectrum.nbytes + blocks
        return need <= self.device.budget and 4 * self._largest <= self.device.traits.allocation

    @property
    def _slice(self) -> tuple[int, int]:
        """Numbers of a slice, and of its views."""
        return math.prod(self.grid.shape[-2:]), len(self.scan.angles) * self.scan.bins

    @property
    def _largest(self) -> int:
        """Numbers of the largest array that a slice takes."""
        edge = self.gridding.edges[1]
        fields = 2 * max(self.period * self._columns, edge * self._spectrum.pairs)
        return max(*self._slice, fields, self._ray_entries, self._spectrum.entries)

    @property
    def _ray_entries(self) -> int:
        """Numbers of a slice's rays."""
        return 2 * len(self._rays.order) * self._samples

    def _slices_together(self) -> int:
        """How many slices are spread at once, which no result depends on."""
        each = 4 * (self._ray_entries + self._spectrum.entries)
        most = min(_TOGETHER_BYTES, self.device.budget // 4)
        return _TOGETHER if self.device.traits.is_cpu and _TOGETHER * each <= most else 1
