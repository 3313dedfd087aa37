"""Figure 7: 5 views from far, 250 from near, 570 from near; what each set samples.

The paper sketches that nearer and more views make the sampled region wider and denser. Here both
are computed, with a thin lens, diffraction and pixels, at the middle of the target and at its rim,
where the lens is out of focus: nearer stops helping there, which the paper does not say.

The paper names the camera's pixels and distance (27 cm), but neither focal length, f-number nor the
target's size; those here are assumed. Pixels are joined 8 x 8, so that maps can show single slices.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np
from numpy.typing import NDArray

from paper.images import decode, encode
from paper.plan import Plan
from rift_cl import Camera, Device
from rift_cl.geometry import CameraType, look_at
from rift_cl.report.html_page import Page
from rift_cl.report.plot import FrequencySlice, curves, figure_png, frequency_maps
from rift_cl.sampling import Target, half_circle, ring_density
from rift_cl.sampling.coverage.density import density
from rift_cl.sampling.criteria.crowther import crowther
from rift_cl.sampling.criteria.limits import limits

NAME = "figure_07"
TITLE = "Figure 7: fewer and further, more and nearer"
# Views and distance in millimetres.
SETS = ((5, 1080.0), (250, 270.0), (570, 270.0))
LENS = CameraType("16 mm f/8", 16.0, 8.0, 8 * 1.85e-3, (380, 503))
DIAMETER = 60.0
# Slices per cycle per millimetre, at the ends of the scale.
_WINDOW = (1.0, 3000.0)
_BAND = 2.6
_DISTANCES = (150.0, 2160.0, 80)
# Frequencies to a sample of a map along each edge, which would skip slices otherwise; and azimuths
# over which the upright map is averaged.
_FINE, _AZIMUTHS = 3, 60

Floats = NDArray[np.float64]


def settings(plan: Plan) -> dict[str, Any]:
    """What decides the result."""
    return plan.size()


def compute(plan: Plan, device: Device, kept: dict[str, Any]) -> Iterator[dict[str, Any]]:
    """Maps, radial densities and limits of each set; larger maps in the full version."""
    result = kept or {"sets": [], "distances": None}
    edge = 320 if plan.full else 160
    for count, distance in SETS[len(result["sets"]) :]:
        result["sets"].append(_measured(count, distance, edge, device))
        yield result
    if result["distances"] is None:
        result["distances"] = _by_distance()
    yield result


def show(page: Page, result: dict[str, Any]) -> None:
    """Draw maps, curves and the table."""
    sets = result["sets"]
    page.paragraph(
        f"A ring of cameras ({LENS.name}, pixels of {1000 * LENS.pixel:.3g} um, focused at the "
        f"middle) about a target {DIAMETER:g} mm wide. The lens, the target's size and the joining "
        "of 8 x 8 pixels are assumptions; the paper does not state the first two."
    )
    _show_maps(page, sets)
    page.figure(
        figure_png(curves(_radial(sets), **_AXES)),
        caption="Density along the plane of the ring, mean over directions, and K / (pi k), which "
        "it would be without optics.",
        alt="Falling curves that end where the optics do",
    )
    page.table(_COLUMNS, [_row(part) for part in sets], caption=_CAPTION)
    if result["distances"]:
        _show_distances(page, result["distances"])


_AXES: dict[str, Any] = {
    "xlabel": "frequency, cycles per mm",
    "ylabel": "slices per cycle per mm",
    "log_x": True,
    "log_y": True,
}
_COLUMNS = (
    "views",
    "distance, mm",
    "pixels end at",
    "diffraction ends at",
    "one camera, middle",
    "one camera, rim",
    "views tell up to",
    "density / (K / (pi k))",
)
_CAPTION = (
    "Frequencies in cycles per mm. The rim is half the target's width nearer to one camera and "
    "further from the opposite one. Views tell 9 of 10 directions up to the frequency of the last "
    "but one column, by Crowther's rule. The last is at 0.1 cycles per mm, optics included."
)


def cameras_of(count: int, distance: float) -> list[Camera]:
    """A ring of cameras in the plane z = 0, focused at its middle."""
    turn = 2 * np.pi * np.arange(count) / count
    places = distance * np.stack([np.cos(turn), np.sin(turn), 0 * turn], axis=1)
    return [LENS.camera(look_at(place, (0, 0, 0), (0, 0, 1)), distance) for place in places]


def _measured(count: int, distance: float, edge: int, device: Device) -> dict[str, Any]:
    cameras = cameras_of(count, distance)
    target = Target((0, 0, 0), DIAMETER, band=_BAND)
    flat = _in_the_plane(cameras, target, edge, device)
    upright = _beside_the_axis(cameras, target, edge, device)
    radii = np.geomspace(0.02, _BAND, 60)
    ring = (radii[:, None, None] * half_circle(360)).reshape(-1, 3)
    mean = density(cameras, target, ring, device=device).reshape(len(radii), -1).mean(1)
    law = float(np.interp(0.1, radii, mean) / ring_density(count, [0.1, 0, 0]))
    rim = Target((0, 0, 0), DIAMETER, points=[[0, 0, 0], [DIAMETER / 2, 0, 0]])
    ends = limits(cameras, rim)
    told = crowther(cameras, target).frequency
    return {
        "views": count,
        "distance": distance,
        "flat": _packed(flat),
        "upright": _packed(upright),
        "k": radii.tolist(),
        "density": mean.tolist(),
        "pixel": float(np.median(ends.pixel[:, 0])),
        "diffraction": float(np.median(ends.diffraction[:, 0])),
        "middle": float(np.median(ends.camera[:, 0])),
        "rim": float(ends.camera[0, 1]),
        "told": told,
        "law": law,
    }


def _in_the_plane(cameras: list[Camera], target: Target, edge: int, device: Device) -> NDArray[Any]:
    """Density over the plane of the ring, (ky, kx)."""
    axis = np.linspace(-_BAND, _BAND, _FINE * edge)
    x, y = np.meshgrid(axis, axis)
    k = np.stack([x.ravel(), y.ravel(), 0 * x.ravel()], axis=1)
    found = density(cameras, target, k, device=device)[0]
    return np.asarray(found.reshape(edge, _FINE, edge, _FINE).mean((1, 3)))


def _beside_the_axis(
    cameras: list[Camera], target: Target, edge: int, device: Device
) -> NDArray[Any]:
    """Density over an upright plane, (kz, kr), the mean over all such planes."""
    half = np.linspace(-_BAND, _BAND, edge)[edge // 2 :]
    turn = np.pi * (np.arange(_AZIMUTHS) + 0.5) / _AZIMUTHS
    z, r, a = (part.ravel() for part in np.meshgrid(half, half, turn, indexing="ij"))
    k = np.stack([r * np.cos(a), r * np.sin(a), z], axis=1)
    found = density(cameras, target, k, device=device)[0]
    quarter = found.reshape(len(half), len(half), _AZIMUTHS).mean(2)
    right = np.concatenate([quarter[::-1], quarter])
    return np.concatenate([right[:, ::-1], right], axis=1)


def _by_distance() -> dict[str, Any]:
    """Where one camera's detail ends at the middle and at the rim, and why, by its distance."""
    distances = np.geomspace(*_DISTANCES)
    target = Target((0, 0, 0), DIAMETER, points=[[0, 0, 0], [DIAMETER / 2, 0, 0]])
    found = [limits(cameras_of(1, float(distance)), target) for distance in distances]
    return {
        "distance": distances.tolist(),
        "middle": [float(part.camera[0, 0]) for part in found],
        "rim": [float(part.camera[0, 1]) for part in found],
    }


