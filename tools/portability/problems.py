"""Fixed problems of every family of kernels: functions from a device to named arrays.

Those that `rift devices` tries a driver on, and others that are larger or take settings that these
do not. Their input is the same on every device, and between them they launch nearly every kernel.
`family_runs.py` runs them, and `differences.py` compares what two drivers give.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

import rift_cl as rift
from rift_cl.basis import angular_basis
from rift_cl.commands.devices import families
from rift_cl.operators.fourier.spectrum import SpectralFilter
from rift_cl.splat import SplatGradients, shade, shade_grad
from rift_cl.splat.orders import count_of
from rift_cl.splat.tile_lists import Tiles, tile_lists
from rift_cl.train import ImageLoss

Arrays = dict[str, np.ndarray]
Problem = Callable[[rift.Device, bool], Arrays]


def _of_one_size(family: Callable[[rift.Device], Arrays]) -> Problem:
    return lambda device, tiny: family(device)


FAMILIES: dict[str, Problem] = {
    name: _of_one_size(family) for name, family in families.FAMILIES.items()
}
_FOCAL = {"pinhole": 60.0, "ortho": 16.0, "fisheye": 50.0}


def _family(problem: Problem) -> Problem:
    FAMILIES[problem.__name__] = problem
    return problem


def _projector(
    device: rift.Device, tiny: bool, kind: Any = rift.Projector, **options: Any
) -> tuple[rift.Grid, Any]:
    n = 24 if tiny else 128
    grid = rift.Grid((n, n), spacing=0.1)
    scan = rift.Parallel(np.arange(n) * np.pi / n, bins=int(n * 1.42) + 2, pitch=0.1)
    return grid, kind(grid, scan, device=device, **options)


def _noise(shape: tuple[int, ...], dtype: Any = np.float32, seed: int = 1) -> np.ndarray:
    return np.random.default_rng(seed).normal(size=shape).astype(dtype)


def _products(A: Any, x: np.ndarray) -> np.ndarray:
    """<A x, y> and <x, A' y>: both sides of what an adjoint is."""
    y = _noise(A.range, x.dtype, seed=2)
    sides = (np.vdot(A(x).astype(float), y), np.vdot(x.astype(float), A.T(y)))
    return np.array(sides)


@_family
def adjoint(device: rift.Device, tiny: bool) -> Arrays:
    """Both sides of the dot test."""
    grid, A = _projector(device, tiny)
    return {"products": _products(A, _noise(grid.shape))}


@_family
def footprints(device: rift.Device, tiny: bool) -> Arrays:
    """Footprints of a pixel on the detector, bins narrower and wider than pixels."""
    n, found = 12 if tiny else 64, {}
    grid = rift.Grid((n, n))
    for name in ("strip", "linear"):
        for pitch in (0.5, 3.0):
            angles = np.linspace(0, np.pi, 17, endpoint=False)
            scan = rift.Parallel(angles, bins=2 * n, pitch=pitch)
            A = rift.Projector(grid, scan, name, device=device)
            y = A(_noise(grid.shape))
            found |= {f"{name} {pitch}": y, f"{name} {pitch} adjoint": A.T(y)}
    return found


