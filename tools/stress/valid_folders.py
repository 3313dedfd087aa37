"""Small valid folders, one file of which is to be damaged: stores, models, scans with a text."""

from __future__ import annotations

import json
import struct
from functools import partial
from pathlib import Path

import numpy as np
import tifffile
import zarr

from rift_cl.commands.reconstruct.kept_slabs import SlabFolder
from stress.valid_scans import Kind

VIEWS, ROWS, BINS = 12, 6, 10
SLABS = (4, 5, 6)
_ZARR_3 = zarr.__version__.startswith("3")

_NIKON = f"""[XTekCT]
Name=part
SrcToObject=50
SrcToDetector=200
DetectorPixelsX={BINS}
DetectorPixelsY={ROWS}
DetectorPixelSizeX=0.2
DetectorPixelSizeY=0.25
CentreOfRotationTop=0
CentreOfRotationBottom=0
WhiteLevel=60000
Projections={VIEWS}
InitialAngle=3
AngularStep=30
"""
_SKYSCAN = f"""[System]
Scanner=SkyScan1173
Camera Pixel Size (um)=  50.0
[Acquisition]
Filename Prefix=bone_
Number of Files=  {VIEWS}
Number of Rows=  {ROWS}
Number of Columns=  {BINS}
Camera binning=1x1
Optical Axis (line)=   2
Object to Source (mm)=50
Camera to Source (mm)=200
Image Pixel Size (um)=12.5
Reference Intensity=58000
Rotation Step (deg)=30
Rotation Direction=CC
"""
_OURS = """projections: images
unit: mm
source_to_axis: 50
source_to_detector: 200
pitch: [0.25, 0.2]
angles: 0:360
white: 60000
"""
_RTK = """projections: images
unit: mm
pitch: [0.25, 0.2]
geometry: rtk.xml
"""
_VECTORS = _RTK.replace("rtk.xml", "vectors.geom")
_CAMERAS = "7 PINHOLE 12 8 20 21 6.5 4.25\n"
_IMAGES = "".join(f"{n + 1} 1 0 0 0 {n} 0 4 7 {n}.png\n1.5 2.5 -1\n" for n in range(3))
_POINTS = "".join(f"{n} {n} 1 2 255 0 9 0.5 1 0\n" for n in range(4))


def _frames(folder: Path, name: str, *, counts: bool = True) -> None:
    folder.mkdir(exist_ok=True)
    for view in range(VIEWS):
        frame = np.full((ROWS, BINS), 59000, np.uint16)
        frame[:, 3:7] = 20000 + 100 * view
        integrals = -np.log(frame.astype(np.float32) / 59000)
        tifffile.imwrite(folder / name.format(view), frame if counts else integrals)


def _nikon(folder: Path) -> None:
    _frames(folder, "part_{:04d}.tif")
    (folder / "part.xtekct").write_text(_NIKON)


def _skyscan(folder: Path) -> None:
    _frames(folder, "bone_{:08d}.tif")
    (folder / "bone_.log").write_text(_SKYSCAN)


def _described(text: str, folder: Path) -> None:
    _frames(folder / "images", "{:04d}.tif", counts="white" in text)
    (folder / "geometry.yaml").write_text(text)
    angles = [f"<Projection><GantryAngle>{30 * n}</GantryAngle></Projection>" for n in range(VIEWS)]
    lengths = "<SourceToIsocenterDistance>50</SourceToIsocenterDistance>"
    lengths += "<SourceToDetectorDistance>200</SourceToDetectorDistance>"
    body = f"<RTKThreeDCircularGeometry>{lengths}{''.join(angles)}</RTKThreeDCircularGeometry>"
    (folder / "rtk.xml").write_text(f"<?xml version='1.0'?>{body}")
    a = 2 * np.pi * np.arange(VIEWS) / VIEWS
    outward, none = np.stack([np.cos(a), np.sin(a), 0 * a], 1), 0 * a
    across = 0.2 * np.stack([-np.sin(a), np.cos(a), none], 1)
    down = np.stack([none, none, none - 0.25], 1)
    np.savetxt(folder / "vectors.geom", np.hstack([-50 * outward, 150 * outward, across, down]))


