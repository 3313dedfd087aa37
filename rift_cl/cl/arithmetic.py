"""Arithmetic on whole arrays, where no kernel of its own has a reason to exist.

pyopencl's own operators would build kernels that ``rift_cl.cl`` knows nothing of.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from rift_cl.cl.passing_parts import CPU_RUN, pass_parts

if TYPE_CHECKING:
    from rift_cl.cl.array import AnyArray, DeviceArray
    from rift_cl.cl.device import Device

# Rows that one run of a column sum has.
_SUM_RUN = 64


def axpby(device: Device, a: float, x: AnyArray, b: float, y: AnyArray) -> None:
    """Y = a x + b y on arrays of the same shape and type, float32 or float64.

    Both are on the device, or both on the host: then parts of them pass through the device.
    """
    if isinstance(x, np.ndarray) and isinstance(y, np.ndarray):
        pass_parts(device, lambda x, y: axpby(device, a, x, b, y), x, y)
        return
    run = CPU_RUN if device.traits.is_cpu else 1
    macros = {"RUN": run, "DOUBLE": int(y.dtype == np.float64)}
    device.launch("axpby", (-(-y.size // run),), x=x, y=y, a=a, b=b, size=y.size, **macros)


def sum_columns(device: Device, table: DeviceArray) -> DeviceArray:
    """Sum over the rows of a (N, C) device array, in an order that N alone decides: (C,)."""
    rows, columns = table.shape
    if rows == 0:
        return device.zeros((columns,))
    while rows > 1:
        runs = -(-rows // _SUM_RUN)
        sums = device.empty((runs, columns))
        device.launch(
            "sum_columns",
            (runs * columns,),
            table=table,
            sums=sums,
            rows=rows,
            columns=columns,
            RUN=_SUM_RUN,
        )
        table, rows = sums, runs
    return table.reshape((columns,))


def copy_columns(
    device: Device,
    source: DeviceArray,
    first: int,
    target: DeviceArray,
    target_first: int,
    columns: int,
) -> None:
    """Copy columns of a (N, C) device array, from ``first`` on, into another of N rows."""
    rows = source.shape[0]
    device.launch(
        "copy_columns",
        (rows,),
        source=source,
        target=target,
        rows=rows,
        columns=columns,
        source_width=source.size // rows if rows else 0,
        source_first=first,
        target_width=target.size // rows if rows else 0,
        target_first=target_first,
    )
