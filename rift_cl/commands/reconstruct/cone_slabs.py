"""A cone-beam volume in slabs of slices, each from the detector rows that it is seen in.

Slabs overlap in the rows that they need, by more where the cone is wider, so that one process that
has room for all rows makes all slices at once. Workers of a cluster, and whoever goes on with what
they left, make them slab by slab, to the same bits.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Iterator
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from rift_cl.commands.pictures.evenly_spaced import evenly
from rift_cl.geometry import Cone
from rift_cl.geometry.seen_grid import rows_seen
from rift_cl.reconstruct import Attenuation, Katsevich

if TYPE_CHECKING:
    from rift_cl.commands.reconstruct.cone_input import ConeInput
    from rift_cl.commands.reconstruct.cone_job import Formula

Floats = NDArray[np.float32]
# Rows that tell whether the object reaches beyond a side of the detector.
_LOOKED_AT = 16


class ConeSlabs:
    """Makes slabs of a volume by a formula.

    Args:
        source: the scan, about its axis.
        formula: that of the whole volume.
    """

    def __init__(self, source: ConeInput, formula: Formula) -> None:
        self._source, self._formula = source, formula
        self._rows = source.scan.shape[1]

    @property
    def block(self) -> int:
        """Slices that slabs are not cut between."""
        return self._formula.block

    def read(self, slab: slice) -> Attenuation:
        """Line integrals of the rows that a slab is seen in.

        What was mended in rows that several slabs are seen in counts for one of them.
        """
        first, stop = self._rows_of(slab)
        own = max(first, self._seam(slab.start)), min(stop, self._seam(slab.stop))
        clean, none = self._source.clean, np.zeros(0, np.int64)
        found = Attenuation(np.empty(0, np.float32), none, none)
        pieces = []
        for piece in ((first, own[0]), own, (own[1], stop)):
            if piece[0] >= piece[1]:
                continue
            before, read = clean.zingers, self._source.read(*piece)
            pieces.append(read.projections)
            if piece == own:
                found = read
            else:
                clean.zingers = before
        return dataclasses.replace(found, projections=np.concatenate(pieces, axis=1))

    def made(self, slab: slice, projections: Floats) -> Iterator[tuple[int, Floats]]:
        """The slices of a slab, in parts that find room: the first one's number, and the part.

        Args:
            slab: slices, counted from the first that is wanted, cut between blocks.
            projections: line integrals of the rows that it is seen in.
        """
        budget, first = self._source.part_budget or self._source.device.budget, slab.start
        given = (slab.start, slab.stop), self._rows_of(slab)
        for part in self._formula.slabs(projections, budget, *given):
            yield first, part
            first += len(part)

    def few_rows(self) -> Floats:
        """Line integrals of a few rows of all, (angle, row, bin)."""
        rows = evenly(self._rows, min(self._rows, _LOOKED_AT))
        return np.concatenate([self._source.read(n, n + 1).projections for n in rows], axis=1)

    def _rows_of(self, slab: slice) -> tuple[int, int]:
        """The first row that a slab is seen in, and the one after the last."""
        if isinstance(self._formula, Katsevich):
            # Curves of its filter go through all rows.
            return 0, self._rows
        window = self._source.window
        first = window.slices[0]
        part = dataclasses.replace(window, slices=(first + slab.start, first + slab.stop))
        return rows_seen(self._source.geometry, part.grid)

    def _seam(self, number: int) -> int:
        """The row from which on rows count for the slab that begins with a slice.

        That in which the axis is seen at the slice's lower end; where views differ, or are placed
        by vectors, all rows count for the first slab.
        """
        scan, grid = self._source.geometry, self._source.grid
        if number == 0:
            return 0
        if number == grid.shape[0] or not isinstance(scan, Cone) or not scan.circular:
            return self._rows
        height = grid.center[0] + (number - grid.shape[0] / 2) * grid.spacing[0] - scan.heights[0]
        row = scan.center[0] + float(height) * scan.magnification / scan.pitch[0]
        return min(max(round(row), 0), self._rows)
