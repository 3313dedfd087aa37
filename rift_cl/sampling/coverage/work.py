"""What the kernels of coverage are given: views and frequencies without unit, cut to the memory."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from rift_cl.cl.array import DeviceArray
from rift_cl.cl.budget import plan_chunks
from rift_cl.cl.device import Device
from rift_cl.cl.discovery import default_device
from rift_cl.errors import InputError, NonFiniteError, ShapeError, check_type
from rift_cl.geometry import Camera, Cone, Fan, Parallel, Scan, Vectors
from rift_cl.geometry.numbers import real_numbers
from rift_cl.geometry.scan_cameras import scan_cameras
from rift_cl.sampling.targets.observations import Observations, ObservationsGradient
from rift_cl.sampling.targets.target import Target

Floats = NDArray[np.float64]
Views = Sequence[Camera] | Observations | Scan
# Numbers of a view and of a block's box.
ROW, BOX = 8, 6
# Frequencies that one work-item of the gradient sums over.
RUN = 1024
_LARGEST = float(np.finfo(np.float32).max)
# Cycles per diameter beyond which float32 does not tell a slab from its neighbour.
_MOST = 1e5


def looks_at(views: Views, target: Target, weights: ArrayLike | None = None) -> Observations:
    """How views of any kind see a target's points.

    Raises:
        ShapeError: there is no view, ``Observations`` are at another number of points, or weights
            have another shape.
        InputError: a weight is given for what is no camera, or is no weight.
    """
    check_type("coverage", "target", target, Target)
    if isinstance(views, (Fan, Cone, Vectors)):
        views = scan_cameras(views).cameras
    if not isinstance(views, (Observations, Parallel)):
        return Observations.of(views, target.points, weights)
    if weights is not None:
        raise InputError("weights are for cameras; a scan has none, Observations have their own")
    observations = (
        Observations.of_scan(views, target.points) if isinstance(views, Parallel) else views
    )
    if observations.points != len(target.points):
        raise ShapeError(
            f"these Observations are at {observations.points} points, "
            f"the target has {len(target.points)}"
        )
    return observations


@dataclass(frozen=True, eq=False)
class CoverageWork:
    """Padded to whole blocks of frequencies, in diameters of the target.

    Args:
        device: where.
        wanted: number of frequencies that were asked for.
        k: (3, frequencies).
        boxes: (blocks, 6) middle and half edges of the box that a block's frequencies lie in.
        rows: (P, V, 8) the views; see ``kernels/include/sampling/coverage.h``.
        diameter: of the target.
    """

    device: Device
    wanted: int
    k: NDArray[np.float32]
    boxes: NDArray[np.float32]
    rows: NDArray[np.float32]
    diameter: float

    @classmethod
    def of(
        cls,
        views: Views,
        target: Target,
        k: ArrayLike | None,
        weights: ArrayLike | None,
        device: Device | None,
    ) -> CoverageWork:
        """Take up what ``coverage`` was given, which says what may be wrong with it."""
        device = device or default_device()
        check_type("coverage", "device", device, Device)
        observations = looks_at(views, target, weights)
        cycles = _cycles(target.k if k is None else k, target.diameter)
        lanes = int(device.traits.macros["LANES"])
        padded = np.concatenate([cycles, np.repeat(cycles[-1:], -len(cycles) % lanes, axis=0)])
        blocks = padded.reshape(-1, lanes, 3)
        low, high = blocks.min(1), blocks.max(1)
        boxes = np.concatenate([(low + high) / 2, (high - low) / 2], axis=1)
        rows = _rows(observations, target.diameter)
        columns = np.ascontiguousarray(padded.T)
        return cls(device, len(cycles), columns, boxes, rows, target.diameter)

    @property
    def points(self) -> int:
        """P."""
        return len(self.rows)

    @property
    def views(self) -> int:
        """V."""
        return int(self.rows.shape[1])

    @property
    def padded(self) -> int:
        """Frequencies of whole blocks."""
        return int(self.k.shape[1])

    @property
    def lanes(self) -> int:
        """Frequencies of a block."""
        return self.padded // len(self.boxes)

    def point_chunks(self) -> Iterator[tuple[slice, Any]]:
        """Points whose views fill no more than a quarter of the memory, with those views."""
        each = self.views * ROW * 4
        chunks = plan_chunks(
            self.points,
            each,
            0,
            self.device.budget // 4,
            what="point's views",
            # The gradient by a run of frequencies is an array of its points as well.
            array=max(each, RUN * 4),
            largest=self.device.traits.allocation,
        )
        for chunk in chunks:
            yield chunk, self.device.array(self.rows[chunk])

    def send(self, at: slice) -> dict[str, DeviceArray | int]:
        """Some frequencies and their boxes, as kernels are told."""
        boxes = self.boxes[at.start // self.lanes : at.stop // self.lanes]
        return {
            "frequencies": self.device.array(np.ascontiguousarray(self.k[:, at])),
            "boxes": self.device.array(boxes),
            "count": at.stop - at.start,
            "view_count": self.views,
        }

    def in_world(self, total: Floats) -> ObservationsGradient:
        """The gradient (V, P, 8) by the kernel's numbers, in the unit of the world."""
        inverse = self.rows[..., 5].T.astype(np.float64)
        return ObservationsGradient(
            direction=total[..., :3].copy(),
            weight=total[..., 3].copy(),
            pixel=total[..., 4] / self.diameter,
            cutoff=-total[..., 5] * inverse**2 * self.diameter,
            blur=total[..., 6] / self.diameter,
        )


def _rows(observations: Observations, diameter: float) -> NDArray[np.float32]:
    rows = np.zeros((observations.points, observations.views, ROW), np.float32)
    rows[..., :3] = observations.direction.transpose(1, 0, 2)
    lengths = (
        observations.pixel / diameter,
        1 / (observations.cutoff * diameter),
        observations.blur / diameter,
    )
    for place, values in enumerate((observations.weight, *lengths), start=3):
        if values.max() > _LARGEST:
            raise InputError(
                f"a weight, a pixel or a blur over the diameter, or the diameter's inverse over a "
                f"cut-off, is {values.max():g}: too large for float32; check the units"
            )
        rows[..., place] = values.T
    return rows


def _cycles(k: ArrayLike, diameter: float) -> NDArray[np.float32]:
    values = real_numbers(k)
    if values is None:
        raise InputError("k: wanted real numbers, in cycles per unit of length")
    if values.ndim != 2 or values.shape[1] != 3 or not len(values):
        raise ShapeError(f"k has shape {values.shape}, wanted (frequencies, 3), at least one")
    if not np.isfinite(values).all():
        raise NonFiniteError("k holds NaN or infinity, wanted finite frequencies")
    cycles = values * diameter
    if np.abs(cycles).max() > _MOST:
        raise InputError(
            f"k reaches {np.abs(cycles).max():g} cycles per diameter of the target, wanted at most "
            f"{_MOST:g}: check the unit of the diameter"
        )
    return cycles.astype(np.float32)
