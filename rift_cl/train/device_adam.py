"""Adam on the device, for arrays of many splats; ``kernels/train/adam.cl`` says what a step is."""

from __future__ import annotations

import numpy as np

from rift_cl.cl.array import DeviceArray
from rift_cl.cl.device import Device

_BETA1, _BETA2, _EPSILON = 0.9, 0.999, 1e-15
# Parameters that one work-item of a CPU goes through; kernels/train/adam.cl has the same.
_CPU_RUN = 4096


class DeviceAdam:
    """Steps of Adam on one device.

    Args:
        device: where the parameters are.
    """

    def __init__(self, device: Device) -> None:
        self.device = device
        self._sent: dict[tuple[int, float], DeviceArray] = {}

    def step(
        self,
        x: DeviceArray,
        first: DeviceArray,
        second: DeviceArray,
        gradient: DeviceArray,
        *,
        rate: float,
        rest: float,
        step: int,
    ) -> None:
        """Move parameters and their moments, in place.

        Args:
            x: (N, ...) the parameters; the other arrays have their shape.
            first: means of gradients.
            second: means of their squares.
            gradient: of the loss.
            rate: of the first three numbers of a splat.
            rest: rate of its other numbers, as a share of that.
            step: number of the step, counted from 1.
        """
        device, size = self.device, x.size
        period = 1 if rest == 1.0 else size // x.shape[0]
        run = _CPU_RUN if device.traits.is_cpu else 1
        device.launch(
            "adam",
            (-(-size // run),),
            x=x,
            m=first,
            v=second,
            g=gradient,
            shares=self._shares(period, rest),
            period=period,
            rate=rate,
            beta1=_BETA1,
            beta2=_BETA2,
            c1=1 / (1 - _BETA1**step),
            c2=1 / (1 - _BETA2**step),
            epsilon=_EPSILON,
            size=size,
            RUN=run,
        )

    def _shares(self, period: int, rest: float) -> DeviceArray:
        """Shares of the rate along a period, one for the first three; sent to the device once."""
        if (period, rest) not in self._sent:
            shares = np.where(np.arange(period) < 3, 1.0, rest)
            # Two periods and a run more, so that shares can be read from any place on.
            length = 2 * period + self.device.traits.macros["LANES"]
            table = np.resize(shares, length).astype(np.float32)
            self._sent[period, rest] = self.device.array(table)
        return self._sent[period, rest]
