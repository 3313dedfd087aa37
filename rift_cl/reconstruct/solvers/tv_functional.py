"""Total variation: its value, its dual steps, and its proximal map.

    TV(x) = sum over samples of |D x| * volume of a sample,

D the forward differences divided by the grid's spacing. This is the integral of the gradient's
length, in the image's unit times length^(axes - 1): for an image, jump times length of the edge,
whatever the grid's spacing. It is isotropic, or weighs D x by direction (``direction_weights``).
``kernels/include/tomo/differences.h`` says what happens at the borders. Images that are kept beside
the device are worked on in runs of slices, with the same bits.

Its proximal map has no closed form; it is found on the dual, where every sample holds a vector
``u`` of length at most the weight (Chambolle, J. Math. Imaging Vis. 20, 2004), by the accelerated
projected gradient of Beck and Teboulle (IEEE Trans. Image Process. 18, 2009), which takes the
constraint x >= 0 in its stride.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from rift_cl.cl.arithmetic import axpby
from rift_cl.cl.array import AnyArray
from rift_cl.cl.array_home import ArrayHome
from rift_cl.cl.elementwise import copy
from rift_cl.cl.passing_parts import runs
from rift_cl.cl.reductions import total
from rift_cl.errors import ShapeError
from rift_cl.reconstruct.solvers.direction_weights import DirectionWeights

# Samples of a row that one work-item of a CPU goes through.
_CPU_RUN = 4096


class TotalVariation:
    """Total variation of images of one shape.

    Args:
        home: where the images are, and of which type.
        shape: (y, x) or (z, y, x).
        spacing: distance between samples along each axis.
        directions: how much a gradient counts by its direction; None: all alike.

    Raises:
        ShapeError: the shape is neither an image's nor a volume's.
    """

    def __init__(
        self,
        home: ArrayHome,
        shape: tuple[int, ...],
        spacing: tuple[float, ...],
        directions: DirectionWeights | None = None,
    ) -> None:
        if len(shape) not in (2, 3) or len(spacing) != len(shape):
            raise ShapeError(
                f"total variation of shape {shape} with spacing {spacing}, wanted (y, x) or "
                "(z, y, x) and a spacing for each"
            )
        device = home.device
        self.home, self.device, self.shape, self.dtype = home, device, shape, home.dtype
        self._spacing, self._directions = spacing, directions
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
            "DOUBLE": int(home.dtype == np.float64),
            "DIRECTIONAL": int(directions is not None),
        }

    def value(self, image: AnyArray) -> float:
        """TV of an image."""
        lengths = self.home.empty(self.shape)
        self._launch("tv_magnitude", {"image": image}, {"magnitude": lengths}, self._along("step"))
        return self.cell * total(self.device, lengths)

    def dual_step(
        self, u: AnyArray, image: AnyArray, moved: AnyArray, *, step: float, radius: float
    ) -> None:
        """``moved`` = u + step D image, each sample's vector shortened to the radius."""
        numbers = {"radius": radius, **self._along("step", step)}
        self._launch("tv_dual_step", {"u": u, "image": image}, {"moved": moved}, numbers)

    def add_adjoint(
        self,
        a: float,
        image: AnyArray,
        scale: float,
        u: AnyArray,
        out: AnyArray,
        *,
        nonnegative: bool = False,
    ) -> None:
        """``out`` = a image + scale D' u, with negative values cut off if asked for."""
        numbers = {"a": a, **self._along("scale", scale), "NONNEGATIVE": int(nonnegative)}
        self._launch("tv_adjoint", {"image": image, "u": u}, {"out": out}, numbers)

    def _launch(
        self,
        kernel: str,
        given: dict[str, AnyArray],
        made: dict[str, AnyArray],
        numbers: dict[str, float],
    ) -> None:
        """Launch a kernel on arrays of the device, or on runs of slices of those of the host."""
        if self.home.on_device:
            self.device.launch(kernel, self._items, **given, **made, **numbers, **self._common)
            return
        every = (*given.values(), *made.values())
        slices = self.shape[0]
        each = sum(x.nbytes for x in every) // slices
        array = max(x.nbytes for x in every) // slices
        room = min(self.device.budget // (2 * each), self.device.traits.allocation // array)
        most = max(room - 2, 1)
        for run in runs(slices, most):
            # Differences reach to the slices beside.
            first, stop = max(run.start - 1, 0), min(run.stop + 1, slices)
            inside = slice(run.start - first, run.stop - first)
            self._launch_part(kernel, given, made, numbers, slice(first, stop), inside)

    def _launch_part(
        self,
        kernel: str,
        given: dict[str, AnyArray],
        made: dict[str, AnyArray],
        numbers: dict[str, float],
        part: slice,
        inside: slice,
    ) -> None:
        """Launch a kernel on some slices, and keep what it makes in some of them."""
        shape = (part.stop - part.start, *self.shape[1:])
        home = ArrayHome(self.device, self.home.dtype)
        of_part = TotalVariation(home, shape, self._spacing, self._directions)
        taken = {name: home.array(self._slices(x, part)) for name, x in given.items()}
        out = {name: home.empty(self._slices(x, part).shape) for name, x in made.items()}
        of_part._launch(kernel, taken, out, numbers)
        wanted = slice(part.start + inside.start, part.start + inside.stop)
        for name, x in made.items():
            found = self._slices(home.host(out[name]), inside)
            self._slices(x, wanted)[...] = found

    def _slices(self, x: Any, part: slice) -> Any:
        """Some slices of an image, or of all components of a field."""
        return x[part] if len(x.shape) == len(self.shape) else x[:, part]

    def _along(self, name: str, factor: float = 1.0) -> dict[str, float]:
        """A factor over the spacing of each axis, as kernels are told."""
        axes = zip("zyx", self._inverse, strict=True)
        return {f"{name}_{axis}": factor * inverse for axis, inverse in axes}

    def denoise(
        self,
        image: AnyArray,
        u: AnyArray,
        out: AnyArray,
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
        moved, ahead = (self.home.empty(self.field_shape) for _ in range(2))
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
