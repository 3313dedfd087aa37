"""Views as a planner moves them: each a row of numbers, all looking at the target's centre."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from rift_cl.errors import InputError
from rift_cl.geometry import Camera
from rift_cl.geometry.camera_type import CameraType
from rift_cl.geometry.pose import look_at
from rift_cl.sampling.planning.design_space import (
    AZIMUTH,
    COLUMNS,
    DISTANCE,
    ELEVATION,
    FOCUS,
    DesignSpace,
)

Floats = NDArray[np.float64]
# How far beside the target's centre a camera that is read back may look, as part of the distance.
_BESIDE = 1e-4


@dataclass(frozen=True, eq=False)
class ViewTable:
    """V views.

    Args:
        kind: (V,) which camera type each has.
        table: (V, 7) azimuth, elevation, distance from the target's centre, focal length,
            f-number, distance of the plane in focus behind the target's centre, exposure.
    """

    kind: NDArray[np.intp]
    table: Floats

    def __len__(self) -> int:
        """V, the number of views."""
        return len(self.kind)

    def take(self, which: Sequence[int] | NDArray[np.intp] | NDArray[np.bool_]) -> ViewTable:
        """Some of them."""
        chosen = np.asarray(which)
        chosen = chosen.astype(np.intp) if chosen.dtype != np.bool_ else chosen
        return ViewTable(self.kind[chosen], self.table[chosen])

    @staticmethod
    def joined(parts: Sequence[ViewTable]) -> ViewTable:
        """Several sets as one."""
        kinds = np.concatenate([part.kind for part in parts])
        return ViewTable(kinds, np.concatenate([part.table for part in parts]))

    def frames(self, design: DesignSpace) -> Floats:
        """(V, 3, 3) rows: unit vectors outwards, along growing azimuth, and upright."""
        return design.constraints.frames(self.table[:, [AZIMUTH, ELEVATION]])

    def places(self, design: DesignSpace) -> Floats:
        """(V, 3) camera positions."""
        outward = self.frames(design)[:, 0]
        return design.target.center + self.table[:, DISTANCE, None] * outward

    def camera_types(self, design: DesignSpace) -> tuple[CameraType, ...]:
        """Camera type of each view, with its settings."""
        return tuple(
            design.type_at(int(kind), row) for kind, row in zip(self.kind, self.table, strict=True)
        )

    def cameras(self, design: DesignSpace) -> tuple[Camera, ...]:
        """The cameras, upright: over a pole the picture's top is where lower azimuths rise to."""
        frames, center = self.frames(design), design.target.center
        types = self.camera_types(design)
        return tuple(
            kind.camera(
                # The upright of the sphere has a value at the poles, other than ``up``.
                look_at(center + row[DISTANCE] * frame[0], center, frame[2]),
                float(row[DISTANCE] + row[FOCUS]),
            )
            for kind, row, frame in zip(types, self.table, frames, strict=True)
        )

    @classmethod
    def of(
        cls,
        cameras: Sequence[Camera],
        types: Sequence[CameraType],
        kinds: Sequence[int],
        design: DesignSpace,
    ) -> ViewTable:
        """Read cameras back.

        Args:
            cameras: that look at the target's centre; their roll is not kept.
            types: (V) how each is set.
            kinds: (V) which of the site's types each is.
            design: where they stand.

        Raises:
            InputError: a camera does not look at the target's centre, or has no aperture.
        """
        table = np.empty((len(cameras), COLUMNS))
        for index, (camera, kind) in enumerate(zip(cameras, types, strict=True)):
            away = design.constraints.axes @ (camera.center - design.target.center)
            x, y, z = away.tolist()
            distance = math.hypot(x, y, z)
            beside = camera.view[:2, :3] @ (design.target.center - camera.center)
            if camera.aperture is None or not math.hypot(*beside.tolist()) <= _BESIDE * distance:
                raise InputError(
                    f"cameras[{index}] does not look at the target's centre, or has no aperture"
                )
            place = (math.atan2(y, x), math.atan2(z, math.hypot(x, y)), distance)
            lens = (kind.focal_length, kind.f_number, camera.aperture.focus - distance)
            table[index] = [*place, *lens, kind.exposure]
        return cls(np.asarray(kinds, np.intp), table)


def turned(table: Floats, design: DesignSpace) -> Floats:
    """A table with azimuths brought into the allowed turn, for full circles."""
    if not design.constraints.full_circle:
        return table
    first = design.constraints.azimuth[0]
    moved = table.copy()
    moved[:, AZIMUTH] = first + np.mod(moved[:, AZIMUTH] - first, 2 * math.pi)
    return moved
