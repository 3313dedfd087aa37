"""A volume as NumPy's NPY file, which other programs write; it is read alone."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np

from rift_cl.errors import ShapeError
from rift_cl.io.boundary import check_claim
from rift_cl.io.npy_file import map_npy, npy_header
from rift_cl.io.volumes.layout import Floats


def load_volume(path: Path, *, budget: int | None) -> Floats:
    """Read the array whole."""
    shape = npy_header(path).shape
    if len(shape) != 3:
        raise ShapeError(f"{path}: has shape {shape}, wanted (z, y, x)")
    check_claim(path, "the volume", 4 * math.prod(shape), budget)
    return np.array(map_npy(path), np.float32, order="C")
