"""What is analysed or planned: views of a target, whatever they come from."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import ArrayLike, NDArray

from rift_cl.cl.device import Device
from rift_cl.geometry import Camera, Cone, Parallel, Vectors
from rift_cl.sampling.coverage.device import coverage
from rift_cl.sampling.targets.free_space import FreeSpace
from rift_cl.sampling.targets.observations import Observations
from rift_cl.sampling.targets.target import Target

Floats = NDArray[np.float64]
# Points off the middle at which coverage is looked at too, so far out as a share of the radius.
_OFF = 0.7
# Frequencies beyond this come of no pixel.
_ENDLESS = 1e200


@dataclass(frozen=True, eq=False)
class ViewSet:
    """Views of a target.

    Args:
        name: of what they are, for people.
        target: what is looked at.
        up: (3,) unit vector.
        unit: of length, for people.
        cameras: the views; empty for a scan with parallel rays.
        scan: parallel rays; None where there are cameras.
        orbit: the cone or the vectors whose views the cameras are; None where they are none.
        weights: (V,) relative photons of the cameras; None where they are all alike.
        facts: what is known of the views, for people, by name.
        notes: what had to be assumed, a sentence each.
        opaque: whether the target is taken for a surface, and not for what is seen through.
        space: what stands where, as far as the views show it; None where that is not known.
        lopsided: whether a detector shows much more on one side of the axis than on the other.
    """

    name: str
    target: Target
    up: Floats
    unit: str
    cameras: tuple[Camera, ...] = ()
    scan: Parallel | None = None
    orbit: Cone | Vectors | None = None
    weights: Floats | None = None
    facts: Mapping[str, object] = field(default_factory=dict)
    notes: tuple[str, ...] = ()
    opaque: bool = False
    space: FreeSpace | None = None
    lopsided: bool = False

    @property
    def views(self) -> int:
        """How many there are."""
        return len(self.cameras) if self.scan is None else self.scan.angles.size

    @property
    def units(self) -> str:
        """The unit of length where there are several."""
        return self.unit if self.unit not in ("unit", "bin") else f"{self.unit}s"

    @property
    def finest(self) -> float:
        """The frequency beyond which no view's pixels and lens pass anything, at the middle.

        The target's highest where views have neither.
        """
        observations = self.observations(self.target.center[None])
        observed = observations.weight[:, 0] > 0
        if not observed.any():
            return self.target.highest
        pixels = 0.5 / np.maximum(observations.pixel[observed, 0], 1e-300)
        finest = float(np.minimum(pixels, observations.cutoff[observed, 0]).max())
        return finest if finest < _ENDLESS else self.target.highest

    @property
    def is_flat(self) -> bool:
        """Whether the target is a plane, as the slices of a scan are."""
        return self.target.is_flat

    @property
    def named_points(self) -> dict[str, Floats]:
        """The points of the target at which coverage is looked at; see ``points_of``."""
        target, flat = self.target, self.is_flat
        return points_of(target.center, target.diameter, self.up, flat=flat, lopsided=self.lopsided)

    def observations(self, points: ArrayLike | None = None) -> Observations:
        """How the views see points (P, 3); those of the target when not given."""
        at = self.target.points if points is None else np.asarray(points, np.float64)
        if self.scan is not None:
            return Observations.of_scan(self.scan, at)
        return Observations.of(self.cameras, at, self.weights)

    def coverage(
        self,
        k: ArrayLike,
        device: Device,
        *,
        points: ArrayLike | None = None,
        diameter: float | None = None,
    ) -> Floats:
        """Coverage (P, K) at frequencies (K, 3).

        Args:
            k: in cycles per unit of length.
            device: that computes it.
            points: (P, 3); those of the target when not given.
            diameter: that smears the slices; that of the target when not given.
        """
        # Coverage asks where and how large a target is; its normals are for merits.
        target = Target(
            self.target.center,
            diameter or self.target.diameter,
            self.target.points if points is None else np.asarray(points, np.float64),
        )
        found = coverage(self.observations(target.points), target, k, device=device)
        return np.asarray(found, np.float64)

    def directions(self) -> Floats:
        """Unit vectors (n, 3) from the target's middle to the views that see it."""
        observations = self.observations(self.target.center[None])
        return np.asarray(observations.direction[observations.weight[:, 0] > 0, 0])

    def with_cameras(self, cameras: Sequence[Camera], weights: ArrayLike | None = None) -> ViewSet:
        """The same target seen by more cameras."""
        light = None
        if weights is not None or self.weights is not None:
            own = np.ones(len(self.cameras)) if self.weights is None else self.weights
            more = np.ones(len(cameras)) if weights is None else np.asarray(weights, np.float64)
            light = np.concatenate([own, more])
        return replace(self, cameras=(*self.cameras, *cameras), weights=light)


def place_of(target: Target) -> str:
    """The middle of a target, for people; what rounding left off zero is zero."""
    near = np.where(np.abs(target.center) < 1e-9 * target.diameter, 0, target.center)
    return "({:.4g}, {:.4g}, {:.4g})".format(*near)


def points_of(
    center: Floats, diameter: float, up: Floats, *, flat: bool, lopsided: bool = False
) -> dict[str, Floats]:
    """Points of a target at which coverage is looked at, by what they are called.

    Across the axis of a lopsided detector they are on all sides: what one of two opposite points
    is seen from need not be what the other is seen from.
    """
    from rift_cl.report.plot.camera_plot import axis_names, upright_frame

    frame = upright_frame(up)
    first, second, third = axis_names(frame)
    step = _OFF * diameter / 2
    out = {"middle": center, f"off the middle, {first}": center + step * frame[0]}
    name, way = (second, frame[1]) if flat else (third, frame[2])
    out[f"off the middle, {name}"] = center + step * way
    if lopsided:
        for word, across in ((first, frame[0]), (second, frame[1])):
            out.setdefault(f"off the middle, {word}", center + step * across)
            out[f"off the middle, -{word}"] = center - step * across
    return out
