"""Figure 15: the first nine spherical harmonics, and the lobes that could stand in for them.

The paper hopes that Laguerre- or Hermite-Gaussian functions represent view-dependent colour better
than the first three rows of harmonics; ``tools/compare_bases.py`` measures it.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np
from numpy.typing import NDArray

from paper.mode_gallery import packed, show_gallery
from paper.plan import Plan
from rift_cl import Device
from rift_cl.basis import AngularBasis, HGLobe, LGLobe, SphericalHarmonics, laguerre_place, place
from rift_cl.basis.indices import laguerre_rows, rows
from rift_cl.report.html_page import Page

NAME = "figure_15"
TITLE = "Figure 15: spherical harmonics, and lobes on the sphere"
WIDTH = 0.45
_TILT = np.radians(30.0)


def settings(plan: Plan) -> dict[str, Any]:
    """What decides the result."""
    return plan.size()


def compute(plan: Plan, device: Device, kept: dict[str, Any]) -> Iterator[dict[str, Any]]:
    """Nine functions of each kind on a sphere that is seen from the side and above."""
    directions, seen = _sphere(129 if plan.full else 65)
    degrees = [(degree, m) for degree in range(3) for m in range(-degree, degree + 1)]
    laguerre, hermite = laguerre_rows(2, "real"), rows(2, 2)
    upright = [1.0, 0.0, 0.0, 0.0]
    sets: dict[str, tuple[AngularBasis, list[float], list[int], list[str]]] = {
        "harmonics": (
            SphericalHarmonics(2),
            [],
            list(range(9)),
            [f"SH {degree} {m}" for degree, m in degrees],
        ),
        "laguerre": (
            LGLobe(16),
            [*upright, np.log(WIDTH)],
            (1 + laguerre_place(laguerre)).tolist(),
            [f"LG {p} {turns}{'s' if part else ''}" for p, turns, part in laguerre.tolist()],
        ),
        "hermite": (
            HGLobe(16),
            [*upright, np.log(WIDTH), np.log(WIDTH)],
            (1 + place(hermite)).tolist(),
            [f"HG {m} {n}" for m, n in hermite.tolist()],
        ),
    }
    yield {
        name: packed(_pictures(basis, geometry, columns, directions, seen), names)
        for name, (basis, geometry, columns, names) in sets.items()
    }


def _pictures(
    basis: AngularBasis,
    geometry: list[float],
    columns: list[int],
    directions: NDArray[np.float64],
    seen: NDArray[np.bool_],
) -> NDArray[np.float64]:
    values = basis.functions(geometry, directions)[..., columns]
    return np.moveaxis(np.where(seen[..., None], values, 0.0), -1, 0)


def _sphere(samples: int) -> tuple[NDArray[np.float64], NDArray[np.bool_]]:
    """Directions (y, x, 3) of a sphere's visible points, and where there are any."""
    line = np.linspace(-1, 1, samples)
    up, right = np.meshgrid(line[::-1], line, indexing="ij")
    toward = np.sqrt(np.maximum(1 - up**2 - right**2, 0))
    seen = up**2 + right**2 <= 1
    # The pole is tilted towards whoever looks, so that lobes about it show whole.
    pole = up * np.sin(_TILT) + toward * np.cos(_TILT)
    ahead = up * np.cos(_TILT) - toward * np.sin(_TILT)
    return np.stack([right, ahead, pole], axis=-1), seen


def show(page: Page, result: dict[str, Any]) -> None:
    """Draw nine of each kind."""
    page.paragraph(
        "On a sphere seen from above and the side. Harmonics have no place of their own; lobes "
        f"have an axis, here the sphere's pole, and a width, here {WIDTH:g} on Lambert's "
        "equal-area chart, both of which a fit may move."
    )
    for name, what in (
        ("harmonics", "Spherical harmonics, degree and order."),
        ("laguerre", "Laguerre-Gaussian lobes, rows p + l = 0, 1, 2; s are sines."),
        ("hermite", "Hermite-Gaussian lobes, rows max(m, n) = 0, 1, 2."),
    ):
        show_gallery(page, result[name], what, columns=9)
