"""What is trained: splats before their activations, on the device, with Adam's moments.

Scales are trained as logarithms, opacities as logits and densities as logarithms; what the
rasterizer draws, ``drawn``, is made from them after every step. One owner, the trainer, changes
these arrays in place.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rift_cl.cl.arithmetic import copy_columns
from rift_cl.cl.device import Device
from rift_cl.splat.frame import FrameGradients
from rift_cl.splat.splats import Splats
from rift_cl.train.band_limit import Detail

GROUPS = ("means", "quats", "log_scales", "logits", "sh")
_BETA1, _BETA2, _EPSILON = 0.9, 0.999, 1e-15
# Parameters that one work-item of a CPU goes through; kernels/adam.cl has the same.
_CPU_RUN = 4096

Arrays = Mapping[str, NDArray[np.float32]]


@dataclass
class Parameters:
    """N splats in training; every mapping has an array for each of ``GROUPS``.

    Args:
        device: where they are.
        raw: what is trained: (N, 3), (N, 4), (N, 3), (N,), (N, K, 3).
        first: Adam's means of gradients.
        second: Adam's means of their squares.
        drawn: what the rasterizer draws; shares positions, quaternions and harmonics with ``raw``.
        step: steps of Adam that were taken.
        density: whether ``logits`` are logarithms of densities, for X-rays.
        band: (N,) lengths below which splats have no detail, or None; see ``limit_band``.
        shares: of the rates along a period of parameters, on the device.
    """

    device: Device
    raw: dict[str, Any]
    first: dict[str, Any]
    second: dict[str, Any]
    drawn: Splats
    step: int = 0
    density: bool = False
    band: Any = None
    shares: dict[tuple[int, float], Any] = field(default_factory=dict)

    @classmethod
    def of(
        cls,
        device: Device,
        raw: Arrays,
        *,
        first: Arrays | None = None,
        second: Arrays | None = None,
        step: int = 0,
        density: bool = False,
        band: NDArray[np.float32] | None = None,
    ) -> Parameters:
        """Send host arrays to a device; moments are zero if not given."""
        sent = {name: device.array(raw[name]) for name in GROUPS}
        parameters = cls(
            device,
            sent,
            _moments(device, sent, first),
            _moments(device, sent, second),
            _undrawn(device, sent),
            step,
            density,
            None if band is None else device.array(band),
        )
        parameters.activate()
        return parameters

    def __len__(self) -> int:
        """Number of splats."""
        return int(self.raw["means"].shape[0])

    def host(self) -> tuple[dict[str, NDArray[np.float32]], ...]:
        """The raw values and both moments, on the host."""
        return tuple(
            {name: self.device.get(group[name]) for name in GROUPS}
            for group in (self.raw, self.first, self.second)
        )

    def replaced(self, raw: Arrays, first: Arrays, second: Arrays) -> Parameters:
        """Other splats in the place of these, at the same step; their band is still to be set."""
        return Parameters.of(
            self.device, raw, first=first, second=second, step=self.step, density=self.density
        )

    def update(
        self,
        gradients: FrameGradients,
        rates: Mapping[str, float],
        *,
        sh_rest: float,
        opacity_penalty: float,
        scale_penalty: float,
    ) -> None:
        """One step of Adam.

        Args:
            gradients: of the loss, by what was drawn.
            rates: of each group; of the harmonics, that of the constant one.
            sh_rest: rate of the other harmonics, as a share of that.
            opacity_penalty: weight of the mean opacity in the loss.
            scale_penalty: weight of the mean scale in the loss.
        """
        count, found = len(self), gradients.splats
        self.device.launch(
            "splat_activate_grad",
            (count,),
            *(*self._before(), found.scales, found.opacities),
            *(scale_penalty / (3 * count), opacity_penalty / count, count),
            **self._kind(),
        )
        by = (found.means, found.quats, found.scales, found.opacities, gradients.sh)
        self.step += 1
        for name, gradient in zip(GROUPS, by, strict=True):
            self._adam(name, gradient, rates[name], sh_rest if name == "sh" else 1.0)
        self.activate()

    def activate(self) -> None:
        """Make what is drawn of what is trained."""
        drawn, count = self.drawn, len(self)
        given = (*self._before(), drawn.scales, drawn.opacities, count)
        self.device.launch("splat_activate", (count,), *given, **self._kind())

    def _before(self) -> tuple[Any, Any, Any]:
        """What is activated; a kernel without a band takes any array in its place."""
        logits = self.raw["logits"]
        return self.raw["log_scales"], logits, logits if self.band is None else self.band

    def _kind(self) -> dict[str, bool]:
        return {"DENSITY": self.density, "BAND": self.band is not None}

    def limit_band(
        self, cameras: Any, *, near: float, unseen: float, detail: Detail | None = None
    ) -> None:
        """Let no splat be finer than what the cameras resolve where it is now.

        Args:
            cameras: (V, 20) device array, as ``kernels/splat_band.cl`` says.
            near: cameras do not see what is nearer.
            unseen: the length for splats that no camera sees.
            detail: of the pictures, where coverage sets the limit; None for pixels alone.
        """
        device, count, views = self.device, len(self), cameras.shape[0]
        self.band = device.empty((count,))
        given = (self.raw["means"], cameras, self.band, float(near), float(unseen))
        if detail is None:
            device.launch("splat_band", (count,), *given, views, count)
        else:
            runs = -(-count // device.traits.macros["LANES"])
            device.launch("splat_band_coverage", (runs,), *given, *detail, views, count)
        self.activate()

    def _adam(self, name: str, gradient: Any, rate: float, rest: float) -> None:
        device, size = self.device, self.raw[name].size
        period = 3 * self.raw["sh"].shape[1] if name == "sh" else 1
        run = _CPU_RUN if device.traits.is_cpu else 1
        device.launch(
            "adam",
            (-(-size // run),),
            *(self.raw[name], self.first[name], self.second[name], gradient),
            *(self._shares(period, rest), period, float(rate), _BETA1, _BETA2),
            *(1 / (1 - _BETA1**self.step), 1 / (1 - _BETA2**self.step), _EPSILON),
            np.uint64(size),
            RUN=run,
        )

    def _shares(self, period: int, rest: float) -> Any:
        """Shares of the rate along a period, one for the first three; sent to the device once."""
        if (period, rest) not in self.shares:
            shares = np.where(np.arange(period) < 3, 1.0, rest)
            # Two periods and a run more, so that shares can be read from any place on.
            length = 2 * period + self.device.traits.macros["LANES"]
            table = np.resize(shares, length).astype(np.float32)
            self.shares[period, rest] = self.device.array(table)
        return self.shares[period, rest]

    def shake(self, amount: float, seed: int) -> None:
        """Move faint splats at random; ``kernels/splat_noise.cl`` says how."""
        drawn, count = self.drawn, len(self)
        self.device.launch(
            "splat_noise",
            (count,),
            *(drawn.means, drawn.quats, drawn.scales, drawn.opacities),
            *(float(amount), np.uint32(seed & 0xFFFFFFFF), np.uint32(self.step), count),
        )

    def add_degree(self) -> None:
        """Let the next degree of harmonics join, with coefficients of zero."""
        count, had = len(self), self.raw["sh"].shape[1]
        wanted = (int(np.sqrt(had)) + 1) ** 2
        for group in (self.raw, self.first, self.second):
            wider = self.device.zeros((count, wanted, 3))
            copy_columns(self.device, group["sh"], 0, wider, 0, 3 * had)
            group["sh"] = wider
        self.drawn = _undrawn(self.device, self.raw)
        self.activate()


def _moments(device: Device, sent: Mapping[str, Any], given: Arrays | None) -> dict[str, Any]:
    if given is None:
        return {name: device.zeros(sent[name].shape) for name in GROUPS}
    return {name: device.array(given[name]) for name in GROUPS}


def _undrawn(device: Device, raw: Mapping[str, Any]) -> Splats:
    """Splats whose scales and opacities are still to be made."""
    count = raw["means"].shape[0]
    scales, opacities = device.empty((count, 3)), device.empty((count,))
    return Splats(raw["means"], raw["quats"], scales, opacities, sh=raw["sh"])
