"""Spectral bias in 2D, with its two causes apart: the sampling's, and the network's own.

A slice whose every frequency has the same power is learned from parallel projections by gradient
steps: its pixels themselves, or a coordinate network (two hidden layers of ReLU) on plain
coordinates or on random Fourier features (Tancik et al., NeurIPS 2020). Each is supervised by the
pixels, by the projections, and by projections whose residual is multiplied by the ramp. Views
sample low frequencies too densely, as 1/k: what differs between pixels and projections is that
bias. What a network shows when it is given the pixels is its own.
"""

from __future__ import annotations

import itertools
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from paper.coordinate_network import NetworkFit, torch_is_missing
from paper.plan import Plan
from rift_cl import Device, Grid, Parallel, Projector
from rift_cl.report.html_page import Page
from rift_cl.report.plot import curves, figure_svgs

NAME = "slice_bias"
TITLE = "Spectral bias in 2D: the sampling's and the network's"
SUPERVISIONS = ("pixels", "projections", "ramped projections")
# Standard deviations of the frequencies of the features, in cycles over the slice; 0 for none.
FEATURES = (0.0, 4.0, 12.0)
# Of the noise in the projections, over that of the projections themselves.
NOISES = (0.0, 0.1)
# Frequencies that the slice has, cycles per pixel; the bands that errors are given in.
HIGHEST, WIDTH = 0.35, 0.05
_LENGTHS = (1 / 8, 1 / 4, 1 / 2, 1)
_MODELS = ("no network", *(f"features {sigma:g}" for sigma in FEATURES))

Floats = NDArray[np.float64]
Image = NDArray[np.float32]


@dataclass(frozen=True)
class Size:
    """How large the study is.

    Args:
        pixels: along the slice's side.
        views: over half a turn.
        steps: of gradient descent without a network, and of Adam with one.
        width: of the hidden layers, and the number of features.
        seeds: of slice, noise and network.
    """

    pixels: int
    views: int
    steps: int
    width: int
    seeds: tuple[int, ...]


FULL = Size(64, 96, 400, 192, (0, 1, 2))
QUICK = Size(32, 48, 80, 48, (0, 1, 2))


def settings(plan: Plan) -> dict[str, Any]:
    """What decides the result."""
    size = _size(plan)
    return {
        **plan.size(),
        "pixels": size.pixels,
        "views": size.views,
        "steps": size.steps,
        "width": size.width,
        "seeds": list(size.seeds),
        "noises": list(NOISES),
    }


def _size(plan: Plan) -> Size:
    return FULL if plan.full else QUICK


class Slice:
    """A slice, its views, and what they say of a slice that is not yet right.

    Args:
        size: of the study.
        seed: of the slice and the noise.
        noise: of the projections, over their root mean square.
        device: that projects.
    """

    def __init__(self, size: Size, seed: int, noise: float, device: Device) -> None:
        n, views = size.pixels, size.views
        scan = Parallel(np.arange(views) * np.pi / views, bins=int(1.5 * n))
        self.A = Projector(Grid((n, n)), scan, device=device)
        self.random = np.random.default_rng((seed, 0x51))
        self.truth = white_slice(n, self.random)
        self.data = self.A(self.truth)
        self.noise = noise * float(np.sqrt(np.mean(self.data**2)))
        self.data += self.noise * self.random.standard_normal(self.data.shape).astype(np.float32)

    def gradient(self, image: Image, supervision: str) -> Image:
        """That of half the squared error by the slice, under one of ``SUPERVISIONS``.

        The exponent of the ramp falls from 1 with the share of the residual that is noise.
        """
        if supervision == "pixels":
            return image - self.truth
        rows, exponent = self.A(image) - self.data, 0.0
        if supervision == "ramped projections":
            exponent = max(1 - self.noise**2 / max(float(np.mean(rows**2)), 1e-30), 0.0)
        return np.asarray(self.A.T(_ramped(rows, exponent)))

    def steepest(self, supervision: str) -> float:
        """The largest eigenvalue of what ``gradient`` multiplies the error by, at any exponent."""
        if supervision == "pixels":
            return 1.0
        exponents = (0.0, 1.0) if supervision == "ramped projections" else (0.0,)
        return max(self._norm(exponent) for exponent in exponents)

    def _norm(self, exponent: float) -> float:
        probe, norm = self.truth, 1.0
        for _ in range(20):
            probe = self.A.T(_ramped(self.A(probe / np.float32(norm)), exponent))
            norm = float(np.linalg.norm(probe))
        return norm

    def density(self) -> Floats:
        """How densely the views sample each band, measured: the gain of A'A, its highest 1."""
        probe = white_slice(len(self.truth), self.random)
        seen = self.A.T(self.A(probe))
        gain = bands(probe, seen) / bands(probe, probe)
        return gain / gain.max()


