"""What ``rift devices`` takes."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class DevicesSettings:
    """List every OpenCL device, its properties and a self-test; a star marks the default device.

    Select another one with --device in any command, or with the environment variable RIFT_DEVICE:
    its number, cpu, gpu, or part of its name. A driver that is met for the first time is tested on
    small problems of every family of kernels; what was found is kept.

    Example: RIFT_DEVICE=cpu rift devices
    """

    retest: bool = False
    """Test every driver again, with all kernels compiled anew where we keep them."""
