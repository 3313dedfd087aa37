"""From the moments that the raster leaves to the gradients of splats on the screen: plain algebra.

u_a He~_m and d/du_a (He~_m g) are made of neighbouring modes; see
``kernels/include/raster/hermite_slots.h``. What is written here for tests alone, projection does on
the device.
"""

import numpy as np

from rift_cl.reference.hermite_raster import graded_pairs, order_of_others


def gradients(splats, records, squared):
    """dL/d(shape, tint, features, weight, mean, whitening) of HermiteSplats, by name."""
    moments = _Moments(splats, records, squared)
    i00, i10, i11 = splats.whitening.T
    by_u = [moments.slope(a, lambda of, m: of[m]) for a in (0, 1)]
    by_uu = [[moments.slope(a, _times(b)) for b in (0, 1)] for a in (0, 1)]
    return {
        "shape": (2 if squared else 1) * moments.of_shape[:, 1 : 1 + splats.shape.shape[1]],
        "tint": moments.of_tint,
        "features": moments.of_features,
        "weight": sum(moments.s[m] * moments.h[m] for m in moments.s) / splats.screen[:, 5],
        "mean": -np.stack([i00 * by_u[0] + i10 * by_u[1], i11 * by_u[1]], axis=1),
        "whitening": np.stack(
            [
                by_uu[0][0] / i00,
                by_uu[1][0] / i00,
                (by_uu[1][1] - i10 / i00 * by_uu[1][0]) / i11,
            ],
            axis=1,
        ),
    }


class _Moments:
    """The records of all splats, mode by mode."""

    def __init__(self, splats, records, squared):
        pairs = graded_pairs(order_of_others(splats.shape.shape[1]) + 2)
        features, (others, colored) = splats.features.shape[1], splats.tint.shape[1:]
        self.squared, count = squared, len(records)
        self.of_shape = records[:, : len(pairs)]
        self.of_features = records[:, len(pairs) : len(pairs) + features]
        self.of_tint = records[:, len(pairs) + features :].reshape(count, others, colored)
        self.h = dict(zip(pairs, self.of_shape.T, strict=True))
        colors = [self.of_features[:, :colored], *np.moveaxis(self.of_tint, 1, 0)]
        tints = graded_pairs(order_of_others(others))
        self.v = dict(zip(tints, colors, strict=True))
        shape = [np.ones(count), *splats.shape.T]
        self.s = dict(zip(pairs[: len(shape)], shape, strict=True))
        self.t = dict(zip(tints[1:], np.moveaxis(splats.tint, 1, 0), strict=True))

    def slope(self, a, at):
        """Sum over pixels of dL/du_a, times whatever ``at`` multiplies a moment with."""
        total = np.zeros(len(self.of_shape))
        for m, s in self.s.items():
            total -= s * np.sqrt(m[a] + 1) * at(self.h, _moved(m, a, 1))
            if self.squared and m[a] > 0:
                total += s * np.sqrt(m[a]) * at(self.h, _moved(m, a, -1))
        for m, t in self.t.items():
            if m[a] > 0:
                total += np.sqrt(m[a]) * (t * at(self.v, _moved(m, a, -1))).sum(axis=1)
        return total


def _times(b):
    """The moment of u_b He~_m."""

    def at(of, m):
        down = np.sqrt(m[b]) * of[_moved(m, b, -1)] if m[b] > 0 else 0
        return np.sqrt(m[b] + 1) * of[_moved(m, b, 1)] + down

    return at


def _moved(m, axis, by):
    return tuple(n + by * (k == axis) for k, n in enumerate(m))
