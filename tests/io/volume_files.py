"""A small volume and the way the tests save it."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from rift_cl.io import open_volume

SHAPE = (5, 6, 7)
VOLUME = np.random.default_rng(5).standard_normal(SHAPE).astype(np.float32)
FORMATS = pytest.mark.parametrize("format", ["tiff", "tiff-stack", "zarr", "h5", "mrc"])


def save(path: Path, format: str, volume: np.ndarray = VOLUME) -> None:
    with open_volume(path, volume.shape, format=format, spacing=0.5, unit="mm") as writer:
        for start in range(0, len(volume), 2):
            writer.write(start, volume[start : start + 2])


def left(folder: Path) -> list[str]:
    return sorted(entry.name for entry in folder.iterdir())