@_family
def stack(device: rift.Device, tiny: bool) -> Arrays:
    """A stack of slices."""
    n = 12 if tiny else 40
    grid = rift.Grid((n // 2, n, n))
    scan = rift.Parallel(np.linspace(0, np.pi, 15, endpoint=False), bins=int(1.5 * n))
    A = rift.Projector(grid, scan, device=device)
    y = A(_noise(grid.shape))
    return {"projections": y, "adjoint": A.T(y), "fbp": rift.fbp(A, y)}


@_family
def double(device: rift.Device, tiny: bool) -> Arrays:
    """Double precision; nothing where the device has none."""
    if not device.traits.fp64:
        return {}
    grid, A = _projector(device, tiny, dtype="float64")
    x = _noise(grid.shape, float)
    y = A(x)
    fbp = rift.fbp(A, y)
    return {"projections": y, "adjoint": A.T(y), "fbp": fbp, "products": _products(A, x)}


@_family
def fast(device: rift.Device, tiny: bool) -> Arrays:
    """The projector by Fourier transforms."""
    grid, A = _projector(device, tiny, rift.FastProjector, error=1e-4)
    y = A(rift.phantom.shepp_logan(grid))
    products = _products(A, _noise(grid.shape))
    return {"projections": y, "adjoint": A.T(y), "products": products}


@_family
def solvers(device: rift.Device, tiny: bool) -> Arrays:
    """A few steps of CGLS, SIRT and total variation."""
    grid, A = _projector(device, tiny)
    y = A(rift.phantom.shepp_logan(grid))
    return {
        "cgls": rift.cgls(A, y, steps=3, precondition="ramp"),
        "sirt": rift.sirt(A, y, steps=3),
        "tv": rift.tv(A, y, 0.01, steps=5, nonnegative=True),
    }


@_family
def sorting(device: rift.Device, tiny: bool) -> Arrays:
    """Radix sort by depth and lists of tiles: whole numbers, equal on every device."""
    found = {}
    for count, sort in ((1, True), (500 if tiny else 20000, True), (300, False)):
        random = np.random.default_rng(count)
        low = random.integers([-3, -3], [12, 10], (count, 2))
        boxes = np.concatenate([low, low + random.integers(0, 4, (count, 2))], axis=1)
        depth = device.array(random.uniform(0.1, 9, count).astype(np.float32))
        lists = tile_lists(
            device, device.array(boxes.astype(np.int32)), depth, Tiles(9, 7, 0), sort=sort
        )
        for field in ("slots", "entries", "starts"):
            found[f"{count} {field}"] = device.get(getattr(lists, field))
    return found


@_family
def cameras(device: rift.Device, tiny: bool) -> Arrays:
    """Images of Gaussian splats and every gradient, by camera and by setting."""
    scene = _scene(40 if tiny else 800, coefficients=4, wide=0.8)
    given = rift.Splats.upload(device, **scene)
    found = {}
    for model in ("ortho", "fisheye"):
        found |= _drawn(device, given, f"{model} ", tiny, model=model)
    for name, options in {
        "pinhole": {},
        "xray": {"mode": "xray"},
        "smooth": {"smooth_cutoff": True},
        "antialiased": {"antialiased": True},
        "tile 8": {"tile": 8},
        "tile 32": {"tile": 32},
    }.items():
        found |= _drawn(device, given, f"{name} ", tiny, **options)
    return found | _drawn(device, given, "depth ", tiny, depth="expected")


@_family
def orders(device: rift.Device, tiny: bool) -> Arrays:
    """Splats with Hermite modes of shape and colour, their squares and X-rays of them."""
    found = {}
    for shape, color in ((1, 1), (2, 0), (3, 1)):
        given = rift.Splats.upload(device, **_modal(20 if tiny else 200, shape, color))
        found |= _drawn(device, given, f"{shape} {color} ", tiny)
        found |= _drawn(device, given, f"{shape} {color} square ", tiny, activation="square")
        if color == 0:
            found |= _drawn(device, given, f"{shape} {color} xray ", tiny, mode="xray")
    return found


@_family
def lobes(device: rift.Device, tiny: bool) -> Arrays:
    """Colours by lobes of direction, and their gradients."""
    found, camera = {}, _camera("pinhole", (97, 143))
    for kind, count in (("hg", 8), ("lg", 9), ("sg", 4), ("asg", 4)):
        given = [device.array(a) for a in _lobes(kind, count, 30 if tiny else 200)]
        means, linear, shapes = given
        culled = device.array(np.zeros(len(means), np.uint8))
        options = {"lobes": shapes, "angular": kind}
        table = shade(device, means, linear, camera, culled, **options)
        incoming = device.array(_noise(table.shape, seed=3))
        by_means = device.array(np.zeros(means.shape, np.float32))
        parts = device.array(np.zeros((device.traits.runs(len(means)), 16), np.float32))
        into = SplatGradients(by_means, None, None, None, None, incoming, None, None, parts)
        by_lobes = device.empty(shapes.shape)
        options |= {"features": table, "gradients": into, "grad_lobes": by_lobes}
        by_linear = shade_grad(device, means, linear, camera, **options)
        arrays = {"colors": table, "by linear": by_linear, "by lobes": by_lobes}
        found |= {f"{kind} {name}": device.get(array) for name, array in arrays.items()}
        found[f"{kind} by means"] = device.get(by_means)
        # A row for each run of splats, which are longer on some devices.
        found[f"{kind} by camera"] = device.get(parts).sum(axis=0, dtype=float)
    return found


@_family
def strips(device: rift.Device, tiny: bool) -> Arrays:
    """L1 and SSIM with their gradient, images of one and of several strips."""
    found = {}
    for size in ((11, 11), (12, 86)) if tiny else ((11, 11), (12, 86), (13, 200), (97, 143)):
        y, x = np.mgrid[: size[0], : size[1]][..., None] / 9
        smooth = 0.5 + 0.4 * np.sin(x + np.arange(3)) * np.cos(y)
        image = device.array((smooth + 0.1 * _noise(smooth.shape)).astype(np.float32))
        target = device.array((smooth + 0.03 * _noise(smooth.shape, seed=2)).astype(np.float32))
        for weight in (0.0, 0.2, 1.0):
            value, gradient = ImageLoss(ssim_weight=weight)(device, image, target)
            found[f"{size} {weight}"] = device.get(value)
            found[f"{size} {weight} gradient"] = device.get(gradient)
    return found


@_family
def odd_sizes(device: rift.Device, tiny: bool) -> Arrays:
    """A filter by fast Fourier transforms of odd sizes."""
    found = {}
    for size in ((13, 17),) if tiny else ((96, 81), (130, 47)):
        soften = SpectralFilter(device, size, lambda fy, fx: 1 / (1 + 50 * (fx**2 + fy**2)))
        found[str(size)] = device.get(soften(device.array(_noise((*size, 3)))))
    return found


def _scene(count: int, *, coefficients: int, wide: float, least: float = 0.005) -> Arrays:
    random = np.random.default_rng(0)
    values = {
        "means": random.uniform(-wide, wide, (count, 3)),
        "quats": random.standard_normal((count, 4)),
        "scales": np.exp(random.uniform(np.log(least), np.log(0.3), (count, 3))),
        "opacities": random.uniform(0.002, 1, count),
        "sh": 0.4 * random.standard_normal((count, coefficients, 3)),
    }
    return {name: value.astype(np.float32) for name, value in values.items()}


def _modal(count: int, shape: int, color: int) -> Arrays:
    values = _scene(count, coefficients=4, wide=1.0, least=0.05)
    values["shape_modes"] = 0.3 * _noise((count, count_of(shape) - 1), seed=50)
    if color:
        values["color_modes"] = 0.3 * _noise((count, count_of(color) - 1, 3), seed=51)
    return values


def _lobes(kind: str, count: int, number: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Means, linear coefficients and lobes of all directions, some wider than their limits."""
    random, basis = np.random.default_rng(0), angular_basis(kind, count)
    shapes = random.standard_normal((number, basis.n_geometry))
    if kind in ("hg", "lg"):
        widths = random.uniform(np.log(0.015), 0.2, (number, basis.n_geometry - 4))
        shapes[:, 4:] = np.where(np.abs(widths) < 1e-3, -0.1, widths)
    means = random.uniform(-1.6, 1.6, (number, 3)).astype(np.float32)
    linear = 0.4 * random.standard_normal((number, count, 3))
    return means, linear.astype(np.float32), shapes.astype(np.float32)


def _camera(model: str, size: tuple[int, int]) -> rift.Camera:
    rotation = np.linalg.qr(np.random.default_rng(5).standard_normal((3, 3)))[0]
    view = np.eye(4)
    view[:3, :3] = rotation * np.sign(np.linalg.det(rotation))
    view[:3, 3] = [0.11, -0.07, 4.0]
    focal = _FOCAL[model]
    K = np.array([[focal, 0, size[1] / 2 + 0.3], [0, 0.9 * focal, size[0] / 2 - 0.4], [0, 0, 1]])
    return rift.Camera(size, K.astype(np.float32), view.astype(np.float32), model)


def _drawn(
    device: rift.Device,
    given: rift.Splats,
    prefix: str,
    tiny: bool,
    *,
    model: str = "pinhole",
    depth: str | None = None,
    **settings: Any,
) -> Arrays:
    """An image, its transmittance and the gradients by all that made it."""
    camera = _camera(model, (33, 41) if tiny else (96, 130))
    renderer = rift.Renderer(rift.SplatSettings(**settings), device=device)
    frame = renderer.forward(given, camera, **({"depth": depth} if depth else {}))
    gradients = renderer.backward(frame, device.array(_noise(frame.image.shape, seed=0)))
    found = {
        f"{prefix}image": device.get(frame.image),
        f"{prefix}transmittance": device.get(frame.transmittance),
    }
    return found | dict(families.arrays_of(f"{prefix}by ", device, gradients))
