"""Focal lengths of a transforms.json, which writers give in pixels, in radians or in degrees.

Along x and y there are instant-ngp's 'x_fov' (degrees), 'fl_x' (pixels) and 'camera_angle_x'
(radians), which it heeds in this order, first in the frame and then in the file. Both axes are
those of one object: a frame's own focal length and that of the file belong to two cameras. Of the
axis that this object says nothing about pixels are square.
"""

from __future__ import annotations

import math

from rift_cl.errors import FileFormatError, InputError
from rift_cl.io.json_fields import Fields

# What half a turn is in the units of angles.
_HALF_TURN = {"x_fov": 180.0, "camera_angle_x": math.pi, "y_fov": 180.0, "camera_angle_y": math.pi}
_UNITS = {180.0: "degrees between 0 and 180", math.pi: "radians between 0 and pi"}
# Shares by which focal lengths may differ that are the same one, rounded.
_ROUNDED = 0.01


def focal_lengths(own: Fields, top: Fields, size: tuple[int, int]) -> tuple[float, float]:
    """Focal lengths (fx, fy) of a photograph in pixels.

    Args:
        own: what its frame says.
        top: what the file says of all frames.
        size: height and width in pixels.

    Raises:
        FileFormatError: no field says it, or one holds no number.
        NonFiniteError: one is NaN or infinite.
        InputError: an angle makes no picture, or 'x_fov' contradicts another field.
    """
    for source in (own, Fields(own.where, top.values)):
        x, y = _focal(source, "x", size[1]), _focal(source, "y", size[0])
        if x is not None:
            return x, x if y is None else y
        if y is not None:
            return y, y
    raise FileFormatError(
        f"{own.where}: has neither 'fl_x' nor 'camera_angle_x' nor 'x_fov', the focal length is "
        "wanted"
    )


def _focal(source: Fields, axis: str, extent: int) -> float | None:
    """Focal length along an axis, by the first of the fields that is there."""
    degrees = f"{axis}_fov"
    said = [name for name in (degrees, f"fl_{axis}", f"camera_angle_{axis}") if name in source]
    if not said:
        return None
    focal = _pixels(source, said[0], extent)
    # Not every program heeds the field, so that one which is wrong would hardly be noticed.
    for name in said[1:] if said[0] == degrees else []:
        other = _pixels(source, name, extent)
        if abs(other - focal) > _ROUNDED * focal:
            raise InputError(
                f"{source.where}: {degrees!r} is a focal length of {focal:g} pixels and {name!r} "
                f"one of {other:g}, which contradict each other; leave out the wrong one"
            )
    return focal


def _pixels(source: Fields, name: str, extent: int) -> float:
    """The focal length that a field says which is there."""
    value, half = source.number(name), _HALF_TURN.get(name)
    if value is None or half is None:
        return value or 0.0
    if not 0 < value < half:
        raise InputError(f"{source.where}: {name!r} is {value:g}, wanted {_UNITS[half]}")
    return extent / 2 / math.tan(math.pi / 2 * value / half)
