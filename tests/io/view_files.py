"""Views of pictures that the tests write, and the curve of sRGB in float64."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import OpenImageIO

from rift_cl.geometry.camera import Camera
from rift_cl.geometry.lens_distortion import Lens
from rift_cl.io import View

HEIGHT, WIDTH = 60, 80
K = np.array([[70.0, 0, 41.5], [0, 72.0, 28.0], [0, 0, 1]])


def view_of(image: Path, mask: Path | None = None, lens: Lens | None = None) -> View:
    spec = OpenImageIO.ImageInput.open(str(image)).spec()
    return View("a", Camera((spec.height, spec.width), K, np.eye(4)), image, mask, lens)


def store(path: Path, pixels: np.ndarray, kind: str, **attributes: object) -> Path:
    """Write numbers with OpenImageIO itself, so that any type, alpha and EXIF can be had."""
    spec = OpenImageIO.ImageSpec(pixels.shape[1], pixels.shape[0], pixels.shape[2], kind)
    for name, value in attributes.items():
        spec.attribute(name, value)
    output = OpenImageIO.ImageOutput.create(str(path))
    assert output.open(str(path), spec) and output.write_image(pixels) and output.close()
    return path


def linear(codes: np.ndarray) -> np.ndarray:
    """The curve of sRGB in float64."""
    codes = np.asarray(codes, np.float64)
    return np.where(codes <= 0.04045, codes / 12.92, ((codes + 0.055) / 1.055) ** 2.4)


def display(light: np.ndarray) -> np.ndarray:
    light = np.asarray(light, np.float64)
    return np.where(light <= 0.0031308, light * 12.92, 1.055 * light ** (1 / 2.4) - 0.055)
