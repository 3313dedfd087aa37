"""Figure 13: Laguerre-Gaussian modes of orders 0 to 2, and what Hermite modes they are made of."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np
from numpy.typing import NDArray

from paper.mode_gallery import packed, show_gallery
from paper.plan import Plan
from rift_cl import Device
from rift_cl.basis import Hermite, Laguerre, laguerre_place
from rift_cl.report.html_page import Page

NAME = "figure_13"
TITLE = "Figure 13: Laguerre-Gaussian modes"
# A mode of total order 6 reaches this far, in widths.
EXTENT = 4.0
# Every one of p and l from 0 to 2; modes with l are the cosines.
PAIRS = tuple((p, turns) for p in range(3) for turns in range(3))


def settings(plan: Plan) -> dict[str, Any]:
    """What decides the result."""
    return plan.size()


def compute(plan: Plan, device: Device, kept: dict[str, Any]) -> Iterator[dict[str, Any]]:
    """The modes, how orthonormal they are, and each one as a sum of Hermite modes."""
    basis = Laguerre(6, form="std")
    places = laguerre_place(np.array([(p, turns, 0) for p, turns in PAIRS]))
    chosen = np.eye(basis.n_coeff)[places]
    pictures = np.moveaxis(on_plane(basis, chosen, 193 if plan.full else 97), -1, 0)
    hermite = Hermite(6, 2, form="std")
    same = chosen @ basis.convert(np.eye(basis.n_coeff), hermite)
    made = np.moveaxis(on_plane(hermite, same, 97), -1, 0)
    direct = np.moveaxis(on_plane(basis, chosen, 97), -1, 0)
    yield {
        "modes": packed(pictures, [f"LG p={p}, l={turns}" for p, turns in PAIRS]),
        "orthonormality": orthonormality(basis),
        "conversion": float(np.abs(made - direct).max()),
        "sums": [
            {
                "mode": f"LG {p} {turns}",
                "terms": [
                    {"mode": f"HG {m} {n}", "coefficient": float(c)}
                    for (m, n), c in zip(hermite.indices().tolist(), row, strict=True)
                    if abs(c) > 1e-9
                ],
            }
            for (p, turns), row in zip(PAIRS, same, strict=True)
        ],
    }


def on_plane(basis: Any, coefficients: NDArray[np.float64], samples: int) -> NDArray[np.float64]:
    """Functions (K, n_coeff) on a square of the plane, (samples, samples, K), y upwards."""
    line = np.linspace(-EXTENT, EXTENT, samples)
    y, x = np.meshgrid(line[::-1], line, indexing="ij")
    points = np.stack([x, y], axis=-1)
    return np.stack([basis.evaluate(c, points) for c in coefficients], axis=-1)


def orthonormality(basis: Any) -> float:
    """How far the integrals of products are from 0 and 1, by summing over a fine grid."""
    line = np.linspace(-10, 10, 161)
    y, x = np.meshgrid(line, line, indexing="ij")
    points = np.stack([x, y], axis=-1).reshape(-1, 2)
    modes = np.stack([basis.evaluate(c, points) for c in np.eye(basis.n_coeff)])
    products = modes @ modes.T * (line[1] - line[0]) ** 2
    return float(np.abs(products - np.eye(len(modes))).max())


def show(page: Page, result: dict[str, Any]) -> None:
    """Draw the modes and the table of their sums."""
    page.paragraph(
        "Rings by p, turns of the phase by l; the cosine mode of each pair. Orthonormal to "
        f"{result['orthonormality']:.1g}; as sums of Hermite-Gaussian modes they are the same "
        f"functions to {result['conversion']:.1g}."
    )
    show_gallery(page, result["modes"], f"The plane to {EXTENT:g} widths.")
    rows = [
        (one["mode"], " ".join(f"{t['coefficient']:+.4f} {t['mode']}" for t in one["terms"]))
        for one in result["sums"]
    ]
    page.table(("mode", "sum of Hermite-Gaussian modes"), rows, caption="Exact change of basis.")
