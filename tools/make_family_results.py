"""Make the known results that drivers are tested against, on a device that is known to be right.

    RIFT_DEVICE=pocl python tools/make_family_results.py

They go into ``rift_cl/commands/devices/families.npz``.
"""

from __future__ import annotations

import argparse

import numpy as np

from rift_cl import open_device
from rift_cl.commands.devices.families import FAMILIES, STORED


def main() -> None:
    """Compute every family and store what came."""
    argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    ).parse_args()
    device = open_device()
    results = {
        f"{name}/{key}": array
        for name, family in FAMILIES.items()
        for key, array in family(device).items()
    }
    np.savez_compressed(STORED, allow_pickle=False, **results)
    print(f"{len(results)} arrays of {device.name} ({device.platform} {device.driver}) in {STORED}")


if __name__ == "__main__":
    main()
