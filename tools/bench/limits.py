"""What the device can do at most, measured with small kernels of our own in the same run.

Three limits: multiply-adds per second, bytes per second from memory, and the time that one launch
takes however little it does. Other work on the machine can only make a limit look lower, and a
kernel's share of it higher. So each is measured in short windows, of the length of a kernel and
shorter than a scheduler's turn, beside every repeat of the kernels, and the best value counts.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pyopencl as cl

import rift_cl as rift
from bench.timing import timed
from rift_cl.cl.build.kernel_cache import build_lock

_OPTIONS = ("-cl-std=CL1.2", "-cl-mad-enable", "-cl-fast-relaxed-math", "-w")
_CHAINS, _LINKS = 10, 8
_LONG_ENOUGH = 0.004
# More than the caches hold, and on a GPU more than a launch takes.
_TRIAD_BYTES = {"cpu": 64 << 20, "gpu": 512 << 20}
_REPEATS, _IDLE_REPEATS = 12, 50


@dataclass(frozen=True)
class Limits:
    """What a device can do at most.

    Args:
        multiply_add: floating-point operations per second, two for each multiply-add.
        bandwidth: bytes per second between memory and the device.
        launch: seconds for one launch and one wait.
    """

    multiply_add: float
    bandwidth: float
    launch: float


class LimitMeter:
    """Measures a device's limits, as often as it is asked.

    Args:
        device: the device.
    """

    def __init__(self, device: rift.Device) -> None:
        self.device = device
        self._lanes = device.traits.macros["LANES"]
        self._group = device.traits.macros["GROUP"]
        self._run = 1024 if device.traits.is_cpu else 1
        self._items = device.traits.compute_units * (8 if device.traits.is_cpu else 4096)
        self._rounds = 64
        self._kernels = {name: self._build(name) for name in ("multiply_add", "triad", "idle")}
        self.measured: list[Limits] = []

    def measure(self) -> None:
        """Measure every limit once more."""
        self.measured.append(Limits(self._multiply_add(), self._bandwidth(), self._launch()))

    def best(self) -> Limits:
        """The best of what was measured so far."""
        return Limits(
            multiply_add=max(limits.multiply_add for limits in self.measured),
            bandwidth=max(limits.bandwidth for limits in self.measured),
            launch=min(limits.launch for limits in self.measured),
        )

    def _build(self, name: str) -> Any:
        macros = {"LANES": self._lanes, "GROUP": self._group, "RUN": self._run}
        macros |= {"CHAINS": _CHAINS, "LINKS": _LINKS}
        options = [*_OPTIONS, *(f"-D{macro}={value}" for macro, value in macros.items())]
        source = Path(__file__).with_name(f"{name}.cl").read_text(encoding="utf-8")
        with build_lock():
            return cl.Kernel(cl.Program(self.device.context, source).build(options), name)

    def _seconds(self, name: str, items: int, *arguments: Any, repeats: int = _REPEATS) -> float:
        """The shortest of several launches, each waited for."""
        kernel, queue = self._kernels[name], self.device.queue
        kernel.set_args(*arguments)

        def run() -> None:
            cl.enqueue_nd_range_kernel(queue, kernel, (items,), (self._group,))
            queue.finish()

        run()
        return min(timed(run)[0] for _ in range(repeats))

    def _multiply_add(self) -> float:
        out = self.device.empty(self._items * self._lanes)
        while True:
            arguments = (out.base_data, np.float32(0.999), np.float32(0.001))
            seconds = self._seconds("multiply_add", self._items, *arguments, np.int32(self._rounds))
            if seconds >= _LONG_ENOUGH:
                break
            self._rounds *= 2
        return 2.0 * self._items * self._lanes * _CHAINS * _LINKS * self._rounds / seconds

    def _bandwidth(self) -> float:
        per_item = self._lanes * self._run
        kind = "cpu" if self.device.traits.is_cpu else "gpu"
        room = min(_TRIAD_BYTES[kind], self.device.budget // 8)
        items = max(1, room // (4 * per_item * self._group)) * self._group
        arrays = [self.device.zeros(items * per_item) for _ in range(3)]
        buffers = [array.base_data for array in arrays]
        seconds = self._seconds("triad", items, *buffers, np.float32(3))
        return 12.0 * items * per_item / seconds

    def _launch(self) -> float:
        out = self.device.empty(1)
        return self._seconds("idle", self._group, out.base_data, repeats=_IDLE_REPEATS)
