"""``rift devices``: the devices, their properties, and whether they compute correctly."""

from __future__ import annotations

from collections.abc import Iterator

from rift_cl.cl.budget import format_bytes
from rift_cl.cl.device import Device
from rift_cl.cl.discovery import devices, open_device
from rift_cl.cl.self_test import self_test
from rift_cl.commands.devices.driver_test import examine_driver, findings, verdict
from rift_cl.commands.devices.families import FAMILIES
from rift_cl.progress import Report


def examine_drivers(*, again: bool) -> Iterator[Report]:
    """Test the drivers that were not yet tested, or all of them."""
    for device in devices():
        if again or verdict(device) is None:
            yield from examine_driver(device, list(FAMILIES))


def device_facts() -> list[tuple[str, dict[str, str]]]:
    """The name and the properties of every device, in the order of their numbers.

    Raises:
        NoDeviceError: there is none, or ``RIFT_DEVICE`` matches none.
    """
    chosen = open_device().selector
    return [
        (f"{number}{'*' if device.selector == chosen else ' '} {device.name}", _facts(device))
        for number, device in enumerate(devices())
    ]


def _facts(device: Device) -> dict[str, str]:
    traits, test = device.traits, self_test(device)
    features = {"unified memory": traits.unified, "fp64": traits.fp64, "PoCL": traits.pocl}
    return {
        "platform": f"{device.platform}, driver {device.driver}",
        "selector": device.selector,
        "kind": f"{device.kind}, {traits.compute_units} compute units",
        "memory": f"{format_bytes(device.budget)} to use of {format_bytes(traits.memory)}, "
        f"arrays of at most {format_bytes(traits.allocation)}",
        "local": f"{format_bytes(traits.local_memory)}, groups of at most {traits.group}",
        "traits": ", ".join(name for name, there in features.items() if there) or "none",
        "self-test": f"{'passed' if test.passed else 'FAILED'}: {test.detail}",
        "driver": "\n".join(findings(device)) or "not tested",
    }
