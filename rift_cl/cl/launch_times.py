"""Keeping launches short where the system ends long ones: by the measured time of a work-item.

Windows and macOS take a GPU away from a program that keeps it busy for two seconds. There a launch
is cut along its longest axis into pieces that take a part of that time, as far as the last pieces
of the same kernel tell. Results have the same bits, however it is cut. Measuring means waiting for
the device, so that only pieces are measured that are not known to be short.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Hashable
from math import prod

from rift_cl.cl.grid_parts import GridPart

# Parts of the longest time: what a piece shall take, and what is too short to be measured again.
_AIM, _SHORT = 1 / 4, 1 / 32
# The first piece of a kernel that was never measured is such a part of a launch, and no piece is
# more than so many times the one before.
_FIRST, _GROWTH = 1 / 256, 4


class LaunchTimes:
    """How long a work-item of each kernel took when it was last measured.

    Args:
        seconds: longest time that a launch may take.
        finish: waits until the device has done everything that was enqueued.
        clock: seconds, from any time on.
    """

    def __init__(
        self,
        seconds: float,
        finish: Callable[[], None],
        clock: Callable[[], float] = time.perf_counter,
    ) -> None:
        self._seconds, self._finish, self._clock = seconds, finish, clock
        self._rates: dict[Hashable, float] = {}

    def launch(
        self, work: Hashable, grid: GridPart, group: int, start: Callable[[GridPart], None]
    ) -> None:
        """Launch a grid in pieces, none of which takes too long.

        Args:
            work: what is launched; work-items of equal work take about the same time.
            grid: the work-items.
            group: work-items of a group, along the first axis.
            start: launches a piece.
        """
        units = [grid.size[0] // group, *grid.size[1:]]
        count = max(units)
        axis = units.index(count)
        items, unit = prod(grid.size) // count, group if axis == 0 else 1
        done, step = 0, 0
        while done < count:
            rate = self._rates.get(work)
            step = min(self._step(rate, items, count, step), count - done)
            piece = _piece(grid, axis, done * unit, step * unit)
            if rate is None or rate * items * step > _SHORT * self._seconds:
                self._rates[work] = self._measured(start, piece) / (items * step)
            else:
                start(piece)
            done += step

    def _step(self, rate: float | None, items: int, count: int, before: int) -> int:
        """Units of the axis for the next piece; ``before`` is those of the last one, 0 if none."""
        if rate is None:
            return max(1, int(_FIRST * count))
        room = _AIM * self._seconds
        most = int(room / (rate * items)) if rate * items * count > room else count
        return max(1, min(most, _GROWTH * before) if before else most)

    def _measured(self, start: Callable[[GridPart], None], piece: GridPart) -> float:
        """Seconds that a piece takes from an idle device to an idle device."""
        self._finish()
        begin = self._clock()
        start(piece)
        self._finish()
        return self._clock() - begin


def _piece(grid: GridPart, axis: int, first: int, count: int) -> GridPart:
    """So many work-items along one axis of a grid."""
    offset, size = list(grid.offset), list(grid.size)
    offset[axis] += first
    size[axis] = count
    return GridPart(tuple(offset), tuple(size))
