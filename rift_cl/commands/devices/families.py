"""Small problems, one for each family of kernels, whose results are known.

A driver is tried on them when it is first met, and ``tools/compare_drivers.py`` runs them beside
larger ones. The results in ``families.npz`` are those of PoCL, which the tests hold to float64
twins; ``tools/make_family_results.py`` makes them. Inputs come from whole numbers, so that they are
the same bits with every NumPy.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rift_cl.cl.device import Device
from rift_cl.cl.host_arrays import is_device_array
from rift_cl.cl.reductions import dot, norm, total
from rift_cl.geometry import Camera, Cone, Fan, Grid, Parallel
from rift_cl.operators import Projector
from rift_cl.operators.fourier.spectrum import SpectralFilter
from rift_cl.reconstruct import backproject, fbp
from rift_cl.sampling.coverage.device import coverage, coverage_grad
from rift_cl.sampling.targets.observations import Observations
from rift_cl.sampling.targets.target import Target
from rift_cl.splat.renderer import Renderer
from rift_cl.splat.splats import Splats
from rift_cl.splat.voxels import voxelise
from rift_cl.train.loss.image_loss import ImageLoss

Results = dict[str, NDArray[Any]]
STORED = Path(__file__).with_name("families.npz")


def tomography(device: Device) -> Results:
    """Projection, its adjoint, and filtered backprojection, of parallel beams."""
    scan = Parallel(np.arange(24) * np.pi / 24, bins=48, pitch=0.1)
    return _tomography(Projector(Grid((32, 32), spacing=0.1), scan, device=device))


def fan(device: Device) -> Results:
    """The same of a fan."""
    angles = np.arange(24) * np.pi / 12
    scan = Fan(angles, bins=40, pitch=0.15, source_to_axis=5.0, source_to_detector=8.0)
    return _tomography(Projector(Grid((24, 24), spacing=0.1), scan, device=device))


def cone(device: Device) -> Results:
    """The same of a cone, by the method of Feldkamp, Davis and Kress."""
    angles = np.arange(12) * np.pi / 6
    scan = Cone(angles, 20, 28, 0.15, source_to_axis=5.0, source_to_detector=8.0)
    return _tomography(Projector(Grid((16, 16, 16), spacing=0.1), scan, device=device))


def splats(device: Device) -> Results:
    """An image of Gaussians, and its gradient by everything that they are."""
    return _drawn(device, _splats(sh=_numbers(5, 30, 4, 3) - 0.5))


def hermite_splats(device: Device) -> Results:
    """The same of Gaussians with Hermite modes to order 2."""
    return _drawn(device, _splats(sh=_numbers(5, 30, 1, 3), shape_modes=_modes()))


def voxels(device: Device) -> Results:
    """Splats with Hermite modes to order 2, summed on a grid."""
    splats = Splats.upload(device, **_splats(shape_modes=_modes()))
    return {"volume": device.get(voxelise(device, splats, Grid((12, 14, 18), spacing=0.2)))}


def image_loss(device: Device) -> Results:
    """L1 with SSIM, and its gradient."""
    image, target = (device.array(_numbers(seed, 13, 40, 3)) for seed in (1, 2))
    value, gradient = ImageLoss()(device, image, target)
    return {"value": device.get(value), "gradient": device.get(gradient)}


def fourier(device: Device) -> Results:
    """A filter in frequency."""
    smooth = SpectralFilter(device, (26, 31), lambda ky, kx: 1 / (1 + 50 * (kx**2 + ky**2)))
    return {"image": device.get(smooth(device.array(_numbers(1, 26, 31, 3))))}


def coverage_of_views(device: Device) -> Results:
    """Coverage of frequencies, and its gradient by the views."""
    direction = _numbers(1, 9, 2, 3).astype(float) - 0.5
    direction /= np.linalg.norm(direction, axis=2, keepdims=True)
    some = [_numbers(seed, 9, 2).astype(float) for seed in range(2, 6)]
    scales = (0.5, 0.1, 4.0, 0.3)
    views = Observations(direction, *(s * (1 + x) for s, x in zip(scales, some, strict=True)))
    points = np.array([[0.1, 0, 0], [-0.5, 0.2, 0.4]])
    target = Target(np.zeros(3), 3.0, points=points)
    k = 4 * (_numbers(7, 200, 3).astype(float) - 0.5)
    grad = coverage_grad(views, target, _numbers(8, 2, 200), k, device=device)
    return {"coverage": coverage(views, target, k, device=device), **grad._asdict()}


def sums(device: Device) -> Results:
    """Sums and inner products."""
    x, y = (device.array(_numbers(seed, 10_007)) for seed in (1, 2))
    return {"sums": np.array([dot(device, x, y), total(device, x), norm(device, x)])}


FAMILIES: dict[str, Callable[[Device], Results]] = {
    "tomography": tomography,
    "fan": fan,
    "cone": cone,
    "splats": splats,
    "Hermite splats": hermite_splats,
    "voxels": voxels,
    "image loss": image_loss,
    "Fourier transform": fourier,
    "coverage": coverage_of_views,
    "sums": sums,
}


def deviation(found: Results, wanted: Mapping[str, NDArray[Any]]) -> float:
    """The largest relative difference (L2) between arrays of the same names.

    What is not finite, of another shape or missing is infinitely far.
    """
    if found.keys() != wanted.keys():
        return float("inf")
    return max(_difference(found[name], wanted[name]) for name in wanted)


def stored_results() -> dict[str, Results]:
    """The known results of every family."""
    results: dict[str, Results] = {name: {} for name in FAMILIES}
    with np.load(STORED, allow_pickle=False) as archive:
        for key in archive.files:
            family, _, name = key.partition("/")
            results[family][name] = archive[key]
    return results


def _difference(found: NDArray[Any], wanted: NDArray[Any]) -> float:
    if found.shape != wanted.shape or not np.isfinite(found).all():
        return float("inf")
    size = np.linalg.norm(wanted.astype(float))
    return float(np.linalg.norm(found.astype(float) - wanted) / (size or 1))


def _numbers(seed: int, *shape: int) -> NDArray[np.float32]:
    """Numbers from 0 to 1 without a pattern, by whole-number arithmetic."""
    low = 0xFFFFFFFF
    x = (np.arange(np.prod(shape), dtype=np.uint64) + np.uint64(seed * 100_003)) * 2654435761 & low
    x = (x ^ x >> np.uint64(15)) * 2246822519 & low
    x = (x ^ x >> np.uint64(13)) * 3266489917 & low
    return ((x >> np.uint64(8)) / 2.0**24).astype(np.float32).reshape(shape)


def _tomography(A: Projector) -> Results:
    y = np.asarray(A(_numbers(1, *A.domain)))
    return {"projection": y, "backprojection": backproject(A, y), "fbp": fbp(A, y)}


def _modes() -> NDArray[np.float32]:
    return 0.4 * (_numbers(6, 30, 9) - 0.5)


def _splats(**more: NDArray[np.float32]) -> dict[str, NDArray[np.float32]]:
    return {
        "means": 2 * (_numbers(1, 30, 3) - 0.5),
        "quats": _numbers(2, 30, 4) - 0.5,
        "scales": 0.1 + 0.3 * _numbers(3, 30, 3),
        "opacities": 0.1 + 0.8 * _numbers(4, 30),
        **more,
    }


def _drawn(device: Device, values: dict[str, NDArray[np.float32]]) -> Results:
    view = np.eye(4)
    view[2, 3] = 4.0
    camera = Camera((33, 41), np.array([[40, 0, 20.7], [0, 38, 16.1], [0, 0, 1]]), view)
    renderer = Renderer(device=device)
    frame = renderer.forward(Splats.upload(device, **values), camera)
    seed = device.array(_numbers(9, *frame.image.shape) - 0.5)
    found = {"image": device.get(frame.image), "transmittance": device.get(frame.transmittance)}
    return found | dict(arrays_of("", device, renderer.backward(frame, seed)))


def arrays_of(before: str, device: Device, record: Any) -> Iterator[tuple[str, NDArray[Any]]]:
    """The device arrays of a record and of the records in it, by their names after a prefix."""
    for field in dataclasses.fields(record):
        value = getattr(record, field.name)
        if is_device_array(value):
            yield f"{before}{field.name}", device.get(value)
        elif dataclasses.is_dataclass(value):
            yield from arrays_of(f"{before}{field.name}.", device, value)
