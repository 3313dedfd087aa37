"""The scenes that a step of training is measured on: pictures, first splats, settings.

The ornament that comes with the package, a few of its views; and cubes of small splats of any
number and image size, whose pictures are drawn by ourselves, kept as codes of 8 bits as photographs
are, and fitted again from splats that were moved and lost their colours. Harmonics have degree 3
from the first step on, and the number of splats stays as it is, so that all steps do the same work.
"""

from __future__ import annotations

import math
import re
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

import rift_cl as rift
from bench.case import Floats
from bench.splats import SplatCase
from rift_cl.commands.fit_photos.pictures import CapturePictures
from rift_cl.commands.fit_photos.start import first_splats
from rift_cl.errors import InputError
from rift_cl.geometry import Camera
from rift_cl.io import open_capture
from rift_cl.sample import ornament
from rift_cl.splat import Renderer, Splats
from rift_cl.train import McmcSettings, Parameters, Trainer, TrainingViews, TrainSettings
from rift_cl.train.parameters import Arrays

# Views that are looked at; each has its turn in every pass.
VIEWS = 8
_COEFFICIENTS, _Y0 = 16, 0.28209479177387814
# How far splats are moved from where they belong, and what they all hide at first.
_MOVED, _LOGIT = 0.02, -1.0
# A run that is much longer than what is measured, without relocations: they are measured apart.
_STEPS = 30_000
# The random walk of 3DGS as MCMC, which fits do without unless they are asked for it.
_WALK = 5e5
_ORNAMENT = "ornament"


@dataclass(frozen=True)
class TrainingCase:
    """A scene, its number of splats and the device.

    Args:
        count: most splats; the ornament's hull gives as many.
        size: (height, width) of the pictures.
        device: where to fit.
        ornament: the ornament's pictures in place of a cube's.
    """

    count: int
    size: tuple[int, int]
    device: rift.Device
    ornament: bool = False

    @classmethod
    def parse(cls, text: str, device: rift.Device) -> TrainingCase:
        """Read ``ornament:10000`` or ``20000:224x168``: splats, then pixels along and down.

        Raises:
            InputError: the text is neither, or there is nothing to fit.
        """
        match = re.fullmatch(r"ornament:(\d+)|(\d+):(\d+)x(\d+)", text.strip())
        wanted = "ornament:SPLATS or SPLATS:WIDTHxHEIGHT such as 20000:224x168, at least 16 x 16"
        if match is None:
            raise InputError(f"scene is {text!r}, wanted {wanted}")
        count, width, height = (int(match[n] or 0) for n in (2, 3, 4))
        if match[1]:
            size = open_capture(ornament()).views[0].camera.size
            return cls(int(match[1]), size, device, ornament=True)
        if count < 1 or min(width, height) < 16:
            raise InputError(f"scene is {text!r}, wanted {wanted}")
        return cls(count, (height, width), device)

    @property
    def name(self) -> str:
        """How tables call it."""
        what = f"{_ORNAMENT}, " if self.ornament else ""
        return f"{what}{self.count} splats, {self.size[1]} × {self.size[0]}"

    def record(self) -> dict[str, Any]:
        """How the JSON file tells it from others."""
        splats = len(self.raw["means"])
        return {"name": self.name, "splats": splats, "size": list(self.size), "views": VIEWS}

    @cached_property
    def settings(self) -> TrainSettings:
        """L1 and D-SSIM, Adam, penalties and the random walk of 3DGS as MCMC; no relocation."""
        return TrainSettings(
            steps=_STEPS,
            splats=self.count,
            sh_degree=3,
            noise=0.0,
            strategy=McmcSettings(first=_STEPS, noise=_WALK),
        )

    @cached_property
    def pictures(self) -> TrainingViews:
        """What is fitted."""
        if not self.ornament:
            return DrawnPictures(self.device, self.count, self.size)
        views = open_capture(ornament()).views
        few = np.linspace(0, len(views), VIEWS, endpoint=False).round().astype(int)
        return CapturePictures(self.device, [views[number] for number in few.tolist()])

    @cached_property
    def raw(self) -> Arrays:
        """The first splats, before their activations, on the host."""
        if not self.ornament:
            return _moved(self.count, self.device)
        capture = replace(open_capture(ornament()), points=None)
        assert isinstance(self.pictures, CapturePictures)
        counts = {"count": self.count, "guessed": self.count}
        raw, _, _ = first_splats(self.device, capture, self.pictures, **counts, seed=0).host()
        wide = np.zeros((len(raw["means"]), _COEFFICIENTS, 3), np.float32)
        wide[:, :1] = raw["sh"]
        return {**raw, "sh": wide}

    def trainer(self, settings: TrainSettings | None = None, pictures: Any = None) -> Trainer:
        """A fit at its beginning."""
        parameters = Parameters.of(self.device, self.raw)
        return Trainer(pictures or self.pictures, parameters, settings or self.settings)


class DrawnPictures:
    """Pictures of a cube of splats from a ring of cameras; see ``rift_cl.train.TrainingViews``.

    Args:
        device: where they are drawn and sent to.
        count: splats of the cube.
        size: (height, width).
    """

    def __init__(self, device: rift.Device, count: int, size: tuple[int, int]) -> None:
        self.device = device
        self.cameras: Sequence[Camera] = [_on_ring(number, size) for number in range(VIEWS)]
        self._behind = np.float32([0.1, 0.2, 0.3])
        self._codes = self._drawn(SplatCase(count, size[0], device).parameters)

    def begin(self, step: int) -> None:
        """Nothing: the background is always the same."""

    def target(self, number: int) -> Any:
        """Decoded and sent anew for each step, as photographs are."""
        return self.device.array(self._codes[number].astype(np.float32) / np.float32(255))

    def weights(self, number: int) -> Any:
        """None: all pixels count alike."""

    def background(self, number: int) -> Any:
        """The same for all."""
        return self.device.array(self._behind)

    def _drawn(self, scene: dict[str, Floats]) -> list[NDArray[np.uint8]]:
        splats, renderer = Splats.upload(self.device, **scene), Renderer(device=self.device)
        behind = self.device.array(self._behind)
        images = [
            self.device.get(renderer.forward(splats, camera, background=behind).image)
            for camera in self.cameras
        ]
        return [np.rint(np.clip(image, 0, 1) * 255).astype(np.uint8) for image in images]


def _on_ring(number: int, size: tuple[int, int]) -> Camera:
    """Observations at the cube from four half-edges away, a part of the way around it."""
    turn = 2 * math.pi * number / VIEWS
    view = np.eye(4)
    view[0, 0] = view[2, 2] = math.cos(turn)
    view[0, 2], view[2, 0], view[2, 3] = math.sin(turn), -math.sin(turn), 4
    focal = 1.2 * min(size)
    return Camera(size, [[focal, 0, size[1] / 2], [0, focal, size[0] / 2], [0, 0, 1]], view)


def _moved(count: int, device: rift.Device) -> Arrays:
    """The cube's splats as raw values: moved a little, grey, and all equally faint."""
    scene = SplatCase(count, 0, device).parameters
    random = np.random.default_rng(3)
    sh = np.zeros((count, _COEFFICIENTS, 3))
    sh[:, 0] = random.uniform(-0.1, 0.1, (count, 3)) / _Y0
    values = {
        "means": scene["means"] + _MOVED * random.normal(size=(count, 3)),
        "quats": scene["quats"],
        "log_scales": np.log(scene["scales"]),
        "logits": np.full(count, _LOGIT),
        "sh": sh,
    }
    return {name: np.ascontiguousarray(array, np.float32) for name, array in values.items()}
