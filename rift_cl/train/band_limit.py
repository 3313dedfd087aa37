"""No splat finer than what the cameras resolve: the per-splat band limit of Mip-Splatting.

What is finer than half a pixel of every photograph was never sampled; a splat that holds it shows
it as soon as a camera comes nearer (Yu et al. 2024, section 4.1). The limit is a Gaussian blur in
space, set anew as splats move.

One camera that comes near lowers that limit by itself. The other choice asks how well all cameras
together know a frequency k at a splat: the mean of their coverage L over the directions of k, times
the signal to noise of one look, which falls with k as power laws do; the last k where this is above
1 sets the limit. It is the former where views are many and clean, and coarser where they are few,
noisy, or out of focus.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray

from rift_cl.cl.array import DeviceArray
from rift_cl.cl.device import Device
from rift_cl.geometry import Camera
from rift_cl.train.start.points import field_diameter, focus_of

if TYPE_CHECKING:
    from rift_cl.train.parameters import Parameters

# Pictures whose contrast is measured.
_FEW = 8
# Finer than any frequency matters: signal to noise of pictures without noise.
_CLEAN = 1e30


class Targets(Protocol):
    """The pictures of a fit, as far as their contrast is concerned."""

    cameras: Sequence[Camera]

    def target(self, number: int) -> DeviceArray:
        """(height, width, C) device array."""


class Detail(NamedTuple):
    """How much of a target shows above the noise of one picture.

    Args:
        diameter: of the target, in the unit of the world.
        snr: power at one cycle per diameter over that of the noise; it falls as k^-2.
    """

    diameter: float
    snr: float

    @classmethod
    def of(cls, device: Device, pictures: Targets, noise: float) -> Detail:
        """From the contrast of a few pictures, whose power is taken to fall as k^-2.

        Args:
            device: where the pictures are.
            pictures: of the fit.
            noise: standard deviation of their noise.
        """
        cameras = pictures.cameras
        diameter = field_diameter(cameras)
        if not noise:
            return cls(diameter, _CLEAN)
        few = np.unique(np.linspace(0, len(cameras) - 1, _FEW).astype(int)).tolist()
        images = [device.get(pictures.target(number)) for number in few]
        levels = [_level(image.shape[:2]) * image.var(axis=(0, 1)).mean() for image in images]
        return cls(diameter, min(float(np.median(levels)) / noise**2, _CLEAN))


def _level(size: Sequence[int]) -> float:
    """Power of variance 1 at one cycle per edge, over white noise of variance 1.

    A power c (f n)^-2 of frequencies f in cycles per pixel, level below 1 / n, integrates to the
    variance over the plane, or over the line for a single row of pixels.
    """
    n = float(max(size))
    if min(size) == 1:
        return n / (4 * max(1 - 1 / n, 0.5))
    return float(n**2 / (np.pi * (1 + 2 * np.log(max(n / 2, 1)))))


def camera_table(cameras: Sequence[Camera]) -> NDArray[np.float32]:
    """What ``kernels/train/splat_band.cl`` reads of cameras, (V, 20).

    An orthographic camera resolves the same at every depth: its third row gives every point the
    depth one.
    """
    return np.array([_row(camera) for camera in cameras], np.float32)


def _row(camera: Camera) -> list[float]:
    view = camera.view[:3].copy()
    if camera.model == "ortho":
        view[2] = (0, 0, 0, 1)
    fx, fy, cx, cy = camera.intrinsics
    lens = camera.aperture
    opening = [0.0] * 3 if lens is None else [lens.radius, 1 / lens.focus, lens.wavelength]
    return [*view.ravel(), max(fx, fy), cx, cy, camera.width, camera.height, *opening]


def unseen_length(cameras: Sequence[Camera]) -> float:
    """The limit of a splat that no camera sees: that of the scene's middle in the median camera."""
    middle = focus_of(cameras)
    depths = [abs(camera.view[2, :3] @ middle + camera.view[2, 3]) for camera in cameras]
    focal = [max(camera.intrinsics[:2]) for camera in cameras]
    return float(np.sqrt(0.2) * np.median(np.divide(depths, focal)))


class BandLimiter:
    """Sets the limit of a run's splats, from its cameras and pictures.

    Args:
        device: where the splats are.
        pictures: of the fit.
        noise: standard deviation of their noise, where coverage sets the limit; None for pixels
            alone.
    """

    def __init__(self, device: Device, pictures: Targets, *, noise: float | None) -> None:
        self._detail = None if noise is None else Detail.of(device, pictures, noise)
        self._cameras = device.array(camera_table(pictures.cameras))
        self._unseen = unseen_length(pictures.cameras)

    def limit(self, parameters: Parameters, *, near: float) -> None:
        """Set it anew; cameras do not see what is nearer than ``near``."""
        parameters.limit_band(self._cameras, near=near, unseen=self._unseen, detail=self._detail)
