"""Random splats in and round a grid of voxels, and what the twin makes of them."""

import numpy as np
from projection_scenes import sent

from rift_cl.reference.voxels import edge, voxelise
from rift_cl.splat.orders import count_of
from rift_cl.splat.voxels import voxelise as on_device

NAMES = ("means", "quats", "scales", "opacities")


def random_splats(count, *, order=0, seed=0, spread=1.0, scales=(0.05, 0.4)):
    """Splats of uneven axes and of both signs, as float32."""
    random = np.random.default_rng(seed)
    values = {
        "means": random.uniform(-spread, spread, (count, 3)),
        "quats": random.standard_normal((count, 4)) * random.uniform(0.1, 5, (count, 1)),
        "scales": np.exp(random.uniform(*np.log(scales), (count, 3))),
        "opacities": random.uniform(-1, 2, count),
    }
    if order:
        values["shape_modes"] = random.normal(0, 0.5, (count, count_of(order) - 1))
    return {name: array.astype(np.float32) for name, array in values.items()}


def order_of_splats(values):
    """The order that the modes' number says."""
    modes = values.get("shape_modes")
    return next(n for n in range(9) if count_of(n) - 1 == (0 if modes is None else modes.shape[1]))


def drawn(device, values, grid, dilation=0.0):
    """The volume that the kernels make, on the host."""
    splats = sent(device, values)
    return device.get(on_device(device, splats, grid, dilation=dilation))


def expected(values, grid, dilation=0.0, reach=None):
    """The volume that the twin makes, as float64."""
    exact = {name: array.astype(float) for name, array in values.items()}
    return voxelise(
        *(exact[name] for name in NAMES),
        grid,
        shape_modes=exact.get("shape_modes"),
        dilation=dilation,
        reach=edge(order_of_splats(values)) if reach is None else reach,
    )


def assert_like_twin(device, values, grid, dilation=0.0, share=1e-5):
    """Equal to a share of the peak, but where a splat ends within 5e-4 of its own radius."""
    reach = edge(order_of_splats(values))
    less, more = (expected(values, grid, dilation, reach * f) for f in (1 - 5e-4, 1 + 5e-4))
    found, even = drawn(device, values, grid, dilation), less == more
    peak = np.abs(less).max()
    assert peak > 0 and even.mean() > 0.9
    assert np.abs(found - less)[even].max() <= share * peak
    # What a splat has where it ends is little: no mode more than 3.4e-4 of it.
    assert np.abs(found - less).max() <= 5e-3 * peak
