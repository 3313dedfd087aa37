"""TIFF files that the tests write, with another library than the one that reads them."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import tifffile
from scan_files import counts

VIEWS, ROWS, BINS = 6, 20, 24


def frames(count: int = VIEWS, dtype: str = "u2") -> np.ndarray:
    """Frames (n, row, bin) of numbers that differ, negative ones among them where there are any."""
    values = counts(count, ROWS, BINS, dtype="f8") % 251
    return (values - 100 if np.dtype(dtype).kind in "if" else values).astype(dtype)


def write_series(folder: Path, name: str, stack: Sequence[np.ndarray], **options: Any) -> Path:
    """A file for each frame; the name holds a format for the number, which starts at 1."""
    folder.mkdir(parents=True, exist_ok=True)
    for index, frame in enumerate(stack, 1):
        tifffile.imwrite(folder / name.format(index), frame, **options)
    return folder


def write_pages(path: Path, stack: np.ndarray, **options: Any) -> Path:
    """One file with a page for each frame."""
    path.parent.mkdir(parents=True, exist_ok=True)
    whole = {name: options.pop(name) for name in ("bigtiff", "byteorder") if name in options}
    with tifffile.TiffWriter(path, **whole) as file:
        for frame in stack:
            file.write(frame, contiguous=False, metadata=None, **options)
    return path
