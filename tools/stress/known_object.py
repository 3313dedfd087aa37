"""Scans of one known object in every kind of file: raw, ambiguous or mislabelled.

The object is a few ellipsoids, none of them alike in two directions or on two rows, whose line
integrals are exact and were computed by none of the package's projectors: a wrong axis, order or
unit shows in every slice.
"""

from __future__ import annotations

import struct
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import h5py
import mrcfile
import numpy as np
import scipy.io
import tifffile
from numpy.typing import NDArray

from rift_cl.geometry import Grid, Parallel
from rift_cl.phantom import Ellipsoid, project, render

VIEWS, ROWS, BINS, CENTER = 120, 5, 96, 47.5
DEGREES = np.arange(VIEWS) * 180.0 / VIEWS
RADIANS = np.deg2rad(DEGREES)
_PIXEL = 0.65
_BEAM, _DARK = 20_000.0, 100.0
_PARTS = (
    Ellipsoid((0, 0, 0), (9, 34, 26), 0.4, 0.018),
    Ellipsoid((1, 8, -10), (6, 9, 5), 1.1, 0.02),
    Ellipsoid((-1, -12, 9), (5, 6, 11), -0.3, -0.01),
    Ellipsoid((0, 15, 11), (8, 3, 3), 0.0, 0.03),
)

Reals = NDArray[Any]
RIGHT, REFUSED = "right", "refused"


@dataclass(frozen=True)
class Case:
    """A file that is to be read.

    Args:
        truth: what it holds, in words.
        write: writes it into a folder and says what to open.
        wanted: whether slices or a sentence should come of it.
        options: what a person says about it, as to ``open_scan``.
        background: bins of air at each end, as to the commands.
        scale: times the true densities, what the slices should show.
        rows: rows of the object that the file holds.
    """

    truth: str
    write: Callable[[Path], Path]
    wanted: str
    options: dict[str, Any] = field(default_factory=dict)
    background: int | None = None
    scale: float = 1.0
    rows: tuple[int, ...] = tuple(range(ROWS))


def integrals(bins: int = BINS, angles: Reals = RADIANS) -> Reals:
    """Line integrals (angle, row, bin)."""
    return project(_PARTS, Grid((ROWS, bins, bins), 1.0), Parallel(angles, bins, 1.0)).astype(float)


def slices() -> Reals:
    """The true densities, (z, y, x)."""
    return render(_PARTS, Grid((ROWS, BINS, BINS), 1.0)).astype(float)


def counts(drift: float = 0.0, uneven: float = 0.3) -> tuple[Reals, Reals, Reals]:
    """Projections, flats before and after, and darks, with the noise of quanta.

    Args:
        drift: by which share the beam changes during the scan.
        uneven: by which share pixels differ at most.
    """
    random = np.random.default_rng(4)
    dark = random.uniform(0.9, 1.1, (ROWS, BINS)) * _DARK
    beam = random.uniform(1 - uneven, 1.0, (ROWS, BINS)) * _BEAM
    times = 1 + drift * (np.arange(VIEWS) + 0.5)[:, None, None] / VIEWS
    data = random.poisson(beam * times * np.exp(-integrals())) + dark
    flats = random.poisson(beam * np.repeat([1.0, 1 + drift], 5)[:, None, None], (10, ROWS, BINS))
    darks = dark + random.normal(0, 2, (10, ROWS, BINS))
    return np.rint(data), np.rint(flats + dark), np.rint(darks)


def transmission() -> Reals:
    """I / I0 with noise."""
    data, flats, darks = counts()
    dark = darks.mean(axis=0)
    return (data - dark) / (flats.mean(axis=0) - dark)


def attenuation(offset: float = 0.0, noise: float = 0.01) -> Reals:
    """Line integrals with noise, and with air that is not zero."""
    random = np.random.default_rng(5)
    return integrals() + offset + random.normal(0, noise, (VIEWS, ROWS, BINS))


def hdf5(**arrays: Any) -> Callable[[Path], Path]:
    """Writes arrays by name, two underscores for a slash; a pair is an array and its attributes."""

    def write(folder: Path) -> Path:
        with h5py.File(folder / "scan.h5", "w") as file:
            for name, value in arrays.items():
                array, attributes = value if isinstance(value, tuple) else (value, {})
                place = name.replace("__", "/")
                file[place] = array
                file[place].attrs.update(attributes)
        return folder / "scan.h5"

    return write


