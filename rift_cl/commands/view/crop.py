"""A box outside of which splats are not shown."""

from __future__ import annotations

import dataclasses
import itertools
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from rift_cl.cl.device import Device
from rift_cl.splat.splats import Splats

Floats = NDArray[np.float32]


@dataclass(frozen=True)
class Crop:
    """A box along the axes of the scene.

    Args:
        low: least x, y and z of the splats' means that are shown, in scene units.
        high: the largest.
    """

    low: tuple[float, ...]
    high: tuple[float, ...]

    def holds(self, means: Floats) -> NDArray[np.bool_]:
        """Which of the means (N, 3) lie in the box."""
        return np.asarray(((means >= self.low) & (means <= self.high)).all(axis=1))

    def edges(self) -> Floats:
        """The ends of the box's edges, (12, 2, 3)."""
        corners = np.array(list(itertools.product(*zip(self.low, self.high, strict=True))))
        # A corner's number has a bit for each axis along which it lies at the upper end.
        ends = [(k, k | bit) for k in range(8) for bit in (1, 2, 4) if not k & bit]
        return np.asarray(corners[np.array(ends)], np.float32)


def cropped(splats: Splats, crop: Crop | None, device: Device) -> Splats:
    """The splats with those outside the box made wholly transparent; they themselves stay."""
    if crop is None:
        return splats
    inside = crop.holds(device.get(splats.means))
    opacities = np.where(inside, device.get(splats.opacities), np.float32(0))
    return dataclasses.replace(splats, opacities=device.send(opacities))