def _ramped(rows: Image, exponent: float) -> Image:
    """Rows of projections times the p-th power of the frequency over the lowest."""
    length = 2 * rows.shape[1]
    k = np.maximum(np.fft.rfftfreq(length) * length, 1)
    spectrum = np.fft.rfft(rows, length, axis=1) * k**exponent
    return np.fft.irfft(spectrum, length, axis=1)[:, : rows.shape[1]].astype(np.float32)


def white_slice(n: int, random: np.random.Generator) -> Image:
    """A slice (n, n) in a disc, with about the same power at all frequencies below ``HIGHEST``."""
    y, x = np.mgrid[:n, :n] - (n - 1) / 2
    soft = 1 / (1 + np.exp(np.hypot(x, y) - (n / 2 - 5)))
    spectrum = np.fft.fft2(random.standard_normal((n, n)) * soft)
    image = np.fft.ifft2(spectrum * (_frequencies(n) < HIGHEST)).real * soft
    return np.asarray(image / image.std(), np.float32)


def _frequencies(n: int) -> Floats:
    return np.asarray(np.hypot(np.fft.fftfreq(n)[:, None], np.fft.fftfreq(n)))


def band_edges() -> Floats:
    """Edges of the bands, cycles per pixel."""
    return np.arange(0, HIGHEST + WIDTH / 2, WIDTH)


def bands(one: Image, other: Image) -> Floats:
    """The cross-power of two slices in each band."""
    spectra = [np.fft.fft2(image.astype(float)) for image in (one, other)]
    power = (spectra[0].conj() * spectra[1]).real
    k = _frequencies(len(one))
    return np.asarray(np.histogram(k, band_edges(), weights=power)[0], np.float64)


def relative_error(image: Image, truth: Image) -> list[float]:
    """The power of the error over that of the truth by band, in dB."""
    error = image - truth
    found = bands(error, error) / bands(truth, truth)
    return (10 * np.log10(np.maximum(found, 1e-12))).tolist()


def compute(plan: Plan, device: Device, kept: dict[str, Any]) -> Iterator[dict[str, Any]]:
    """The error by band of every model, supervision, noise and seed, now and then on its way."""
    size = _size(plan)
    runs = list(kept.get("runs", []))
    models = _MODELS[:1] if torch_is_missing() else _MODELS
    middles = (band_edges()[1:] + band_edges()[:-1]) / 2
    density = Slice(size, 0, 0.0, device).density()
    result = {
        "frequency": middles.tolist(),
        "density": density.tolist(),
        "models": list(models),
        "runs": runs,
    }
    yield result
    done = {_key(run) for run in runs}
    for seed, noise, model, supervision in itertools.product(
        size.seeds, NOISES, models, SUPERVISIONS
    ):
        case = (seed, noise, model, supervision)
        # Pixels have no noise of views.
        if case in done or (noise and supervision == "pixels"):
            continue
        body = Slice(size, seed, noise, device)
        moments = list(_moments(body, model, supervision, size, seed))
        runs.append({**dict(zip(_OF, case, strict=True)), "moments": moments})
        yield result


_OF = ("seed", "noise", "model", "supervision")


def _key(run: dict[str, Any]) -> tuple[Any, ...]:
    return tuple(run[name] for name in _OF)


def _moments(
    body: Slice, model: str, supervision: str, size: Size, seed: int
) -> Iterator[dict[str, Any]]:
    """The error by band after a part of the steps, and after all."""
    gradient = partial(body.gradient, supervision=supervision)
    wanted = {max(1, round(share * size.steps)) for share in _LENGTHS}
    if model == "no network":
        images = _descent(gradient, np.zeros_like(body.truth), body.steepest(supervision))
    else:
        sigma = float(model.removeprefix("features "))
        images = NetworkFit(size.pixels, size.width, sigma, seed).images(gradient, body.truth)
    for step, image in enumerate(itertools.islice(images, size.steps), start=1):
        if step in wanted:
            yield {"step": step, "error": relative_error(image, body.truth)}


