"""Finds the scan in an HDF5 file: Data Exchange, NXtomo, or arrays that the caller names.

Data Exchange is the layout of the synchrotron beamlines: ``/exchange/data`` with ``data_white``,
``data_dark`` and ``theta`` (De Carlo et al., J. Synchrotron Rad. 21, 1224, 2014).
"""

from __future__ import annotations

from pathlib import Path

import h5py
import numpy as np
from numpy.typing import NDArray

from rift_cl.errors import FileFormatError
from rift_cl.io.angle_list import given_angles
from rift_cl.io.hdf5_frames import FrameStack, Hdf5Rows, calibration_stack, projection_stack
from rift_cl.io.hdf5_tree import Hdf5Tree, open_tree
from rift_cl.io.hdf5_values import read_angles
from rift_cl.io.nxtomo import find_entry, read_entry
from rift_cl.io.scan_file import ArrayNames, Kind, ScanFile, check_angles

_DATA = "/exchange/data"
_WHITE = "/exchange/data_white"
_DARK = "/exchange/data_dark"
_THETA = "/exchange/theta"


def open_hdf5_scan(path: Path, names: ArrayNames, *, budget: int | None) -> ScanFile:
    """Find the scan in an HDF5 file; see ``open_scan``."""
    with open_tree(path) as tree:
        named = tree.find(names.dataset) if names.dataset else tree.root
        if not isinstance(named, h5py.Group):
            return _named(tree, names, budget=budget)
        if not names.dataset and tree.find(_DATA) is not None:
            return _data_exchange(tree, names, budget=budget)
        entry = find_entry(tree, names.dataset or "/")
        if entry is None:
            raise FileFormatError(
                f"{path}: holds neither a Data Exchange scan ({_DATA}) nor an NXtomo scan; "
                f"{tree.contents()}"
            )
        return _nxtomo(tree, entry, names, budget=budget)


def _named(tree: Hdf5Tree, names: ArrayNames, *, budget: int | None) -> ScanFile:
    projections = projection_stack(tree, str(names.dataset))
    if names.theta is None:
        raise FileFormatError(
            f"{tree.path}: the angles of {names.dataset!r} are not known; name them with theta= "
            f"(--theta); {tree.contents()}"
        )
    flats = calibration_stack(tree, names.flats, projections) if names.flats else None
    darks = calibration_stack(tree, names.darks, projections) if names.darks else None
    kind: Kind = "attenuation" if flats is None else "transmission"
    rows = Hdf5Rows(tree.path, projections, flats, darks, budget)
    return _scan(rows, _angles(tree, names.theta, projections), kind, f"array {names.dataset}")


def _data_exchange(tree: Hdf5Tree, names: ArrayNames, *, budget: int | None) -> ScanFile:
    projections = projection_stack(tree, _DATA)
    theta = names.theta or _THETA
    if names.theta is None and tree.find(theta) is None:
        raise FileFormatError(
            f"{tree.path}: a Data Exchange scan without its angles {theta!r}; name them with "
            f"theta= (--theta); {tree.contents()}"
        )
    rows = Hdf5Rows(
        tree.path,
        projections,
        _present(tree, names.flats, _WHITE, projections),
        _present(tree, names.darks, _DARK, projections),
        budget,
    )
    return _scan(rows, _angles(tree, theta, projections), "transmission", "Data Exchange")


def _nxtomo(tree: Hdf5Tree, group: str, names: ArrayNames, *, budget: int | None) -> ScanFile:
    entry = read_entry(tree, group, names)
    rows = Hdf5Rows(tree.path, entry.projections, entry.flats, entry.darks, budget)
    source = f"NXtomo {entry.group or '/'}"
    return _scan(rows, entry.angles, "transmission", source, pitch=entry.pitch, unit=entry.unit)


def _present(
    tree: Hdf5Tree, named: str | None, usual: str, projections: FrameStack
) -> FrameStack | None:
    if named is None and tree.find(usual) is None:
        return None
    return calibration_stack(tree, named or usual, projections)


def _angles(tree: Hdf5Tree, name: str, projections: FrameStack) -> NDArray[np.float64]:
    if tree.find(name) is None:
        given = given_angles(name, projections.frames)
        if given is not None:
            return given
    return check_angles(tree.path, name, read_angles(tree, name), projections=projections.frames)


def _scan(
    rows: Hdf5Rows,
    angles: NDArray[np.float64],
    kind: Kind,
    source: str,
    *,
    pitch: float | None = None,
    unit: str = "",
) -> ScanFile:
    stack = rows.projections
    shape = (stack.frames, stack.rows, stack.bins)
    return ScanFile(rows.path, shape, angles, pitch, unit, kind, source, rows)
