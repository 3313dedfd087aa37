"""Figure 9: from a real lens to a pinhole, a to d, with what each step leaves out.

The paper draws a lens of its own and gives no numbers. Here the lens is a published Cooke triplet,
its rays are real ones, and the losses are those of four published lenses at the paper's distance,
behind a sensor of the paper's format; the pitch of its pixels is not in the paper (1.85 micrometres
is that of the camera it names).
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np

from paper.figure_09_drawing import draw
from paper.plan import Plan
from rift_cl import Device
from rift_cl.io import open_lens
from rift_cl.optics import LensPrescription, reduce_camera
from rift_cl.optics.camera_reduction import Reduction
from rift_cl.optics.depth_of_field import finite_depth_optimum
from rift_cl.optics.optical_transfer import incoherent_cutoff
from rift_cl.optics.real_rays import pupil_rays, trace
from rift_cl.reference.pupil import (
    defocus_mtf,
    defocused_otf,
    diffraction_mtf,
    worst_depth_cutoff,
)
from rift_cl.report.html_page import Page
from rift_cl.report.plot import curves, figure_png
from rift_cl.sample.stock_lenses import STOCK_LENSES, stock_lens

NAME = "figure_09"
TITLE = "Figure 9: from a lens to a pinhole"
DRAWN = "cooke_triplet"
DISTANCE, DEPTH, PIXEL, SIZE = 270.0, 60.0, 1.85e-3, (3036, 4024)
GREEN = 550e-6
# Of the lens whose field would not hold the paper's target at the paper's distance.
_FARTHER = {"achromat": 5000.0}
_WAVES = 0.35
# The drawing is focused closer, and has a larger sensor, so that its lens can be seen.
_NEAR, _HEIGHT = 120.0, 9.0

Json = dict[str, Any]


def settings(plan: Plan) -> Json:
    """What decides the result; the figure is small enough to have one size."""
    return {"distance": DISTANCE, "depth": DEPTH, "pixel": PIXEL, "size": list(SIZE)}


def compute(plan: Plan, device: Device, kept: Json) -> Iterator[Json]:
    """The drawing, and the losses of every lens; no device is needed."""
    found = {name: _reduced(name) for name in STOCK_LENSES}
    yield {
        "drawing": _drawing(found[DRAWN]),
        "losses": {name: _losses(reduction) for name, reduction in found.items()},
        "apertures": _apertures(),
        "defocus": _defocus(),
    }


def show(page: Page, result: Json) -> None:
    """Draw the four stages, the tables, and what the last step hides."""
    page.paragraph(
        f"A published Cooke triplet, 50 mm f/5, focused at {_NEAR:g} mm: with all its surfaces "
        "(a), as its principal planes and pupils (b), as a stop and a thin lens (c), as a pinhole "
        "(d). The rays of (a) obey Snell's law; each stage after it follows from the one before."
    )
    page.figure(
        figure_png(draw(result["drawing"])),
        caption="To scale; blue: from a point on the axis, orange: from one at the edge of the "
        "sensor. H and H' are the principal planes; the thick bars are edges of stop and pupils.",
        alt="A triplet, its principal planes, a stop and a pinhole, one below the other",
    )
    for name, loss in result["losses"].items():
        page.table(
            ("step", "what it leaves out", "how much", "unit"),
            loss["rows"],
            caption=f"{loss['title']}, focused at {loss['distance']:g} mm, pixels of "
            f"{PIXEL * 1e3:g} \N{MICRO SIGN}m ({name}).",
        )
    _show_curves(page, result)


def _show_curves(page: Page, result: Json) -> None:
    apertures = result["apertures"]
    page.figure(
        figure_png(
            curves(
                {name: (apertures["diameter"], y) for name, y in apertures["cutoffs"].items()},
                xlabel="diameter of the entrance pupil, mm",
                ylabel="cycles per mm in the object",
            )
        ),
        caption=f"What a pinhole knows nothing of: a target {DEPTH:g} mm deep at {DISTANCE:g} mm. "
        f"The frequency at which contrast falls to a tenth, in focus and at the worst depth; the "
        f"best single exposure resolves {apertures['best']:.1f} cycles per mm, whatever the lens.",
        alt="Resolution against the diameter of the entrance pupil",
    )
    defocus = result["defocus"]
    page.figure(
        figure_png(
            curves(
                {name: (defocus["share"], y) for name, y in defocus["mtf"].items()},
                xlabel="frequency over the cut-off of diffraction",
                ylabel="MTF",
            )
        ),
        caption=f"MTF at {_WAVES:g} wavelengths of defocus, where the product of diffraction and "
        "blur disc is farthest from the exact one.",
        alt="Exact MTF and its approximations",
    )


def _reduced(name: str) -> Reduction:
    lens = open_lens(stock_lens(name))
    return reduce_camera(lens, _FARTHER.get(name, DISTANCE), PIXEL, SIZE, DEPTH)


def _losses(reduction: Reduction) -> Json:
    letters = ("a to b", "b to c", "c to d")
    rows = [
        [f"{letter}: {step.name}", loss.what, float(f"{loss.value:.4g}"), loss.unit]
        for letter, step in zip(letters, reduction.steps, strict=True)
        for loss in step.losses
    ]
    lens = reduction.prescription
    return {"title": lens.name, "distance": reduction.distance, "rows": rows}


def _drawing(reduction: Reduction) -> Json:
    """Everything that is drawn, as numbers along the axis (z) and across it (y)."""
    lens, gaussian, camera = reduction.prescription, reduction.gaussian, reduction.camera
    rear = lens.length
    return {
        "glasses": _outlines(lens),
        "stop": [_vertices(lens)[lens.stop], gaussian.stop_radius],
        "rays": [_real_rays(reduction, 0.0), _real_rays(reduction, _HEIGHT / _NEAR)],
        "object": [gaussian.entrance_pupil - _NEAR, _HEIGHT],
        "image": [rear + gaussian.image_position(_NEAR), _HEIGHT * camera.magnification(_NEAR)],
        "principal": [gaussian.front_principal, rear + gaussian.rear_principal],
        "pupils": [
            [gaussian.entrance_pupil, gaussian.pupil_diameter / 2],
            [rear + gaussian.exit_pupil, gaussian.exit_pupil_diameter / 2],
        ],
        "image_distance": camera.image_distance(_NEAR),
    }


def _vertices(lens: LensPrescription) -> list[float]:
    return [float(sum(s.thickness for s in lens.surfaces[:i])) for i in range(len(lens.surfaces))]


def _outlines(lens: LensPrescription) -> list[list[list[float]]]:
    """The outline of each element: [z, y] along its front and back along its rear."""
    edges, vertices = [], _vertices(lens)
    for surface, vertex in zip(lens.surfaces, vertices, strict=True):
        y = np.linspace(-1, 1, 41) * (surface.semi_diameter or 1.0)
        c = surface.curvature
        sag = c * y**2 / (1 + np.sqrt(1 - (1 + surface.conic) * c**2 * y**2))
        edges.append(np.stack([vertex + sag, y], 1))
    return [
        np.concatenate([edges[i], edges[i + 1][::-1]]).tolist()
        for i, surface in enumerate(lens.surfaces)
        if surface.glass is not None
    ]


def _real_rays(reduction: Reduction, slope: float) -> list[list[list[float]]]:
    """Three rays of a point through the pupil: the [z, y] of each on every surface."""
    lens, gaussian = reduction.prescription, reduction.gaussian
    rays = pupil_rays(gaussian, [[0, -1], [0, 0], [0, 1]], distance=_NEAR, slope=slope)
    steps = trace(lens, rays)
    start = np.array([gaussian.entrance_pupil - _NEAR, slope * _NEAR])
    end = lens.length + gaussian.image_position(_NEAR)
    last = np.stack([np.full(3, end), steps[-1].at(end)[:, 1]], 1)
    within = np.stack([step.position[:, [2, 1]] for step in steps])
    paths = np.concatenate([np.tile(start, (1, 3, 1)), within, last[None]])
    return paths.transpose(1, 0, 2).tolist()


def _apertures() -> Json:
    """Resolution of a deep target against the pupil's diameter, by the exact OTF."""
    best = finite_depth_optimum(DEPTH, DISTANCE, GREEN)
    diameters = best.diameter * np.linspace(0.2, 2.0, 91)
    # Contrast of diffraction alone falls to a tenth at 0.808 of its cut-off.
    grid = np.linspace(0, 1, 2001)
    tenth = float(grid[np.argmax(diffraction_mtf(grid) < 0.1)])
    focused = [tenth * incoherent_cutoff(A, DISTANCE, GREEN) for A in diameters]
    worst = [worst_depth_cutoff(A, DISTANCE, DEPTH, GREEN) for A in diameters]
    return {
        "diameter": diameters.tolist(),
        "cutoffs": {"in focus": focused, "worst depth": worst},
        "best": max(worst),
    }


def _defocus() -> Json:
    share = np.linspace(0, 1, 201)
    focused = diffraction_mtf(share)
    mtf = {
        "exact": np.abs(defocused_otf(share, _WAVES)),
        "diffraction x blur disc": focused * defocus_mtf(share, 8 * _WAVES),
        "with the cut-off in the disc": focused * defocus_mtf(share, 8 * _WAVES, 1.0),
        "in focus": focused,
    }
    return {"share": share.tolist(), "mtf": {name: y.tolist() for name, y in mtf.items()}}
