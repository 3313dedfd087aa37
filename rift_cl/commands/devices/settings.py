"""What ``rift devices`` takes."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class DevicesSettings:
    """List every OpenCL device, its properties and a self-test; a star marks the default device.

    Select another one with --device in any command, or with the environment variable RIFT_DEVICE:
    its number, cpu, gpu, or part of its name.

    Example: RIFT_DEVICE=cpu rift devices
    """
