"""The operations whose kernels are timed one by one, and the split of each by kernel.

``Device.launch`` is wrapped for the purpose: the queue is drained before and after every launch,
so that a kernel's time is its own. The sum is therefore a little longer than the operation as it
is used, where launches overlap with Python.
"""

from __future__ import annotations

from collections import Counter, defaultdict
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, field
from typing import Any
from unittest import mock

import rift_cl as rift
from bench.case import Case
from bench.costs import COSTS, Cost
from bench.limits import LimitMeter, Limits
from bench.timing import summary, timed


@dataclass
class Split:
    """Where the time of one operation went.

    Args:
        operation: its name.
        case: the size it ran at, a ``Case`` or a ``SplatCase``; what its costs are told.
        launches: how often it launched each kernel.
        kernels: seconds spent in each kernel, one number for each repeat.
        total: seconds that the operation took in all, likewise, drained queues included.
    """

    operation: str
    case: Any
    launches: Counter[str] = field(default_factory=Counter)
    kernels: dict[str, list[float]] = field(default_factory=lambda: defaultdict(list))
    total: list[float] = field(default_factory=list)


@contextmanager
def each_launch(device: rift.Device) -> Iterator[list[tuple[str, float]]]:
    """Time every kernel that is launched on a device while this lasts: (name, seconds) each."""
    plain, log = device.launch, []

    def launch(kernel: str, size: tuple[int, ...], *arguments: Any, **macros: Any) -> None:
        device.finish()

        def run() -> None:
            plain(kernel, size, *arguments, **macros)
            device.finish()

        log.append((kernel, timed(run)[0]))

    with mock.patch.object(device, "launch", launch):
        yield log


def operations(device: rift.Device, case: Case) -> dict[str, Callable[[], Any]]:
    """The operations by name, each on device arrays; a new kernel's operation belongs here."""
    A = rift.Projector(case.grid, case.scan, device=device)
    x, y = device.array(case.image), device.array(case.projections)
    return {
        "forward": lambda: A(x),
        "backward": lambda: A.T(y),
        "fbp": lambda: rift.fbp(A, y),
        "unfiltered": lambda: rift.backproject(A, y),
    }


def splits(
    meter: LimitMeter, case: Any, runs: dict[str, Callable[[], Any]], *, repeats: int
) -> list[Split]:
    """Time every kernel of every operation, the operations and the device's limits in turns."""
    device = meter.device
    found = {name: Split(name, case) for name in runs}
    for run in runs.values():
        run()
        device.finish()
    for _ in range(repeats):
        meter.measure()
        for name, run in runs.items():
            _add(found[name], device, run)
    return list(found.values())


def _add(split: Split, device: rift.Device, run: Callable[[], Any]) -> None:
    def run_and_wait() -> None:
        run()
        device.finish()

    with each_launch(device) as log:
        seconds, _ = timed(run_and_wait)
    split.total.append(seconds)
    split.launches = Counter(name for name, _ in log)
    for kernel in split.launches:
        split.kernels[kernel].append(sum(time for name, time in log if name == kernel))


def split_record(split: Split, limits: Limits, costs: Mapping[str, Cost] = COSTS) -> dict[str, Any]:
    """The JSON record of a split: times, rates and shares of the device's limits.

    Rates and shares follow from the shortest times. The rest is what is left of the operation:
    clearing memory, the design of a filter, Python between launches.
    """
    repeats = zip(split.total, *split.kernels.values(), strict=True)
    rest = [total - sum(kernels) for total, *kernels in repeats]
    shortest = sum(min(seconds) for seconds in (*split.kernels.values(), rest))
    return {
        "operation": split.operation,
        "total": summary(split.total),
        "rest": {**summary(rest), "share": min(rest) / shortest},
        "kernels": [
            {
                "kernel": kernel,
                "launches": split.launches[kernel],
                **summary(seconds),
                "share": min(seconds) / shortest,
                **_rates(costs[kernel], split.case, min(seconds), limits),
            }
            for kernel, seconds in split.kernels.items()
        ],
    }


def _rates(cost: Cost, case: Any, seconds: float, limits: Limits) -> dict[str, Any]:
    count = cost.units(case)
    flops, moved = cost.flops * count / seconds, cost.bytes(case) / seconds
    return {
        "unit": cost.unit,
        "count": count,
        "rate_per_s": count / seconds,
        "flops_per_s": flops,
        "multiply_add_share": flops / limits.multiply_add,
        "bytes_per_s": moved,
        "bandwidth_share": moved / limits.bandwidth,
    }