def npz(**arrays: Any) -> Callable[[Path], Path]:
    """Writes arrays into an NPZ file."""

    def write(folder: Path) -> Path:
        np.savez(folder / "scan.npz", **arrays)
        return folder / "scan.npz"

    return write


def npy(**arrays: Any) -> Callable[[Path], Path]:
    """Writes arrays into NPY files that are called so; the first is the scan's."""

    def write(folder: Path) -> Path:
        for name, values in arrays.items():
            np.save(folder / f"{name}.npy", values)
        return folder / f"{next(iter(arrays))}.npy"

    return write


def mat(**arrays: Any) -> Callable[[Path], Path]:
    """Writes arrays into a MAT file of version 5."""

    def write(folder: Path) -> Path:
        scipy.io.savemat(folder / "scan.mat", arrays)
        return folder / "scan.mat"

    return write


def tiff(pages: Reals, angles: Reals | None = None, **beside: Reals) -> Callable[[Path], Path]:
    """Writes pages into a TIFF file, angles and other stacks beside it."""

    def write(folder: Path) -> Path:
        if angles is not None:
            np.savetxt(folder / "angles.txt", angles)
        for name, stack in {"scan": pages, **beside}.items():
            with tifffile.TiffWriter(folder / f"{name}.tif") as file:
                for page in np.atleast_3d(stack) if stack.ndim == 3 else [stack]:
                    file.write(page, contiguous=False, metadata=None)
        return folder / "scan.tif"

    return write


def mrc(
    data: Reals, tilts: Reals | None = None, *, header: Reals | None = None
) -> Callable[[Path], Path]:
    """Writes a tilt series, its angles beside it or in SerialEM's extended header."""

    def write(folder: Path) -> Path:
        with mrcfile.new(folder / "scan.mrc") as file:
            file.set_data(data)
            file.voxel_size = 5.2
            if header is not None:
                records = b"".join(struct.pack("<h", round(100 * tilt)) for tilt in header)
                file.set_extended_header(np.frombuffer(records, "V1"))
                file.header.exttyp = b"SERI"
                extra = bytearray(bytes(file.header.extra2))
                extra[16:20] = struct.pack("<2h", 2, 1)
                file.header.extra2 = np.void(bytes(extra))
        if tilts is not None:
            np.savetxt(folder / "scan.rawtlt", tilts, fmt="%.3f")
        return folder / "scan.mrc"

    return write


def cases() -> list[Case]:
    """Every file, in the order of the table."""
    data, flats, darks = (part.astype("u2") for part in counts())
    whole = {"exchange__data": data, "exchange__theta": DEGREES}
    full = {**whole, "exchange__data_white": flats, "exchange__data_dark": darks}
    named = {"dataset": "a/p", "theta": "a/t"}
    raw = {"a__p": data, "a__t": DEGREES}
    return [
        *_data_exchange(data, flats, darks, whole, full),
        *_named(data, flats, darks, raw, named),
        *_nxtomo(),
        *_angles(full),
        *_values(named),
        *_npz(data, flats),
        *_npy(data, flats),
        *_mat(data),
        *_tiff(data, flats, darks),
        *_mrc(data),
        *_bad(data, flats, darks, whole, full),
    ]


def _data_exchange(
    data: Reals, flats: Reals, darks: Reals, whole: dict[str, Any], full: dict[str, Any]
) -> list[Case]:
    said = {"dataset": "/exchange/data", "theta": "/exchange/theta"}
    normalised = {**full, "exchange__data": transmission().astype("f4")}
    turned = {**full, "exchange__data": data.transpose(1, 0, 2)}
    even = {**whole, "exchange__data": counts(uneven=0.0)[0].astype("u2")}
    even["exchange__data_dark"] = darks
    for name, frames in (("exchange__data_white", flats), ("exchange__data_dark", darks)):
        turned[name] = frames.transpose(1, 0, 2)
    return [
        Case("Data Exchange: uint16 counts, flats, darks", hdf5(**full), RIGHT),
        Case("the same, projections and angles named", hdf5(**full), RIGHT, said),
        Case("the same as sinograms (row, angle, bin)", hdf5(**turned), RIGHT),
        Case("Data Exchange: uint16 counts without flats", hdf5(**whole), REFUSED),
        Case("the same, the beam from air", hdf5(**whole), REFUSED, {"flats": "air"}),
        Case("counts of an even beam, from air", hdf5(**even), RIGHT, {"flats": "air"}),
        Case("Data Exchange: transmission beside its old flats", hdf5(**normalised), RIGHT),
    ]


