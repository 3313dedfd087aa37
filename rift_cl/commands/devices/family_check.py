"""The child process that tries a driver on the families: the driver may die of it, or hang.

    python -m rift_cl.commands.devices.family_check 0:0 tomography sums

For each family one line of JSON on its output: the relative deviation from the known results, or
the error that was raised, and the kernels that were built for it.
"""

from __future__ import annotations

import json
import os
import sys
from collections.abc import Callable, Mapping
from typing import Any

from rift_cl.cl.device import Device
from rift_cl.cl.discovery import open_device
from rift_cl.commands.devices.families import FAMILIES, Results, deviation, stored_results
from rift_cl.errors import DeviceError, ResourceLimitError


def try_family(
    device: Device, family: Callable[[Device], Results], wanted: Mapping[str, Any]
) -> dict[str, Any]:
    """Try a device on one family: its ``deviation`` or its ``error``, and its ``kernels``.

    Numbers that are so wrong that they raise an error are infinitely far off, and both are told.
    """
    fresh = Device(device._handle, device.selector, traits=device.traits)
    found: dict[str, Any] = {}
    try:
        found["deviation"] = deviation(family(fresh), wanted)
    except (DeviceError, ResourceLimitError) as error:
        found["error"] = str(error)
    except Exception as error:
        found |= {"deviation": float("inf"), "error": f"wrong numbers ({error})"}
    return {**found, "kernels": fresh.kernels}


def main(arguments: list[str]) -> None:
    """Try the device of this selector on these families."""
    selector, *names = arguments
    # What a driver prints is no line of ours.
    answers = os.fdopen(os.dup(1), "w", encoding="utf-8")
    os.dup2(2, 1)
    device, wanted = open_device(selector), stored_results()
    for name in names:
        found = try_family(device, FAMILIES[name], wanted[name])
        print(json.dumps({"family": name, **found}), file=answers, flush=True)


if __name__ == "__main__":
    main(sys.argv[1:])
