"""Gaussians in front of every camera model and switch that projection knows."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from rift_cl.geometry import Aperture, Camera
from rift_cl.reference.splat_projection import covariances, project_splats
from rift_cl.splat.projection import project
from rift_cl.splat.settings import SplatSettings
from rift_cl.splat.splats import Splats


def turned(seed):
    """A rotation drawn at random."""
    rotation, upper = np.linalg.qr(np.random.default_rng(seed).standard_normal((3, 3)))
    rotation = rotation * np.sign(np.diag(upper))
    return rotation * np.sign(np.linalg.det(rotation))


def camera_of(model, *, distance=4.0, focal=None, size=(97, 143), seed=5, aperture=None):
    """A camera of odd numbers that looks at the origin; every number is a float32."""
    focal = focal or {"pinhole": 150.0, "ortho": 41.0, "fisheye": 120.0}[model]
    view = np.eye(4)
    view[:3, :3] = turned(seed)
    view[:3, 3] = [0.11, -0.07, distance]
    K = np.array([[focal, 0, 66.3], [0, 0.9 * focal, 51.7], [0, 0, 1]])
    return Camera(size, K.astype(np.float32), view.astype(np.float32), model, aperture)


@dataclass(frozen=True)
class Kind:
    """One way to project."""

    model: str = "pinhole"
    covars: bool = False
    settings: SplatSettings = field(default_factory=SplatSettings)
    aperture: Aperture | None = field(default=None, kw_only=True)
    focal: float | None = field(default=None, kw_only=True)

    @property
    def camera(self):
        return camera_of(self.model, aperture=self.aperture, focal=self.focal)


# Blurs by up to 10 pixels, and through diffraction by as much as the tests' dilation.
LENS = Aperture(0.25, 3.75, 0.002)


KINDS = {
    "pinhole": Kind(),
    "ortho": Kind("ortho"),
    "fisheye": Kind("fisheye"),
    "pinhole antialiased": Kind(settings=SplatSettings(antialiased=True)),
    "fisheye antialiased covariances": Kind("fisheye", True, SplatSettings(antialiased=True)),
    "pinhole xray": Kind(settings=SplatSettings(mode="xray")),
    "ortho xray": Kind("ortho", settings=SplatSettings(mode="xray", eps2d=0.1)),
    "pinhole xray covariances": Kind("pinhole", True, SplatSettings(mode="xray")),
    "lens": Kind(aperture=LENS),
    "lens antialiased": Kind(settings=SplatSettings(antialiased=True), aperture=LENS),
    "lens covariances": Kind(covars=True, aperture=LENS),
    "lens antialiased covariances": Kind(
        "pinhole", True, SplatSettings(antialiased=True), aperture=LENS
    ),
}


def random_splats(count=400, seed=0, *, coefficients=16, wide=1.6):
    """Host arrays of splats of all shapes about the origin, in float32."""
    random = np.random.default_rng(seed)
    values = {
        "means": random.uniform(-wide, wide, (count, 3)),
        "quats": random.standard_normal((count, 4)) * np.exp(random.normal(0, 1, (count, 1))),
        "scales": np.exp(random.uniform(np.log(0.005), np.log(0.3), (count, 3))),
        "opacities": random.uniform(0.002, 1, count),
        "sh": 0.4 * random.standard_normal((count, coefficients, 3)),
    }
    return {name: value.astype(np.float32) for name, value in values.items()}


def all_round(camera, count=200, *, angles=(60, 150), seed=3):
    """Small splats about a camera, at angles between two from its axis, in degrees."""
    random = np.random.default_rng(seed)
    angle, turn = np.radians(np.linspace(*angles, count)), random.uniform(0, 2 * np.pi, count)
    ways = [np.sin(angle) * np.cos(turn), np.sin(angle) * np.sin(turn), np.cos(angle)]
    points = random.uniform(1, 4, (count, 1)) * np.stack(ways, axis=1)
    means = np.linalg.solve(camera.view[:3, :3], (points - camera.view[:3, 3]).T).T
    values = random_splats(count, seed)
    return values | {"means": means.astype(np.float32), "scales": values["scales"] / 4}


def shaped(values, kind):
    """The splats as this kind takes them: covariances of float32 numbers where it wants those."""
    if not kind.covars:
        return values
    rest = {name: value for name, value in values.items() if name not in ("quats", "scales")}
    covars = covariances(values["quats"].astype(float), values["scales"].astype(float))
    rows, columns = np.triu_indices(3)
    return rest | {"covars": covars[:, rows, columns].astype(np.float32)}


def upload(device, values, kind):
    return sent(device, shaped(values, kind))


def sent(device, values):
    """Splats past what ``Splats.upload`` refuses: kernels are given any numbers."""
    arrays = {name: device.array(host) for name, host in values.items()}
    return Splats(**{"quats": None, "scales": None} | arrays)


def full_covars(values, kind):
    """(N, 3, 3) float64 covariances of the numbers that the device sees."""
    values = shaped(values, kind)
    if not kind.covars:
        return covariances(values["quats"].astype(float), values["scales"].astype(float))
    full = np.empty((len(values["covars"]), 3, 3))
    rows, columns = np.triu_indices(3)
    full[:, rows, columns] = full[:, columns, rows] = values["covars"]
    return full


def twin_of(values, kind, camera=None, covars=None):
    """The reference projection of the same numbers."""
    settings = kind.settings
    names = ("far", "radius_clip", "eps2d", "antialiased", "mode")
    return project_splats(
        values["means"].astype(float),
        full_covars(values, kind) if covars is None else covars,
        values["opacities"].astype(float),
        camera or kind.camera,
        **{name: getattr(settings, name) for name in names},
        near=settings.near_plane,
        tile=settings.tile or 16,
    )


def arrays_of(projection):
    """The device arrays of a projection, by name."""
    return {name: getattr(projection, name) for name in ("screen", "depths", "boxes", "culled")}


def projected_on(device, values, kind, camera=None):
    """What the device gives, on the host."""
    projected = project(device, upload(device, values, kind), camera or kind.camera, kind.settings)
    found = {name: device.get(array) for name, array in arrays_of(projected).items()}
    return found | {"radii": np.ceil(found["screen"][:, 6:])}


# One splat in the middle of the picture, for cases that change one thing.
PLAIN = {
    "means": [[0, 0, 0]],
    "quats": [[1, 0, 0, 0]],
    "scales": [[0.1, 0.2, 0.1]],
    "opacities": [0.5],
}


def plain(**changes):
    return {name: np.array(value, np.float32) for name, value in (PLAIN | changes).items()}


def changed(**changes):
    return Kind(settings=SplatSettings(**changes))
