"""What solvers do to whole images: sums, weights, inner products, and total variation.

A cost here asks a case for its ``size`` in samples, ``axes``, and the bytes of a number.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np

import rift_cl as rift
from bench.case import Case
from bench.costs import Cost
from bench.operations import Task
from rift_cl.cl.arithmetic import axpby
from rift_cl.cl.array_home import ArrayHome
from rift_cl.cl.elementwise import clip_between, clip_negative, multiply, pull_to_levels
from rift_cl.cl.reductions import dot
from rift_cl.reconstruct.direct.ray_factors import RayFactors
from rift_cl.reconstruct.solvers.tv_functional import TotalVariation

# Of the noise in an image from 0 to 1, and the longest vector of the dual, its weight.
_NOISE, _RADIUS = 0.02, 0.1


@dataclass(frozen=True)
class VectorCase:
    """An image or a volume.

    Args:
        shape: (y, x) or (z, y, x).
    """

    shape: tuple[int, ...]
    itemsize = 4

    @property
    def name(self) -> str:
        """How tables call it."""
        edges = set(self.shape)
        power = {2: "²", 3: "³"}[self.axes]
        return f"{self.shape[0]}{power}" if len(edges) == 1 else " × ".join(map(str, self.shape))

    @property
    def axes(self) -> int:
        """Axes of the image."""
        return len(self.shape)

    @property
    def size(self) -> int:
        """Samples of the image."""
        return math.prod(self.shape)

    def record(self) -> dict[str, Any]:
        """How the JSON file tells it from others."""
        return {"name": self.name, "shape": list(self.shape)}


def _vector(flops: int, arrays: int, formula: str) -> Cost:
    return Cost("sample", flops, lambda c: c.size, lambda c: c.itemsize * arrays * c.size, formula)


def _variation(axes: int) -> dict[str, Cost]:
    """Differences along each axis, and what is made of them."""
    return {
        "tv_magnitude": _vector(
            4 * axes,
            2,
            "4 flop per sample and axis: difference, scale, square, sum or root; bytes: the image "
            "in, lengths out",
        ),
        "tv_dual_step": _vector(
            6 * axes + 1,
            2 * axes + 1,
            "6 flop per sample and axis: difference, step, square, share; 1 more for the root; "
            "bytes: image and dual in, dual out",
        ),
        "tv_adjoint": _vector(
            3 * axes + 1,
            axes + 2,
            "3 flop per sample and axis: difference, scale, sum; 1 more to scale the image; bytes: "
            "image and dual in, image out",
        ),
    }


VECTOR_COSTS: dict[str, Cost] = {
    "axpby": _vector(3, 3, "3 flop per sample; bytes: two arrays in, one out"),
    "multiply": _vector(1, 3, "1 flop per sample; bytes: two arrays in, one out"),
    "rays_weigh": _vector(2, 2, "2 flop per sample; bytes: rays in and out, factors stay cached"),
    "clip_negative": _vector(0, 2, "no arithmetic; bytes: an array in and out"),
    "clip_between": _vector(0, 4, "no arithmetic; bytes: an array and its bounds in, it out"),
    "level_pull": _vector(
        5,
        3,
        "5 flop per sample: the middle of two levels, distance, multiply-add; bytes: the image in, "
        "the gradient in and out",
    ),
    "dot_product": _vector(
        5,
        2,
        "5 flop per sample: a product, and a sum with what rounding took from it; no product in a "
        "plain sum; bytes: one array in, or two",
    ),
    **_variation(2),
}
VOLUME_COSTS = {**VECTOR_COSTS, **_variation(3)}
# The sum of lengths in TV's value reads one array, and has no product.
_SUM = {"dot_product": _vector(4, 1, VECTOR_COSTS["dot_product"].formula)}


def vector_tasks(device: rift.Device, shape: tuple[int, ...]) -> Iterator[Task]:
    """Every kernel of its own, on arrays of one shape."""
    case, costs = VectorCase(shape), VECTOR_COSTS if len(shape) == 2 else VOLUME_COSTS
    for name, run in _runs(device, shape).items():
        own = _SUM if name == "variation" else {}
        yield Task(f"{name}, {case.name}", case, run, {**costs, **own})


def _runs(device: rift.Device, shape: tuple[int, ...]) -> dict[str, Callable[[], Any]]:
    # A head with noise, and a dual that follows it: which vectors are shortened, and how well that
    # is foreseen, depends on the image.
    head = Case(shape[-1], 2, slices=math.prod(shape[:-2])).image.reshape(shape)
    x = device.array(head + _NOISE * np.random.default_rng(0).standard_normal(shape))
    y, ones, out = device.array(head), device.array(np.ones(shape)), device.empty(shape)
    low, levels = device.zeros(shape), device.array(np.array([0.0, 0.5, 1.0], np.float32))
    V = TotalVariation(ArrayHome(device, np.float32), shape, (1.0,) * len(shape))
    u = device.zeros(V.field_shape)
    rays = RayFactors(device, np.float32, np.ones((1, shape[-1])), np.ones((shape[0], shape[-1])))
    return {
        "sum": lambda: axpby(device, 0.5, x, 0.5, y),
        "weights": lambda: multiply(device, ones, y),
        "weights of rays": lambda: rays.widen(x, out),
        "clip": lambda: clip_negative(device, y),
        "clip between": lambda: clip_between(device, low, ones, y),
        "level pull": lambda: pull_to_levels(device, levels, 0.1, x, out),
        "inner product": lambda: dot(device, x, y),
        "variation": lambda: V.value(x),
        "dual step": lambda: V.dual_step(u, x, u, step=0.1, radius=_RADIUS),
        "adjoint": lambda: V.add_adjoint(1.0, x, -1.0, u, out, nonnegative=True),
    }
