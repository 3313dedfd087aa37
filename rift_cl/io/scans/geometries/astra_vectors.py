"""ASTRA's vectors in a file: twelve numbers a view, as ``cone_vec`` takes them.

Source, middle of the detector, the step from bin to bin and that from row to row, (x, y, z) each.
Files are arrays (.npy) or text with a view to a line (.txt, .csv, .geom).
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

from rift_cl.errors import FileFormatError, NonFiniteError, ShapeError
from rift_cl.io.boundary import check_claim, reading
from rift_cl.io.npy_file import SUFFIX, load_npy
from rift_cl.io.scans.beam import Floats, ViewVectors

# A million views.
_LARGEST = 96 << 20
_WIDE = 12


def read_vectors(path: Path) -> ViewVectors:
    """Source and detector of every view.

    Raises:
        ShapeError: there are not twelve numbers to a view.
        FileFormatError: the file holds no numbers.
        NonFiniteError: a number is NaN or infinite.
        ResourceLimitError: it is far longer than any scan.
    """
    with reading(path, "the list of vectors"):
        check_claim(path, "the list of vectors", path.stat().st_size, 4 * _LARGEST)
        is_npy = path.suffix.lower() == SUFFIX
        values = load_npy(path, "the list of vectors", _LARGEST) if is_npy else _text(path)
    return view_vectors(path, values)


def view_vectors(path: Path, values: Floats) -> ViewVectors:
    """Vectors of an array (view, 12); errors as ``read_vectors``."""
    if values.ndim != 2 or values.shape[1] != _WIDE or not len(values):
        raise ShapeError(
            f"{path}: has shape {values.shape}, wanted {_WIDE} numbers for each view: source, "
            "middle of the detector, step from bin to bin, step from row to row"
        )
    bad = np.flatnonzero(~np.isfinite(values).all(axis=1))
    if bad.size:
        raise NonFiniteError(f"{path}: the vectors of view {bad[0]} are not finite")
    parts = (values[:, k : k + 3] for k in (0, 3, 6, 9))
    source, middle, across, down = parts
    return ViewVectors(source=source, middle=middle, across=across, down=down)


def _text(path: Path) -> Floats:
    rows = []
    for number, line in enumerate(path.read_text(encoding="utf-8-sig").splitlines(), 1):
        words = line.split("#")[0].replace(",", " ").replace(";", " ").split()
        if not words:
            continue
        try:
            rows.append([float(word) for word in words])
        except ValueError:
            raise FileFormatError(
                f"{path}: line {number} holds something else than numbers"
            ) from None
        if len(rows[-1]) != len(rows[0]):
            raise FileFormatError(f"{path}: line {number} holds {len(rows[-1])} numbers, not 12")
    return np.array(rows, np.float64).reshape(len(rows), -1)
