"""Our own layout of a scan in a file of named arrays, NPZ or Zarr.

``projections`` (angle, row, bin) or ``sinogram`` (angle, bin), ``angles`` in radians, and where
there are such ``flats``, ``darks``, ``pitch`` (of rows and bins, or one number), the ``unit`` of
lengths as the store tells it, and the distances of a source with ``center``,
``heights`` and ``curved``.
"""

from __future__ import annotations

import numpy as np

from rift_cl.errors import FileFormatError, InputError, ShapeError
from rift_cl.io.scans.axes import USUAL
from rift_cl.io.scans.beam import Beam
from rift_cl.io.scans.named_arrays import ArrayStore, Layout, layout_by_name
from rift_cl.io.scans.scan_file import Pitches

PROJECTIONS = "projections", "sinogram"
# How distances are called: from the source to the axis, from there and from the axis to the
# detector.
_TO_AXIS = ("source_to_axis", "sid", "sod", "dso", "source_origin", "source_axis", "sad")
_TO_DETECTOR = ("source_to_detector", "sdd", "dsd", "source_detector")
_BEYOND = ("odd", "dod", "origin_detector", "axis_to_detector")
_DISTANCES = (*_TO_AXIS, *_TO_DETECTOR, *_BEYOND)
# Numbers of a pitch that is not the same along rows and bins.
_ROW_AND_BIN = 2
_PITCHES = (("pitch",), ("dv", "du"), ("row_pitch", "bin_pitch"), ("pixel_size",))


def own_layout(store: ArrayStore, source: str, dataset: str | None = None) -> Layout:
    """What there is to know of a scan by the names of its arrays.

    Args:
        store: the arrays.
        source: the format, for people.
        dataset: the projections, where a person names them.

    Raises:
        FileFormatError: no array has the name of projections.
    """
    usual, called = [name for name in PROJECTIONS if name in store], tuple[str, ...]()
    if dataset is None and not usual:
        named = layout_by_name(store, source, store.beside(""))
        if named is None:
            raise FileFormatError(
                f"{store.path}: has neither 'projections' nor 'sinogram'; {store.contents()}"
            )
        dataset, called = named.projections, named.notes
    known = dataset is None
    in_small = {name.lower(): name for name in store.beside("")}
    lengths = _pitches(store, in_small)
    beam, notes = _beam(store, in_small, lengths)
    usable = lengths.usable
    return Layout(
        source=source,
        projections=dataset or usual[0],
        theta="angles" if "angles" in store else None,
        flats="flats" if known and "flats" in store else None,
        darks="darks" if known and "darks" in store else None,
        axes=USUAL if known else None,
        angle_unit="radians" if "angles" in store else "degrees",
        search=True,
        pitch=usable.bin,
        row_pitch=usable.row,
        unit=usable.unit,
        beam=beam,
        notes=(*called, *notes),
    )


def _pitches(store: ArrayStore, named: dict[str, str]) -> Pitches:
    """The pitch of the detector, of rays of every kind.

    Args:
        store: the arrays.
        named: their names by the same in small letters.

    Raises:
        ShapeError: there are more numbers than those of rows and bins.
    """
    for names in _PITCHES:
        if not all(name in named for name in names):
            continue
        values = np.concatenate([store.vector(named[name]) for name in names])
        if values.size > _ROW_AND_BIN:
            raise ShapeError(
                f"{store.path}: {named[names[0]]!r} has {values.size} numbers, wanted one, or "
                "those of rows and of bins"
            )
        row = float(values[0]) if values.size == _ROW_AND_BIN else None
        return Pitches(row, float(values[-1]), store.unit(named[names[-1]]))
    return Pitches()


def _beam(
    store: ArrayStore, named: dict[str, str], lengths: Pitches
) -> tuple[Beam | None, tuple[str, ...]]:
    """Source and detector where the file names their distances, or a doubt."""
    found = [named[name] for name in _DISTANCES if name in named]
    if not found:
        return None, ()
    listed = ", ".join(map(repr, found))
    to_axis = _first_number(store, named, _TO_AXIS)
    to_detector = _first_number(store, named, _TO_DETECTOR)
    beyond = _first_number(store, named, _BEYOND)
    if to_detector is None and to_axis is not None and beyond is not None:
        to_detector = to_axis + beyond
    if to_axis is None and to_detector is not None and beyond is not None:
        to_axis = to_detector - beyond
    if to_axis is None or to_detector is None:
        return None, (
            f"The file names one distance of a source ({listed}) and not the other, so that it is "
            "not used: rays are taken as parallel. Give both with geometry= (--geometry).",
        )
    if lengths.bin is None:
        raise InputError(
            f"{store.path}: names distances of a source ({listed}) and no pitch of the detector "
            "in the same unit: add 'pitch' (or 'dv' and 'du'), or give geometry= (--geometry)"
        )
    center = None
    if "center" in named:
        values = store.vector(named["center"])
        if values.size != 2:
            raise ShapeError(f"{store.path}: 'center' has {values.size} numbers, not row and bin")
        center = (float(values[0]), float(values[1]))
    heights = store.vector(named["heights"]) if "heights" in named else None
    curved = _first_number(store, named, ("curved",)) or 0.0
    if curved not in (0, 1):
        raise InputError(
            f"{store.path}: 'curved' is {curved:g}, wanted 1 where rows are arcs about the source, "
            "else 0"
        )
    return Beam(
        source_to_axis=to_axis,
        source_to_detector=to_detector,
        pitch=(lengths.bin if lengths.row is None else lengths.row, lengths.bin),
        unit=lengths.unit,
        center=center,
        heights=heights,
        curved=bool(curved),
    ), (f"Distances of the source are {listed}, in the unit of the pitch.",)


def _first_number(store: ArrayStore, named: dict[str, str], names: tuple[str, ...]) -> float | None:
    return next((float(store.vector(named[n])[0]) for n in names if n in named), None)
