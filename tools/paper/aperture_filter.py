"""What a thin lens is worth where photographs were taken through one, and what it filters.

The paper's section on its camera model has the aperture as a "natural filter" in front of the
sensor, and its Figure 8 draws the camera as it is. This bears out two claims: defocus of fitted
splats explains pictures through an aperture far better than a pinhole does; and an aperture only
takes away, by the transfer of its blur disc, while the difference of two apertures is a band-pass.
"""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

from paper.aperture_pictures import (
    FOCUS,
    Drawn,
    lens_capture,
    many_pinholes,
    pinhole,
    radii,
    sharp_splats,
    split_azimuths,
)
from paper.aperture_spectra import spectra
from paper.images import decode, encode
from paper.plan import EPS2D, PRESET, Plan
from rift_cl import Device
from rift_cl.commands.fit_photos.job import Fit
from rift_cl.commands.fit_photos.settings import FitPhotosSettings
from rift_cl.commands.progress_bar import show_progress
from rift_cl.io import open_capture, read_view
from rift_cl.metrics import psnr
from rift_cl.report.html_page import Page
from rift_cl.report.plot import curves, figure_png, image_grid

NAME = "aperture_filter"
TITLE = "Through an aperture: defocus of splats, and the aperture as a filter"
# Of the two fits to pictures through the lens; enough for the difference to show.
STEPS, SPLATS = 2000, 12_000
_WAYS = ("pinhole", "thin lens")
_DIFFERENCE = 0.25
_WORDS = (
    f"Pictures through a thin lens of three apertures, all focused at depth {FOCUS:g}; every 4th "
    "azimuth is scored and never trained on. The same splats, fitted to sharp pictures alone, are "
    "drawn by a pinhole and through the lens; 'many pinholes' is the mean of 48 pinhole pictures "
    "spread over the aperture, in linear light: the defocus of the splats without the renderer's "
    "approximations. Then splats are fitted to the blurred pictures themselves, once as if a "
    "pinhole had taken them and once through the lens. PSNR in dB, means over the pictures."
)


def settings(plan: Plan) -> dict[str, Any]:
    """What decides the result."""
    steps, splats = _length(plan)
    made = {"lens_steps": steps, "lens_splats": splats, "seed": plan.seeds[0]}
    return {**plan.size(), **plan.fits(), "count": plan.counts[-1], **made}


def compute(plan: Plan, device: Device, kept: dict[str, Any]) -> Iterator[dict[str, Any]]:
    """Scores of the splats fitted to sharp pictures, then of the two fits, then the spectra."""
    result = dict(kept)
    drawn = sharp_splats(plan, device)
    capture = lens_capture(plan, drawn)
    place = plan.out / "fits" / ("full" if plan.full else "quick")
    seen, unseen = split_azimuths(capture, place)
    if "sharp" not in result:
        result["sharp"], result["shown"] = _of_sharp_splats(drawn, unseen)
        yield result
    for way in _WAYS:
        if way not in result:
            result[way] = _fit_scores(plan, seen, unseen, place, way)
            yield result
    if "spectra" not in result:
        result["spectra"] = spectra(drawn, capture, radii(plan))
        yield result


def _of_sharp_splats(drawn: Drawn, unseen: Path) -> tuple[dict[str, Any], dict[str, Any]]:
    """PSNR by way of drawing and radius, and pictures of the first azimuth."""
    scores: dict[str, dict[str, list[float]]] = {}
    shown = []
    for view in open_capture(unseen).views:
        camera, truth = view.camera, read_view(view)[..., :3]
        pictures = {
            "pinhole": drawn.picture(pinhole(camera)),
            "thin lens": drawn.picture(camera),
            "many pinholes": many_pinholes(drawn, camera),
        }
        assert camera.aperture is not None
        for way, picture in pictures.items():
            of_way = scores.setdefault(way, {})
            of_way.setdefault(f"{camera.aperture.radius:g}", []).append(psnr(picture, truth))
        if len(shown) < 3:
            shown.append([truth, pictures["pinhole"], pictures["thin lens"]])
    packed = [[encode(picture, (0, 1)) for picture in row] for row in shown]
    means = {
        way: {radius: float(np.mean(values)) for radius, values in of_way.items()}
        for way, of_way in scores.items()
    }
    return means, {"rows": packed}


