"""Small scans as scanners write them: texts beside images."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from tiff_files import write_series

VIEWS, ROWS, BINS = 12, 6, 10

NIKON = """[XTekCT]
Name=part
InputFolderName={folder}
SrcToObject=50
SrcToDetector=200
DetectorPixelsX={bins}
DetectorPixelsY={rows}
DetectorPixelSizeX=0.2
DetectorPixelSizeY=0.25
CentreOfRotationTop={top}
CentreOfRotationBottom={bottom}
WhiteLevel=60000
Projections={views}
InitialAngle=3
AngularStep=30
[Xrays]
XraykV=160
"""

SKYSCAN = """[System]
Scanner=SkyScan1173
Camera Pixel Size (um)=  50.0
[Acquisition]
Filename Prefix=bone_
Number of Files=  12
Number of Rows=  6
Number of Columns=  10
Camera binning=1x1
Optical Axis (line)=   2
Object to Source (mm)=50
Camera to Source (mm)=200
Image Pixel Size (um)=12.5
Reference Intensity=58000
Rotation Step (deg)=30
Rotation Direction=CC
"""


def counts() -> np.ndarray:
    """Counts of an object in the middle of the detector, 60000 in air."""
    images = np.full((VIEWS, ROWS, BINS), 59000, np.uint16)
    images[:, :, 3:7] = 20000 + 100 * np.arange(VIEWS, dtype=np.uint16)[:, None, None]
    return images


def nikon(folder: Path, **fields: object) -> Path:
    """A folder of radiographs with the text; the path of the text."""
    known = {"top": 0, "bottom": 0, "views": VIEWS, "rows": ROWS, "bins": BINS, "folder": ""}
    write_series(folder, "part_{:04d}.tif", list(counts()))
    path = folder / "part.xtekct"
    path.write_text(NIKON.format(**{**known, **fields}))
    return path


def skyscan(folder: Path, text: str = SKYSCAN) -> Path:
    """A folder of projections with the log; the path of the log."""
    write_series(folder, "bone_{:08d}.tif", list(counts()))
    write_series(folder, "bone__arc{:01d}.tif", [counts()[0, :4]])
    path = folder / "bone_.log"
    path.write_text(text)
    return path


def described(folder: Path, lines: str) -> Path:
    """Images in a folder of their own, and our file beside it."""
    write_series(folder / "images", "{:04d}.tif", list(counts()))
    path = folder / "geometry.yaml"
    path.write_text(f"projections: images\n{lines}\n")
    return path
