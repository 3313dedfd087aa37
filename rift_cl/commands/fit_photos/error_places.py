"""Where a fit errs: by region of the photographs, by spatial frequency, and by where a view stands.

A mean PSNR does not say what to mend. Shares of the squared error do: a silhouette wants smaller
splats, highlights want more functions of direction, high frequencies more splats or steps, and
views above the others want photographs from there.
"""

from __future__ import annotations

import itertools
import math
from bisect import bisect_right
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rift_cl.metrics import BAND_EDGES, REGIONS, band_power, photograph_regions

Floats = NDArray[np.float32]
Mask = NDArray[np.bool_]

# Degrees of elevation, and distances from the nearest training camera as a share of that from the
# focus, between which views are taken together.
_ELEVATIONS = tuple(range(-90, 95, 5))
_DISTANCES = (0, 0.01, 0.02, 0.05, 0.1, 0.2, 0.5, 1.0, math.inf)


@dataclass(frozen=True)
class ErrorPlaces:
    """Sums over one picture, or over several.

    Args:
        squares: (R,) sums of squared errors in the regions of ``metrics.REGIONS``.
        samples: (R,) how many samples are in each.
        bands: (3, B) power of the error, of the truth and of the picture in the bands of
            ``metrics.BAND_EDGES``.
    """

    squares: NDArray[np.float64]
    samples: NDArray[np.float64]
    bands: NDArray[np.float64]

    @classmethod
    def of(
        cls, image: Floats, truth: Floats, counted: Mask | None, foreground: Mask | None
    ) -> ErrorPlaces:
        """Those of a picture (height, width, 3) in display light.

        Args:
            image: what was drawn.
            truth: the photograph.
            counted: (height, width) pixels that count; None for all.
            foreground: (height, width); None where it is not known.
        """
        drawn = image if counted is None else np.where(counted[..., None], image, truth)
        error = np.asarray(drawn, np.float64) - truth
        regions = photograph_regions(truth, foreground, counted)
        masks = [regions[name] for name in REGIONS]
        squares = (error**2).sum(axis=2)
        return cls(
            np.array([squares[mask].sum() for mask in masks]),
            np.array([error.shape[2] * np.count_nonzero(mask) for mask in masks], np.float64),
            np.array([band_power(part) for part in (error, truth, drawn)]),
        )

    def __add__(self, other: ErrorPlaces) -> ErrorPlaces:
        """The sums of both."""
        return ErrorPlaces(
            self.squares + other.squares, self.samples + other.samples, self.bands + other.bands
        )

    def region_record(self) -> list[dict[str, Any]]:
        """By region: shares of the pixels and of the squared error, PSNR; without empty regions."""
        shares = self.samples / self.samples.sum(), self.squares / (self.squares.sum() or 1.0)
        return [
            {"region": name, "pixels": pixels, "error": error, "psnr": _decibels(square, count)}
            for name, pixels, error, square, count in zip(
                *(REGIONS, shares[0].tolist(), shares[1].tolist()),
                *(self.squares.tolist(), self.samples.tolist()),
                strict=True,
            )
            if count
        ]

    def band_record(self) -> list[dict[str, Any]]:
        """By band: share of the squared error, error and picture over the truth."""
        error, truth, drawn = self.bands.tolist()
        total = sum(error) or 1.0
        edges = itertools.pairwise(BAND_EDGES)
        return [
            {
                "from": low,
                "to": high,
                "error": error[k] / total,
                "relative_error_db": _ratio_decibels(error[k], truth[k]),
                "relative_power": drawn[k] / truth[k] if truth[k] else None,
            }
            for k, (low, high) in enumerate(edges)
        ]


def by_elevation(views: Iterable[tuple[float, float]]) -> list[dict[str, Any]]:
    """Mean PSNR of views by their elevation above the scene's horizon.

    Args:
        views: degrees and PSNR of each view; those without a number are left out.
    """
    return _binned(views, _ELEVATIONS)


def by_distance(views: Iterable[tuple[float, float]]) -> list[dict[str, Any]]:
    """Mean PSNR of views by their distance from the nearest training camera.

    Args:
        views: distance over that from the focus, and PSNR, of each view.
    """
    return _binned(views, _DISTANCES)


def _binned(views: Iterable[tuple[float, float]], edges: Sequence[float]) -> list[dict[str, Any]]:
    """Views, mean place and mean PSNR between neighbouring edges, without empty bins."""
    bins: dict[int, list[tuple[float, float]]] = {}
    for pair in views:
        if all(map(math.isfinite, pair)):
            last = len(edges) - 2
            bins.setdefault(min(bisect_right(edges, pair[0]) - 1, last), []).append(pair)
    found = []
    for k, pairs in sorted(bins.items()):
        place, psnr = np.mean(pairs, axis=0).tolist()
        end = edges[k + 1] if math.isfinite(edges[k + 1]) else None
        found.append({"from": edges[k], "to": end, "views": len(pairs), "at": place, "psnr": psnr})
    return found


def _decibels(square: float, count: float) -> float:
    return 10 * math.log10(count / square) if square > 0 else math.inf


def _ratio_decibels(power: float, reference: float) -> float | None:
    return 10 * math.log10(power / reference) if power > 0 and reference > 0 else None
