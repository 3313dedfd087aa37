"""What the benchmark compares: one interface for the peers and for ourselves.

A contender takes an image (y, x) and a sinogram (angle, bin) in our conventions; we take stacks as
well. What it must do
to bring them into its own happens in ``enter`` and ``leave``, which are not timed, unless its
users would have to pay for it every time.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from typing import Any

import numpy as np

import rift_cl as rift
from bench.case import Case, Floats


class Contender(ABC):
    """Projection, backprojection and reconstruction by one package, at one size.

    Args:
        device: the OpenCL device to use, if it uses one.
        case: the size.
    """

    name: str
    arrays = "NumPy"
    ours = False
    operations: tuple[str, ...] = ("forward", "backward", "fbp")
    # Runs of each operation in a round.
    repeats = 1

    def __init__(self, device: rift.Device, case: Case) -> None:
        self.device = device
        self.case = case

    @property
    def sinogram(self) -> Floats:
        """The exact sinogram with the axis where this contender has it."""
        return self.case.projections

    def enter(self, array: Floats) -> Any:
        """Bring an array to where this contender wants it."""
        return array

    def leave(self, array: Any) -> Floats:
        """Bring a result back."""
        return np.asarray(array)

    @abstractmethod
    def forward(self, image: Any) -> Any:
        """Project an image."""

    @abstractmethod
    def backward(self, sinogram: Any) -> Any:
        """Backproject a sinogram, without a filter."""

    def fbp(self, sinogram: Any) -> Any:
        """Reconstruct from a sinogram with the plain ramp."""
        raise NotImplementedError(f"{self.name} has no filtered backprojection")


class RiftOnHost(Contender):
    """Ours, NumPy in and out."""

    name = "rift_cl, NumPy"
    ours = True
    repeats = 3

    def __init__(self, device: rift.Device, case: Case) -> None:
        super().__init__(device, case)
        self.A = rift.Projector(case.grid, case.scan, device=device)

    def forward(self, image: Any) -> Any:
        """Project an image and wait for the result."""
        return self._waited(self.A(image))

    def backward(self, sinogram: Any) -> Any:
        """Backproject a sinogram and wait for the result."""
        return self._waited(self.A.T(sinogram))

    def fbp(self, sinogram: Any) -> Any:
        """Reconstruct, the design of the filter included, and wait for the result."""
        return self._waited(rift.fbp(self.A, sinogram))

    def _waited(self, result: Any) -> Any:
        self.device.finish()
        return result


class RiftOnDevice(RiftOnHost):
    """Ours, arrays on the device in and out."""

    name = "rift_cl, device"
    arrays = "device"

    def enter(self, array: Floats) -> Any:
        """Copy to the device."""
        return self.device.array(array)

    def leave(self, array: Any) -> Floats:
        """Copy to the host."""
        return np.asarray(self.device.get(array))
