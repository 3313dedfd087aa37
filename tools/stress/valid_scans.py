"""Small valid scans, one of each kind of file that is to be damaged."""

from __future__ import annotations

import io
import struct
import tempfile
import zlib
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import h5py
import mrcfile
import numpy as np
import OpenImageIO
import scipy.io

_VIEWS, _ROWS, _BINS = 6, 20, 24
_HEADER, _TEXT = 128, 116
_PACKED = 15


@dataclass(frozen=True)
class Kind:
    """A kind of file.

    Args:
        suffix: how its name ends.
        make: gives a valid one.
        pack: what is done to it after the damage.
        read: what reads it; see ``stress_readers``.
        around: makes the folder that the file is one of, where it is read with others.
        inside: its name in that folder.
        opened: what of that folder is read; the folder itself if empty.
    """

    suffix: str
    make: Callable[[], bytes]
    pack: Callable[[bytes], bytes] = bytes
    read: str = "scan"
    around: Callable[[Path], object] | None = None
    inside: str = ""
    opened: str = ""

    @classmethod
    def of_folder(
        cls, around: Callable[[Path], object], inside: str, opened: str = "", read: str = "scan"
    ) -> Kind:
        """A kind of file that is read with others; the arguments are those of the class."""

        def make() -> bytes:
            with tempfile.TemporaryDirectory() as folder:
                around(Path(folder))
                return Path(folder, inside).read_bytes()

        suffix = Path(inside).suffix
        return cls(suffix, make, read=read, around=around, inside=inside, opened=opened)

    def put(self, folder: Path, content: bytes) -> Path:
        """Write a file into its kind's folder, which the first one makes; what is to be read."""
        first = not folder.exists()
        folder.mkdir(exist_ok=True)
        if self.around is None:
            path = folder / f"file{self.suffix}"
            path.write_bytes(content)
            return path
        if first:
            self.around(folder)
        (folder / self.inside).write_bytes(content)
        return folder / self.opened


def _frames(count: int = _VIEWS, dtype: str = "u2") -> np.ndarray:
    values = np.arange(count * _ROWS * _BINS).reshape(count, _ROWS, _BINS)
    return (values % 251).astype(dtype)


def _tiff(dtype: str, tile: int = 0, **attributes: str) -> bytes:
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder, "a.tif")
        output = OpenImageIO.ImageOutput.create("tiff")
        kind = {"u2": "uint16", "u1": "uint8", "f4": "float", "f8": "double"}[dtype]
        for page, frame in enumerate(_frames(dtype=dtype)):
            spec = OpenImageIO.ImageSpec(_BINS, _ROWS, 1, kind)
            spec.attribute("tiff:write_exif", 0)
            spec.attribute("tiff:RowsPerStrip", 8)
            # OpenImageIO writes the time otherwise; the same seed is to give the same files.
            spec.attribute("DateTime", "")
            for name, value in attributes.items():
                spec.attribute(name, value)
            spec.tile_width = spec.tile_height = tile
            mode = "AppendSubimage" if page else "Create"
            if not output.open(str(path), spec, mode) or not output.write_image(frame[..., None]):
                raise OSError(output.geterror())
        output.close()
        return path.read_bytes()


def _mat5(packed: bool) -> bytes:
    parameters = {
        "angles": np.arange(_VIEWS) * 30.0,
        "distanceSourceOrigin": 400.0,
        "distanceSourceDetector": 500.0,
        "distanceUnit": "mm",
        "pixelSizePost": 0.2,
        "binning": np.array(["1x1", 2.0], dtype=object),
    }
    scan = {"type": "2d", "sinogram": _frames()[:, 0].astype(float), "parameters": parameters}
    file = io.BytesIO()
    scipy.io.savemat(file, {"CtDataFull": scan}, do_compression=packed)
    # SciPy writes the time into the text at the head; the same seed is to give the same files.
    return b"MATLAB 5.0 MAT-file".ljust(_TEXT) + file.getvalue()[_TEXT:]


