"""Scenes of splats that benchmarks draw: random ones, and one that was fitted to pictures.

A cube of small Gaussians of random colours flatters a rasterizer: its splats are nearly round, and
most of its entries lie behind others. Splats that were fitted to pictures are needles, of which few
pixels of a vector see anything. So the scenes are

    cube:SPLATS:WIDTHxHEIGHT     as in the comparison of rasterizers that the design quotes
    needles:SPLATS:WIDTHxHEIGHT  the same, each splat forty times as long as it is wide
    fitted:WIDTHxHEIGHT          some 15,000 splats fitted to 64 views of the ornament, at any size
    PATH:WIDTHxHEIGHT            a scene of yours, in any format that is read, seen from outside

Harmonics have degree 3 in all of them; those of a scene that has fewer are zero.
"""

from __future__ import annotations

import math
import re
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

import numpy as np

from bench.case import Floats
from rift_cl.errors import InputError
from rift_cl.io import SplatScene

_FITTED = Path(__file__).with_name("fitted_ornament.splat")
_COEFFICIENTS = 16
# Lengths of a needle's axes over those of the cube's splats: the same volume.
_NEEDLE = np.float32([40.0 ** (2 / 3), 40.0 ** (-1 / 3), 40.0 ** (-1 / 3)])
_WANTED = "cube:SPLATS:WIDTHxHEIGHT, needles:SPLATS:WIDTHxHEIGHT, fitted:WIDTHxHEIGHT or PATH:.."


@dataclass(frozen=True)
class DrawnScene:
    """Splats and an observer, on the host, so that several versions of the package can draw them.

    Args:
        name: as ``parse`` reads it.
        kind: ``cube``, ``needles``, ``fitted`` or the path of a scene.
        count: number of splats; 0 for all that there are.
        size: (height, width) in pixels.
    """

    name: str
    kind: str
    count: int
    size: tuple[int, int]

    @classmethod
    def parse(cls, text: str) -> DrawnScene:
        """Read ``cube:100000:512x512`` or ``fitted:480x360``.

        Raises:
            InputError: the text is none of the forms above.
        """
        match = re.fullmatch(r"(?:(cube|needles):([1-9]\d*)|(.+)):(\d+)x(\d+)", text.strip())
        if match is None or min(int(match[4]), int(match[5])) < 1:
            raise InputError(f"scene is {text!r}, wanted {_WANTED}")
        kind, count = (match[1], int(match[2])) if match[1] else (match[3], 0)
        if count == 0 and kind != "fitted" and not Path(kind).is_file():
            raise InputError(f"scene is {text!r}, and {kind} is no file; wanted {_WANTED}")
        return cls(text.strip(), kind, count, (int(match[5]), int(match[4])))

    @cached_property
    def parameters(self) -> dict[str, Floats]:
        """Host arrays by the names that ``Splats.upload`` has for them."""
        if self.count:
            return random_splats(self.count, long=self.kind == "needles")
        return _read(_FITTED if self.kind == "fitted" else Path(self.kind))

    @property
    def lens(self) -> tuple[tuple[int, int], list[list[float]], Floats]:
        """(height, width), K and the view of a camera that has the scene before it."""
        height, width = self.size
        focal = 1.2 * min(self.size)
        K = [[focal, 0.0, width / 2], [0.0, focal, height / 2], [0.0, 0.0, 1.0]]
        if self.count:
            view = np.eye(4)
            view[2, 3] = 4.0
            return self.size, K, view
        return self.size, K, _before(self.parameters["means"], focal, self.size)

    @cached_property
    def grad_image(self) -> Floats:
        """A loss's gradient by the image, white noise."""
        return np.random.default_rng(1).normal(size=(*self.size, 3)).astype(np.float32)


def random_splats(count: int, *, long: bool = False) -> dict[str, Floats]:
    """A cube of Gaussians with harmonics of degree 3, of seed 0; needles if they are ``long``."""
    random = np.random.default_rng(0)
    values = {
        "means": random.uniform(-1, 1, (count, 3)),
        "quats": random.normal(size=(count, 4)),
        "scales": np.exp(random.normal(np.log(0.02), 0.4, (count, 3))),
        "opacities": random.uniform(0.1, 0.9, count),
        "sh": 0.2 * random.normal(size=(count, _COEFFICIENTS, 3)),
    }
    if long:
        values["scales"] = 0.25 * values["scales"] * _NEEDLE
    return {name: array.astype(np.float32) for name, array in values.items()}


def _read(path: Path) -> dict[str, Floats]:
    scene = SplatScene.load(path)
    sh = np.zeros((len(scene), _COEFFICIENTS, 3), np.float32)
    kept = min(scene.sh.shape[1], _COEFFICIENTS)
    sh[:, :kept] = scene.sh[:, :kept]
    return {
        "means": scene.means,
        "quats": scene.quats,
        "scales": np.exp(scene.log_scales),
        "opacities": 1 / (1 + np.exp(-scene.logit_opacities)),
        "sh": sh,
    }


def _before(means: Floats, focal: float, size: tuple[int, int]) -> Floats:
    """World to camera (4, 4), 12 degrees from above: nine tenths of the splats are seen."""
    middle = np.median(means, axis=0)
    reach = np.quantile(np.linalg.norm(means - middle, axis=1), 0.9)
    distance = 2.0 * reach * focal / min(size)
    elevation = math.radians(12.0)
    forward = -np.array([math.cos(elevation), 0.0, math.sin(elevation)])
    right = np.array([0.0, 1.0, 0.0])
    view = np.eye(4)
    view[:3, :3] = [right, np.cross(forward, right), forward]
    view[:3, 3] = -view[:3, :3] @ (middle - distance * forward)
    return view
