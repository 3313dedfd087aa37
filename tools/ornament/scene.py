"""The ornament as Mitsuba is told about it: shapes, materials, soft boxes.

What any scene is told with, pictures as textures, colours, and a scene for each light, is here too.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from ornament import paint
from ornament.strands import BASE_RADIUS, BASE_TOP, strands, write_strands

_BASE_BOTTOM = BASE_TOP - 0.16
_CAP_LOW, _CAP_HIGH, _CAP_RADIUS = 0.96, 1.13, 0.16
# Azimuth, elevation (degrees), half of the side, radiance of each soft box.
_BOXES = (
    (35, 42, 2.6, 8.0),
    (150, 30, 2.2, 6.0),
    (265, 36, 2.4, 6.8),
    (90, 78, 3.4, 4.4),
    (330, 8, 1.2, 5.5),
)
# Beyond every camera.
_BOX_DISTANCE = 11.0
BOX_COLORS = ((1, 0.97, 0.92), (0.92, 0.96, 1), (1, 0.94, 0.96), (1, 1, 1), (1, 0.95, 0.85))

PARTS = ("ball", "cap", "base", "strands")


def scenes(mi: Any, seed: int, folder: Path, parts: tuple[str, ...] = PARTS) -> list[Any]:
    """The ornament under each of its lights; see ``lit``.

    Args:
        mi: the module mitsuba, its variant set.
        seed: of all that is random.
        folder: for the files in which the tracer wants its strands.
        parts: what of ``PARTS`` is there.
    """
    makers = {
        "ball": lambda: _ball(mi),
        "cap": lambda: _cap(mi),
        "base": lambda: _base(mi, seed),
        "strands": lambda: _strands(seed, folder),
    }
    shapes = {}
    for part in parts:
        shapes |= {name: mi.load_dict(shape) for name, shape in makers[part]().items()}
    boxes = [soft_box(mi, *box, BOX_COLORS[k]) for k, box in enumerate(_BOXES)]
    return lit(mi, shapes, [sky(0.13, 0.14, 0.16), *boxes])


def lit(mi: Any, shapes: dict[str, Any], lights: Sequence[dict[str, Any]]) -> list[Any]:
    """Shapes under each of some lights; the sum of the pictures is the picture under all.

    A path that has to choose among lights is noisy: with a scene for each, none has to.
    """
    integrator = {"type": "path", "max_depth": 5, "hide_emitters": True}
    common = {"type": "scene", "integrator": integrator, **shapes}
    return [mi.load_dict({**common, "light": light}) for light in lights]


def sky(red: float, green: float, blue: float) -> dict[str, Any]:
    """Light from everywhere."""
    return {"type": "constant", "radiance": color(red, green, blue)}


def soft_box(
    mi: Any,
    azimuth: float,
    elevation: float,
    half: float,
    radiance: float,
    tint: tuple[float, float, float],
) -> dict[str, Any]:
    """A square light beyond every camera that faces the middle.

    Args:
        mi: the module mitsuba, its variant set.
        azimuth: where it stands, in degrees.
        elevation: in degrees.
        half: of its side.
        radiance: of its brightest colour.
        tint: red, green and blue, 0 to 1.
    """
    a, e = math.radians(azimuth), math.radians(elevation)
    way = (math.cos(a) * math.cos(e), math.sin(a) * math.cos(e), math.sin(e))
    place = [_BOX_DISTANCE * w for w in way]
    pose = mi.ScalarTransform4f().look_at(origin=place, target=[0, 0, 0], up=[0, 1, 0])
    light = {"type": "area", "radiance": color(*(radiance * c for c in tint))}
    return {"type": "rectangle", "to_world": pose.scale(half), "emitter": light}


def picture(mi: Any, codes: Any, *, raw: bool = False) -> dict[str, Any]:
    """A texture of (height, width, channels) codes; ``raw`` ones are numbers, not colours."""
    return {"type": "bitmap", "bitmap": mi.Bitmap(codes), "raw": raw, "wrap_mode": "repeat"}


def color(red: float, green: float, blue: float) -> dict[str, Any]:
    """One colour in linear light."""
    return {"type": "rgb", "value": [red, green, blue]}


def _ball(mi: Any) -> dict[str, Any]:
    colors, painted = paint.ball()
    metal = {
        "type": "roughconductor",
        "material": "Ag",
        "alpha": 0.17,
        "specular_reflectance": picture(mi, colors),
    }
    plastic = {
        "type": "roughplastic",
        "alpha": 0.12,
        "diffuse_reflectance": picture(mi, colors),
    }
    mask = picture(mi, painted, raw=True)
    bands = {"type": "blendbsdf", "weight": mask, "metal": metal, "plastic": plastic}
    return {"ball": {"type": "sphere", "radius": 1.0, "bsdf": bands}}


def _gold(alpha: float) -> dict[str, Any]:
    return {
        "type": "twosided",
        "metal": {"type": "roughconductor", "material": "Au", "alpha": alpha},
    }


def _cap(mi: Any) -> dict[str, Any]:
    T = mi.ScalarTransform4f
    lid = T().translate([0, 0, _CAP_HIGH]).scale(_CAP_RADIUS)
    wall = {"p0": [0, 0, _CAP_LOW], "p1": [0, 0, _CAP_HIGH], "radius": _CAP_RADIUS}
    return {
        "cap_wall": {"type": "cylinder", **wall, "bsdf": _gold(0.35)},
        "cap_lid": {"type": "disk", "to_world": lid, "bsdf": _gold(0.35)},
    }


def _base(mi: Any, seed: int) -> dict[str, Any]:
    T = mi.ScalarTransform4f
    wood = {
        "type": "roughplastic",
        "alpha": 0.25,
        "diffuse_reflectance": picture(mi, paint.base(seed)),
    }
    side = {"type": "roughplastic", "alpha": 0.3, "diffuse_reflectance": color(0.30, 0.16, 0.075)}
    wall = {"p0": [0, 0, _BASE_BOTTOM], "p1": [0, 0, BASE_TOP], "radius": BASE_RADIUS}
    bottom = T().translate([0, 0, _BASE_BOTTOM]).rotate([1, 0, 0], 180).scale(BASE_RADIUS)
    top = T().translate([0, 0, BASE_TOP]).scale(BASE_RADIUS)
    return {
        "base_top": {"type": "disk", "to_world": top, "bsdf": wood},
        "base_wall": {"type": "cylinder", **wall, "bsdf": side},
        "base_bottom": {"type": "disk", "to_world": bottom, "bsdf": side},
    }


def _strands(seed: int, folder: Path) -> dict[str, Any]:
    materials = {
        "pale": {
            "type": "roughplastic",
            "alpha": 0.3,
            "diffuse_reflectance": color(0.62, 0.6, 0.55),
        },
        "green": {
            "type": "roughplastic",
            "alpha": 0.3,
            "diffuse_reflectance": color(0.22, 0.5, 0.05),
        },
        "grass": {
            "type": "roughplastic",
            "alpha": 0.3,
            "diffuse_reflectance": color(0.05, 0.26, 0.04),
        },
        "gold": {"type": "roughconductor", "material": "Au", "alpha": 0.4},
        "ring": {"type": "roughconductor", "material": "Ag", "alpha": 0.3},
    }
    found = {}
    for kind, lines in strands(seed).items():
        path = folder / f"{kind}.txt"
        write_strands(path, lines)
        found[kind] = {"type": "linearcurve", "filename": str(path), "bsdf": materials[kind]}
    return found
