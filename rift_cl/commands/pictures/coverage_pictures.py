"""Plots of coverage: planes of frequencies, spectra, directions, cameras."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from rift_cl.cl.device import Device
from rift_cl.commands.inputs.view_set import ViewSet
from rift_cl.geometry import Camera, Cone, Grid, Vectors
from rift_cl.report.html_page import Page
from rift_cl.report.plot import curves, figure_svg
from rift_cl.report.plot.camera_plot import Stands, camera_plot
from rift_cl.report.plot.direction_map import direction_maps
from rift_cl.report.plot.frequency_map import FrequencySlice, frequency_maps
from rift_cl.report.plot.section_map import section_map
from rift_cl.sampling.coverage.density import window_width
from rift_cl.sampling.criteria.orlov import slice_gaps
from rift_cl.sampling.criteria.tuy import missed_planes
from rift_cl.sampling.targets.prior import directions_for

if TYPE_CHECKING:
    from matplotlib.figure import Figure

Floats = NDArray[np.float64]
# Samples along a map, slices that lie side by side in it, and samples of a slice's thickness.
_SAMPLES, _SLICES = 181, 24
# Of frequencies, float64, and their coverage.
MAP_BYTES = _SAMPLES**2 * 4 * 8
PLANES = ((0, 1), (0, 2), (1, 2))
# The least density that is shown, in views.
LEAST = 0.01
# Frequency, in cycles per diameter, at which directions of detail are asked for.
_DETAIL = 8.0
_RADII, _WAYS = 60, 500
# Samples along the longer edge of a section through the target.
_SECTION = 61


def slice_maps(sampled: ViewSet, points: Mapping[str, Floats], device: Device) -> Figure:
    """Density over planes of frequencies about each point, so near that slices are told apart."""
    near = near_band(sampled)
    return _maps(sampled, [(name, point, near) for name, point in points.items()], device)


def support_maps(sampled: ViewSet, device: Device) -> Figure | None:
    """Density over planes of frequencies out to the finest detail; None if that is near already."""
    finest = 1.05 * sampled.finest
    if finest < 1.5 * near_band(sampled):
        return None
    return _maps(sampled, [("middle", sampled.target.center, finest)], device)


def near_band(sampled: ViewSet) -> float:
    """The highest frequency of a map in which single slices are told apart."""
    return min(_SLICES / sampled.target.diameter, 1.05 * sampled.finest)


def _maps(sampled: ViewSet, wanted: list[tuple[str, Floats, float]], device: Device) -> Figure:
    """A row of planes for each name, point and highest frequency; for a flat target, a panel."""
    planes = PLANES[:1] if sampled.is_flat else PLANES
    slices = [
        FrequencySlice(
            plane_density(sampled, point, plane, band, device),
            band,
            (f"k{'xyz'[plane[0]]}", f"k{'xyz'[plane[1]]}"),
            name if plane == planes[len(planes) // 2] else "",
        )
        for name, point, band in wanted
        for plane in planes
    ]
    # What a slice covers of a sample is the less, the coarser the samples are.
    thin = min(1.0, _SLICES / (wanted[0][2] * sampled.target.diameter))
    return frequency_maps(
        slices,
        columns=3,
        window=(LEAST * thin, max(float(sampled.views), 1.0)),
        label="views",
        unit=sampled.unit,
    )


def plane_density(
    sampled: ViewSet, point: Floats, plane: tuple[int, int], band: float, device: Device
) -> Floats:
    """Coverage over a plane, (n, n); slices thinner than a sample are averaged over it."""
    n = _SAMPLES
    along = np.linspace(-band, band, n)
    k = np.zeros((n * n, 3))
    k[:, plane[0]], k[:, plane[1]] = np.tile(along, n), np.repeat(along, n)
    own = sampled.target.diameter
    # A target half as large has slices twice as thick, whose sum is twice as much.
    coarse = min(own, 1 / (2 * (along[1] - along[0])))
    # Coverage at -k is that at k.
    half = n * n // 2 + 1
    found = sampled.coverage(k[:half], device, points=point[None], diameter=coarse)[0]
    whole = np.concatenate([found, found[:-1][::-1]]) * (coarse / own)
    return np.asarray(whole.reshape(n, n))


def density_curves(sampled: ViewSet, device: Device) -> Figure:
    """Coverage against frequency, over all directions and for the tenth that has least."""
    target = sampled.target
    first, last = 1 / target.diameter, max(1.2 * sampled.finest, 4 / target.diameter)
    radii = np.geomspace(first, last, _RADII)
    ways = directions_for(2 if sampled.is_flat else 3, _WAYS)
    k = (radii[:, None, None] * ways).reshape(-1, 3)
    found = sampled.coverage(k, device, points=target.center[None])[0].reshape(_RADII, _WAYS)
    mean, least = found.mean(axis=1), np.quantile(found, 0.1, axis=1)
    floor = LEAST / 10
    series = {}
    for name, values in (("mean", mean), ("least covered tenth", least)):
        kept = values > floor
        if kept.any():
            series[name] = (radii[kept], values[kept])
    law = (
        window_width(target.diameter)
        * sampled.views
        / (radii * (math.pi if sampled.is_flat else 2))
    )
    series["law 1/k"] = (radii[law > floor], law[law > floor])
    return curves(
        series,
        xlabel=f"|k|, cycles per {sampled.unit}",
        ylabel="views",
        log_x=True,
        log_y=True,
    )


def direction_figure(sampled: ViewSet, device: Device, added: Sequence[Camera] = ()) -> Figure:
    """Lines of sight, and how many views see detail along each direction, at 8 per diameter.

    A direction that lies on no slice, slices being as thick as the target makes them, is shaded.
    """
    target, center = sampled.target, sampled.target.center[None]
    views = {"views": sampled.directions()}
    if added:
        more = np.array([camera.center for camera in added]) - center
        views["to add"] = more / np.linalg.norm(more, axis=1, keepdims=True)
    fine = detail_of(sampled)
    return direction_maps(
        views,
        lambda ways: sampled.coverage(fine * ways, device, points=center)[0],
        lambda ways: slice_gaps(sampled.directions(), ways) > 0.5 / (target.diameter * fine),
        up=sampled.up,
        label="views",
    )


def detail_of(sampled: ViewSet) -> float:
    """The frequency of the detail whose directions are shown, in cycles per unit of length."""
    return min(_DETAIL / sampled.target.diameter, 0.5 * sampled.finest)


def camera_figure(groups: Mapping[str, Sequence[Camera]], sampled: ViewSet) -> Figure:
    """Cameras round the target from above and from the side."""
    return camera_plot(
        {name: Stands.of(cameras) for name, cameras in groups.items() if cameras},
        center=tuple(sampled.target.center),
        diameter=sampled.target.diameter,
        up=tuple(sampled.up),
        unit=sampled.unit,
    )


def add_missed_planes(page: Page, scan: Cone | Vectors, grid: Grid, *, unit: str) -> None:
    """Add to a report what the path of a scanner's source cannot tell, place by place.

    Args:
        page: the report.
        scan: the views.
        grid: the volume; its section along the axis is shown.
        unit: of length.
    """
    edges = tuple(
        (middle - count * step / 2, middle + count * step / 2)
        for count, step, middle in (
            (grid.shape[axis], grid.spacing[axis], grid.center[axis]) for axis in (2, 0)
        )
    )
    lengths = [high - low for low, high in edges]
    across, up = (max(5, round(_SECTION * length / max(lengths))) for length in lengths)
    x, z = (np.linspace(*ends, n) for ends, n in zip(edges, (across, up), strict=True))
    points = np.stack(
        [np.tile(x, up), np.full(across * up, grid.center[1]), np.repeat(z, across)], axis=1
    )
    missed = missed_planes(scan, points)
    page.section("What the source's path cannot tell")
    if not missed.any():
        page.paragraph(
            "The source crosses every plane through the volume: Tuy's condition is met, and views "
            "enough determine every point."
        )
        return
    page.paragraph(
        f"Of the planes through a point, up to {missed.max():.2%} are never crossed by the source. "
        "What varies across such a plane is not measured there: edges that lie along it blur, "
        "whatever the method, and filtered backprojection loses contrast besides. No more views "
        "on this path mend it; a helix, or a second circle, does."
    )
    page.figure(
        figure_svg(
            section_map(
                missed.reshape(up, across),
                edges=(edges[0], edges[1]),
                axes=("x", "z"),
                label="planes never crossed",
                unit=unit,
            )
        ),
        caption="Section along the rotation axis: the share of planes through each point that the "
        "source's path misses (Tuy's condition).",
        alt="Map of the share of planes that the source never crosses",
    )


def add_coverage(
    page: Page, sampled: ViewSet, points: Mapping[str, Floats], device: Device
) -> None:
    """Add the maps of density near and far, and density against frequency, to a report."""
    page.figure(
        figure_svg(slice_maps(sampled, points, device)),
        caption="Planes of the target's Fourier domain: how many views sample each frequency; "
        "white is close to none.",
        alt="Maps of density over planes of frequencies",
    )
    support = support_maps(sampled, device)
    if support is not None:
        page.figure(
            figure_svg(support),
            caption="The same about the centre, out to the highest frequency that any view passes; "
            "slices thinner than a sample count by the fraction that they fill.",
            alt="Maps of density out to the finest detail",
        )
    page.figure(
        figure_svg(density_curves(sampled, device)),
        caption="Mean coverage over all directions, that of the least covered tenth, and the 1/k "
        "law of ideal views (no pixels, no lens).",
        alt="Density against frequency",
    )
