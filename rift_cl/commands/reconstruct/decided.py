"""What a reconstruction decided by itself, as the settings that would decide it again.

``config.json`` keeps these, so that a run can be repeated with ``--config`` and read years later:
nothing in it is left to a default that another version may have, or to a search that may end
elsewhere.
"""

from __future__ import annotations

import dataclasses
from typing import TYPE_CHECKING, Any

import numpy as np

from rift_cl.commands.reconstruct.settings import ReconstructSettings
from rift_cl.operators import FILTERS, ParallelProjector, Ramp
from rift_cl.reconstruct.direct.view_weights import WAYS, view_weights

if TYPE_CHECKING:
    from rift_cl.commands.reconstruct.inversion import Inversion
    from rift_cl.commands.reconstruct.slice_input import SliceInput


def decided_settings(
    source: SliceInput, inversion: Inversion, values: tuple[float, float] | None
) -> ReconstructSettings:
    """The settings with a value for everything that was left open.

    Args:
        source: the scan; located.
        inversion: the method.
        values: what the integers of the volume stand for; None for floating samples.
    """
    settings, file, window = source.settings, source.file, inversion.window
    decided: dict[str, Any] = {
        "scan": file.path,
        "kind": file.kind,
        "out": settings.out.absolute(),
        "rings": source.clean.rings or "off",
        "pad": "on" if source.pad else "off",
        "center": source.axis["center"],
        "tilt": source.tilt,
        "rows": settings.rows or (0, file.shape[1]),
        "pitch": source.detector_pitch,
        "unit": source.unit,
        "pixel": window.pixel,
        "size": window.size,
        "background": file.background,
        "window": values,
    }
    A = inversion.projector(1)
    decided |= inversion.projection
    if settings.centers is not None:
        decided |= {"center": None, "tilt": None, "centers": settings.centers.absolute()}
    if settings.iterative:
        decided["steps"] = settings.most_steps
    if source.turned:
        decided["reversed"] = not settings.reversed
    if settings.method == "fbp":
        decided |= filter_settings(settings)
        if isinstance(A, ParallelProjector):
            decided["compensate"] = settings.compensate or _weights(A.scan.angles)
    return dataclasses.replace(settings, **decided)


def filter_settings(settings: ReconstructSettings) -> dict[str, Any]:
    """The filter along the detector, with the values that were left open."""
    if settings.filter == "high-pass":
        return {"exponent": 1.0 if settings.exponent is None else settings.exponent}
    name = settings.filter or "ram-lak"
    if not isinstance(FILTERS[name], Ramp):
        # A person's own filter has no cut-off besides its own.
        return {"filter": name}
    return {"filter": name, "cutoff": 1.0 if settings.cutoff is None else settings.cutoff}


def _weights(angles: np.ndarray[Any, np.dtype[np.float64]]) -> str:
    """The compensation that the views' weights come to where none is said."""
    weights = view_weights(angles)
    same = (how for how in WAYS if np.array_equal(weights, view_weights(angles, how)))
    return next(same)


def in_words(decided: ReconstructSettings) -> str:
    """The method and its options, for people: ``fbp, ram-lak filter, voronoi weights``."""
    words: list[str] = [decided.method]
    if decided.method == "fbp":
        words += [f"{decided.filter} filter"]
        words += [] if decided.exponent is None else [f"exponent {decided.exponent:g}"]
        words += [] if decided.cutoff is None else [f"cut-off {decided.cutoff:g}"]
        words += [f"{decided.compensate} view weights"] if decided.compensate else []
    if decided.iterative:
        words += [f"at most {decided.steps} steps"]
        words += [f"{decided.subsets} subsets"] if decided.subsets else []
        words += [f"{decided.precondition} preconditioner"] if decided.precondition else []
        words += ["rays weighed by counts"] if decided.weights else []
        words += ["non-negative"] if decided.nonnegative else []
    words += [f"{decided.footprint} footprint"] if decided.footprint else []
    words += [f"Fourier projector within {decided.error:g}"] if decided.error else []
    return ", ".join(words)
