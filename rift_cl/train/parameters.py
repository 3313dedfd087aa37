"""What is trained: splats before their activations, on the device, with Adam's moments.

Scales are trained as logarithms, opacities as logits and densities as logarithms; what the
rasterizer draws, ``drawn``, is made from them after every step. Hermite modes, lobes, normals and
reflectances, where splats have some, are trained as they are. An environment light belongs to all
splats, and stays as it is whatever becomes of them. One owner, the trainer, changes these arrays in
place.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from rift_cl.cl.adam import Adam, AdamStep, constants
from rift_cl.cl.arithmetic import axpby, copy_columns
from rift_cl.cl.array import DeviceArray
from rift_cl.cl.device import Device
from rift_cl.cl.elementwise import multiply
from rift_cl.cl.host_arrays import as_real_array, is_device_array
from rift_cl.errors import InputError
from rift_cl.splat.projection import SplatGradients
from rift_cl.splat.renderer import FrameGradients
from rift_cl.splat.splats import Splats
from rift_cl.train.band_limit import Detail
from rift_cl.train.surface_settings import SurfacePenalties

# What a splat is without what it shows, what all splats have, and what some have as well.
_GEOMETRY = ("means", "quats", "log_scales", "logits")
GROUPS = (*_GEOMETRY, "sh")
MODES = ("shape_modes", "color_modes")
MORE = (*MODES, "lobes", "normals", "reflectance")

Arrays = Mapping[str, NDArray[np.float32]]


class Environment(NamedTuple):
    """The light that all splats share: (K, 3) device arrays, trained as it is.

    Args:
        raw: logarithms of its radiance.
        first: Adam's means of gradients.
        second: Adam's means of their squares.
    """

    raw: DeviceArray
    first: DeviceArray
    second: DeviceArray

    @classmethod
    def of(cls, device: Device, raw: NDArray[np.float32]) -> Environment:
        """Send logarithms of radiance, (K, 3), to a device; moments are zero."""
        return cls(device.array(raw), device.zeros(raw.shape), device.zeros(raw.shape))

    @classmethod
    def restored(cls, device: Device, state: Arrays) -> Environment:
        """Undoes ``state``."""
        return cls(*(device.array(state[name]) for name in cls._fields))

    def state(self, device: Device) -> dict[str, NDArray[np.float32]]:
        """All of it, as host arrays by name."""
        return {name: device.get(array) for name, array in self._asdict().items()}


@dataclass
class Parameters:
    """N splats in training; every mapping has an array for each of ``groups``.

    Args:
        device: where they are.
        raw: what is trained: (N, 3), (N, 4), (N, 3), (N,), (N, K, 3), and any of ``MORE``:
            (N, modes), (N, modes, 3), (N, G), (N, 3), (N, 7).
        first: Adam's means of gradients.
        second: Adam's means of their squares.
        drawn: what the rasterizer draws; shares all but scales and opacities with ``raw``.
        step: steps of Adam that were taken.
        density: whether ``logits`` are logarithms of densities, for X-rays.
        amplitude: whether optical depths are drawn, those that hide sigmoid(logit).
        band: (N,) lengths below which splats have no detail, or None; see ``limit_band``.
        environment: the light that all splats share, or None.
        sheet: (N, 3) normals of the sheets that splats lie in, or None; see
            ``SurfaceSettings.normal_consistency``.
        free: by group, of its shape, 1 where a mode is trained and 0 where it stays as it is.
    """

    device: Device
    raw: dict[str, DeviceArray]
    first: dict[str, DeviceArray]
    second: dict[str, DeviceArray]
    drawn: Splats
    step: int = 0
    density: bool = False
    amplitude: bool = False
    band: DeviceArray | None = None
    environment: Environment | None = None
    sheet: DeviceArray | None = None
    free: dict[str, DeviceArray] = field(default_factory=dict)

    def __post_init__(self) -> None:
        """Make what takes the steps."""
        self._adam = Adam(self.device)

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
        amplitude: bool = False,
        band: NDArray[np.float32] | None = None,
        environment: Environment | None = None,
        sheet: NDArray[np.float32] | None = None,
    ) -> Parameters:
        """Send host arrays to a device; moments are zero if not given."""
        names = [*GROUPS, *(name for name in MORE if name in raw)]
        sent = {name: device.array(raw[name]) for name in names}
        parameters = cls(
            device,
            sent,
            _moments(device, sent, first),
            _moments(device, sent, second),
            _undrawn(device, sent, environment),
            step,
            density,
            amplitude,
            None if band is None else device.array(band),
            environment,
            None if sheet is None else device.array(sheet),
        )
        parameters.activate()
        return parameters

    def __len__(self) -> int:
        """Number of splats."""
        return int(self.raw["means"].shape[0])

    @property
    def groups(self) -> tuple[str, ...]:
        """The names of what is trained: ``GROUPS``, and those of ``MORE`` that there are."""
        return tuple(self.raw)

    def host(self) -> tuple[dict[str, NDArray[np.float32]], ...]:
        """The raw values and both moments, on the host."""
        return tuple(
            {name: self.device.get(group[name]) for name in self.groups}
            for group in (self.raw, self.first, self.second)
        )

    def replaced(self, raw: Arrays, first: Arrays, second: Arrays) -> Parameters:
        """Other splats in the place of these, at the same step.

        Their band and their sheets are still to be set.
        """
        return Parameters.of(
            self.device,
            raw,
            first=first,
            second=second,
            step=self.step,
            density=self.density,
            amplitude=self.amplitude,
            environment=self.environment,
        )

    def selected(self, rows: ArrayLike) -> Parameters:
        """Some of these splats with their moments, by index or mask; see ``replaced``.

        Args:
            rows: a mask of bool, (N,), or indices: a NumPy array, or what becomes one, as lists and
                tensors do; not an array on the device.

        Raises:
            InputError: ``rows`` is no such array; a mask has not a value for each splat, or is one
                of whole numbers, which would be read as indices; or an index is that of no splat.
        """
        chosen = _rows_of(rows, len(self))
        groups = ({name: array[chosen] for name, array in group.items()} for group in self.host())
        return self.replaced(*groups)

    def update(
        self,
        gradients: FrameGradients,
        rates: Mapping[str, float],
        *,
        sh_rest: float,
        opacity_penalty: float,
        scale_penalty: float,
        ridge: float = 0.0,
        surface: SurfacePenalties | None = None,
    ) -> None:
        """One step of Adam.

        Args:
            gradients: of the loss, by what was drawn; without one by the harmonics where these
                took their step (``sh_step``) as it was made.
            rates: of each group; of the harmonics, that of the constant one.
            sh_rest: rate of the other harmonics, as a share of that.
            opacity_penalty: weight of the mean opacity in the loss.
            scale_penalty: weight of the mean scale in the loss.
            ridge: weight in the loss of the mean over splats of their modes' squares.
            surface: weights of the priors for surfaces; none of them if not given. That on normals
                counts where there is a ``sheet``.
        """
        count = len(self)
        self.step += 1
        for name in self.groups:
            gradient = None if name in _GEOMETRY else getattr(gradients, name)
            if gradient is None:
                continue
            if name in MODES and ridge:
                axpby(self.device, 2 * ridge / count, self.raw[name], 1.0, gradient)
            if name in self.free:
                multiply(self.device, self.free[name], gradient)
            self._adam.take(self._adam_step(name, rates, sh_rest), self.raw[name], gradient)
        if self.environment is not None and gradients.environment is not None:
            raw, *moments = self.environment
            step = self._adam.next_step(
                *moments, rate=rates["environment"], rest=1.0, number=self.step
            )
            self._adam.take(step, raw, gradients.environment)
        prior = surface or SurfacePenalties()
        self._update_geometry(gradients.splats, rates, opacity_penalty, scale_penalty, prior)

    def _update_geometry(
        self,
        by: SplatGradients,
        rates: Mapping[str, float],
        opacity_penalty: float,
        scale_penalty: float,
        surface: SurfacePenalties,
    ) -> None:
        """Step along places, turns, scales and opacities, and compute what is drawn of them."""
        count = len(self)
        turned = self.sheet is not None and surface.normal_consistency > 0
        self.device.launch(
            "splat_update",
            (self.device.traits.runs(count),),
            **self._before(),
            means=self.raw["means"],
            quats=self.raw["quats"],
            **{f"{name}_m": self.first[name] for name in _GEOMETRY},
            **{f"{name}_v": self.second[name] for name in _GEOMETRY},
            by_means=by.means,
            by_quats=by.quats,
            by_scales=by.scales,
            by_opacities=by.opacities,
            sheet=self.sheet if turned else self.raw["logits"],
            scales=self.drawn.scales,
            opacities=self.drawn.opacities,
            shares=self._adam.shares(),
            each_scale=scale_penalty / (3 * count),
            each_flat=surface.flatness / count,
            each_opacity=opacity_penalty / count,
            each_entropy=surface.opacity_entropy / count,
            each_turn=2 * surface.normal_consistency / count,
            rates=np.array([rates[name] for name in _GEOMETRY], np.float32),
            **constants(self.step),
            count=count,
            RUN=self.device.traits.run,
            **self._kind(),
            **({"SHEET": True} if turned else {}),
        )

    def sh_step(self, rates: Mapping[str, float], *, sh_rest: float) -> AdamStep:
        """The harmonics' part of the next step, for ``Renderer.backward``; rates as of it."""
        return self._adam_step("sh", rates, sh_rest, ahead=1)

    def _adam_step(
        self, name: str, rates: Mapping[str, float], sh_rest: float, ahead: int = 0
    ) -> AdamStep:
        return self._adam.next_step(
            *(self.first[name], self.second[name]),
            rate=rates[name],
            rest=sh_rest if name == "sh" else 1.0,
            number=self.step + ahead,
        )

    def activate(self) -> None:
        """Compute the rendered splats from the trained parameters."""
        drawn, count = self.drawn, len(self)
        self.device.launch(
            "splat_activate",
            (self.device.traits.runs(count),),
            **self._before(),
            scales=drawn.scales,
            opacities=drawn.opacities,
            count=count,
            RUN=self.device.traits.run,
            **self._kind(),
        )

    def _before(self) -> dict[str, DeviceArray]:
        """What is activated; a kernel without a band takes any array in its place."""
        scales, logits = self.raw["log_scales"], self.raw["logits"]
        band = logits if self.band is None else self.band
        return {"log_scales": scales, "logits": logits, "band": band}

    def _kind(self) -> dict[str, bool]:
        kind = {"DENSITY": self.density, "BAND": self.band is not None}
        return kind | ({"AMPLITUDE": True} if self.amplitude else {})

    def limit_band(
        self, cameras: DeviceArray, *, near: float, unseen: float, detail: Detail | None = None
    ) -> None:
        """Let no splat be finer than what the cameras resolve where it is now.

        Args:
            cameras: (V, 20) device array, as ``kernels/train/splat_band.cl`` says.
            near: cameras do not see what is nearer.
            unseen: the length for splats that no camera sees.
            detail: of the pictures, where coverage sets the limit; None for pixels alone.
        """
        device, count, views = self.device, len(self), cameras.shape[0]
        self.band = device.empty((count,))
        given = {"means": self.raw["means"], "cameras": cameras, "band": self.band}
        limits = {"near_plane": near, "unseen": unseen, "views": views, "count": count}
        if detail is None:
            device.launch("splat_band", (count,), **given, **limits)
        else:
            runs = -(-count // device.traits.macros["LANES"])
            device.launch("splat_band_coverage", (runs,), **given, **limits, **detail._asdict())
        self.activate()

    def shake(self, amount: float, seed: int) -> None:
        """Move faint splats at random; ``kernels/train/splat_noise.cl`` says how."""
        drawn, count = self.drawn, len(self)
        self.device.launch(
            "splat_noise",
            (self.device.traits.runs(count),),
            means=drawn.means,
            quats=drawn.quats,
            scales=drawn.scales,
            opacities=drawn.opacities,
            amount=amount,
            seed=seed & 0xFFFFFFFF,
            step=self.step,
            count=count,
            RUN=self.device.traits.run,
        )

    def add_degree(self) -> None:
        """Let the next degree of harmonics join, with coefficients of zero."""
        self.widen("sh", (int(np.sqrt(self.raw["sh"].shape[1])) + 1) ** 2)

    def widen(self, name: str, count: int) -> None:
        """Let more coefficients of a group join, with zeros; a group that is not there begins.

        Args:
            name: ``sh``, ``shape_modes`` or ``color_modes``.
            count: coefficients that there are then, of each channel.
        """
        rows, tail = len(self), () if name == "shape_modes" else (3,)
        for group in (self.raw, self.first, self.second):
            wider = self.device.zeros((rows, count, *tail))
            if name in group:
                had = group[name].size // max(rows, 1)
                copy_columns(self.device, group[name], 0, wider, 0, had)
            group[name] = wider
        self.free.pop(name, None)
        self.redraw()

    def redraw(self) -> None:
        """Compute the rendered splats again, after arrays of ``raw`` were replaced."""
        self.drawn = _undrawn(self.device, self.raw, self.environment)
        self.activate()


def _rows_of(given: Any, count: int) -> NDArray[Any]:
    """What selects some of ``count`` splats, checked; see ``Parameters.selected``."""
    if is_device_array(given):
        raise InputError(
            "Parameters.selected: rows is an array on the device: give parameters.device.get(rows) "
            "or a mask made of that"
        )
    rows = as_real_array(given, name="Parameters.selected: rows")
    kind, wanted = rows.dtype.kind, f"wanted a mask of bool, ({count},), or indices below {count}"
    if rows.ndim != 1 or kind not in "biu" or (kind == "b" and len(rows) != count):
        raise InputError(
            f"Parameters.selected: rows has type {rows.dtype} and shape {rows.shape}, {wanted}"
        )
    if kind == "b":
        return rows
    if len(rows) == count > 2 and set(np.unique(rows).tolist()) <= {0, 1}:
        raise InputError(
            "Parameters.selected: a mask of whole numbers would be read as indices, of splats "
            "0 and 1 alone: give one of bool, mask.astype(bool)"
        )
    if len(rows) and not -count <= rows.min() <= rows.max() < count:
        raise InputError(
            f"Parameters.selected: rows has indices from {rows.min()} to {rows.max()}, {wanted}"
        )
    return rows


def _moments(
    device: Device, sent: Mapping[str, DeviceArray], given: Arrays | None
) -> dict[str, DeviceArray]:
    if given is None:
        return {name: device.zeros(array.shape) for name, array in sent.items()}
    return {name: device.array(given[name]) for name in sent}


def _undrawn(
    device: Device, raw: Mapping[str, DeviceArray], environment: Environment | None
) -> Splats:
    """Splats whose scales and opacities are still to be made."""
    count = raw["means"].shape[0]
    scales, opacities = device.empty((count, 3)), device.empty((count,))
    more = {name: raw[name] for name in MORE if name in raw}
    if environment is not None:
        more["environment"] = environment.raw
    return Splats(raw["means"], raw["quats"], scales, opacities, sh=raw["sh"], **more)
