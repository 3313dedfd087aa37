"""Splats with Hermite modes before a camera, on the device and by the float64 twins."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from projection_scenes import LENS, camera_of, random_splats

from rift_cl.geometry import Aperture, Camera
from rift_cl.reference.hermite_projection import project_modes, splat_roots
from rift_cl.reference.hermite_raster import hermite_modes
from rift_cl.reference.splat_projection import project_splats
from rift_cl.splat.orders import count_of
from rift_cl.splat.settings import SplatSettings


@dataclass(frozen=True)
class Modal:
    """One way to project splats with modes; three channels have polynomials."""

    shape: int
    color: int = 0
    model: str = "pinhole"
    settings: SplatSettings = field(default_factory=SplatSettings)
    aperture: Aperture | None = None

    @property
    def camera(self):
        return camera_of(self.model, aperture=self.aperture)


MODALS = {
    "order 1": Modal(1),
    "colour 1": Modal(0, 1),
    "orders 2 and 1, ortho": Modal(2, 1, "ortho"),
    "orders 3 and 4, fisheye": Modal(3, 4, "fisheye"),
    "order 2, xray": Modal(2, 0, settings=SplatSettings(mode="xray")),
    "order 1, parallel xray": Modal(1, 1, "ortho", SplatSettings(mode="xray", eps2d=0.1)),
    "order 2, square": Modal(2, 0, settings=SplatSettings(activation="square")),
    "antialiased": Modal(2, 2, settings=SplatSettings(antialiased=True, activation="exp")),
    "lens": Modal(2, 1, aperture=LENS),
    "lens antialiased": Modal(1, 1, settings=SplatSettings(antialiased=True), aperture=LENS),
    "no modes, exp": Modal(0, settings=SplatSettings(activation="exp")),
    "orders 8 and 8": Modal(8, 8),
}


def modal_splats(modal, count=100, seed=0, *, strength=0.3, **options):
    """Host arrays of random splats with random modes, in float32."""
    values = random_splats(count, seed, **options)
    random = np.random.default_rng(seed + 50)
    if modal.shape:
        modes = random.standard_normal((count, count_of(modal.shape) - 1))
        values["shape_modes"] = np.float32(strength * modes)
    if modal.color:
        modes = random.standard_normal((count, count_of(modal.color) - 1, 3))
        values["color_modes"] = np.float32(strength * modes)
    return values


def in_double(values):
    return {name: value.astype(float) for name, value in values.items()}


def twin_of(values, modal, camera: Camera | None = None):
    """The reference projection of the splats and of their modes."""
    settings, camera = modal.settings, camera or modal.camera
    values = in_double(values)
    roots = splat_roots(values["quats"], values["scales"])
    names = ("far", "eps2d", "antialiased", "mode")
    options = {name: getattr(settings, name) for name in names}
    options |= {"near": settings.near_plane, "tile": settings.tile or 16}
    covars = roots @ roots.transpose(0, 2, 1)
    seen = project_splats(values["means"], covars, values["opacities"], camera, **options)
    modes = project_modes(
        *(values["means"], roots, seen.covars, camera),
        *(values.get("shape_modes"), values.get("color_modes")),
    )
    return seen, modes


def polynomials(modes, orders, at):
    """He~_m at each splat's places (N, P, 2), up to the larger of the orders: (M, N, P)."""
    return hermite_modes(at[..., 0], at[..., 1], max(orders))


def whitened(seen, modes, pixels):
    """u' of (N, P, 2) pixels."""
    return np.einsum("nab,npb->npa", modes.whitening, pixels - seen.means[:, None])