def _named(
    data: Reals, flats: Reals, darks: Reals, raw: dict[str, Any], named: dict[str, Any]
) -> list[Case]:
    mean = data.astype("f4") + 0.25
    beside = {**raw, "a__flat_field": flats, "a__dark": darks}
    other = {**raw, "b__x": flats, "b__y": darks}
    calibrated = {**named, "flats": "b/x", "darks": "b/y"}
    sinograms = {"a__p": attenuation().transpose(1, 0, 2), "a__t": DEGREES}
    last = {"a__p": attenuation().transpose(2, 1, 0), "a__t": DEGREES}
    square = {"a__p": attenuation()[:ROWS], "a__t": DEGREES[:ROWS]}
    turn = {"dataset": "a/p", "theta": "0:180"}
    return [
        Case("named: uint16 counts without flats", hdf5(**raw), REFUSED, named),
        Case("named: float counts without flats", hdf5(**{**raw, "a__p": mean}), REFUSED, named),
        Case("named: counts, flats and darks beside them", hdf5(**beside), RIGHT, named),
        Case("named: counts, flats and darks named", hdf5(**other), RIGHT, calibrated),
        Case("named: sinograms (row, angle, bin)", hdf5(**sinograms), RIGHT, named),
        Case("named: (bin, row, angle)", hdf5(**last), REFUSED, named),
        Case("the same, axes said", hdf5(**last), RIGHT, {**named, "axes": "bin,row,angle"}),
        Case("named: as many angles as rows", hdf5(**square), REFUSED, named),
        Case("named: sinograms, angles 0:180", hdf5(**sinograms), REFUSED, turn),
        Case("the same, axes said", hdf5(**sinograms), RIGHT, {**turn, "axes": "row,angle,bin"}),
    ]


def _nxtomo() -> list[Case]:
    data, flats, darks = (part.astype("u2") for part in counts(drift=0.3))
    frames = np.concatenate([darks, flats[:5], data, flats[5:]])
    keys = np.repeat([2, 1, 0, 1], [len(darks), 5, VIEWS, 5])
    angles = np.zeros(len(keys))
    angles[keys == 0] = DEGREES
    place = "entry__instrument__detector__"
    tomo = {
        f"{place}data": frames,
        f"{place}image_key": keys,
        f"{place}x_pixel_size": (_PIXEL, {"units": "um"}),
        "entry__sample__rotation_angle": (angles, {"units": "degree"}),
    }
    detector = {"dataset": "entry/instrument/detector/data"}
    apart = {"a__p": frames, "b__k": keys, "c__t": angles}
    said = {"dataset": "a/p", "theta": "c/t"}
    return [
        Case("NXtomo: a beam that drifts by 30 %", hdf5(**tomo), RIGHT),
        Case("the same, projections named", hdf5(**tomo), RIGHT, detector),
        Case("frames of all kinds in one array, keys named", hdf5(**apart), RIGHT,
             {**said, "image_key": "b/k"}),
        Case("the same, keys not named", hdf5(**apart), REFUSED, said),
    ]  # fmt: skip


def _angles(full: dict[str, Any]) -> list[Case]:
    def turned(values: Reals, units: str | None) -> Callable[[Path], Path]:
        stated = values if units is None else (values, {"units": units})
        return hdf5(**{**full, "exchange__theta": stated})

    radians = {"angle_unit": "radians"}
    return [
        Case("radians, no unit stated", turned(RADIANS, None), RIGHT),
        Case("radians that are stated", turned(RADIANS, "radian"), RIGHT),
        Case("radians stated as degrees", turned(RADIANS, "deg"), REFUSED),
        Case("the same, radians said", turned(RADIANS, "deg"), RIGHT, radians),
        Case("degrees stated as radians", turned(DEGREES, "rad"), REFUSED),
        Case("numbers of frames in the place of angles", turned(10.0 * DEGREES, None), REFUSED),
        Case("a third of a turn in radians, no unit", turned(RADIANS * 2 / 3, None), REFUSED),
    ]


