"""A short computation whose result is known to the bit: does this device work at all?

A driver may list a device that cannot compile, that fails at the first launch, or that gives
wrong numbers. What is done here is what every operator does: copies both ways and launches of
shipped kernels, built as they are built for real work.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from rift_cl.cl.device import Device
from rift_cl.errors import RiftError

# No multiple of a tile, a group or a vector.
_ROWS, _COLUMNS = 19, 83


@dataclass(frozen=True)
class SelfTest:
    """What the self-test of a device found.

    Args:
        passed: whether every result was right.
        detail: one sentence for a person.
    """

    passed: bool
    detail: str


def self_test(device: Device) -> SelfTest:
    """Copy an image to a device, split it into planes, merge them, copy it back, compare exactly.

    Args:
        device: the device to test.

    Returns:
        What was found; a failure of the driver is a finding, not an exception.
    """
    image = np.arange(_ROWS * _COLUMNS, dtype=np.float32).reshape(_ROWS, _COLUMNS)
    try:
        copied = np.array_equal(device.get(device.array(image)), image)
        computed = np.array_equal(_merged(device, image), 2 * image)
    except RiftError as error:
        return SelfTest(passed=False, detail=str(error))
    if not copied:
        return SelfTest(passed=False, detail=f"{device.name} changed numbers while copying them")
    if not computed:
        return SelfTest(passed=False, detail=f"{device.name} computed wrong numbers")
    return SelfTest(passed=True, detail="copies and kernels gave the right numbers")


def _merged(device: Device, image: NDArray[np.float32]) -> NDArray[np.float32]:
    """The image's rows and columns as two planes, added: twice the image."""
    rows, columns = image.shape
    source, merged = device.array(image), device.empty(image.shape)
    by_rows, by_columns = device.zeros((rows, columns)), device.zeros((columns, rows))
    # One tile per item at most, so more items than tiles on a CPU; those outside do nothing.
    device.launch(
        "plane_split",
        (columns, rows, 1),
        image=source,
        plane=by_rows,
        rows=rows,
        width=columns,
        slice0=0,
        margin=0,
    )
    device.launch(
        "plane_split",
        (rows, columns, 1),
        image=source,
        plane=by_columns,
        rows=columns,
        width=rows,
        slice0=0,
        margin=0,
        TRANSPOSE=1,
    )
    device.launch(
        "plane_merge",
        (columns, rows, 1),
        by_rows=by_rows,
        by_columns=by_columns,
        image=merged,
        slice0=0,
        ny=rows,
        nx=columns,
        row_pitch=columns,
        column_pitch=rows,
    )
    result: NDArray[np.float32] = device.get(merged)
    return result
