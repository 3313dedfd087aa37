"""A volume as OME-Zarr 0.4: a Zarr group of the volume and coarser copies of it.

Version 0.4 of OME-NGFF (https://ngff.openmicroscopy.org/0.4) on Zarr 2 is what napari, Fiji,
Neuroglancer and their like have opened for years; Zarr 2.18 and 3 both write it. The headers are
written here, so that they are the same bytes whichever of the two is installed.

A store says ``complete: false`` until its last copy is on the disk, so that one that was cut off
is known even when somebody renames it. Zarr takes a chunk that is missing for zeros; in a store
that says ``complete: true`` every chunk was written, and one that is missing is an error.
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterator
from contextlib import contextmanager
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np
import zarr
from numpy.typing import NDArray

from rift_cl.errors import FileFormatError, PathEscapeError, ShapeError
from rift_cl.io.boundary import check_claim, check_numeric
from rift_cl.io.output import staged_folder, writing
from rift_cl.io.volumes.layout import PART, Floats, VolumeLayout, VolumePlace, WriteSlab
from rift_cl.io.volumes.sample_window import restored, suggested_window
from rift_cl.io.volumes.slice_statistics import SliceStatistics
from rift_cl.io.volumes.zarr_chunks import ChunkedArray, Index, in_threads, write_header
from rift_cl.io.zarr_store import check_codecs, check_entries, read_header

Shape = tuple[int, ...]

_CHUNK = (PART, 256, 256)
# Slices of the coarsest copy from which the range to display is taken.
_LOOKED_AT = 16
# Our own entry among the attributes.
_OURS = "rift_cl"
_STORE = re.compile(r"\.zgroup(\..*)?|\.zattrs(\..*)?|\d{1,2}")


@contextmanager
def staged_volume(path: Path, layout: VolumeLayout) -> Iterator[WriteSlab]:
    """Write chunks into a store that gets its name at the end."""
    statistics = SliceStatistics(layout.shape[0])
    with staged_folder(path, _strange) as folder:
        with writing(path):
            write_header(folder / ".zgroup", {"zarr_format": 2})
            write_header(folder / ".zattrs", {_OURS: {**layout.attributes, "complete": False}})
            levels = _Levels(folder, layout)

        def write_slab(start: int, slab: NDArray[Any]) -> None:
            with writing(path):
                levels.write(start, slab)

        yield statistics.watching(write_slab)
        with writing(path):
            shown = _display(layout, statistics.range, levels.coarsest)
            write_header(folder / ".zattrs", _attributes(path, layout, shown))


def load_volume(path: Path, *, budget: int | None) -> Floats:
    """Read the finest array of a store, or an array that stands alone."""
    check_entries(path)
    attributes, place = _finest(path)
    ours = attributes.get(_OURS)
    if isinstance(ours, dict) and ours.get("complete") is not True:
        raise FileFormatError(f"{path}: was cut off while it was written; write it again")
    if not any((place / name).is_file() for name in ("zarr.json", ".zarray")):
        raise FileFormatError(f"{path}: lacks the array {place.name!r} that it names")
    check_codecs(place)
    array: Any = zarr.open_array(str(place), mode="r")
    check_numeric(path, "the array", array.dtype)
    if array.ndim != 3 or 0 in array.shape:
        raise ShapeError(f"{path}: has shape {array.shape}, wanted (z, y, x)")
    each = array.dtype.itemsize + (0 if array.dtype == np.float32 else 4)
    need = math.prod(array.shape) * each + math.prod(array.chunks) * array.dtype.itemsize
    check_claim(path, "the volume", need, budget)
    if not isinstance(ours, dict):
        return np.asarray(array[...], np.float32)
    _check_chunks(place, array)
    if "scale_factor" in ours:
        return restored(array[...], float(ours["scale_factor"]), float(ours["add_offset"]))
    return np.asarray(array[...], np.float32)


def load_place(path: Path) -> VolumePlace:
    """What our own entry among a store's attributes says of where its samples stand."""
    ours = _finest(path)[0].get(_OURS)
    return VolumePlace.of(ours if isinstance(ours, dict) else {})


def _create(place: Path, shape: Shape, layout: VolumeLayout) -> ChunkedArray:
    """A new array of a store, of which every chunk will be written, zeros too."""
    # The name under which xarray looks for the axes.
    attributes: dict[str, Any] = {"_ARRAY_DIMENSIONS": ["z", "y", "x"]}
    if layout.window is not None:
        attributes |= layout.window.attributes
    return ChunkedArray(place, shape, _CHUNK, layout.dtype, attributes)