def _mat73() -> bytes:
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder, "a.mat")
        with h5py.File(path, "w", userblock_size=512) as file:
            scan = file.create_group("CtDataFull")
            scan["sinogram"] = _frames()[:, 0].astype(float).T
            scan["parameters/angles"] = np.arange(_VIEWS)[:, None] * 30.0
            for name, value in (("Origin", 400.0), ("Detector", 500.0)):
                scan[f"parameters/distanceSource{name}"] = np.full((1, 1), value)
            scan["parameters/pixelSizePost"] = np.full((1, 1), 0.2)
            scan["parameters/distanceUnit"] = np.array([[109], [109]], np.uint16)
            scan["parameters/distanceUnit"].attrs["MATLAB_class"] = np.bytes_("char")
        content = bytearray(path.read_bytes())
        content[:128] = b"MATLAB 7.3 MAT-file".ljust(124) + b"\x00\x02IM"
        return bytes(content)


def _repacked(content: bytes) -> bytes:
    """Pack what follows the header into one element, with a size that fits."""
    packed = zlib.compress(content[_HEADER:])
    return content[:_HEADER] + struct.pack("<II", _PACKED, len(packed)) + packed


def _data_exchange() -> bytes:
    file = io.BytesIO()
    with h5py.File(file, "w") as scan:
        scan.create_dataset("exchange/data", data=_frames(), chunks=(1, 8, 8), compression="gzip")
        scan["exchange/data_white"], scan["exchange/data_dark"] = _frames(2), _frames(3)
        scan["exchange/theta"] = np.arange(_VIEWS) * 30.0
        scan["exchange/theta"].attrs["units"] = "degrees"
    return file.getvalue()


def _nxtomo() -> bytes:
    file = io.BytesIO()
    with h5py.File(file, "w") as scan:
        entry = scan.create_group("entry/tomo")
        entry["instrument/detector/data"] = _frames(_VIEWS + 2)
        entry["instrument/detector/image_key"] = [1, 2] + _VIEWS * [0]
        entry["instrument/detector/x_pixel_size"] = 3.5
        entry["sample/rotation_angle"] = np.arange(_VIEWS + 2) * 30.0
        scan["link"] = h5py.SoftLink("/entry")
    return file.getvalue()


def _npz() -> bytes:
    file = io.BytesIO()
    frames = {"projections": _frames(), "flats": _frames(2) + 300, "darks": _frames(1)}
    np.savez_compressed(file, angles=np.arange(_VIEWS) * 0.5, pitch=0.2, **frames)
    return file.getvalue()


def _npy_files(folder: Path) -> None:
    np.save(folder / "proj.npy", _frames())
    np.save(folder / "flats.npy", _frames(2) + 300)
    np.save(folder / "theta.npy", np.arange(_VIEWS) * 30.0)


def _mrc() -> bytes:
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder, "a.mrc")
        with mrcfile.new(path) as file:
            file.set_data(_frames())
            tilts = b"".join(struct.pack("<h", 1000 * view) for view in range(_VIEWS))
            file.set_extended_header(np.frombuffer(tilts, "V1"))
            file.header.exttyp = b"SERI"
            extra = bytearray(bytes(file.header.extra2))
            extra[16:20] = struct.pack("<2h", 2, 1)
            file.header.extra2 = np.void(bytes(extra))
        content = bytearray(path.read_bytes())
        # The library writes the time among the labels; the same seed is to give the same files.
        content[224:1024] = bytes(800)
        return bytes(content)


SCANS = {
    "TIFF strips": Kind(".tif", lambda: _tiff("u2", compression="none")),
    "TIFF deflate": Kind(".tif", lambda: _tiff("f4", compression="zip")),
    "TIFF tiles, LZW": Kind(".tif", lambda: _tiff("u1", 16, compression="lzw")),
    "TIFF float64": Kind(".tif", lambda: _tiff("f8", compression="zip")),
    "MAT 5": Kind(".mat", lambda: _mat5(packed=False)),
    "MAT 5 packed": Kind(".mat", lambda: _mat5(packed=True)),
    "MAT 5 inside": Kind(".mat", lambda: _mat5(packed=False), _repacked),
    "MAT 7.3": Kind(".mat", _mat73),
    "Data Exchange": Kind(".h5", _data_exchange),
    "NXtomo": Kind(".nxs", _nxtomo),
    "NPZ": Kind(".npz", _npz),
    "NPY": Kind.of_folder(_npy_files, "proj.npy", "proj.npy"),
    "NPY flats": Kind.of_folder(_npy_files, "flats.npy", "proj.npy"),
    "NPY angles": Kind.of_folder(_npy_files, "theta.npy", "proj.npy"),
    "MRC": Kind(".mrc", _mrc),
}
