"""What the arrays of a trainer's state look like, checked before a device sees any of them.

A checkpoint is a file, and a file may be anybody's: kernels go by the number of splats and read
every array that far, so that one moment of Adam with a row too few would be read and written
beyond its end. Strategies, which users may add, check their own arrays.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rift_cl.basis.angular.environment import REFLECTANCE
from rift_cl.errors import CheckpointError
from rift_cl.train.parameters import GROUPS, MORE

Arrays = Mapping[str, NDArray[Any]]


@dataclass(frozen=True)
class Field:
    """What an array has to be.

    Args:
        shape: numbers, or names of sizes that are the same wherever they are named.
        dtype: NumPy's code of the type.
        least: smallest value.
        finite: whether infinity is refused.
        numbers: whether what is not a number is refused.
    """

    shape: tuple[int | str, ...]
    dtype: str = "f4"
    least: float = -np.inf
    finite: bool = True
    numbers: bool = True


# (splats, ...); what modes, coefficients and lobes count is the same in values and moments.
_GROUPS = {
    "means": ("splats", 3),
    "quats": ("splats", 4),
    "log_scales": ("splats", 3),
    "logits": ("splats",),
    "sh": ("splats", "coefficients", 3),
    "shape_modes": ("splats", "shape modes"),
    "color_modes": ("splats", "color modes", 3),
    "lobes": ("splats", "numbers of lobes"),
    "normals": ("splats", 3),
    "reflectance": ("splats", REFLECTANCE),
}
# What there is where splats share a light, beside that.
_LIT = ("normals", "reflectance")
_PER_VIEW: Mapping[str, Mapping[str, tuple[int, ...]]] = {
    "poses": {"counts": (), "views": (4, 4), "first": (6,), "second": (6,)},
    "exposures": {"values": (2, 3)},
}
# Infinity until the first square of a residual is known.
_LOSS = Field((), "f8", 0, finite=False)
_OCTAVES = {
    "octaves.level": Field((), "i8", 0),
    "octaves.ended": Field(("octaves",), "i8", -1),
    "octaves.mean_square": _LOSS,
    "octaves.looks": Field((), "i8", 0),
}


def check_state(state: Arrays, *, views: int) -> None:
    """Check all arrays of ``Trainer.state`` but the strategy's.

    Args:
        state: by name.
        views: of the training.

    Raises:
        CheckpointError: an array is missing, unknown, or not what it has to be; names it.
    """
    schema = _schema(state, views)
    names = {name for name in state if not name.startswith("strategy.")}
    for name in sorted(names ^ schema.keys()):
        found = "an unknown" if name in names else "no"
        raise CheckpointError(f"the checkpoint is of another run: it has {found} {name}")
    sizes: dict[str, int] = {}
    for name, field in schema.items():
        _check(name, np.asarray(state[name]), field, sizes)


def _schema(state: Arrays, views: int) -> dict[str, Field]:
    """The fields by name; the values say which of the groups are there that not all splats have."""
    fields = {"step": Field((), "i8", 0)}
    lit = any(name in state for name in ("environment.raw", *(f"raw.{name}" for name in _LIT)))
    there = [name for name in MORE if f"raw.{name}" in state or (lit and name in _LIT)]
    parts = ("raw", -np.inf), ("first", -np.inf), ("second", 0.0)
    for name in (*GROUPS, *there):
        for part, least in parts:
            fields[f"{part}.{name}"] = _trained(_GROUPS[name], least)
    for part, least in parts if lit else ():
        fields[f"environment.{part}"] = _trained(("lobes of light", 3), least)
    if "band.lengths" in state:
        fields["band.lengths"] = _trained(("splats",), 0)
    if "sheet.normals" in state:
        fields["sheet.normals"] = _trained(("splats", 3), -np.inf)
    for name, shapes in _PER_VIEW.items():
        if any(key.startswith(f"{name}.") for key in state):
            for key, shape in shapes.items():
                least = 0 if key in ("second", "counts") else -np.inf
                fields[f"{name}.{key}"] = Field((views, *shape), "f8", least)
    if any(key.startswith("octaves.") for key in state):
        fields |= _OCTAVES
    return {**fields, "loss.mean_square": _LOSS, "loss.noise": _LOSS}


def _trained(shape: tuple[int | str, ...], least: float) -> Field:
    """What is known of splats, which may be no numbers until a strategy removes them."""
    return Field(shape, least=least, finite=False, numbers=False)


def _check(name: str, array: NDArray[Any], field: Field, sizes: dict[str, int]) -> None:
    """Check one array; sizes are those that were met before, and take those that are new."""
    shape, dtype = array.shape, np.dtype(field.dtype)
    wanted = tuple(sizes.get(size, size) if isinstance(size, str) else size for size in field.shape)
    fits = array.ndim == len(wanted) and all(
        isinstance(size, str) or size == found for size, found in zip(wanted, shape, strict=True)
    )
    if not fits or array.dtype != dtype:
        raise CheckpointError(
            f"the checkpoint is of another run: {name} is {array.dtype} {shape}, wanted {dtype} "
            f"({', '.join(map(str, wanted))})"
        )
    refused = array < field.least
    if field.finite:
        refused |= np.isinf(array)
    if field.numbers:
        refused |= np.isnan(array)
    if refused.any():
        raise CheckpointError(f"the checkpoint is damaged: values of {name} cannot be right")
    named = zip(field.shape, shape, strict=True)
    sizes.update((size, found) for size, found in named if isinstance(size, str))
