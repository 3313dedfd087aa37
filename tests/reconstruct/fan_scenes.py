"""Small fans and cones with a known axis: ellipsoids, projected by their formula."""

import numpy as np
from axis_scenes import PARTS, grains

import rift_cl as rift
from rift_cl.phantom import Ellipsoid, project

BINS, HALF_FAN = 160, np.deg2rad(9.0)
DETECTOR = BINS / 2 / np.tan(HALF_FAN)
AXIS = DETECTOR / 1.5
FULL = np.arange(224) * 2 * np.pi / 224
SHORT = np.arange(140) * np.deg2rad(200.0) / 140
KINDS = {"parts": PARTS, "porous": grains(45, 80), "wider than the detector": grains(110, 150)}


def fan(angles=FULL, center=83.7, bins=BINS):
    """A fan of 9 degrees to either side, of magnification 1.5."""
    return rift.Fan(angles, bins, 1.0, AXIS, DETECTOR, center)


def sinogram(ellipses, scan, *, noise=0.01, seed=0):
    """Noisy line integrals of (value, x, y, half axes, direction), in bins; (view, bin)."""
    parts = [
        Ellipsoid((0.0, y / 1.5, x / 1.5), (1.0, b / 1.5, a / 1.5), turned, value)
        for value, x, y, a, b, turned in ellipses
    ]
    return noisy(project(parts, rift.Grid((4, 4)), scan, dtype=np.float64), noise, seed)


def noisy(y, noise, seed):
    """With noise as a share of the greatest line integral."""
    random = np.random.default_rng(seed)
    return (y + noise * y.max() * random.standard_normal(y.shape)).astype(np.float32)


def body(seed=0, count=24, height=60.0):
    """A body with holes and grains in three dimensions, in bins at the axis."""
    random = np.random.default_rng(seed)
    parts = [Ellipsoid((0.0, 2.0, -3.0), (height, 44.0, 48.0), 0.3, 1.0)]
    for _ in range(count):
        away, turn = 40 * np.sqrt(random.uniform(0, 1)), random.uniform(0, 7)
        z = random.uniform(-0.8, 0.8) * height
        axes = tuple(random.uniform(1.5, 6, 3))
        place = (z, away * np.sin(turn), away * np.cos(turn))
        parts.append(Ellipsoid(place, axes, random.uniform(0, 3), random.choice([-1.0, 0.7])))
    scale = 1 / 1.5
    return [part.placed(scale, (0.0, 0.0, 0.0)) for part in parts]


def cone(angles=FULL[::2], rows=24, center=(11.5, 83.7), **given):
    """A cone with the fan's bins."""
    return rift.Cone(angles, rows, BINS, 1.0, AXIS, DETECTOR, center, **given)


def projections(scan, *, noise=0.01, seed=0, **given):
    """Noisy line integrals of the body, (view, row, bin)."""
    return noisy(project(body(**given), rift.Grid((4, 4, 4)), scan, dtype=np.float64), noise, seed)
