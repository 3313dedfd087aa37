"""Spectra of pictures through apertures, beside what the blur disc's transfer predicts of them.

Defocus filters each depth by itself. Where depths have nothing to do with each other their powers
add up, so that the power at a frequency k is that of a sharp picture times the mean of the squared
transfer at the depths that are seen, each weighted by how much of that frequency is there.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.special import j1

from paper.aperture_pictures import Drawn, linear_pictures, pinhole
from paper.images import encode
from paper.spectra import radial_power, ring_edges
from rift_cl.geometry import Camera
from rift_cl.io import open_capture, to_linear

Floats = NDArray[np.float64]

_SHOWN, _SOLID = 0.25, 0.5


def spectra(drawn: Drawn, capture: Path, radii: Sequence[float]) -> dict[str, Any]:
    """Transfers over that of the smallest aperture, by radius and kind; JSON.

    Args:
        drawn: sharp splats, for the depths, and to be drawn through the lens.
        capture: pictures of all apertures from each azimuth in turn.
        radii: of the apertures, the smallest first.
    """
    views = open_capture(capture).views
    edges, middles = ring_edges(views[0].camera.size)
    kinds = ("pictures", "splats", "disc")
    power = {kind: np.zeros((len(radii), len(middles))) for kind in kinds}
    between = {kind: np.zeros(len(middles)) for kind in kinds}
    for first in range(0, len(views), len(radii)):
        cameras = [view.camera for view in views[first : first + len(radii)]]
        pictures = linear_pictures(capture, range(first, first + len(radii)))
        _add(power["pictures"], between["pictures"], pictures, edges)
        _add(power["splats"], between["splats"], [_linear(drawn, c) for c in cameras], edges)
        transfers, weights = _disc_transfers(drawn, cameras, edges, middles)
        power["disc"] += (weights * transfers**2).sum(axis=2)
        between["disc"] += (weights * (transfers[0] - transfers[-1]) ** 2).sum(axis=1)
        if first == 0:
            difference = (pictures[0] - pictures[-1])[..., 1]
    found: dict[str, Any] = {"frequencies": middles.tolist()}
    for kind in kinds:
        ratios = np.sqrt(power[kind] / power[kind][0])
        found[kind] = {f"{r:g}": ratios[k].tolist() for k, r in enumerate(radii) if k}
    found["difference"] = {kind: np.sqrt(between[kind] / power[kind][0]).tolist() for kind in kinds}
    return {**found, "picture": encode(difference, (-_SHOWN, _SHOWN))}


def disc_transfer(diameter: Floats, frequency: Floats) -> Floats:
    """2 J1(x) / x with x = pi diameter frequency: the transfer of an evenly lit disc."""
    x = np.maximum(np.pi * diameter * frequency, 1e-9)
    return np.asarray(2 * j1(x) / x)


def _linear(drawn: Drawn, camera: Camera) -> NDArray[np.float32]:
    picture = drawn.picture(camera)
    to_linear(picture)
    return picture


def _add(
    power: Floats, between: Floats, pictures: list[NDArray[np.float32]], edges: Floats
) -> None:
    """Add the powers of one azimuth's pictures, and of the first less the last."""
    # The corner is background, which has no spectrum.
    bare = [picture - picture[0, 0] for picture in pictures]
    power += [radial_power(picture, edges) for picture in bare]
    between += radial_power(bare[0] - bare[-1], edges)


def _disc_transfers(
    drawn: Drawn, cameras: list[Camera], edges: Floats, frequencies: Floats
) -> tuple[Floats, Floats]:
    """Transfers at the depths that are seen, and the power that a sharp picture has there.

    Returns:
        (radii, frequencies, pixels) transfers and (frequencies, pixels) powers.
    """
    sharp = pinhole(cameras[0])
    depth, alpha = drawn.depth(sharp)
    seen = alpha > _SOLID
    z = depth[seen].astype(float)
    focal = np.sqrt(np.prod(sharp.intrinsics[:2]))
    transfers = []
    for camera in cameras:
        assert camera.aperture is not None
        transfers.append(disc_transfer(focal * camera.aperture.blur(z) / z, frequencies[:, None]))
    return np.array(transfers), local_power(_linear(drawn, sharp), edges)[:, seen]


def local_power(picture: NDArray[np.float32], edges: Floats) -> Floats:
    """How much of each ring of frequencies there is at each pixel: (rings, height, width).

    Seen through the window that ``radial_power`` has.
    """
    window = np.hanning(picture.shape[0])[:, None] * np.hanning(picture.shape[1])
    bare = (picture - picture[0, 0]) * window[..., None]
    spectrum = np.fft.fft2(bare, axes=(0, 1))
    down, along = (np.fft.fftfreq(edge) for edge in picture.shape[:2])
    ring = np.digitize(np.hypot(down[:, None], along), edges) - 1
    rings = [
        np.fft.ifft2(spectrum * (ring == k)[..., None], axes=(0, 1)) for k in range(len(edges) - 1)
    ]
    return np.array([(np.abs(part) ** 2).sum(axis=2) for part in rings])
