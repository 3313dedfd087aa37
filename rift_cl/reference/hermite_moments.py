"""What the gradient of compositing keeps of every splat with Hermite modes, by definition.

These moments say all that the pixels have to say: the gradients of a splat's modes, weight, place
and shape are linear in them. ``kernels/include/raster/hermite_slots.h`` has the record.
"""

from __future__ import annotations

import numpy as np

from rift_cl.reference.hermite_raster import (
    Floats,
    HermiteRules,
    HermiteSplats,
    Ints,
    Seen,
    graded_pairs,
    look_through,
    order_of_others,
    tile_windows,
)


def hermite_moments(
    splats: HermiteSplats,
    entries: Ints,
    starts: Ints,
    how: HermiteRules,
    grad_image: Floats,
    grad_transmittance: Floats,
    background: Floats | None = None,
) -> Floats:
    """The record of every splat, (N, P), summed over the tiles.

    Args:
        splats: what was drawn.
        entries: (M, 2), of which the first is the splat.
        starts: (tiles + 1,), where each tile's entries begin.
        how: how it was drawn.
        grad_image: dL/d image, (height, width, D).
        grad_transmittance: dL/d transmittance, (height, width).
        background: (D,), black if not given.
    """
    size = grad_transmittance.shape
    shape = len(graded_pairs(order_of_others(splats.shape.shape[1]) + 2))
    tint = splats.tint.shape[1] * splats.tint.shape[2]
    records = np.zeros((len(splats.screen), shape + splats.features.shape[1] + tint))
    for order, here in tile_windows(entries, starts, (size[0], size[1]), how.rules.tile):
        v, behind = grad_image[here], grad_transmittance[here].copy()
        if background is not None and not how.rules.additive:
            behind += v @ background
        for seen in reversed(list(look_through(splats, order, here, how))):
            difference = (seen.color * v).sum(axis=-1)
            if not how.rules.additive:
                difference -= behind
            behind += seen.alpha * difference
            by_density = seen.before * difference * seen.bend
            records[seen.splat] += _record(seen, by_density * seen.lever, v, splats, shape)
    return records


def _record(seen: Seen, h: Floats, v: Floats, splats: HermiteSplats, shape: int) -> Floats:
    """One splat's record on one tile: H_m, then V_0c of all channels, then V_mc."""
    others, colored = splats.tint.shape[1:]
    tint = seen.modes[1 : 1 + others]
    by_color = seen.light[..., None] * v
    return np.concatenate(
        [
            (seen.modes[:shape] * h).sum(axis=(1, 2)),
            by_color.sum(axis=(0, 1)),
            np.einsum("myx,yxc->mc", tint, by_color[..., :colored]).ravel(),
        ]
    )
