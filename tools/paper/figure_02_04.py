"""Figures 2, 3 and 4: one image is a slice, an orbit gathers slices, low frequencies have too many.

The paper draws them as sketches. Here they are computed on the Shepp-Logan phantom: the transform
of its projection against the slice of its transform (the complex amplitudes, where the paper speaks
of power); what the spectrum of an unfiltered backprojection holds after 1, 4, 12 and 48 views; and
the density of slices against frequency, in the plane and in space, with its slope.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np
from numpy.typing import NDArray

from paper.images import decode, encode
from paper.plan import Plan
from paper.slice_theorem import slice_comparison
from rift_cl import Device, Grid, Parallel, Projector, backproject
from rift_cl.phantom import shepp_logan
from rift_cl.report.html_page import Page
from rift_cl.report.plot import FrequencySlice, curves, figure_png, frequency_maps, image_grid
from rift_cl.sampling import Observations, Target, half_sphere, mean_density, power_slope
from rift_cl.sampling.coverage.density import density

NAME = "figure_02_04"
TITLE = "Figures 2 to 4: slices of the spectrum, and how densely they lie"
COUNTS = (1, 4, 12, 48)
VIEWS = 512
ANGLE = 0.6
# Densities are drawn, and kept, between these, in slices per cycle per diameter.
_WINDOW = (0.1, 30.0)
_DECADES = (-4.5, 0.0)
_BAND = 16.0
# Radii from which on slopes are taken: 3 cycles per diameter.
_STEEP = 4

Floats = NDArray[np.float64]


def settings(plan: Plan) -> dict[str, Any]:
    """What decides the result."""
    return plan.size()


def compute(plan: Plan, device: Device, kept: dict[str, Any]) -> Iterator[dict[str, Any]]:
    """The three parts one after the other; more samples in the full version."""
    size = 256 if plan.full else 128
    result = dict(kept)
    if "slice" not in result:
        result["slice"] = _slice(size, device)
        yield result
    if "orbit" not in result:
        result["orbit"] = _orbit(size, device)
        yield result
    if "density" not in result:
        result["density"] = _densities(16384 if plan.full else 4096, device)
    yield result


def show(page: Page, result: dict[str, Any]) -> None:
    """Draw what there is of the three."""
    if "slice" in result:
        _show_slice(page, result["slice"])
    if "orbit" in result:
        _show_orbit(page, result["orbit"])
    if "density" in result:
        _show_density(page, result["density"])


def _slice(size: int, device: Device) -> dict[str, Any]:
    grid = Grid((size, size))
    image = shepp_logan(grid)
    found = slice_comparison(image, grid, ANGLE, device=device)
    return {
        "size": size,
        "image": encode(image, (0.0, 0.5)),
        "spectrum": encode(_spectrum(image), _DECADES),
        "k": np.linalg.norm(found.frequencies, axis=1).tolist(),
        "projection": np.abs(found.projection).tolist(),
        "slice": np.abs(found.slice).tolist(),
        "difference": np.abs(found.projection - found.slice).tolist(),
        "error": found.error,
    }


def _orbit(size: int, device: Device) -> dict[str, Any]:
    grid, target = Grid((size, size)), Target.flat(1.0, band=_BAND)
    image, axis = shepp_logan(grid), np.linspace(-_BAND, _BAND, 192)
    x, y = np.meshgrid(axis, axis)
    k = np.stack([x.ravel(), y.ravel(), 0 * x.ravel()], axis=1)
    maps, spectra = [], []
    for count in COUNTS:
        scan = Parallel(ANGLE + np.arange(count) * np.pi / count, 2 * size)
        fine = Parallel(scan.angles, 64, pitch=1e-4)
        found = density(fine, target, k, device=device).reshape(x.shape)
        shown = np.log10(np.maximum(found, _WINDOW[0] / 2))
        maps.append(encode(shown, tuple(np.log10([_WINDOW[0] / 2, _WINDOW[1]]).tolist())))
        A = Projector(grid, scan, device=device)
        spectra.append(encode(_spectrum(np.asarray(backproject(A, A(image)))), _DECADES))
    return {"size": size, "maps": maps, "spectra": spectra}


def _densities(samples: int, device: Device) -> dict[str, Any]:
    radii = np.geomspace(1, 64, 13)
    scan = Parallel(np.arange(VIEWS) * np.pi / VIEWS, 64, pitch=1e-4)
    plane = mean_density(scan, Target.flat(1.0), radii, samples=samples, device=device)
    space = Target((0, 0, 0), 1.0)
    observations = Observations.along(half_sphere(VIEWS))
    sphere = mean_density(observations, space, radii, samples=samples, device=device)
    return {
        "k": radii.tolist(),
        "plane": plane.tolist(),
        "sphere": sphere.tolist(),
        "slopes": {
            "plane": power_slope(radii[_STEEP:], plane[_STEEP:]),
            "sphere": power_slope(radii[_STEEP:], sphere[_STEEP:]),
        },
        "constants": {
            "plane": float(np.mean(plane[_STEEP:] * radii[_STEEP:]) / VIEWS),
            "sphere": float(np.mean(sphere[_STEEP:] * radii[_STEEP:]) / VIEWS),
        },
    }


def _spectrum(image: NDArray[Any]) -> NDArray[np.float32]:
    """The magnitude of an image's transform, over its largest, in decades; zero in the middle."""
    window = np.hanning(image.shape[0])[:, None] * np.hanning(image.shape[1])
    found = np.abs(np.fft.fftshift(np.fft.fft2(image * window)))[::-1]
    low = 10.0 ** _DECADES[0]
    return np.log10(np.maximum(found / found.max(), low)).astype(np.float32)


