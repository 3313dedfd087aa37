"""An array of a Zarr 2 store, whose chunks several threads pack and write at a time.

Only its samples decide a chunk's bytes: it is packed by one thread and is a file of its own. Zarr
reads these arrays. It does not write them, since its assignment passes every sample through the
one thread of its event loop, for which fast devices and workers of a cluster would have to wait.
"""

from __future__ import annotations

import json
import os
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from itertools import product
from pathlib import Path
from typing import Any

import numcodecs
import numpy as np
from numpy.typing import NDArray

Index = tuple[int, ...]

# Packing of chunks: nearly as fast as none, and every reader of Zarr has it.
_COMPRESSOR = {"id": "blosc", "cname": "zstd", "clevel": 1, "shuffle": 2, "blocksize": 0}
# Threads that pack at most, each with a few chunks in memory.
_THREADS = 8


class ChunkedArray:
    """An array (z, y, x) of a Zarr 2 store that is being made.

    Args:
        place: its folder; made here.
        shape: of the array.
        chunks: shape of a chunk.
        dtype: of the samples, little-endian.
        attributes: what is noted beside it.
    """

    def __init__(
        self,
        place: Path,
        shape: Index,
        chunks: Index,
        dtype: np.dtype[Any],
        attributes: dict[str, Any],
    ) -> None:
        self.shape = shape
        self.chunks = tuple(min(n, chunk) for n, chunk in zip(shape, chunks, strict=True))
        self.dtype, self._place = dtype, place
        self._codec = numcodecs.get_codec(dict(_COMPRESSOR))
        place.mkdir()
        header = {
            "zarr_format": 2,
            "shape": list(shape),
            "chunks": list(self.chunks),
            "dtype": dtype.str if dtype.itemsize > 1 else "|u1",
            "order": "C",
            "dimension_separator": "/",
            "compressor": _COMPRESSOR,
            "filters": None,
            "fill_value": 0,
        }
        write_header(place / ".zarray", header)
        write_header(place / ".zattrs", attributes)

    def indices(self, slices: slice) -> list[Index]:
        """The chunks in which slices lie."""
        depth = self.chunks[0]
        counts = (-(-n // chunk) for n, chunk in zip(self.shape[1:], self.chunks[1:], strict=True))
        layers = range(slices.start // depth, -(-slices.stop // depth))
        return list(product(layers, *(range(count) for count in counts)))

    def extent(self, index: Index) -> tuple[slice, ...]:
        """The samples of a chunk; at the end of an axis there are fewer than its shape says."""
        return tuple(
            slice(i * chunk, min((i + 1) * chunk, n))
            for i, chunk, n in zip(index, self.chunks, self.shape, strict=True)
        )

    def write_slices(self, start: int, slab: NDArray[Any]) -> None:
        """Write slices ``start``, ``start + 1``, ..., and leave others of their chunks as they are.

        Raises:
            OSError: the disk cannot be written to.
        """
        stop = start + len(slab)

        def write(index: Index) -> None:
            z, y, x = self.extent(index)
            first, last = max(z.start, start), min(z.stop, stop)
            chunk = slab[first - start : last - start, y, x]
            if last - first < z.stop - z.start:
                part, chunk = chunk, self._kept(index)
                chunk[first - z.start : last - z.start] = part
            self.write_chunk(index, chunk)

        in_threads(write, self.indices(slice(start, stop)))

    def write_chunk(self, index: Index, samples: NDArray[Any]) -> None:
        """Write the samples of a chunk; one that reaches beyond the array has zeros there.

        Raises:
            OSError: the disk cannot be written to.
        """
        if samples.shape != self.chunks:
            whole = np.zeros(self.chunks, self.dtype)
            whole[tuple(slice(n) for n in samples.shape)] = samples
            samples = whole
        path = self._path(index)
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_bytes(self._codec.encode(np.ascontiguousarray(samples, self.dtype)))

    def read_chunk(self, index: Index) -> NDArray[Any]:
        """The samples of a chunk that was written, without those beyond the array.

        Raises:
            OSError: the disk cannot be read.
        """
        packed = self._codec.decode(self._path(index).read_bytes())
        chunk = np.frombuffer(packed, self.dtype).reshape(self.chunks)
        return chunk[tuple(slice(e.stop - e.start) for e in self.extent(index))]

    def _kept(self, index: Index) -> NDArray[Any]:
        """The samples of a chunk, zero where none were written."""
        if self._path(index).exists():
            return self.read_chunk(index).copy()
        return np.zeros([e.stop - e.start for e in self.extent(index)], self.dtype)

    def _path(self, index: Index) -> Path:
        return self._place.joinpath(*map(str, index))


def in_threads(work: Callable[[Index], None], indices: Iterable[Index]) -> None:
    """Do independent work on chunks in a few threads; the first exception is raised at the end."""
    with _packing_in_one_thread(), ThreadPoolExecutor(_threads(), "pack") as pool:
        for _ in pool.map(work, indices):
            pass


def _threads() -> int:
    return min(_THREADS, os.cpu_count() or 1)


@contextmanager
def _packing_in_one_thread() -> Iterator[None]:
    """Blosc puts blocks down in the order in which its threads end: one thread, one order."""
    before = numcodecs.blosc.use_threads
    numcodecs.blosc.use_threads = False
    try:
        yield
    finally:
        numcodecs.blosc.use_threads = before


def write_header(path: Path, value: dict[str, Any]) -> None:
    """Write a header of a store, or its attributes."""
    path.write_text(json.dumps(value, indent=2, allow_nan=False) + "\n", encoding="utf-8")