def _fit_scores(plan: Plan, seen: Path, unseen: Path, place: Path, way: str) -> dict[str, Any]:
    """PSNR of a fit to the pictures through the lens, by radius, and of sharp pictures."""
    (steps, splats), sharp = _length(plan), plan.captures.test or plan.captures.off_path
    job = FitPhotosSettings.of(
        capture=seen,
        preset=PRESET,
        test=(unseen, sharp, seen),
        out=place / f"aperture_{way.replace(' ', '_')}_{steps}_steps_{splats}_splats",
        steps=steps,
        splats=splats,
        seed=plan.seeds[0],
        eps2d=EPS2D,
        hold_out=0,
        pinhole=way == "pinhole",
        resume=True,
        device=plan.device,
    )
    fit = Fit(job)
    show_progress(fit.run(), quiet=False)
    return {
        "unseen": _by_radius(unseen, fit.metrics["views"][unseen.name]),
        "seen": _by_radius(seen, fit.metrics["views"][seen.name]),
        "sharp": fit.metrics["scores"][sharp.name]["fit_psnr"],
    }


def _by_radius(capture: Path, entries: list[dict[str, Any]]) -> dict[str, float]:
    """The mean PSNR of a capture's pictures for each aperture."""
    lenses = {view.name: view.camera.aperture for view in open_capture(capture).views}
    found: dict[str, list[float]] = {}
    for entry in entries:
        lens = lenses[entry["name"]]
        assert lens is not None
        found.setdefault(f"{lens.radius:g}", []).append(entry["fit_psnr"])
    return {radius: float(np.mean(values)) for radius, values in found.items()}


def _length(plan: Plan) -> tuple[int, int]:
    """Steps and splats of the fits to pictures through the lens."""
    return (STEPS, SPLATS) if plan.full else (plan.steps, plan.splats)


def show(page: Page, result: dict[str, Any]) -> None:
    """Draw the table of scores, the pictures, and the spectra."""
    page.paragraph(_WORDS)
    page.table(("pictures", *_columns(result)), _rows(result), caption="PSNR in dB.")
    if "shown" in result:
        rows = result["shown"]["rows"]
        titles = [
            title
            for radius in result["sharp"]["pinhole"]
            for title in (f"radius {radius}: picture", "pinhole", "thin lens")
        ]
        images = [decode(packed) for row in rows for packed in row]
        page.figure(
            figure_png(image_grid(images, titles=titles, columns=3, window=(0.0, 1.0))),
            caption="An azimuth that was not trained on: what the lens saw, and the same sharp "
            "splats drawn without and with it.",
            alt="Pictures through three apertures beside splats",
        )
    if "spectra" in result:
        _show_spectra(page, result["spectra"])


def _columns(result: dict[str, Any]) -> tuple[str, ...]:
    columns = tuple(f"sharp splats, {way}" for way in result["sharp"])
    fits = tuple(f"fit, {way}" for way in _WAYS if way in result)
    return (*columns, *fits)


def _rows(result: dict[str, Any]) -> list[tuple[Any, ...]]:
    """A row for each radius; on sharp pictures, and those trained on, the fits alone are scored."""
    fits = [result[way] for way in _WAYS if way in result]
    blank = [float("nan")] * len(result["sharp"])
    rows: list[tuple[Any, ...]] = []
    for radius in result["sharp"]["pinhole"]:
        cells = [of_way[radius] for of_way in result["sharp"].values()]
        rows.append((f"radius {radius}", *cells, *(fit["unseen"][radius] for fit in fits)))
    if fits:
        for radius in result["sharp"]["pinhole"]:
            trained = (fit["seen"][radius] for fit in fits)
            rows.append((f"radius {radius}, trained on", *blank, *trained))
        rows.append(("sharp pictures", *blank, *(fit["sharp"] for fit in fits)))
    return rows


def _show_spectra(page: Page, found: dict[str, Any]) -> None:
    frequencies = found["frequencies"]
    series = {
        f"{radius}, {kind}": (frequencies, found[kind][radius])
        for radius in found["disc"]
        for kind in ("pictures", "splats", "disc")
    }
    page.figure(
        figure_png(curves(series, xlabel="frequency, cycles per pixel", ylabel="transfer")),
        caption="Amplitude spectra over that of the smallest aperture: of the pictures, of sharp "
        "splats through the thin lens, and as the blur disc's transfer 2 J1(x) / x has it at the "
        "depths that are seen, which counts one depth for each pixel: hairs in front of what is "
        "out of focus keep more. A wider aperture takes away and never adds.",
        alt="Transfer of wider apertures by frequency",
    )
    band = {kind: (frequencies, values) for kind, values in found["difference"].items()}
    page.figure(
        figure_png(curves(band, xlabel="frequency, cycles per pixel", ylabel="transfer")),
        caption="The smallest aperture's picture less the widest one's: it takes away what is "
        "coarse, which no aperture does by itself. The upper end of this band-pass is that of the "
        "smallest aperture, beyond what the pixels resolve.",
        alt="Transfer of the difference of two apertures",
    )
    window = (-_DIFFERENCE, _DIFFERENCE)
    page.figure(
        figure_png(
            image_grid([decode(found["picture"])], titles=["difference"], columns=1, window=window)
        ),
        caption="That difference in linear light, one channel; gray is zero.",
        alt="Difference of the pictures of two apertures",
    )
