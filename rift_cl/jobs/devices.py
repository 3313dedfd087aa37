"""``rift devices``: what there is to compute on, and whether it computes rightly."""

from __future__ import annotations

from dataclasses import dataclass

from rift_cl.cl.budget import format_bytes
from rift_cl.cl.discovery import devices, open_device
from rift_cl.cl.self_test import self_test

COLUMNS = ("device", "name", "platform, driver", "kind", "units", "memory", "traits", "self-test")


@dataclass(frozen=True)
class DevicesSettings:
    """List every OpenCL device, its traits and a self-test; the one that is used has a star.

    Choose another with --device in any command, or with the environment's RIFT_DEVICE: its
    number, cpu, gpu, or a part of its name.

    Example: RIFT_DEVICE=cpu rift devices
    """


def device_rows() -> list[tuple[str, ...]]:
    """A row for every device, in the order of their numbers.

    Raises:
        NoDeviceError: there is none, or ``RIFT_DEVICE`` fits none.
    """
    chosen = open_device().selector
    rows: list[tuple[str, ...]] = []
    for number, device in enumerate(devices()):
        traits, test = device.traits, self_test(device)
        features = {"unified memory": traits.unified, "fp64": traits.fp64, "PoCL": traits.pocl}
        rows.append(
            (
                f"{number}{' *' if device.selector == chosen else ''}",
                device.name,
                f"{device.platform}, {device.driver}",
                "CPU" if traits.is_cpu else "GPU",
                str(traits.compute_units),
                f"{format_bytes(device.budget)} of {format_bytes(traits.memory)}",
                ", ".join(name for name, there in features.items() if there),
                "passed" if test.passed else f"FAILED: {test.detail}",
            )
        )
    return rows
