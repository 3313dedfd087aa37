"""Total variation on the device: its value, its dual steps, and its proximal map.

    TV(x) = sum over samples of |D x| * volume of a sample,

D the forward differences divided by the grid's spacing. This is the integral of the gradient's
length, in the image's unit times length^(axes - 1): for an image, jump times length of the edge,
whatever the grid's spacing. It is isotropic, or weighs D x by direction (``direction_weights``).
``kernels/include/tomo/differences.h`` says what happens at the borders.

Its proximal map has no closed form; it is found on the dual, where every sample holds a vector
``u`` of length at most the weight (Chambolle, J. Math. Imaging Vis. 20, 2004), by the accelerated
projected gradient of Beck and Teboulle (IEEE Trans. Image Process. 18, 2009), which takes the
constraint x >= 0 in its stride.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import DTypeLike

from rift_cl.cl.arithmetic import axpby
from rift_cl.cl.array import DeviceArray
from rift_cl.cl.device import Device
from rift_cl.cl.elementwise import copy
from rift_cl.cl.reductions import total
from rift_cl.errors import ShapeError
from rift_cl.reconstruct.solvers.direction_weights import DirectionWeights

# Samples of a row that one work-item of a CPU goes through.
_CPU_RUN = 4096


class TotalVariation:
    """Total variation of images of one shape.

    Args:
        device: where the images are.
        shape: (y, x) or (z, y, x).
        spacing: distance between samples along each axis.
        dtype: of the images.
        directions: how much a gradient counts by its direction; None: all alike.

    Raises:
        ShapeError: the shape is neither an image's nor a volume's.
    """

    def __init__(
        self,
        device: Device,
        shape: tuple[int, ...],
        spacing: tuple[float, ...],
        dtype: DTypeLike,
        directions: DirectionWeights | None = None,
    ) -> None:
        if len(shape) not in (2, 3) or len(spacing) != len(shape):
            raise ShapeError(
                f"total variation of shape {shape} with spacing {spacing}, wanted (y, x) or "
                "(z, y, x) and a spacing for each"
            )
        self.device, self.shape, self.dtype = device, shape, np.dtype(dtype)
        self.cell = math.prod(spacing)
        """Volume of a sample."""
        self.field_shape = (len(shape), *shape)
        """Shape of a gradient or dual field."""
        lengths = zip(shape, spacing, strict=True)
        heaviest = 1.0 if directions is None else directions.heaviest(len(shape))
        self.norm_squared = heaviest**2 * 4 * sum(1 / h**2 for n, h in lengths if n > 1)
        """An upper bound of |D|^2, next to attained; 0 for a single sample."""
        full = (1,) * (3 - len(shape)) + shape
        self._inverse = tuple(1 / h for h in (1.0,) * (3 - len(shape)) + tuple(spacing))
        run = _CPU_RUN if device.traits.is_cpu else 1
        self._items = (-(-full[2] // run), full[1], full[0])
        matrix = (1.0, 0.0, 1.0) if directions is None else directions.matrix
        # What all three kernels are told alike.
        self._common = {
            **dict(zip(("nz", "ny", "nx"), full, strict=True)),
            **dict(zip(("m_yy", "m_yx", "m_xx"), matrix, strict=True)),
            "AXES": len(shape),
            "RUN": run,
            "DOUBLE": int(self.dtype == np.float64),
            "DIRECTIONAL": int(directions is not None),
        }

    def value(self, image: DeviceArray) -> float:
        """TV of a device array."""
        lengths = self.device.empty(self.shape, self.dtype)
        self.device.launch(
            "tv_magnitude",
            self._items,
            image=image,
            magnitude=lengths,
            **self._along("step"),
            **self._common,
        )
        return self.cell * total(self.device, lengths)

    def dual_step(
        self, u: DeviceArray, image: DeviceArray, moved: DeviceArray, *, step: float, radius: float
    ) -> None:
        """``moved`` = u + step D image, each sample's vector shortened to the radius."""
        self.device.launch(
            "tv_dual_step",
            self._items,
            u=u,
            image=image,
            moved=moved,
            radius=radius,
            **self._along("step", step),
            **self._common,
        )

    def add_adjoint(
        self,
        a: float,
        image: DeviceArray,
        scale: float,
        u: DeviceArray,
        out: DeviceArray,
        *,
        nonnegative: bool = False,
    ) -> None:
        """``out`` = a image + scale D' u, with negative values cut off if asked for."""
        self.device.launch(
            "tv_adjoint",
            self._items,
            image=image,
            u=u,
            out=out,
            a=a,
            **self._along("scale", scale),
            **self._common,
            NONNEGATIVE=int(nonnegative),
        )

    def _along(self, name: str, factor: float = 1.0) -> dict[str, float]:
        """A factor over the spacing of each axis, as kernels are told."""
        axes = zip("zyx", self._inverse, strict=True)
        return {f"{name}_{axis}": factor * inverse for axis, inverse in axes}

    def denoise(
        self,
        image: DeviceArray,
        u: DeviceArray,
        out: DeviceArray,
        *,
        weight: float,
        steps: int,
        nonnegative: bool,
    ) -> None:
        """``out`` = argmin over x (of x >= 0) of |x - image|^2 / 2 + weight TV(x), nearly.

        Args:
            image: what to denoise.
            u: dual field to begin from, and where it ends; a good one from before saves steps.
            out: where to put the result; not ``image``.
            weight: in the image's unit times length.
            steps: of the dual.
            nonnegative: whether x >= 0.
        """
        moved, ahead = (self.device.empty(self.field_shape, self.dtype) for _ in range(2))
        copy(self.device, u, ahead)
        step = 1 / self.norm_squared if self.norm_squared else 0.0
        t = 1.0
        for _ in range(steps):
            self.add_adjoint(1.0, image, -1.0, ahead, out, nonnegative=nonnegative)
            self.dual_step(ahead, out, moved, step=step, radius=weight * self.cell)
            following = following_weight(t)
            # ahead = moved + momentum (moved - u); then u = moved.
            momentum = (t - 1) / following
            axpby(self.device, -momentum, u, 0.0, ahead)
            axpby(self.device, 1 + momentum, moved, 1.0, ahead)
            copy(self.device, moved, u)
            t = following
        self.add_adjoint(1.0, image, -1.0, u, out, nonnegative=nonnegative)


def following_weight(t: float) -> float:
    """The weight that follows t in Nesterov's sequence, 1, 1.618, 2.194, and so on.

    A step with weight t looks ahead by (t - 1) / following of its own length.
    """
    return (1 + math.sqrt(1 + 4 * t * t)) / 2