def _values(named: dict[str, Any]) -> list[Case]:
    def values(array: Reals) -> Callable[[Path], Path]:
        return hdf5(a__p=array.astype("f4"), a__t=DEGREES)

    inner = integrals()[..., 30:66]
    sums = 255 * integrals()
    random = np.random.default_rng(7)
    beam = 5000 / (1 + np.exp((np.abs(np.arange(BINS) - CENTER) - 42) / 0.8))
    narrow = beam * np.exp(-integrals()) + random.normal(0, 3, (VIEWS, ROWS, BINS))
    known = {**named, "kind": "attenuation"}
    return [
        Case("line integrals", values(integrals()), RIGHT, named),
        Case("line integrals, noisy air", values(attenuation()), RIGHT, named),
        Case("line integrals, air at -0.05, brought to 0", values(attenuation(-0.05)), RIGHT,
             named, background=4),
        Case("sums of grey levels, in hundreds", values(sums), RIGHT, named, scale=255),
        Case("dark-corrected float counts of a beam narrower than the detector",
             values(narrow), REFUSED, named),
        Case("transmission", values(transmission()), RIGHT, named),
        Case("transmission of a beam that faded by 15 %, air brought to 1",
             values(0.85 * transmission()), RIGHT, named, background=4),
        Case("transmission in thousandths, rounded",
             hdf5(a__p=np.rint(1000 * transmission()).astype("u2"), a__t=DEGREES), REFUSED, named),
        Case("transmission, object wider than the detector", values(np.exp(-inner)), REFUSED,
             named),
        Case("line integrals that air offsets by 5", values(integrals() + 5), REFUSED, named),
        Case("the same, said to be attenuation", values(integrals() + 5), RIGHT, known,
             background=4),
        Case("line integrals of the other sign", values(-integrals()), REFUSED, named),
    ]  # fmt: skip


def _npz(data: Reals, flats: Reals) -> list[Case]:
    lines = attenuation()
    one, first = lines[:, 0], (0,)
    square = lines[np.arange(BINS), 0]
    said = {"dataset": "s", "theta": "t"}
    return [
        Case("NPZ: uint16 counts without flats", npz(projections=data, angles=RADIANS), REFUSED),
        Case("NPZ: uint16 counts and flats",
             npz(projections=data - 100, flats=flats - 100, angles=RADIANS), RIGHT),
        Case("NPZ: angles in degrees", npz(sinogram=one, angles=DEGREES), RIGHT, rows=first),
        Case("NPZ: a sinogram (bin, angle)", npz(sinogram=one.T, angles=RADIANS), RIGHT,
             rows=first),
        Case("NPZ: data, white, black and theta_deg",
             npz(data=data, white=flats, black=np.full_like(flats, 100), theta_deg=DEGREES), RIGHT),
        Case("NPZ: as many angles as bins, named", npz(s=square, t=RADIANS[:BINS]), REFUSED,
             said),
    ]  # fmt: skip


def _npy(data: Reals, flats: Reals) -> list[Case]:
    lines = attenuation()
    one, first = lines[:, 0], (0,)
    turn = {"theta": "0:180"}
    return [
        Case("NPY: uint16 counts, flats and darks, angles in degrees beside",
             npy(scan=data, flat=flats, dark=np.full_like(flats, 100), theta=DEGREES), RIGHT),
        Case("NPY: uint16 counts without flats", npy(scan=data, theta=DEGREES), REFUSED),
        Case("NPY: a sinogram and a turn", npy(scan=one), RIGHT, {**turn, "axes": "angle,bin"},
             rows=first),
        Case("NPY: a sinogram (bin, angle), angles in radians beside",
             npy(scan=np.asfortranarray(one.T), angles=RADIANS), RIGHT, rows=first),
        Case("NPY: sinograms (row, angle, bin) of big-endian numbers",
             npy(scan=np.moveaxis(lines, 1, 0).astype(">f4"), theta=DEGREES), RIGHT),
        Case("NPY: angles of another scan beside", npy(scan=lines, theta=DEGREES[:-1]), REFUSED),
        Case("NPY: flats of another scan beside",
             npy(scan=lines, flat=flats[..., 1:], theta=DEGREES), RIGHT),
        Case("NPY: no angles at all", npy(scan=lines), REFUSED),
    ]  # fmt: skip


