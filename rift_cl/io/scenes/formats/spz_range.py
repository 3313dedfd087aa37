"""Scales, colours and harmonics beyond the ends of SPZ's bytes: told of, or refused.

What a byte cannot hold becomes the nearest that it can. That hardly shows where a splat becomes a
bit narrower, or no thinner than the width of a tenth of a pixel, and makes another scene where
walls shrink or dust swells, as in a scene whose lengths were multiplied by 1000 or by 1e-4. How
much shows is judged by what splats cover: opacity times the area of the two longer axes, as seen
from as far away as the middle of the scene, and from the scene's size at least.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from rift_cl.errors import InputError
from rift_cl.io.scenes.formats.plain import Floats
from rift_cl.io.scenes.splat_activations import opacities_of
from rift_cl.io.scenes.splat_scene import SplatScene

# Logarithms of scales, and sizes of first and of higher harmonics, that the levels 0 to 255 hold,
# and half a step between levels: what lies beyond by less is rounded like all others.
_THINNEST, _WIDEST, _HALF_SCALE = -10.0, 255 / 16 - 10, 1 / 32
_COLOR, _HALF_COLOR = 1 / 0.3, 1 / (2 * 255 * 0.15)
_REST, _HALF_REST = 1.0, 1 / 64
# Widths below this share of the scene's size are all alike: a tenth of a pixel of a camera that
# sees the scene from so far away with a focal length of 1000 pixels.
_FINE = 1e-4
# How much of what splats cover may be covered otherwise: more is another scene.
_ANOTHER = 0.1
# Powers of ten by which lengths are tried for a scene that fits, the nearest first.
_POWERS = sorted(range(-9, 10), key=abs)


def check_scales(scene: SplatScene) -> None:
    """Check that the scales of splats that are to be written make the same scene.

    Raises:
        InputError: splats that are clipped would cover more than a tenth more or less, together,
            than all splats do.
    """
    share = _covered_otherwise(scene)
    if share > _ANOTHER:
        raise InputError(
            f"SPZ would make another scene of this: {'; '.join(_scale_notes(scene))}; the area "
            f"that splats cover would change by {100 * share:.3g} %"
        )


def range_notes(scene: SplatScene) -> list[str]:
    """What is to be said of what is clipped in splats as they are written, a sentence each."""
    rest = np.abs(scene.sh[:, 1:]).max(axis=(1, 2), initial=0)
    return [
        *_scale_notes(scene),
        *_reach_notes("a colour", np.abs(scene.sh[:, 0]).max(axis=1), _COLOR, _HALF_COLOR),
        *_reach_notes("harmonics above the first", rest, _REST, _HALF_REST),
    ]


def _scale_notes(scene: SplatScene) -> list[str]:
    """Of splats that are too wide or too thin: how many, by how much, and what would help."""
    widest, thinnest = scene.log_scales.max(axis=1), scene.log_scales.min(axis=1)
    wide, thin = widest > _WIDEST + _HALF_SCALE, thinnest < _THINNEST - _HALF_SCALE
    notes = []
    if wide.any():
        notes.append(
            f"{np.count_nonzero(wide)} of {len(scene)} splats are made narrower, by up to "
            f"{_times(widest.max() - _WIDEST)}, since SPZ holds standard deviations up to "
            f"{np.exp(_WIDEST):.3g} units{_way_out(scene)}"
        )
    if thin.any() and _shows(scene):
        notes.append(
            f"{np.count_nonzero(thin)} of {len(scene)} splats are made thicker, by up to "
            f"{_times(_THINNEST - thinnest.min())}, since SPZ holds standard deviations from "
            f"{np.exp(_THINNEST):.2g} units on{_way_out(scene)}"
        )
    return notes


def _times(logarithm: float) -> str:
    return f"{np.exp(float(logarithm)):.3g} times"


def _shows(scene: SplatScene, factor: float = 1.0) -> bool:
    """Whether the least width, of a scene with lengths times a factor, is one that can be seen."""
    return bool(np.exp(_THINNEST) > _FINE * factor * _size(scene))


def _way_out(scene: SplatScene) -> str:
    """By how much to multiply lengths, so that no scale is clipped that can be seen."""
    for power in _POWERS:
        factor = 10.0**power
        if scene.log_scales.max() + np.log(factor) <= _WIDEST and not _shows(scene, factor):
            return f" (lengths {factor:g} times as long would fit: change --scale by that factor)"
    return " (the scene spans more than SPZ holds: take another format)"


def _reach_notes(what: str, largest: NDArray[np.float32], reach: float, half: float) -> list[str]:
    """Of coefficients (N,), the largest of each splat, that lie beyond what is held."""
    beyond = np.count_nonzero(largest > reach + half)
    if not beyond:
        return []
    return [
        f"{beyond} of {len(largest)} splats have {what} with a coefficient beyond {reach:.3g} (up "
        f"to {largest.max():.3g}), which SPZ clips: they look paler, or of another colour"
    ]


def _covered_otherwise(scene: SplatScene) -> float:
    """How much more and less clipped splats cover, as a share of what all splats cover."""
    given = scene.log_scales.astype(np.float64)
    before = _covered(scene, given)
    after = _covered(scene, np.clip(given, _THINNEST, _WIDEST))
    return float(np.abs(after - before).sum() / max(before.sum(), np.finfo(float).tiny))


def _covered(scene: SplatScene, log_scales: Floats) -> Floats:
    """What splats (N,) of such scales cover; one that fills the view covers no more than that."""
    distances = np.maximum(_distances(scene), _size(scene))
    areas = np.sort(log_scales, axis=1)[:, 1:].sum(axis=1) - 2 * np.log(distances)
    return np.asarray(opacities_of(scene.logit_opacities) * np.exp(np.minimum(areas, 0)))


def _distances(scene: SplatScene) -> Floats:
    places = scene.means.astype(np.float64)
    return np.asarray(np.linalg.norm(places - np.median(places, axis=0), axis=1))


def _size(scene: SplatScene) -> float:
    """The median distance from the middle; the splats' own width where they lie in one place."""
    widths = np.exp(scene.log_scales.max(axis=1).astype(np.float64))
    return max(float(np.median(_distances(scene))), float(np.median(widths)))
