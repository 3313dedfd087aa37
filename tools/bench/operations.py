"""Tasks whose kernels are timed one by one, and the split of each by kernel.

``Device.launch`` is wrapped for the purpose: the queue is drained before and after every launch,
so that a kernel's time is its own. The sum is therefore a little longer than the operation as it
is used, where launches overlap with Python.
"""

from __future__ import annotations

from collections import Counter, defaultdict
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, field
from typing import Any, NamedTuple
from unittest import mock

import rift_cl as rift
from bench.costs import Cost
from bench.limits import LimitMeter, Limits
from bench.timing import summary, timed


class Task(NamedTuple):
    """An operation that is measured.

    Args:
        operation: its name.
        case: the size it runs at: a ``Case``, a ``SplatCase`` and so on; what its costs are told.
        run: does it once, on device arrays.
        costs: of the kernels that it may launch.
    """

    operation: str
    case: Any
    run: Callable[[], Any]
    costs: Mapping[str, Cost]


@dataclass
class Split:
    """Where the time of one task went.

    Args:
        task: what was done.
        launches: how often it launched each kernel.
        kernels: seconds spent in each kernel, one number for each repeat.
        total: seconds that the operation took in all, likewise, drained queues included.
    """

    task: Task
    launches: Counter[str] = field(default_factory=Counter)
    kernels: dict[str, list[float]] = field(default_factory=lambda: defaultdict(list))
    total: list[float] = field(default_factory=list)


@contextmanager
def each_launch(device: rift.Device) -> Iterator[list[tuple[str, float]]]:
    """Time every kernel that is launched on a device while this lasts: (name, seconds) each."""
    plain, log = device.launch, []

    def launch(kernel: str, work: tuple[int, ...], /, **given: Any) -> None:
        device.finish()

        def run() -> None:
            plain(kernel, work, **given)
            device.finish()

        log.append((kernel, timed(run)[0]))

    with mock.patch.object(device, "launch", launch):
        yield log


def splits(meter: LimitMeter, tasks: Iterable[Task], *, repeats: int) -> list[Split]:
    """Time every kernel of every task, the tasks and the device's limits in turns."""
    device = meter.device
    found = [Split(task) for task in tasks]
    for split in found:
        split.task.run()
        device.finish()
    for _ in range(repeats):
        meter.measure()
        for split in found:
            _add(split, device)
    return found


def _add(split: Split, device: rift.Device) -> None:
    def run_and_wait() -> None:
        split.task.run()
        device.finish()

    with each_launch(device) as log:
        seconds, _ = timed(run_and_wait)
    split.total.append(seconds)
    split.launches = Counter(name for name, _ in log)
    for kernel in split.launches:
        split.kernels[kernel].append(sum(time for name, time in log if name == kernel))


def split_record(split: Split, limits: Limits) -> dict[str, Any]:
    """The JSON record of a split: times, rates and shares of the device's limits.

    Rates and shares follow from the shortest times. The rest is what is left of the operation:
    clearing memory, the design of a filter, Python between launches.
    """
    task = split.task
    repeats = zip(split.total, *split.kernels.values(), strict=True)
    rest = [total - sum(kernels) for total, *kernels in repeats]
    shortest = sum(min(seconds) for seconds in (*split.kernels.values(), rest))
    return {
        "operation": task.operation,
        "total": summary(split.total),
        "rest": {**summary(rest), "share": min(rest) / shortest},
        "kernels": [
            {
                "kernel": kernel,
                "launches": split.launches[kernel],
                **summary(seconds),
                "share": min(seconds) / shortest,
                **_rates(task.costs[kernel], task.case, min(seconds), limits),
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