def _mat(data: Reals) -> list[Case]:
    one, first = attenuation()[:, 0], (0,)
    said = {"dataset": "s", "theta": "t"}
    turn = {"dataset": "s", "theta": "180"}
    return [
        Case("MAT: a sinogram (bin, angle)", mat(s=one.T, t=DEGREES), RIGHT, said, rows=first),
        Case("MAT: uint16 counts without flats", mat(s=data, t=DEGREES), REFUSED, said),
        Case("MAT: a sinogram (bin, angle), angles 180", mat(s=one.T), REFUSED, turn),
        Case("the same, axes said", mat(s=one.T), RIGHT, {**turn, "axes": "bin,angle"},
             rows=first),
    ]  # fmt: skip


def _tiff(data: Reals, flats: Reals, darks: Reals) -> list[Case]:
    page, first = attenuation()[:, 0].astype("f4"), (0,)
    sinograms = attenuation().transpose(1, 0, 2).astype("f4")
    beside = {"flats": flats, "darks": darks}
    said = {"axes": "angle,bin", "theta": "180"}
    return [
        Case("TIFF: counts, flats and darks beside", tiff(data, DEGREES, **beside), RIGHT),
        Case("TIFF: counts without flats", tiff(data, DEGREES), REFUSED),
        Case("TIFF: float counts without flats", tiff(data.astype("f4"), DEGREES), REFUSED),
        Case("TIFF: one page, a sinogram", tiff(page, DEGREES), RIGHT, rows=first),
        Case("TIFF: one page, a sinogram on its side", tiff(page.T, DEGREES), RIGHT, rows=first),
        Case("TIFF: one page, a sinogram, no angles", tiff(page), REFUSED),
        Case("the same, axes and angles said", tiff(page), RIGHT, said, rows=first),
        Case("TIFF: a page for each sinogram", tiff(sinograms, DEGREES), RIGHT),
        Case("TIFF: angles.txt in radians", tiff(attenuation().astype("f4"), RADIANS), RIGHT),
    ]


def _mrc(data: Reals) -> list[Case]:
    even = (counts(uneven=0.0)[0] - 100).astype("u2")
    field = (1000 * attenuation()).astype("i2")
    thickness = {"kind": "attenuation"}
    return [
        Case("MRC: bright field", mrc(data, DEGREES), REFUSED),
        Case("the same, counts and air said", mrc(even, DEGREES), RIGHT, {"flats": "air"}),
        Case("MRC: dark field, angles in the header", mrc(field, header=DEGREES), RIGHT, thickness,
             scale=1000),
        Case("MRC: no angles", mrc(field), REFUSED, thickness),
    ]  # fmt: skip


def _bad(
    data: Reals, flats: Reals, darks: Reals, whole: dict[str, Any], full: dict[str, Any]
) -> list[Case]:
    starved = data.copy()
    random = np.random.default_rng(6)
    starved[random.random(starved.shape) < 0.01] = 90
    names = ("exchange__data_white", "exchange__data_dark")
    swapped = dict(zip(names, (darks, flats), strict=True))
    row = {name: array if array.ndim < 3 else array[:, 1:2] for name, array in full.items()}
    return [
        Case("1 % of the samples without signal", hdf5(**{**full, "exchange__data": starved}),
             RIGHT),
        Case("one row", hdf5(**row), RIGHT, rows=(1,)),
        Case("one view", hdf5(**{**full, "exchange__data": data[:1],
             "exchange__theta": DEGREES[:1]}), REFUSED),
        Case("views at one angle", hdf5(**{**full, "exchange__theta": np.full(VIEWS, 7.0)}),
             REFUSED),
        Case("flats of another size", hdf5(**{**full, names[0]: flats[..., 1:]}), REFUSED),
        Case("no values", hdf5(**{**full, "exchange__data": data[:, :0]}), REFUSED),
        Case("flats and darks swapped", hdf5(**{**full, **swapped}), REFUSED),
        Case("flats taken with a third of the exposure",
             hdf5(**{**full, names[0]: flats // 3}), REFUSED),
    ]  # fmt: skip
