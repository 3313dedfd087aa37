"""Places without cameras as a person writes them on the command line."""

from __future__ import annotations

import math

from rift_cl.errors import InputError
from rift_cl.sampling.planning.keep_out import Box, Cone, KeepOut, Sphere

_BODY = "body-"
_FORMS = {
    "sphere": "sphere:X,Y,Z,RADIUS",
    "box": "box:X,Y,Z,X,Y,Z",
    "cone": "cone:X,Y,Z,DX,DY,DZ,DEGREES",
}


def keep_out_of(text: str) -> KeepOut:
    """The place that a text such as ``sphere:0,0,-50,40`` names.

    ``body-`` before it says that the target is not seen through it.

    Raises:
        InputError: it is no such text, or names an impossible shape.
    """
    hides = text.startswith(_BODY)
    kind, _, rest = text.removeprefix(_BODY).partition(":")
    try:
        numbers = [float(part) for part in rest.split(",")]
    except ValueError:
        numbers = []
    if kind not in _FORMS or len(numbers) != _FORMS[kind].count(",") + 1:
        wanted = " or ".join(_FORMS.values())
        raise InputError(f"--keep-out is {text!r}, wanted {wanted}, with 'body-' before it or not")
    try:
        return KeepOut(_shape(kind, numbers), hides)
    except InputError as error:
        raise InputError(f"--keep-out {text}: {error}") from error


def _shape(kind: str, numbers: list[float]) -> Sphere | Box | Cone:
    first, second = (numbers[0], numbers[1], numbers[2]), tuple(numbers[3:6])
    if kind == "sphere":
        return Sphere(first, numbers[3])
    x, y, z = second
    if kind == "box":
        return Box(first, (x, y, z))
    return Cone(first, (x, y, z), math.radians(numbers[6]))
