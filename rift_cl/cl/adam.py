"""Adam on device arrays: what a step is made of, and steps by a gradient that is an array.

A kernel that makes a gradient can take a step along it at once
(``kernels/include/train/adam_step.h``): it is given ``AdamStep.arguments``.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

if TYPE_CHECKING:
    from rift_cl.cl.array import DeviceArray
    from rift_cl.cl.device import Device

# Adam's constants, and parameters that one work-item of a CPU goes through, as
# kernels/train/adam.cl has it.
_BETA1, _BETA2, _EPSILON = 0.9, 0.999, 1e-15
_CPU_RUN = 4096


def constants(number: int) -> dict[str, float]:
    """What a kernel takes that is the same for all parameters of step ``number``, from 1 on."""
    return {
        "beta1": _BETA1,
        "beta2": _BETA2,
        "c1": 1 / (1 - _BETA1**number),
        "c2": 1 / (1 - _BETA2**number),
        "epsilon": _EPSILON,
    }


@dataclass(frozen=True, eq=False)
class AdamStep:
    """One step along an array of parameters, still to be taken.

    Args:
        first: means of gradients, of the parameters' shape; changed by the step.
        second: means of their squares; changed by the step.
        shares: of the rate along a period, as ``kernels/train/adam.cl`` says.
        period: numbers after which the shares repeat.
        rate: of the first three numbers of a splat.
        number: of the step, counted from 1.
    """

    first: DeviceArray
    second: DeviceArray
    shares: DeviceArray
    period: int
    rate: float
    number: int

    @property
    def arguments(self) -> dict[str, Any]:
        """What a kernel takes beside the parameters and their gradient, by name."""
        own = {"m": self.first, "v": self.second, "shares": self.shares, "period": self.period}
        return own | {"rate": self.rate} | constants(self.number)


class Adam:
    """Steps of Adam on one device; ``kernels/train/adam.cl`` says what a step is.

    Args:
        device: where the parameters are.
    """

    def __init__(self, device: Device) -> None:
        self.device = device
        self._sent: dict[tuple[int, float], DeviceArray] = {}

    def next_step(
        self, first: DeviceArray, second: DeviceArray, *, rate: float, rest: float, number: int
    ) -> AdamStep:
        """A step along parameters with these moments.

        Args:
            first: (N, ...) means of gradients.
            second: means of their squares.
            rate: of the first three numbers of a splat.
            rest: rate of its other numbers, as a share of that.
            number: of the step, counted from 1.
        """
        period = 1 if rest == 1.0 else first.size // max(first.shape[0], 1)
        return AdamStep(first, second, self.shares(period, rest), period, rate, number)

    def take(self, step: AdamStep, x: DeviceArray, gradient: DeviceArray) -> None:
        """Move parameters and their moments, in place.

        Args:
            step: what is taken.
            x: (N, ...) the parameters.
            gradient: of the loss.
        """
        size, run = x.size, _CPU_RUN if self.device.traits.is_cpu else 1
        given = {"x": x, "g": gradient, "size": size} | step.arguments
        self.device.launch("adam", (-(-size // run),), **given, RUN=run)

    def shares(self, period: int = 1, rest: float = 1.0) -> DeviceArray:
        """Shares of the rate along a period, one for the first three; sent to the device once."""
        if (period, rest) not in self._sent:
            shares = np.where(np.arange(period) < 3, 1.0, rest)
            # Two periods and a run more, so that shares can be read from any place on.
            length = 2 * period + self.device.traits.macros["LANES"]
            table = np.resize(shares, length).astype(np.float32)
            self._sent[period, rest] = self.device.array(table)
        return self._sent[period, rest]
