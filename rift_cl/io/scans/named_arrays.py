"""Files that hold arrays by name, HDF5, NPZ and MAT: one way from names to a scan.

A layout, or a person, says which arrays are the projections, the angles, the flats and the darks.
What it does not say is looked for beside the projections under names that cannot be mistaken.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from rift_cl.errors import FileFormatError, InputError, ShapeError
from rift_cl.geometry import FanBeam
from rift_cl.io.scans.angle_list import AngleList, given_angles
from rift_cl.io.scans.axes import axes_of
from rift_cl.io.scans.beam import AnyBeam
from rift_cl.io.scans.beam_file import given_beam
from rift_cl.io.scans.contract import AIR, MEAN, Finding, scan_of
from rift_cl.io.scans.frame_stack import FrameStack, runs_of
from rift_cl.io.scans.frame_words import is_said, says_angles, says_projections
from rift_cl.io.scans.literals import AngleUnit, Kind
from rift_cl.io.scans.scan_file import RowSource, ScanFile, ScanRequest

# Projections are views of rows, or of a single one.
_AXES = (2, 3)
_KEY = ("image_key",)
# Axes of frames as detectors give them.
_FRAME_BY_FRAME = "nrb"
# Keys of frames in NXtomo; everything else is no part of a scan.
PROJECTION, FLAT, DARK = 0, 1, 2


class ArrayStore(Protocol):
    """A file with arrays by name, open for reading."""

    @property
    def path(self) -> Path:
        """The file."""

    def __contains__(self, name: str) -> bool:
        """Whether there is an array of that name."""

    def shape(self, name: str) -> tuple[int, ...]:
        """Shape of an array that holds real numbers, and at least one; else an ``InputError``."""

    def dtype(self, name: str) -> np.dtype[np.generic]:
        """Type of the numbers as they are stored."""

    def vector(self, name: str) -> NDArray[np.float64]:
        """An array of one number per frame."""

    def angles(self, name: str) -> AngleList:
        """The angles in an array, with the unit that the file states."""

    def unit(self, name: str) -> str:
        """Unit of an array as the file states it, or nothing."""

    def axes(self, name: str) -> str | None:
        """The letters of the axes that the file states for an array, or None."""

    def beside(self, name: str) -> Iterable[str]:
        """Names of the arrays of numbers in the same group."""

    def contents(self) -> str:
        """A phrase that lists what there is, and how to name it."""

    def rows(
        self, projections: FrameStack, flats: FrameStack | None, darks: FrameStack | None
    ) -> RowSource:
        """What reads these stacks."""


@dataclass(frozen=True, kw_only=True)
class Layout:
    """Where a layout, or a person, says that the parts of a scan are.

    Args:
        source: the layout, for people.
        projections: name of the projections.
        theta: name of the angles, or None where they are to be looked for.
        flats, darks, image_key: names, or None.
        axes: letters of the axes of projections by number of axes, where the layout defines them.
        fixed: the layout is known for no other axes, whatever the number of angles.
        angle_unit: unit of angles whose unit the file does not state.
        search: look beside the projections for what is not named.
        kind, pitch, row_pitch, unit, fan, beam, background, notes: as in ``Finding``.
    """

    source: str
    projections: str
    theta: str | None = None
    flats: str | None = None
    darks: str | None = None
    image_key: str | None = None
    axes: dict[int, str] | None = None
    fixed: bool = False
    angle_unit: AngleUnit = "degrees"
    search: bool = False
    kind: Kind | None = None
    pitch: float | None = None
    row_pitch: float | None = None
    unit: str = ""
    fan: FanBeam | None = None
    beam: AnyBeam | None = None
    background: int = 0
    notes: tuple[str, ...] = ()

    @property
    def pitches(self) -> tuple[float, float] | None:
        """Distance between rows and between bins; pixels are square where only one is told."""
        return None if self.pitch is None else (self.row_pitch or self.pitch, self.pitch)


def scan_in(store: ArrayStore, layout: Layout, request: ScanRequest) -> ScanFile:
    """Find the parts of a scan by their names, and settle what they are.

    Raises:
        InputError: a part is missing, parts do not fit each other, or what they are is doubtful.
    """
    layout, beside = _completed(store, layout, request)
    beam = given_beam(request, store.path, layout.pitches, layout.unit) or layout.beam
    angles = _angles(store, layout, beam)
    keys = store.vector(layout.image_key) if layout.image_key else None
    if keys is not None and layout.image_key in beside:
        # Keys that nobody named may be those of another array.
        keys = keys if keys.size in store.shape(layout.projections) else None
    projections = _projections(store, layout, request, angles, keys)
    frames, flats_at = projections, None
    flats = _calibration(store, layout.flats, frames, beside)
    darks = _calibration(store, layout.darks, frames, beside)
    if keys is not None:
        projections, flats, darks, flats_at = _sorted(store, layout, frames, keys, flats, darks)
        if angles.count == keys.size:
            angles = replace(angles, values=angles.values[keys == PROJECTION])
    radians, phrase, notes = angles.settled(store.path, projections.frames, request.angle_unit)
    found = Finding(
        path=store.path,
        source=layout.source,
        name=repr(layout.projections),
        shape=(projections.frames, projections.rows, projections.bins),
        axes=projections.axes,
        dtype=store.dtype(layout.projections),
        rows=store.rows(projections, flats, darks),
        angles=radians,
        angle_words=phrase,
        flats=flats.frames if flats else 0,
        darks=darks.frames if darks else 0,
        evidence=(store.unit(layout.projections), _last(layout.projections)),
        kind=layout.kind,
        flats_at=flats_at,
        pitch=layout.pitch,
        row_pitch=layout.row_pitch,
        unit=layout.unit,
        fan=layout.fan,
        beam=beam,
        background=layout.background,
        notes=(*layout.notes, *_told(beside, layout, flats, darks), *notes),
        unused=_unused(store, frames, flats, darks),
        contents=store.contents,
    )
    return scan_of(found, request)


def layout_by_name(store: ArrayStore, source: str, names: Iterable[str]) -> Layout | None:
    """Projections that no layout prescribes: the only array that is called so, if there is one.

    Where none is called so, it is the only one beside angles that has an axis of as many.

    Args:
        store: the arrays.
        source: the format, for people.
        names: arrays that may be meant; those beside angles come first.
    """
    names = list(names)
    called = [name for name in names if says_projections(_last(name)) and _is_stack(store, name)]
    beside_angles = [
        name for name in called if any(says_angles(_last(other)) for other in store.beside(name))
    ]
    found, by = beside_angles or called, "its name"
    if not called:
        found, by = [name for name in names if _fits_angles(store, name)], "its shape"
    if len(found) != 1:
        return None
    return Layout(
        source=source,
        projections=found[0],
        search=True,
        notes=(f"Nothing but {by} says that {found[0]!r} are the projections (--dataset).",),
    )


def _is_stack(store: ArrayStore, name: str) -> bool:
    try:
        return len(store.shape(name)) in _AXES
    except InputError:
        return False


def _fits_angles(store: ArrayStore, name: str) -> bool:
    """Whether an array that is no flats and no darks has an axis of as many as angles beside it."""
    word = _last(name)
    if is_said("flats", word) or is_said("darks", word) or not _is_stack(store, name):
        return False
    angles = [other for other in store.beside(name) if says_angles(_last(other))]
    return any(store.shape(other) in {(size,) for size in store.shape(name)} for other in angles)


def _completed(
    store: ArrayStore, layout: Layout, request: ScanRequest
) -> tuple[Layout, frozenset[str]]:
    """The layout with what a person names and what stands beside the projections; the latter."""
    store.shape(layout.projections)
    named: dict[str, Any] = {
        part: getattr(request, part)
        for part in ("theta", "flats", "darks", "image_key")
        if getattr(request, part) is not None
    }
    wanted: tuple[str, ...] = ("theta", "image_key", "darks", "flats")
    if named.get("flats") in (AIR, MEAN) and named["flats"] not in store:
        # What takes the place of flats is no name, and then none are looked for.
        del named["flats"]
        layout = replace(layout, flats=None)
        wanted = wanted[:-1]
    layout = replace(layout, **named)
    if not layout.search:
        return layout, frozenset()
    beside = [name for name in store.beside(layout.projections) if name != layout.projections]
    found = {
        "theta": [name for name in beside if says_angles(_last(name))],
        "image_key": [name for name in beside if _last(name).lower() in _KEY],
        "flats": [name for name in beside if is_said("flats", _last(name))],
        "darks": [name for name in beside if is_said("darks", _last(name))],
    }
    only: dict[str, Any] = {part: found[part][0] for part in wanted if len(found[part]) == 1}
    new = {part: name for part, name in only.items() if not getattr(layout, part)}
    return replace(layout, **new), frozenset(new.values())


def _angles(store: ArrayStore, layout: Layout, beam: AnyBeam | None) -> AngleList:
    if layout.theta is None and beam is not None and beam.angles is not None:
        return beam.angles
    if layout.theta is None:
        raise FileFormatError(
            f"{store.path}: the angles of {layout.projections!r} are not known; {store.contents()}"
        )
    given = None if layout.theta in store else given_angles(layout.theta)
    return given or replace(store.angles(layout.theta), usual=layout.angle_unit)


def _projections(
    store: ArrayStore,
    layout: Layout,
    request: ScanRequest,
    angles: AngleList,
    keys: NDArray[np.float64] | None,
) -> FrameStack:
    shape = store.shape(layout.projections)
    usual = (layout.axes or {}).get(len(shape)) or store.axes(layout.projections)
    axes = axes_of(
        store.path,
        layout.projections,
        shape,
        count=None if layout.fixed else angles.count if keys is None else keys.size,
        asked=request.axes,
        usual=usual if usual and len(usual) == len(shape) else None,
    )
    stack = FrameStack(layout.projections, shape, axes, ())
    return replace(stack, runs=((0, stack.size("n")),))


def _calibration(
    store: ArrayStore, name: str | None, frames: FrameStack, beside: frozenset[str]
) -> FrameStack | None:
    """Flats or darks: frames like the projections, or one without the axis of frames.

    Beside projections whose axes were put in another order, flats often stand frame by frame.
    What was found beside the projections, and named by nobody, is passed over if it does not fit.
    """
    if name is None:
        return None
    shape = store.shape(name)
    for order in (frames.axes, _FRAME_BY_FRAME):
        axes = order.replace("n", "") if len(shape) < len(order) else order
        if len(shape) != len(axes):
            continue
        stack = FrameStack(name, shape, axes, ())
        if all(stack.size(axis) == frames.size(axis) for axis in "rb"):
            return replace(stack, runs=((0, stack.size("n")),))
    if name in beside:
        return None
    raise ShapeError(
        f"{store.path}: {name!r} has shape {shape}, the projections {frames.name!r} have "
        f"{frames.shape}: rows and bins must agree"
    )


def _unused(
    store: ArrayStore, frames: FrameStack, flats: FrameStack | None, darks: FrameStack | None
) -> tuple[str, ...]:
    """Names beside the projections that hold frames of their size, and are no part of the scan."""
    used = {_last(stack.name) for stack in (frames, flats, darks) if stack}
    names = [name for name in store.beside(frames.name) if _last(name) not in used]
    beside = frozenset(names)
    return tuple(
        name
        for name in names
        if _is_stack(store, name) and _calibration(store, name, frames, beside) is not None
    )


def _told(
    beside: frozenset[str], layout: Layout, flats: FrameStack | None, darks: FrameStack | None
) -> tuple[str, ...]:
    names = [layout.theta, *(stack.name for stack in (flats, darks) if stack)]
    found = [repr(name) for name in names if name in beside]
    if not found:
        return ()
    return (f"Found beside the projections and used: {', '.join(found)}.",)


def _sorted(
    store: ArrayStore,
    layout: Layout,
    frames: FrameStack,
    keys: NDArray[np.float64],
    flats: FrameStack | None,
    darks: FrameStack | None,
) -> tuple[FrameStack, FrameStack | None, FrameStack | None, NDArray[np.float64] | None]:
    """The frames of one array by their keys; flats and darks that are named come before those."""
    if keys.size != frames.frames:
        raise ShapeError(
            f"{store.path}: {layout.image_key!r} has {keys.size} image keys for {frames.frames} "
            f"frames of {frames.name!r}"
        )
    projections = _keyed(frames, keys, PROJECTION)
    if projections is None:
        raise FileFormatError(
            f"{store.path}: no frame of {frames.name!r} has image key 0, a projection"
        )
    at = None
    if flats is None:
        flats = _keyed(frames, keys, FLAT)
        # Flats that are taken before, between and after tell how the beam changed.
        at = np.cumsum(keys == PROJECTION, dtype=np.float64)[keys == FLAT]
    return projections, flats, darks or _keyed(frames, keys, DARK), at


def _keyed(frames: FrameStack, keys: NDArray[np.float64], key: int) -> FrameStack | None:
    runs = runs_of(np.flatnonzero(keys == key))
    return replace(frames, runs=runs) if runs else None


def _last(name: str) -> str:
    return name.replace(".", "/").rsplit("/", maxsplit=1)[-1]
