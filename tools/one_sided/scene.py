"""Two subjects that are seen from the front alone: x to the right, z up, the cameras at -y.

The wall has a mask on a picture, a painted ball that hangs before it, a vase and a box on a plank.
The shelf is a box that is open to the front, with books, a ball, jars and a box in it. Behind both
is a wall that fills every picture; nothing is known of what lies behind that.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from one_sided import paint
from ornament import paint as ornament_paint
from ornament.scene import color, lit, picture, sky, soft_box
from ornament.strands import write_strands

Shapes = dict[str, dict[str, Any]]
Triple = Sequence[float]

# Azimuth (the cameras' middle is at -90), elevation, half of the side, radiance, tint.
_BOXES = (
    (-135, 48, 2.6, 17.0, (1, 0.96, 0.90)),
    (-50, 30, 2.0, 13.0, (0.92, 0.96, 1)),
)
# Half of the subject's width, depth and height, whose middle is the origin.
SUBJECT = {"wall": (0.95, 0.5, 0.92), "shelf": (1.2, 0.45, 0.85)}
# How far behind that middle the wall is.
BEHIND = {"wall": 0.301, "shelf": 0.481}


def wall(mi: Any, seed: int, folder: Path) -> list[Any]:
    """The wall under each of its lights; see ``ornament.scene.lit``."""
    hills = _painted(mi, paint.canvas(seed, (384, 512)))
    wood = _plain(0.28, 0.15, 0.07)
    head = _plain(0.72, 0.33, 0.10)
    ball, _ = ornament_paint.ball()
    wire = np.array(
        [[-0.66, 0.25, 1.2, 0.012], [-0.66, -0.3, 0.9, 0.012], [-0.66, -0.32, 0, 0.012]]
    )
    write_strands(folder / "wire.txt", [wire])
    shapes = {
        "frame": _box(mi, (0, 0.24, 0.1), (0.86, 0.06, 0.68), wood),
        "canvas": _panel(mi, (0, 0.17, 0.1), (0.76, 0.58), hills),
        "head": _ball(mi, (0.1, 0.05, 0.1), 0.3, head),
        "snout": _ball(mi, (0.1, -0.22, 0), 0.13, _plain(0.8, 0.76, 0.7)),
        "nose": _ball(mi, (0.1, -0.38, 0.03), 0.05, _plain(0.02, 0.02, 0.02)),
        "left_eye": _ball(mi, (0.0, -0.2, 0.22), 0.05, _plain(0.9, 0.9, 0.1)),
        "right_eye": _ball(mi, (0.2, -0.2, 0.22), 0.05, _plain(0.9, 0.9, 0.1)),
        **_ear(mi, "left_ear", (-0.12, 0.05, 0.36), head),
        **_ear(mi, "right_ear", (0.32, 0.05, 0.36), head),
        "ball": _ball(mi, (-0.66, -0.32, -0.2), 0.22, _painted(mi, ball)),
        "wire": {"type": "linearcurve", "filename": str(folder / "wire.txt"), "bsdf": wood},
        "plank": _box(mi, (0, 0.05, -0.88), (0.95, 0.25, 0.04), wood),
        "vase": _upright(mi, (0.5, -0.02, -0.84), 0.13, 0.3, _plain(0.1, 0.3, 0.42)),
        "bud": _ball(mi, (0.5, -0.02, -0.46), 0.1, _plain(0.6, 0.06, 0.1)),
        "box": _box(mi, (-0.2, -0.02, -0.7), (0.17, 0.14, 0.14), hills, turned=25),
    }
    return _before_wall(mi, seed, "wall", shapes)


def shelf(mi: Any, seed: int, folder: Path) -> list[Any]:
    """The shelf under each of its lights; see ``ornament.scene.lit``."""
    grain = paint.wallpaper(seed + 1, (256, 512), 90) // 4 * 3
    board, ball = _painted(mi, grain), _painted(mi, ornament_paint.ball()[0])
    shapes = {
        "back": _box(mi, (0, 0.42, 0), (1.2, 0.03, 0.85), board),
        "left": _box(mi, (-1.17, 0, 0), (0.03, 0.4, 0.85), board),
        "right": _box(mi, (1.17, 0, 0), (0.03, 0.4, 0.85), board),
        "bottom": _box(mi, (0, 0, -0.82), (1.2, 0.4, 0.03), board),
        "middle": _box(mi, (0, 0, 0.02), (1.15, 0.4, 0.03), board),
        "top": _box(mi, (0, 0, 0.82), (1.2, 0.4, 0.03), board),
        "ball": _ball(mi, (0.2, -0.05, 0.31), 0.26, ball),
        "jar": _upright(mi, (0.75, 0.05, 0.05), 0.18, 0.4, _plain(0.12, 0.34, 0.2)),
        "lid": _ball(mi, (0.75, 0.05, 0.47), 0.17, _plain(0.7, 0.5, 0.1)),
        "egg": _ball(mi, (-0.35, -0.2, -0.6), 0.15, _plain(0.75, 0.7, 0.62)),
        "cup": _upright(mi, (-0.8, 0, -0.79), 0.2, 0.34, _plain(0.5, 0.1, 0.08)),
        "box": _box(
            mi,
            (0.55, 0.05, -0.53),
            (0.32, 0.2, 0.25),
            _painted(mi, paint.canvas(seed + 1, (256, 256))),
            turned=-20,
        ),
        **_books(mi, seed),
    }
    return _before_wall(mi, seed, "shelf", shapes)


def _ear(mi: Any, name: str, foot: Triple, bsdf: Any) -> Shapes:
    """Three balls above one another, each smaller than the one below."""
    steps = ((0.0, 0.1), (0.1, 0.075), (0.18, 0.05))
    return {
        f"{name}_{k}": _ball(mi, (foot[0], foot[1], foot[2] + up), radius, bsdf)
        for k, (up, radius) in enumerate(steps)
    }


SCENES = {"wall": wall, "shelf": shelf}


def _books(mi: Any, seed: int) -> Shapes:
    """Nine books in the upper left, of several heights."""
    random = np.random.default_rng((seed, 0xB00C))
    left, found = -1.1, {}
    for k in range(9):
        half, high, deep = random.uniform((0.035, 0.24, 0.2), (0.06, 0.37, 0.3))
        place = (left + half, 0.1 - 0.3 * (0.3 - deep), 0.05 + high)
        found[f"book_{k}"] = _box(mi, place, (half, deep, high), _painted(mi, paint.spine(seed, k)))
        left += 2 * half + 0.004
    return found


def _before_wall(mi: Any, seed: int, name: str, shapes: Shapes) -> list[Any]:
    """Shapes before a wall that fills every picture, under each light."""
    paper = _painted(mi, paint.wallpaper(seed, (1024, 1536), 4000))
    shapes = {**shapes, "behind": _panel(mi, (0, BEHIND[name], 0), (12, 8), paper)}
    loaded = {key: mi.load_dict(shape) for key, shape in shapes.items()}
    return lit(mi, loaded, [sky(0.5, 0.52, 0.56), *(soft_box(mi, *box) for box in _BOXES)])


def _plain(red: float, green: float, blue: float) -> dict[str, Any]:
    return {"type": "roughplastic", "alpha": 0.3, "diffuse_reflectance": color(red, green, blue)}


def _painted(mi: Any, codes: paint.Codes) -> dict[str, Any]:
    return {"type": "roughplastic", "alpha": 0.3, "diffuse_reflectance": picture(mi, codes)}


def _box(mi: Any, middle: Triple, half: Triple, bsdf: Any, turned: float = 0.0) -> dict[str, Any]:
    """A box, turned about the upright by some degrees."""
    pose = mi.ScalarTransform4f().translate(list(middle)).rotate([0, 0, 1], turned)
    return {"type": "cube", "to_world": pose.scale(list(half)), "bsdf": bsdf}


def _ball(mi: Any, middle: Triple, radius: float, bsdf: Any) -> dict[str, Any]:
    # The tracer's spheres must not be stretched.
    pose = mi.ScalarTransform4f().translate(list(middle)).scale(radius)
    return {"type": "sphere", "to_world": pose, "bsdf": bsdf}


def _upright(mi: Any, foot: Triple, radius: float, high: float, bsdf: Any) -> dict[str, Any]:
    """A cylinder without a lid."""
    top = [foot[0], foot[1], foot[2] + high]
    both = {"type": "twosided", "side": bsdf}
    return {"type": "cylinder", "p0": list(foot), "p1": top, "radius": radius, "bsdf": both}


def _panel(mi: Any, middle: Triple, half: Sequence[float], bsdf: Any) -> dict[str, Any]:
    """A rectangle that faces the cameras."""
    pose = mi.ScalarTransform4f().translate(list(middle)).rotate([1, 0, 0], 90)
    return {"type": "rectangle", "to_world": pose.scale([*half, 1]), "bsdf": bsdf}