def _zarr(version: int, folder: Path) -> None:
    path = folder / "a.zarr"
    path.mkdir()
    group = {"zarr_format": version, **({"node_type": "group"} if version == 3 else {})}
    (path / ("zarr.json" if version == 3 else ".zgroup")).write_text(json.dumps(group))
    frames = np.arange(VIEWS * ROWS * BINS).reshape(VIEWS, ROWS, BINS) % 251
    # Air at the ends of the detector: these are line integrals.
    edge = (np.arange(BINS) > 1) & (np.arange(BINS) < BINS - 2)
    arrays = {"projections": (frames / 100 * edge).astype("f4"), "angles": np.arange(VIEWS) * 0.2}
    for name, values in arrays.items():
        given = {"shape": values.shape, "dtype": values.dtype, "chunks": values.shape}
        given |= {"zarr_format": version} if _ZARR_3 else {}
        zarr.open_array(str(path / name), mode="w", **given)[...] = values


def _model_text(folder: Path) -> None:
    (folder / "cameras.txt").write_text(_CAMERAS)
    (folder / "images.txt").write_text(_IMAGES)
    (folder / "points3D.txt").write_text(_POINTS)


def _model_binary(folder: Path) -> None:
    camera = struct.pack("<QIiQQ4d", 1, 7, 1, 12, 8, 20, 21, 6.5, 4.25)
    images, points = struct.pack("<Q", 3), struct.pack("<Q", 4)
    for n in range(3):
        images += struct.pack("<I7dI", n + 1, 1, 0, 0, 0, n, 0, 4, 7)
        images += f"{n}.png".encode() + b"\0" + struct.pack("<Q2dQ", 1, 1.5, 2.5, 2**64 - 1)
    for n in range(4):
        points += struct.pack("<Q3d3BdQ2i", n, n, 1, 2, 255, 0, 9, 0.5, 1, 1, 0)
    (folder / "cameras.bin").write_bytes(camera)
    (folder / "images.bin").write_bytes(images)
    (folder / "points3D.bin").write_bytes(points)


def _slabs(folder: Path) -> None:
    kept = SlabFolder(folder, SLABS)
    kept.begin({"rows": "a", "axis": "2.5", "tilt of the axis": "0"}, {"error": 0.1})
    for first in (0, 2):
        kept.path.joinpath(f"{first:05d}-{first + 2:05d}.npy").write_bytes(b"")
        np.save(kept.path / f"{first:05d}-{first + 2:05d}.npy", np.zeros((2, 5, 6), np.float32))


_MODELS = {
    f"COLMAP {name}": Kind.of_folder(around, name, read="capture")
    for around, suffix in ((_model_binary, "bin"), (_model_text, "txt"))
    for name in (f"cameras.{suffix}", f"images.{suffix}", f"points3D.{suffix}")
}
FOLDERS = {
    **_MODELS,
    "Nikon text": Kind.of_folder(_nikon, "part.xtekct", "part.xtekct"),
    "SkyScan text": Kind.of_folder(_skyscan, "bone_.log", "bone_.log"),
    "our geometry": Kind.of_folder(partial(_described, _OURS), "geometry.yaml", "geometry.yaml"),
    "RTK geometry": Kind.of_folder(partial(_described, _RTK), "rtk.xml", "geometry.yaml"),
    "vectors": Kind.of_folder(partial(_described, _VECTORS), "vectors.geom", "geometry.yaml"),
    "Zarr 2 header": Kind.of_folder(partial(_zarr, 2), "a.zarr/projections/.zarray", "a.zarr"),
    "Zarr 2 chunk": Kind.of_folder(partial(_zarr, 2), "a.zarr/projections/0.0.0", "a.zarr"),
    "kept slab": Kind.of_folder(_slabs, "00000-00002.npy", read="slabs"),
    "record of slabs": Kind.of_folder(_slabs, "run.json", read="slabs"),
}
if _ZARR_3:
    FOLDERS |= {
        "Zarr 3 header": Kind.of_folder(
            partial(_zarr, 3), "a.zarr/projections/zarr.json", "a.zarr"
        ),
        "Zarr 3 chunk": Kind.of_folder(partial(_zarr, 3), "a.zarr/projections/c/0/0/0", "a.zarr"),
    }
