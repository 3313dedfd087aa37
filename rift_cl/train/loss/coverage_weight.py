"""Inverse coverage as the weight of a residual: what all views know well counts less.

The ramp of ``rift_cl.train.loss.homogenisation`` is the inverse density of views that lie evenly on
a sphere, or on a ring. Here the density is counted: an image frequency f of a view stands for the
frequency k of the target on that view's slice, which all views together cover L(k) times
(``rift_cl.sampling.coverage.device``), so that it gets the weight (1 / L)^p. Even views on a sphere
give |k|^p, a ring |k_r|^p along the rows of its detector, up to where the slices part (Crowther's
frequency); beyond, a view alone knows its slice and the weight is flat.

L is taken at the middle of what the cameras look at, for a target that fills their pictures. It is
kept on a polar grid, since slices of other views meet that of a view in lines through zero.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import map_coordinates

from rift_cl.cl.device import Device
from rift_cl.geometry import Camera
from rift_cl.operators.fourier.spectrum import Response
from rift_cl.sampling.coverage.device import coverage
from rift_cl.sampling.targets.observations import Observations
from rift_cl.sampling.targets.target import Target
from rift_cl.train.loss.homogenisation import Homogenisation
from rift_cl.train.start.points import field_diameter, focus_of

Floats = NDArray[np.float64]

# Angles over half a turn and radii of the grid, the largest in the corner of a spectrum.
_ANGLES, _RADII, _LARGEST = 64, 24, np.sqrt(0.5)
# Few views are lines on the grid, finer than its cells: so many views at least, or directions
# within the cells, are averaged over.
_LINES = 256
# The least coverage: a square pixel passes more at any frequency, an aperture may pass nothing.
_LEAST = 0.1


def weight_of(
    chosen: Homogenisation, cameras: Sequence[Camera], device: Device
) -> CoverageWeight | None:
    """Coverage weights, if the settings ask for them; None for the ramp or no weights."""
    if chosen.weight == "ramp" or not chosen.exponent:
        return None
    return CoverageWeight(cameras, device)


class CoverageWeight:
    """The weights of all views' image frequencies.

    Args:
        cameras: all that are trained on.
        device: where coverage is counted.
    """

    def __init__(self, cameras: Sequence[Camera], device: Device) -> None:
        self.device = device
        self._cameras = cameras
        self._observations = Observations.of(cameras, focus_of(cameras)[None])
        self._longest = np.array([max(camera.size) for camera in cameras])
        self._target = Target(focus_of(cameras), field_diameter(cameras))
        self._tables: dict[int, NDArray[np.float32]] = {}

    def response(self, view: int, exponent: float, shrink: int = 1) -> Response:
        """The weight of a view's image frequencies, in cycles per pixel.

        ``shrink`` is how many of the camera's pixels a pixel is long.
        """
        table, diminishing_returns = self._table(view), self._diminishing_returns(view)

        def weight(ky: Floats, kx: Floats) -> Floats:
            ky, kx = ky / shrink, kx / shrink
            radius = np.arcsinh(np.hypot(ky, kx) / diminishing_returns) / np.arcsinh(
                _LARGEST / diminishing_returns
            )
            angle = np.mod(np.arctan2(ky, kx), np.pi) / np.pi
            places = np.broadcast_arrays(angle * _ANGLES - 0.5, radius * (_RADII - 1))
            # The last angle is the neighbour of the first: spectra of pictures are even.
            around = np.concatenate([table[-1:], table, table[:1]])
            logs = map_coordinates(around, [places[0] + 1, places[1]], order=1, mode="nearest")
            return np.asarray(np.exp(-exponent * logs), np.float64)

        return weight

    def _diminishing_returns(self, view: int) -> float:
        """The frequency from which the grid's radii lie in proportion to themselves."""
        return float(0.5 / self._longest[view])

    def _table(self, view: int) -> NDArray[np.float32]:
        """The logarithm of the coverage on the grid, (angles, radii)."""
        if view not in self._tables:
            self._tables[view] = self._counted(view)
        return self._tables[view]

    def _counted(self, view: int) -> NDArray[np.float32]:
        if not self._observations.weight[view, 0]:
            # What the others know where this one does not look says nothing about it.
            return np.zeros((_ANGLES, _RADII), np.float32)
        within = -(-_LINES // len(self._cameras))
        angles = (np.arange(_ANGLES * within) + 0.5) * (np.pi / _ANGLES / within)
        diminishing_returns = self._diminishing_returns(view)
        radii = diminishing_returns * np.sinh(
            np.linspace(0, 1, _RADII) * np.arcsinh(_LARGEST / diminishing_returns)
        )
        ky, kx = np.sin(angles)[:, None] * radii, np.cos(angles)[:, None] * radii
        k = self._on_slice(view, ky.ravel(), kx.ravel())
        covered = coverage(self._observations, self._target, k, device=self.device)[0]
        means = covered.reshape(_ANGLES, within, _RADII).mean(axis=1)
        return np.asarray(np.log(np.maximum(means, _LEAST)), np.float32)

    def _on_slice(self, view: int, ky: Floats, kx: Floats) -> Floats:
        """Frequencies (n, 3) of the target on the slice of a view's image frequencies."""
        camera, sight = self._cameras[view], self._observations.direction[view, 0]
        fx, fy = camera.intrinsics[:2]
        axes = camera.view[:2, :3]
        # Across the line of sight, which need not be the optical axis.
        axes = axes - np.outer(axes @ sight, sight)
        axes /= np.linalg.norm(axes, axis=1, keepdims=True)
        pixels = np.stack([kx, ky * (fy / fx)], axis=1) / self._observations.pixel[view, 0]
        return np.asarray(pixels @ axes)