def _descent(gradient: Callable[[Image], Image], image: Image, steepest: float) -> Iterator[Image]:
    """Gradient steps, the longest that are stable."""
    while True:
        image = image - gradient(image) / np.float32(steepest)
        yield image


def show(page: Page, result: dict[str, Any]) -> None:
    """Draw the density, the errors of each model, and the table."""
    frequency, runs = result["frequency"], result["runs"]
    _draw_density(page, frequency, result["density"])
    seeds = len({run["seed"] for run in runs})
    page.paragraph(
        "Power of the error over that of the slice by band, after all steps; the mean of dB over "
        f"{seeds} seeds of slice, noise and network. 0 dB: nothing is learned. What differs "
        "between 'pixels' and 'projections' is the bias of the sampling, which the ramp is meant "
        "to take back; the slope of 'pixels' is the network's own, which Fourier features change."
    )
    for noise in sorted({run["noise"] for run in runs}):
        for model in result["models"]:
            _draw_model(page, frequency, [r for r in runs if _is_of(r, noise, model)], noise, model)
    _table(page, result)
    page.paragraph(
        "Not claimed: that a network is worse or better than pixels or splats (compare the shapes "
        "of curves at one total error, not their heights); that the ramp suits noisy views as "
        "well as clean ones (its exponent falls to 0 as the residual comes down to the noise); "
        "anything about opaque scenes, where no slice theorem holds."
    )


def _is_of(run: dict[str, Any], noise: float, model: str) -> bool:
    return bool(run["noise"] == noise and run["model"] == model)


def _draw_density(page: Page, frequency: Sequence[float], density: Sequence[float]) -> None:
    first = 1 / np.asarray(frequency)
    series = {"measured": (frequency, density), "1/k": (frequency, first / first.max())}
    words = (
        "Sampling density of the views by frequency: the gain of projection and backprojection of "
        "white noise in a disc, and 1/k, both over their highest."
    )
    _draw(page, series, "density / highest", words, log_y=True)


def _draw_model(
    page: Page, frequency: Sequence[float], runs: Sequence[dict[str, Any]], noise: float, model: str
) -> None:
    series = {}
    for supervision in SUPERVISIONS:
        found = [r["moments"][-1]["error"] for r in runs if r["supervision"] == supervision]
        if found:
            series[supervision] = (frequency, np.mean(found, axis=0))
    if series:
        noisy = f", noise {noise:g} of the projections" if noise else ""
        words = f"Relative error after all steps: {_words(model)}{noisy}."
        _draw(page, series, "error / truth, dB", words)


def _words(model: str) -> str:
    if model == "no network":
        return "pixels by gradient descent, no network"
    sigma = model.removeprefix("features ")
    return (
        "network on plain coordinates"
        if sigma == "0"
        else f"network on Fourier features of standard deviation {sigma}"
    )


def _draw(
    page: Page, series: dict[str, tuple[Any, Any]], label: str, words: str, *, log_y: bool = False
) -> None:
    figure = figure_svgs(
        lambda width: curves(
            series,
            xlabel="spatial frequency, cycles per pixel",
            ylabel=label,
            log_y=log_y,
            width=width,
        )
    )
    page.figure(figure, caption=words, alt=words)


def _table(page: Page, result: dict[str, Any]) -> None:
    """Mean and spread over the seeds of the last moment, by band."""
    edges, rows = band_edges(), []
    cases = dict.fromkeys((r["noise"], r["model"], r["supervision"]) for r in result["runs"])
    for case in cases:
        same = [r for r in result["runs"] if (r["noise"], r["model"], r["supervision"]) == case]
        errors = np.array([r["moments"][-1]["error"] for r in same])
        spread = (errors.max(axis=0) - errors.min(axis=0)) / 2
        cells = [f"{m:.1f} ± {s:.1f}" for m, s in zip(errors.mean(axis=0), spread, strict=True)]
        rows.append((f"{case[1]}, {case[2]}", case[0], *cells))
    heads = [f"{low:.2f}–{high:.2f}" for low, high in itertools.pairwise(edges)]
    words = (
        "Relative error in dB by band of cycles per pixel after all steps: mean over the seeds and "
        "half the range."
    )
    page.table(("model, supervision", "noise", *heads), rows, caption=words)
