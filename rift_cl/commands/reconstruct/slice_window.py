"""Where the slices of ``rift reconstruct`` lie about the axis, and which part of them is wanted."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from rift_cl.commands.reconstruct.settings import ReconstructSettings
from rift_cl.commands.reconstruct.slice_input import SliceInput
from rift_cl.errors import InputError
from rift_cl.geometry import Grid


@dataclass(frozen=True)
class Window:
    """Where a slice lies: samples of the whole one, and the part of it that is wanted.

    Args:
        size: samples along each side of the whole slice, centred on the axis.
        pixel: distance between samples.
        roi: first column, the one after the last, first line, the one after the last.
    """

    size: int
    pixel: float
    roi: tuple[int, int, int, int]

    @classmethod
    def of(cls, settings: ReconstructSettings, source: SliceInput) -> Window:
        """What the settings ask for; of a full turn, not final before the axis is known.

        Raises:
            InputError: the part is not inside the slice, or will not be wherever the axis is.
        """
        pixel = source.pitch if settings.pixel is None else settings.pixel
        size = most = settings.size
        if size is None or most is None:
            ratio = source.pitch / pixel
            size, most = (int(np.ceil(n * ratio - 1e-6)) for n in (source.bins, source.most_bins))
        roi = settings.roi or (0, size, 0, size)
        check_window(roi, most)
        return cls(size, pixel, roi)

    @property
    def shape(self) -> tuple[int, int]:
        """Lines and columns that are wanted."""
        left, right, top, bottom = self.roi
        return bottom - top, right - left

    def grid(self, slices: int) -> Grid:
        """The samples that are wanted, of so many slices."""
        left, right, top, bottom = self.roi
        middle = self.size / 2
        center = (((top + bottom) / 2 - middle), ((left + right) / 2 - middle))
        return Grid((slices, *self.shape), self.pixel, (0.0, *(c * self.pixel for c in center)))

    def around(self, width: float) -> tuple[Grid, tuple[slice, slice]]:
        """An image at least so wide about the axis, and where in it the wanted part lies.

        Methods that explain every ray need all that the rays meet.
        """
        margin = max(0, int(np.ceil((width / self.pixel - self.size) / 2)))
        left, right, top, bottom = (edge + margin for edge in self.roi)
        whole = Grid((self.size + 2 * margin,) * 2, self.pixel)
        return whole, (slice(top, bottom), slice(left, right))


def cut_evenly(run: slice, most: int) -> list[slice]:
    """Cut a run of slices at multiples of a number, so that parts of a volume's file are whole.

    Args:
        run: slices of the volume.
        most: slices of a part.
    """
    edges = [run.start, *range((run.start // most + 1) * most, run.stop, most), run.stop]
    return [slice(first, stop) for first, stop in pairwise(edges)]


def check_window(roi: tuple[int, int, int, int], size: int) -> None:
    """Make sure that a part of a slice is inside it.

    Raises:
        InputError: it is not.
    """
    left, right, top, bottom = roi
    if not (0 <= left < right <= size and 0 <= top < bottom <= size):
        raise InputError(
            f"--roi is {left} {right} {top} {bottom}, the slice has the columns and lines 0 to "
            f"{size}: give the first column and the one after the last, then the same of lines"
        )
