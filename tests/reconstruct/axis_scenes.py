"""Small sinograms with a known axis: ellipses, projected by their formula."""

import numpy as np

BINS = 160
HALF = np.arange(224) * np.pi / 224
FULL = np.arange(300) * 2 * np.pi / 300
# Value, x, y, half axes and the direction of the first: a few parts, well inside the detector.
PARTS = [
    (1.0, 4.0, -6.0, 38.0, 30.0, 0.4),
    (-0.6, 12.0, 8.0, 9.0, 6.0, 1.1),
    (0.8, -16.0, 4.0, 6.0, 10.0, 0.2),
    (0.5, -2.0, -22.0, 5.0, 4.0, 2.0),
]


def grains(reach, count, seed=0):
    """A body with small holes and grains, reaching so many bins."""
    random = np.random.default_rng(seed)
    away, turn = reach * np.sqrt(random.uniform(0, 0.95, count)), random.uniform(0, 7, count)
    size, value = random.uniform(1.5, 4, (2, count)), random.choice([-1.0, 0.7], count)
    holes = [value, away * np.cos(turn), away * np.sin(turn), *size, random.uniform(0, 3, count)]
    return [(1.0, 0.0, 0.0, reach, 0.9 * reach, 0.3), *map(tuple, np.transpose(holes))]


def sinogram(ellipses, angles, center, *, bins=BINS, noise=0.01, seed=0):
    """Noisy line integrals at the bins' centres, (angle, bin); noise as a share of the greatest."""
    t = np.arange(bins) - center
    y = np.zeros((angles.size, bins))
    for value, x, z, long, short, turned in ellipses:
        half = np.hypot(long * np.cos(angles - turned), short * np.sin(angles - turned))[:, None]
        u = (t - (x * np.cos(angles) + z * np.sin(angles))[:, None]) / half
        y += value * 2 * long * short / half * np.sqrt(np.clip(1 - u * u, 0, None))
    random = np.random.default_rng(seed)
    return (y + noise * y.max() * random.standard_normal(y.shape)).astype(np.float32)
