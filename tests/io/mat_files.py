"""MAT files that the tests write: version 5 by SciPy, version 7.3 by HDF5 as MATLAB lays it out."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import h5py
import numpy as np
import scipy.io
from scan_files import BINS, DEGREES, FRAMES, counts

USER_BLOCK = 512
VERSIONS = ["5", "5 packed", "7.3"]


def write_mat(path: Path, values: dict[str, Any], version: str) -> Path:
    """Arrays, texts and (nested) structures, in the shapes that MATLAB gives them."""
    if version == "7.3":
        with h5py.File(path, "w", userblock_size=USER_BLOCK) as file:
            _fill(file, values)
        with path.open("r+b") as raw:
            raw.write(b"MATLAB 7.3 MAT-file, Platform: GLNXA64".ljust(124) + b"\x00\x02IM")
    else:
        scipy.io.savemat(path, values, do_compression=version == "5 packed", oned_as="row")
    return path


def challenge(**changes: Any) -> dict[str, Any]:
    """A scan as the Helsinki Tomography Challenge keeps it."""
    parameters = {
        "scanner": "a scanner",
        "distanceSourceOrigin": 400.0,
        "distanceSourceDetector": 500.0,
        "distanceUnit": "mm",
        "angles": DEGREES,
        "pixelSize": 0.05,
        "pixelSizePost": 0.2,
    }
    return {
        "type": "2d",
        "sinogram": counts(FRAMES, BINS, dtype="f8"),
        "parameters": {**parameters, **changes},
    }


def _fill(group: Any, values: dict[str, Any]) -> None:
    for name, value in values.items():
        if isinstance(value, dict):
            _fill(group.create_group(name), value)
            group[name].attrs["MATLAB_class"] = np.bytes_("struct")
            continue
        text = isinstance(value, str)
        array = np.array([ord(c) for c in value], np.uint16) if text else np.asarray(value)
        logical = array.dtype == bool
        array = array.astype(np.uint8) if logical else array
        group[name] = np.atleast_2d(array).T
        kind = "char" if text else "logical" if logical else "double"
        group[name].attrs["MATLAB_class"] = np.bytes_(kind)
