"""One size of the benchmark: the geometry, the phantom in it and its exact sinogram."""

from __future__ import annotations

import math
import re
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

import rift_cl as rift
from rift_cl import metrics, phantom
from rift_cl.errors import InputError

Floats = NDArray[np.float32]


@dataclass(frozen=True)
class Case:
    """A square image under equally spaced views; pixels and bins have the size 1.

    Args:
        n: pixels along a side.
        views: number of views, over half a turn.
        slices: slices in the stack; 1 is a single image of shape (n, n).
        footprint: what a pixel leaves on the detector.
        dtype: of the images.
    """

    n: int
    views: int
    slices: int = 1
    footprint: str = "strip"
    dtype: str = "float32"

    @classmethod
    def parse(cls, text: str) -> Case:
        """Read a size such as ``512x768``: pixels along a side, then views.

        Raises:
            InputError: the text is none, or the image is too small to be scored.
        """
        match = re.fullmatch(r"(\d+)x(\d+)", text.strip())
        if match is None or int(match[1]) < 16 or int(match[2]) < 2:
            raise InputError(
                f"size is {text!r}, wanted PIXELSxVIEWS such as 512x768, at least 16x2"
            )
        return cls(int(match[1]), int(match[2]))

    @property
    def name(self) -> str:
        """How tables call it."""
        stack = f", {self.slices} slices" if self.slices > 1 else ""
        return f"{self.n}² × {self.views} views{stack}"

    @property
    def rows(self) -> int:
        """Detector rows of all views."""
        return self.slices * self.views

    @property
    def filters(self) -> int:
        """Filters along the detector: one that all views share."""
        return 1

    @property
    def itemsize(self) -> int:
        """Bytes of a number."""
        return np.dtype(self.dtype).itemsize

    @property
    def bins(self) -> int:
        """Bins that see the whole square from every direction."""
        return math.ceil(math.sqrt(2) * self.n) + 2

    def record(self) -> dict[str, Any]:
        """How the JSON file tells it from others."""
        names = ("name", "n", "views", "bins", "slices", "footprint", "dtype", "updates")
        return {name: getattr(self, name) for name in names}

    @property
    def updates(self) -> int:
        """Pairs of a pixel and a view: the work of one projection or backprojection."""
        return self.slices * self.n**2 * self.views

    @cached_property
    def angles(self) -> NDArray[np.float64]:
        """Directions in radians, (views,)."""
        return np.linspace(0, np.pi, self.views, endpoint=False)

    @cached_property
    def plane(self) -> rift.Grid:
        """The grid of one slice."""
        return rift.Grid((self.n, self.n))

    @property
    def grid(self) -> rift.Grid:
        """The grid of the image or of the stack."""
        return rift.Grid((self.slices, self.n, self.n)) if self.slices > 1 else self.plane

    @cached_property
    def scan(self) -> rift.Parallel:
        """The scan, its axis in the middle of the detector."""
        return rift.Parallel(self.angles, self.bins)

    def projector(self, device: rift.Device) -> rift.Projector:
        """The operator."""
        return rift.Projector(self.grid, self.scan, self.footprint, device, self.dtype)

    @cached_property
    def truth(self) -> Floats:
        """The Shepp-Logan head in one slice, (n, n)."""
        return phantom.shepp_logan(self.plane)

    @cached_property
    def sinogram(self) -> Floats:
        """Exact line integrals of the head, (views, bins)."""
        return phantom.shepp_logan_sinogram(self.plane, self.scan)

    @property
    def image(self) -> Floats:
        """The head in every slice, in the shape of ``grid``."""
        return np.array(np.broadcast_to(self.truth, self.grid.shape), order="C")

    @property
    def projections(self) -> Floats:
        """The head's sinogram in every row: (views, bins), or (views, slices, bins) of a stack."""
        if self.slices == 1:
            return self.sinogram
        return np.repeat(self.sinogram[:, None], self.slices, axis=1)

    def disc(self, *, margin: float = 0.0) -> NDArray[np.bool_]:
        """Mask of the pixels that every view sees, less a margin in pixels."""
        return metrics.disc(self.plane, radius=self.n / 2 - margin)