def _show_maps(page: Page, sets: list[dict[str, Any]]) -> None:
    slices = [
        FrequencySlice(10.0 ** decode(part[plane]), _BAND, axes, _name(part))
        for plane, axes in (("flat", ("kx", "ky")), ("upright", ("kr", "kz")))
        for part in sets
    ]
    page.figure(
        figure_png(
            frequency_maps(
                slices,
                columns=len(sets),
                window=_WINDOW,
                label="slices per cycle per mm",
                unit="mm",
            )
        ),
        caption="Density of sampled frequencies at the target's middle: above in the plane of the "
        "ring, below beside its axis (mean over azimuths), where its excess is a line. What lies "
        "beyond half a cycle per pixel is passed, but folded onto what lies before.",
        alt="Discs of sampled frequencies that grow denser and wider",
    )


def _show_distances(page: Page, part: dict[str, Any]) -> None:
    series = {name: (part["distance"], part[name]) for name in ("middle", "rim")}
    drawn = curves(
        series,
        xlabel="distance, mm",
        ylabel="detail ends at, cycles per mm",
        log_x=True,
        log_y=True,
    )
    page.figure(
        figure_png(drawn),
        caption="Nearer is wider at the plane in focus alone. At the rim, nearest to the camera, "
        "depth of field ends it: there is a best distance for an opening, and a best opening for a "
        "distance.",
        alt="Two curves against the distance; that of the rim bends down",
    )


def _packed(values: NDArray[np.float32]) -> dict[str, Any]:
    low, high = _WINDOW[0] / 2, _WINDOW[1]
    shown = np.log10(np.clip(values, low, high))
    return encode(shown, (float(np.log10(low)), float(np.log10(high))))


def _name(part: dict[str, Any]) -> str:
    return f"{part['views']} views at {part['distance']:g} mm"


def _radial(sets: list[dict[str, Any]]) -> dict[str, tuple[Any, Any]]:
    series = {}
    for part in sets:
        # Below the scale lies what nobody sees.
        kept = np.array(part["density"]) > _WINDOW[0] / 10
        series[_name(part)] = (np.array(part["k"])[kept], np.array(part["density"])[kept])
    k = np.array(sets[-1]["k"])
    return {**series, "570 without optics": (k, sets[-1]["views"] / (np.pi * k))}


def _row(part: dict[str, Any]) -> tuple[object, ...]:
    numbers = ("pixel", "diffraction", "middle", "rim", "told", "law")
    return (part["views"], f"{part['distance']:g}", *(f"{part[name]:.3g}" for name in numbers))
