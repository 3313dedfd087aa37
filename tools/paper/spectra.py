"""The power of pictures by spatial frequency, to see which frequencies a fit has learned."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]

_BINS = 14
_LOWEST, _HIGHEST = 0.01, 0.5


def radial_power(image: NDArray[np.float32], edges: Floats) -> Floats:
    """The power of an image in rings of the Fourier plane.

    A Hann window keeps the jump between opposite borders out of it.

    Args:
        image: (y, x, C), background 0.
        edges: (n + 1,) of the rings, in cycles per pixel.

    Returns:
        (n,) the sums over each ring and the channels.
    """
    high, wide = image.shape[:2]
    window = np.hanning(high)[:, None] * np.hanning(wide)
    spectrum = np.fft.fft2(image * window[..., None], axes=(0, 1))
    power = np.sum(np.abs(spectrum) ** 2, axis=2)
    return np.histogram(_radius((high, wide)), edges, weights=power)[0].astype(np.float64)


def ring_edges(shape: tuple[int, int]) -> tuple[Floats, Floats]:
    """Rings of equal ratio, each with a sample of the spectrum in it at least.

    Args:
        shape: (height, width) of the image.

    Returns:
        (n + 1,) their edges and (n,) their middles, in cycles per pixel.
    """
    radius = _radius(shape)
    kept = [_LOWEST]
    for edge in np.geomspace(_LOWEST, _HIGHEST, _BINS + 1)[1:].tolist():
        if ((radius >= kept[-1]) & (radius < edge)).any():
            kept.append(edge)
    edges = np.array(kept)
    return edges, np.sqrt(edges[1:] * edges[:-1])


def error_spectrum(
    images: Sequence[NDArray[np.float32]], truths: Sequence[NDArray[np.float32]], edges: Floats
) -> tuple[Floats, Floats]:
    """How wrong pictures are, by frequency.

    Args:
        images: (y, x, C) each, less their background.
        truths: what they should be, likewise.
        edges: of the rings.

    Returns:
        (n,) the error's power and the images' power, both as shares of the truths' power. The
        error's is 1 where nothing was learned and 0 where everything was.
    """
    truth = sum(radial_power(t, edges) for t in truths)
    pairs = zip(images, truths, strict=True)
    error = sum(radial_power(image - true, edges) for image, true in pairs)
    drawn = sum(radial_power(image, edges) for image in images)
    return np.asarray(error / truth), np.asarray(drawn / truth)


def _radius(shape: tuple[int, int]) -> Floats:
    ky, kx = np.fft.fftfreq(shape[0])[:, None], np.fft.fftfreq(shape[1])
    return np.asarray(np.hypot(ky, kx))
