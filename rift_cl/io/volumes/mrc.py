"""A volume as an MRC file, the format of electron tomography (MRC2014).

Float32 (mode 2) or unsigned 16-bit integers (mode 6); the format's bytes are signed, so that
``open_volume`` refuses 8-bit samples. Lengths are in angstrom. Where the unit is no length, voxels
are 1 along x, as IMOD takes a size that is not known: the standard is silent, and programs that
divide by the size fail with zero. A label says so. What integers stand for is said in the labels
``add_offset = ...`` and ``scale_factor = ...``.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from contextlib import contextmanager
from functools import partial
from pathlib import Path
from typing import Any

import mrcfile
import numpy as np
from mrcfile.dtypes import HEADER_DTYPE

from rift_cl.errors import FileFormatError
from rift_cl.io.boundary import check_claim, check_numeric
from rift_cl.io.volumes.layout import Floats, VolumeLayout, WriteSlab
from rift_cl.io.volumes.plain_samples import staged_samples
from rift_cl.io.volumes.sample_window import restored
from rift_cl.io.volumes.slice_statistics import SliceStatistics

_ANGSTROM = 1e-10
_UNKNOWN = "Voxel size unknown: 1 stands for it"
_LABEL = re.compile(r"(add_offset|scale_factor) = (\S+)\s*")


@contextmanager
def staged_volume(path: Path, layout: VolumeLayout) -> Iterator[WriteSlab]:
    """Write sections into a file that gets its name at the end."""
    statistics = SliceStatistics(layout.shape[0], moments=True)
    header, finish = partial(_write_header, layout), partial(_write_statistics, statistics)
    with staged_samples(path, layout, header, finish) as write:
        yield statistics.watching(write)


def load_volume(path: Path, *, budget: int | None) -> Floats:
    """Read every section."""
    with mrcfile.mmap(path, mode="r") as file:
        data = file.data
        if data is None or data.ndim != 3 or 0 in data.shape:
            raise FileFormatError(f"{path}: holds no volume (z, y, x)")
        check_numeric(path, "the volume", data.dtype)
        check_claim(path, "the volume", 4 * data.size + data[0].nbytes, budget)
        found = [_LABEL.fullmatch(label) for label in file.get_labels()]
        values = {match[1]: float(match[2]) for match in found if match}
        if "scale_factor" in values:
            return restored(data, values["scale_factor"], values.get("add_offset", 0.0))
        return np.array(data, np.float32)


def _write_header(layout: VolumeLayout, part: Path) -> int:
    with mrcfile.new(part, overwrite=True) as file:
        file.set_data(np.zeros((1, 1, 1), layout.dtype))
        file.set_volume()
        header = file.header.copy()
    header.nz, header.ny, header.nx = header.mz, header.my, header.mx = layout.shape
    lengths = layout.lengths(_ANGSTROM)
    steps = lengths or [step / layout.spacing[2] for step in layout.spacing]
    extent = [n * step for n, step in zip(layout.shape, steps, strict=True)]
    header.cella.z, header.cella.y, header.cella.x = extent
    ratio = steps[2] / layout.spacing[2]
    header.origin.z, header.origin.y, header.origin.x = (ratio * at for at in layout.origin)
    _write_labels(header, layout)
    part.write_bytes(header.tobytes())
    return int(header.nbytes)


def _write_labels(header: Any, layout: VolumeLayout) -> None:
    """Replace the library's own label, which holds the time."""
    labels = [_values(layout)]
    if layout.window is not None:
        numbers = layout.window.attributes
        labels += [f"{name} = {numbers[name]!r}" for name in ("add_offset", "scale_factor")]
        labels.append(numbers["formula"])
    if layout.lengths(_ANGSTROM) is None:
        labels.append(_UNKNOWN)
    header.label[:] = b""
    for index, label in enumerate(labels):
        header.label[index] = label.encode("ascii", "replace")[:80]
    header.nlabl = len(labels)


def _values(layout: VolumeLayout) -> str:
    """What the samples are, for a reader."""
    if not layout.attenuation:
        return "Values without a unit"
    return f"Attenuation in {layout.value_unit}" if layout.value_unit else "Attenuation"


def _write_statistics(statistics: SliceStatistics, part: Path) -> None:
    with part.open("r+b") as file:
        header: Any = np.frombuffer(file.read(HEADER_DTYPE.itemsize), HEADER_DTYPE)[0].copy()
        header["dmin"], header["dmax"] = statistics.range
        header["dmean"], header["rms"] = statistics.mean, statistics.deviation
        file.seek(0)
        file.write(header.tobytes())
