"""Figure 14: Hermite-Gaussian modes of orders 0 to 2 along either axis."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np

from paper.figure_13 import EXTENT, on_plane, orthonormality
from paper.mode_gallery import packed, show_gallery
from paper.plan import Plan
from rift_cl import Device
from rift_cl.basis import Hermite, place
from rift_cl.report.html_page import Page

NAME = "figure_14"
TITLE = "Figure 14: Hermite-Gaussian modes"
PAIRS = tuple((m, n) for m in range(3) for n in range(3))


def settings(plan: Plan) -> dict[str, Any]:
    """What decides the result."""
    return plan.size()


def compute(plan: Plan, device: Device, kept: dict[str, Any]) -> Iterator[dict[str, Any]]:
    """The modes, and how orthonormal they are."""
    basis = Hermite(4, 2, form="std")
    chosen = np.eye(basis.n_coeff)[place(np.array(PAIRS))]
    pictures = np.moveaxis(on_plane(basis, chosen, 193 if plan.full else 97), -1, 0)
    yield {
        "modes": packed(pictures, [f"HG {m} {n}" for m, n in PAIRS]),
        "orthonormality": orthonormality(basis),
    }


def show(page: Page, result: dict[str, Any]) -> None:
    """Draw the modes."""
    page.paragraph(
        "Zeros along x by the first number, along y by the second: separable, unlike the modes of "
        f"figure 13, whose spans by total order are the same. Orthonormal to "
        f"{result['orthonormality']:.1g}."
    )
    show_gallery(page, result["modes"], f"The plane to {EXTENT:g} widths.")