def _show_slice(page: Page, part: dict[str, Any]) -> None:
    size = part["size"]
    spectrum = decode(part["spectrum"])
    steps = np.linspace(-0.5, 0.5, 4 * size)
    columns = np.clip(np.rint(size / 2 + steps * size * np.cos(ANGLE)), 0, size - 1).astype(int)
    rows = np.clip(np.rint(size / 2 - 1 - steps * size * np.sin(ANGLE)), 0, size - 1).astype(int)
    grey = (spectrum - _DECADES[0]) / (_DECADES[1] - _DECADES[0])
    marked = np.repeat(grey[..., None], 3, axis=2)
    marked[rows, columns] = (0.84, 0.37, 0.0)
    image = np.clip(decode(part["image"]) / 0.5, 0, 1)
    page.figure(
        figure_png(image_grid([image, marked], titles=["phantom", "its spectrum"], columns=2)),
        caption=f"The Shepp-Logan phantom on {size} x {size} samples, and the magnitude of its "
        f"transform over {-_DECADES[0]:g} decades. The line is the slice that a view at "
        f"{np.degrees(ANGLE):.0f} degrees sees.",
        alt="The phantom and its spectrum with a line through the middle",
    )
    k = np.array(part["k"])
    least = 1e-7 * max(part["slice"])
    series = {
        "projection": (k, np.maximum(part["projection"], least)),
        "slice": (k, np.maximum(part["slice"], least)),
        "difference": (k, np.maximum(part["difference"], least)),
    }
    drawn = curves(series, xlabel="frequency, cycles per sample", ylabel="magnitude", log_y=True)
    page.figure(
        figure_png(drawn),
        caption="Figure 2: the transform of one projection, and the slice of the phantom's "
        f"transform. They differ by {part['error']:.1e} in root mean square, weighted by the ramp.",
        alt="Two curves that lie on each other, and their difference far below",
    )


def _show_orbit(page: Page, part: dict[str, Any]) -> None:
    names = [f"{count} view{'s' if count > 1 else ''}" for count in COUNTS]
    slices = [
        FrequencySlice(10.0 ** decode(packed), _BAND, ("kx", "ky"), name)
        for packed, name in zip(part["maps"], names, strict=True)
    ]
    page.figure(
        figure_png(
            frequency_maps(
                slices,
                columns=4,
                window=_WINDOW,
                label="slices per cycle per diameter",
                unit="diameter",
            )
        ),
        caption="Figure 3: an orbit gathers slices. Each is as thick as the target's size lets it "
        "be, one cycle per diameter; near the middle they overlap.",
        alt="Lines through the middle, more in each panel",
    )
    spectra = [decode(packed) for packed in part["spectra"]]
    page.figure(
        figure_png(image_grid(spectra, titles=names, columns=4, window=_DECADES)),
        caption="What they tell of the phantom: the spectrum of the unfiltered backprojection, "
        "magnitude in decades. It glows in the middle, where slices are dense.",
        alt="Spectra of backprojections",
    )


def _show_density(page: Page, part: dict[str, Any]) -> None:
    k, slopes = np.array(part["k"]), part["slopes"]
    fine = np.geomspace(k[0], k[-1], 100)
    # Lines last, to lie above the dots.
    series = {
        f"plane, {VIEWS} angles": (k, part["plane"]),
        f"space, {VIEWS} directions": (k, part["sphere"]),
        "K / (pi k)": (fine, VIEWS / (np.pi * fine)),
        "K / (2 k)": (fine, VIEWS / (2 * fine)),
    }
    drawn = curves(
        series,
        xlabel="frequency, cycles per diameter",
        ylabel="slices per cycle per diameter",
        log_x=True,
        log_y=True,
    )
    constants = part["constants"]
    page.figure(
        figure_png(drawn),
        caption="Figure 4: mean density of slices over circles and spheres of frequencies. From 3 "
        f"cycles per diameter on the slopes are {slopes['plane']:.3f} in the plane and "
        f"{slopes['sphere']:.3f} in space; density times frequency over views is "
        f"{constants['plane']:.4f} (1 / pi is 0.3183) and {constants['sphere']:.4f} (1 / 2).",
        alt="Dots on straight lines that fall with slope minus one",
    )
