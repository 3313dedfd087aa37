"""Normals of splats from where their neighbours are: across the sheet that they lie in.

The normal is the direction in which the neighbours' positions vary least, weighted by their
opacities and by a Gaussian of their distance. Learned normals drift, since whatever they do
explains some picture; places of many splats do not.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from rift_cl.cl.budget import cut_evenly

# Neighbours that make a sheet, the splat itself among them; what a transparent one counts.
_NEIGHBOURS, _LEAST_WEIGHT = 24, 1e-6
# Splats whose neighbours are looked at together: some 2 kB each.
_RUN = 1 << 14

Floats = NDArray[np.float64]


def neighbour_normals(raw: Mapping[str, NDArray[np.float32]]) -> Floats:
    """Normals (N, 3) of length one, away from the middle of the splats where sides differ.

    Args:
        raw: the splats' ``means`` and ``logits``.
    """
    means, logits = raw["means"].astype(float), raw["logits"].astype(float)
    usable = np.flatnonzero(np.isfinite(means).all(axis=1))
    found = np.tile([0.0, 0.0, 1.0], (len(means), 1))
    if not usable.size:
        return found
    places = means[usable]
    with np.errstate(over="ignore"):
        weights = 1 / (1 + np.exp(-logits))
    weights = np.nan_to_num(weights)[usable]
    tree = cKDTree(places)
    normals = np.empty_like(places)
    for run in cut_evenly(len(places), _RUN):
        normals[run] = _across_sheets(tree, weights, run)
    outward = places - np.average(places, axis=0, weights=weights + _LEAST_WEIGHT)
    inside = (normals * outward).sum(axis=1, keepdims=True) < 0
    found[usable] = np.where(inside, -normals, normals)
    return found


def _across_sheets(tree: cKDTree, weights: Floats, run: slice) -> Floats:
    """For a run of the tree's places, the directions in which their neighbours vary least."""
    places: Floats = tree.data
    distances, near = tree.query(places[run], min(_NEIGHBOURS, len(places)))
    near = near.reshape(len(distances), -1)
    reach = distances.reshape(near.shape)
    reach = reach / np.maximum(reach[:, -1:], np.finfo(float).tiny)
    share = weights[near] * np.exp(-(reach**2)) + _LEAST_WEIGHT
    share /= share.sum(axis=1, keepdims=True)
    aside = places[near] - np.einsum("nk,nki->ni", share, places[near])[:, None]
    spread = np.einsum("nk,nki,nkj->nij", share, aside, aside)
    # Ascending: the first is the direction of the least variance.
    across: Floats = np.linalg.eigh(spread)[1][:, :, 0]
    return across
