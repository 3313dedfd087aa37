"""Mitsuba draws a shot: which of its variants, with which random numbers, over which background.

Its llvm variants take half the time of the scalar one and need a libLLVM, which they load at run
time; an unfit one (15 on a processor with AVX-512) ends the whole process. So a trial picture is
drawn in a process of its own first.
"""

from __future__ import annotations

import math
import subprocess
import sys
import tempfile
from collections.abc import Callable
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ornament.cameras import Shot
from ornament.scene import scenes as ornament
from rift_cl.errors import InputError
from rift_cl.io import to_display, to_linear

FAST, SLOW = "llvm_ad_rgb", "scalar_rgb"
BACKGROUND = 0.5
# Paths that are traced at a time; each takes some hundred bytes.
_PATHS = 1 << 21
_TRIAL = """
import mitsuba as mi
mi.set_variant({variant!r})
box = mi.cornell_box()
box["sensor"]["film"].update(width=8, height=8)
print(float(sum(mi.render(mi.load_dict(box), spp=1).numpy().ravel())))
"""
_LLVM = (
    "it needs a working libLLVM: Debian's libllvm19 is one (15 fails where there is AVX-512); "
    "name it in DRJIT_LIBLLVM_PATH"
)


def choose_variant(asked: str) -> tuple[str, str]:
    """The variant to render with, and a sentence on why.

    Args:
        asked: a variant's name, or ``auto``: the fast one if it works here, else the slow one.

    Raises:
        InputError: mitsuba is not installed, or the variant that was asked for does not work.
    """
    if find_spec("mitsuba") is None:
        raise InputError("mitsuba is not installed: pip install mitsuba")
    if asked == SLOW:
        return SLOW, "as asked"
    wanted = FAST if asked == "auto" else asked
    trouble = _trial(wanted)
    if trouble is None:
        return wanted, "it works here"
    advice = _LLVM if wanted.startswith("llvm") else "see what 'mitsuba' says of its variants"
    if asked != "auto":
        raise InputError(f"--variant {wanted} does not work here ({trouble}); {advice}")
    return SLOW, f"{wanted} does not work here ({trouble}) and takes half the time; {advice}"


def _trial(variant: str) -> str | None:
    """Why a variant does not work; None if it does."""
    code = [sys.executable, "-c", _TRIAL.format(variant=variant)]
    try:
        done = subprocess.run(code, capture_output=True, text=True, timeout=300, check=False)
    except subprocess.TimeoutExpired:
        return "no trial picture within 300 s"
    if done.returncode == 0:
        return None
    said = [line for line in done.stderr.splitlines() if line.strip()]
    told = next((line for line in said if "ERROR" in line or "Error" in line), "")
    return told.strip()[:160] or f"the trial picture ended with status {done.returncode}"


class Tracer:
    """A scene, ready to be looked at.

    Args:
        variant: of Mitsuba.
        seed: of the scene and of the noise.
        samples: least number of samples per pixel, shared out among the lights.
        scenes: makes the scene under each of its lights, from the module mitsuba, the seed and a
            folder for files that are wanted for a moment.
    """

    def __init__(
        self,
        variant: str,
        *,
        seed: int,
        samples: int,
        scenes: Callable[[Any, int, Path], list[Any]] = ornament,
    ) -> None:
        import mitsuba as mi

        mi.set_variant(variant)
        self._mi, self._seed, self._samples = mi, seed, samples
        with tempfile.TemporaryDirectory(prefix="tracer-") as folder:
            self._scenes = scenes(mi, seed, Path(folder))
        self.name = f"Mitsuba {mi.__version__}, {variant}"

    def picture(self, shot: Shot, number: int) -> NDArray[np.float32]:
        """(height, width, 3) in display light; what is empty is exactly the background."""
        drawn = self.light(shot, number)
        behind = np.full(3, BACKGROUND, np.float32)
        to_linear(behind)
        image = np.ascontiguousarray(drawn[..., :3] + (1 - drawn[..., 3:]) * behind, np.float32)
        to_display(image)
        return image

    def light(self, shot: Shot, number: int) -> NDArray[np.float64]:
        """(height, width, 4) linear light, multiplied by alpha, and alpha."""
        sensor = self._mi.load_dict(self._sensor(shot))
        height, width = shot.size
        most = max(1, _PATHS // (height * width))
        each = -(-self._samples // len(self._scenes))
        # The sampler lays its samples out in a square of cells.
        side = min(math.ceil(math.sqrt(each)), math.isqrt(most))
        passes = -(-each // side**2)
        # Other numbers of samples are other draws, lest good pictures share the noise of poor ones.
        entropy = np.random.SeedSequence((self._seed, number, self._samples))
        seeds = iter(entropy.generate_state(passes * len(self._scenes)).tolist())
        total = np.zeros((height, width, 4))
        for scene in self._scenes:
            for _ in range(passes):
                drawn = self._mi.render(scene, sensor=sensor, spp=side**2, seed=next(seeds))
                total += np.asarray(drawn, np.float64)
        total[..., :3] /= passes
        total[..., 3] = np.clip(total[..., 3] / (passes * len(self._scenes)), 0, 1)
        return total

    def places(self, shot: Shot, number: int) -> NDArray[np.float32]:
        """(height, width, 3) the point of the scene that somewhere in each pixel is seen."""
        positions = self._mi.load_dict({"type": "aov", "aovs": "place:position"})
        sensor = self._mi.load_dict(self._sensor(shot))
        drawn = self._mi.render(
            self._scenes[0], sensor=sensor, integrator=positions, spp=1, seed=number
        )
        return np.asarray(drawn, np.float32)[..., -3:]

    def _sensor(self, shot: Shot) -> dict[str, Any]:
        height, width = shot.size
        # Mitsuba's cameras look along +z with x to the left, those of the file along -z.
        pose = shot.pose @ np.diag([-1.0, 1.0, -1.0, 1.0])
        found: dict[str, Any] = {
            "type": "perspective",
            "to_world": self._mi.ScalarTransform4f(pose),
            "fov": float(np.degrees(2 * np.arctan(width / 2 / shot.focal))),
            "fov_axis": "x",
            "film": {
                "type": "hdrfilm",
                "width": width,
                "height": height,
                "pixel_format": "rgba",
                "component_format": "float32",
                "rfilter": {"type": "box"},
            },
            "sampler": {"type": "multijitter"},
        }
        if shot.aperture_radius:
            lens = {"aperture_radius": shot.aperture_radius, "focus_distance": shot.focus_distance}
            return {**found, "type": "thinlens", **lens}
        cx, cy = shot.center
        # Mitsuba says where the picture's middle is from there, not where the point is.
        shift = {"x": 0.5 - cx / width, "y": 0.5 - cy / height}
        return found | {f"principal_point_offset_{axis}": value for axis, value in shift.items()}
