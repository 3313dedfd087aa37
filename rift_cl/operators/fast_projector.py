"""The X-ray transform of a parallel scan by the Fourier slice theorem, with an error that is named.

The transform of a view is the image's spectrum along a ray (R. N. Bracewell, Australian J. Physics
9, 198, 1956). So a projection is a transform of the padded image, a reading of its rays between the
grid's points, and a transform of each ray; backprojection is the same steps transposed, in reverse,
with the same numbers. That costs N^2 log N for the transforms and a constant for each sample of a
view, where every pixel of every view costs ``Projector`` something.

``rift_cl/reference/band_limited.py`` has the matrix that this approximates.
"""

from __future__ import annotations

from functools import cached_property
from typing import Any

import numpy as np

from rift_cl.cl.device import Device
from rift_cl.errors import InputError
from rift_cl.geometry import Grid, Parallel
from rift_cl.geometry.numbers import one_number
from rift_cl.operators.gridding import LOG2_ROWS, choose
from rift_cl.operators.padded_spectrum import PaddedSpectrum, in_steps
from rift_cl.operators.parallel_projector import ParallelProjector
from rift_cl.operators.ray_geometry import IMAGE, rays
from rift_cl.operators.ray_tables import RayTables

_MOST_LOBES = 8


class FastProjector(ParallelProjector):
    """Line integrals of an image, or of every slice of a volume, with an error that is named.

    It approximates the transform with the footprint ``linear`` of ``Projector``, which reads views
    by straight lines from bin to bin. The spectrum of such lines never ends: it is that of the
    bins, repeated, under sinc^2. Here it ends where the image has no more to show:
    along either axis at 0.55 cycles per sample of the image, of which 1/2 can be told apart, or at
    0.71 as far as that lies below the detector's own Nyquist frequency. What lies beyond would fold
    back into the image. By that the two projectors differ on sharp data; reconstructions are as
    good.

    Args:
        grid: where the image lives, (ny, nx) or (nz, ny, nx).
        scan: how it is looked at.
        error: what the result may differ by from that transform's, the norm of the difference
            over the norm of the result: for data as rough as white noise or smoother, on a detector
            that sees the image. Rougher data (a checkerboard, a lone corner pixel) may differ by a
            little more, and float32 rounds at 1e-6.
        lobes: ``image``, or how many lobes of sinc^2 are kept, folded or not. 0: nothing
            beyond the detector's Nyquist frequency; edges ring. 3: the same values as with
            straight lines, as far as phase tables give those.
        device: where to work; the default device if not given.

    Bins of which the hats lie further than eight bins from the image's shadow are taken for zero.

    Raises:
        InputError: the error is smaller than this method allows, or bins are very much finer than
            samples.
    """

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
        self._columns = in_steps(-(-len(scan.angles) // 2))
        self._spectrum = PaddedSpectrum(
            self.device, grid.slice(), scan, self.gridding, found.length
        )

    def prepare(self) -> None:
        """Make the tables now, which is otherwise left to the first application."""
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

    @cached_property
    def _tables(self) -> RayTables:
        return RayTables(self.device, self._rays, self.gridding, self._columns)

    def _apply(self, x: Any, out: Any) -> None:
        for k in range(x.shape[0] if len(x.shape) == 3 else 1):
            grid = self._spectrum.of(x, k)
            values = self._read(grid)
            del grid
            self._views_of(values, out, k)

    def _apply_adjoint(self, y: Any, out: Any) -> None:
        for k in range(out.shape[0] if len(out.shape) == 3 else 1):
            values = self._rays_of(y, k)
            grid = self._spread(values)
            del values
            self._spectrum.crop(grid, out, k)

    def _rays_of(self, views: Any, k: int) -> Any:
        """Transforms of the views of slice k, as rays (2, n, samples)."""
        found, tables, device = self._rays, self._tables, self.device
        count, length, columns = len(found.order), found.length, self._columns
        fields, spare = self._planes(length, columns)
        arguments = self._view_arguments(views, k)
        size = (*self._blocks(columns, length), 2)
        device.launch("rays_pack", size, views, fields, *arguments, RUN=self._run)
        fields, spare = tables.views(fields, spare)
        values = device.empty((2, count, self._samples))
        size = (*self._blocks(columns, self._samples), 2)
        sizes = (count, self._samples, length, columns)
        arrays = (fields, values, *tables.factors, tables.ends)
        device.launch("rays_weigh", size, *arrays, *sizes, RUN=self._run)
        return values

    def _views_of(self, values: Any, views: Any, k: int) -> None:
        """The transpose of ``_rays_of``."""
        found, tables, device = self._rays, self._tables, self.device
        count, length, columns = len(found.order), found.length, self._columns
        fields, spare = self._planes(length, columns)
        blocks = self._blocks(columns, length // 2 + 1)
        sizes = (count, self._samples, length, columns)
        factors = tables.factors
        device.launch("rays_unweigh", blocks, values, fields, *factors, *sizes, RUN=self._run)
        fields, spare = tables.views(fields, spare, inverse=True)
        size = (*self._blocks(columns, found.window), 2)
        arguments = self._view_arguments(views, k)
        device.launch("rays_unpack", size, fields, views, *arguments, RUN=self._run)

    def _view_arguments(self, views: Any, k: int) -> tuple[Any, ...]:
        found, tables = self._rays, self._tables
        slices = views.shape[1] if len(views.shape) == 3 else 1
        sizes = (len(found.order), k, slices, self.scan.bins)
        return (tables.order, tables.starts, *sizes, found.window, found.length, self._columns)

    def _spread(self, values: Any) -> Any:
        """Rays to the grid of frequencies, (2, rows, columns)."""
        tables, (rows, edge) = self._tables, self.gridding.edges
        grid = self.device.empty((2, rows, self._spectrum.across))
        tiles = len(tables.tiles) - 1
        self.device.launch(
            "rays_spread",
            (tiles,),
            *(values, grid, tables.kernel, tables.steps, tables.inverses, tables.ends),
            *(tables.visits, tables.tiles, *values.shape[1:], tiles),
            *(-(-(edge // 2 + 1) // tables.tile), rows, self._spectrum.across),
            **self._macros,
            TILE=tables.tile,
        )
        return grid

    def _read(self, grid: Any) -> Any:
        """The transpose of ``_spread``."""
        tables, (rows, edge) = self._tables, self.gridding.edges
        values = self.device.empty((2, len(self._rays.order), self._samples))
        count, samples = values.shape[1:]
        width = self.gridding.width
        self.device.launch(
            "spectrum_mirror", (rows, 2 * width), grid, rows, self._spectrum.across, edge
        )
        cpu = self.device.traits.is_cpu
        run = 64 if cpu else 1
        arguments = (grid, values, tables.kernel, tables.steps, tables.ends)
        sizes = (count, samples, rows, self._spectrum.across, edge)
        runs = -(-samples // run)
        size = (count, runs) if cpu else (runs, count)
        self.device.launch("rays_read", size, *arguments, *sizes, RUN=run, **self._macros)
        return values

    def _planes(self, rows: int, columns: int) -> tuple[Any, Any]:
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
        found = self._rays
        values = 2 * len(found.order) * self._samples
        fields = 2 * found.length * self._columns
        grid, transform = self._spectrum.entries, self._spectrum.scratch_entries
        most = max(2 * fields + values, values + grid, transform)
        return 4 * most + self._tables.nbytes + self._spectrum.nbytes