class _Levels:
    """The volume and its coarser copies, of which each part is made once all below it is there.

    Args:
        folder: of the store.
        layout: the volume.
    """

    def __init__(self, folder: Path, layout: VolumeLayout) -> None:
        copies = coarser_shapes(layout.shape)
        shapes = [layout.shape, *(shape for shape, _ in copies)]
        self._factors = [factors for _, factors in copies]
        self._arrays = [_create(folder / str(n), shape, layout) for n, shape in enumerate(shapes)]
        # Of each slice of each level, whether it is on the disk.
        self._written = [np.zeros(shape[0], np.bool_) for shape in shapes]

    @property
    def coarsest(self) -> NDArray[Any]:
        """The coarsest copy."""
        last = self._arrays[-1]
        whole = np.empty(last.shape, last.dtype)
        for index in last.indices(slice(0, last.shape[0])):
            whole[last.extent(index)] = last.read_chunk(index)
        return whole

    def write(self, start: int, slab: NDArray[Any]) -> None:
        """Write slices of the volume, and what they complete of the copies."""
        self._arrays[0].write_slices(start, slab)
        self._wrote(0, slice(start, start + len(slab)))

    def _wrote(self, level: int, slices: slice) -> None:
        """Note slices of a level, and write those of the next whose last ones they are."""
        self._written[level][slices] = True
        if level == len(self._factors):
            return
        factor, coarser = self._factors[level][0], self._arrays[level + 1]
        depth, count = coarser.chunks[0], coarser.shape[0]
        first = slices.start // factor // depth * depth
        for start in range(first, min(count, -(-slices.stop // factor)), depth):
            made = slice(start, min(start + depth, count))
            finer = slice(factor * made.start, factor * made.stop)
            if self._written[level][finer].all():
                self._halve(level, made)
                self._wrote(level + 1, made)

    def _halve(self, level: int, slices: slice) -> None:
        """Write slices of the level above, chunk by chunk."""
        finer, coarser = self._arrays[level], self._arrays[level + 1]
        factors = self._factors[level]

        def make(index: Index) -> None:
            extent = coarser.extent(index)
            chunk = np.empty([part.stop - part.start for part in extent], coarser.dtype)
            for below in _chunks_below(index, factors, finer):
                # Chunks have an even length along axes that are halved, but for the last.
                place = tuple(
                    slice(at.start // f - part.start, -(-at.stop // f) - part.start)
                    for at, f, part in zip(finer.extent(below), factors, extent, strict=True)
                )
                chunk[place] = halved(finer.read_chunk(below), factors)
            coarser.write_chunk(index, chunk)

        in_threads(make, coarser.indices(slices))


def _chunks_below(index: Index, factors: Shape, finer: ChunkedArray) -> Iterator[Index]:
    """The chunks of an array of which a chunk of its copy is made."""
    counts = (-(-n // chunk) for n, chunk in zip(finer.shape, finer.chunks, strict=True))
    return product(
        *(
            range(f * i, min(f * (i + 1), count))
            for i, f, count in zip(index, factors, counts, strict=True)
        )
    )


def _attributes(path: Path, layout: VolumeLayout, shown: dict[str, float]) -> dict[str, Any]:
    unit = {} if layout.unit_name is None else {"unit": layout.unit_name}
    scale, datasets = list(layout.spacing), []
    first = list(layout.origin)
    steps = [(layout.shape, (1, 1, 1)), *coarser_shapes(layout.shape)]
    for level, (_, factors) in enumerate(steps):
        # The first sample of a copy stands in the middle of those that it is the mean of.
        first = [at + (f - 1) / 2 * d for at, f, d in zip(first, factors, scale, strict=True)]
        scale = [f * d for f, d in zip(factors, scale, strict=True)]
        transformations = [
            {"type": "scale", "scale": scale},
            {"type": "translation", "translation": first},
        ]
        datasets.append({"path": str(level), "coordinateTransformations": transformations})
    image = {
        "version": "0.4",
        "name": path.stem,
        "axes": [{"name": axis, "type": "space", **unit} for axis in "zyx"],
        "datasets": datasets,
        "type": "mean",
        "metadata": {"description": "means of 2 samples along each axis that was longer than 64"},
    }
    channel = {"active": True, "color": "FFFFFF", "label": "attenuation", "window": shown}
    omero = {"channels": [channel], "rdefs": {"model": "greyscale"}} if shown else None
    return {
        "multiscales": [image],
        **({"omero": omero} if omero else {}),
        _OURS: {**layout.attributes, "complete": True},
    }


def _display(
    layout: VolumeLayout, range: tuple[float, float], coarsest: NDArray[Any]
) -> dict[str, float]:
    """Which samples are shown black and white; nothing where some are not finite."""
    if layout.window is not None:
        return {"min": 0, "max": layout.window.levels, "start": 0, "end": layout.window.levels}
    if not (all(map(math.isfinite, range)) and np.isfinite(coarsest).all()):
        return {}
    start, end = suggested_window(coarsest[:: -(-len(coarsest) // _LOOKED_AT)])
    return {"min": range[0], "max": range[1], "start": start, "end": end}


def _finest(path: Path) -> tuple[dict[str, Any], Path]:
    """Attributes of a store, and where its finest array is: of Zarr 2 and 3, group or array."""
    if (path / "zarr.json").is_file():
        header = read_header(path / "zarr.json")
        attributes = header.get("attributes", {})
        attributes = attributes.get("ome", attributes)
        group = header.get("node_type") == "group"
    else:
        there = (path / ".zattrs").is_file()
        attributes = read_header(path / ".zattrs") if there else {}
        group = (path / ".zgroup").is_file()
    if not group:
        return attributes, path
    if _OURS in attributes and "multiscales" not in attributes:
        return attributes, path / "0"
    try:
        name = str(attributes["multiscales"][0]["datasets"][0]["path"])
    except (KeyError, IndexError, TypeError) as error:
        raise FileFormatError(
            f"{path}: is a Zarr group that names no image; name one of its arrays"
        ) from error
    if not (path / name).resolve().is_relative_to(path.resolve()):
        raise PathEscapeError(f"{path}: {name!r} leads outside the store; copy it in")
    return attributes, path / name


def _check_chunks(place: Path, array: Any) -> None:
    counts = (-(-n // chunk) for n, chunk in zip(array.shape, array.chunks, strict=True))
    for index in product(*(range(count) for count in counts)):
        chunk = place.joinpath(*map(str, index))
        if not chunk.is_file():
            raise FileFormatError(
                f"{place.parent}: the chunk {chunk.relative_to(place.parent)} is missing; copy the "
                "store again, or write it again"
            )


def _strange(names: list[str]) -> str | None:
    strange = next((name for name in names if not _STORE.fullmatch(name)), None)
    if strange is None and names and ".zgroup" not in names:
        return names[0]
    return strange


# Copies end where no axis is longer than this,
_SMALL = 256
# and axes that are this short stay as they are, so that a few slices do not melt into one.
_SHORT = 64


def coarser_shapes(shape: Shape) -> list[tuple[Shape, Shape]]:
    """Shape of each coarser copy, and by how much it is coarser than the one before, by axis.

    Args:
        shape: (z, y, x) of the volume.
    """
    copies = []
    while max(shape) > _SMALL:
        factors = tuple(2 if n > _SHORT else 1 for n in shape)
        shape = tuple(-(-n // f) for n, f in zip(shape, factors, strict=True))
        copies.append((shape, factors))
    return copies


def halved(block: NDArray[Any], factors: Shape) -> NDArray[Any]:
    """Means of neighbouring pairs along the axes whose factor is 2.

    A last sample without a neighbour stays as it is. Integers are rounded to the nearest (ties to
    the even one), after the last axis.
    """
    means = block.astype(np.float32)
    for axis, factor in enumerate(factors):
        if factor == 2:
            means = _halved_axis(means, axis)
    if block.dtype.kind in "iu":
        np.rint(means, out=means)
    return means.astype(block.dtype)


def _halved_axis(block: NDArray[np.float32], axis: int) -> NDArray[np.float32]:
    count = block.shape[axis]
    pairs = count // 2
    means = np.empty((*block.shape[:axis], count - pairs, *block.shape[axis + 1 :]), np.float32)
    along = (slice(None),) * axis
    first, second = (block[(*along, slice(start, 2 * pairs, 2))] for start in (0, 1))
    both = means[(*along, slice(pairs))]
    np.add(first, second, out=both)
    both *= np.float32(0.5)
    means[(*along, slice(pairs, None))] = block[(*along, slice(2 * pairs, None))]
    return means
