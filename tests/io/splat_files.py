"""Scenes of splats for the tests, and the same as the records that other programs write."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from plyfile import PlyData, PlyElement

import rift_cl as rift

KINDS = ["binary.ply", "text.ply", "a.splat"]
ARRAYS = ("means", "log_scales", "quats", "logit_opacities", "sh")


def scene(count: int = 7, degree: int = 3) -> rift.SplatScene:
    random = np.random.default_rng([5, degree])
    return rift.SplatScene(
        means=random.normal(size=(count, 3)),
        log_scales=random.normal(-3, 1, (count, 3)),
        quats=random.normal(size=(count, 4)),
        logit_opacities=random.normal(0, 3, count),
        sh=random.normal(size=(count, (degree + 1) ** 2, 3)),
    )


def names(degree: int) -> list[str]:
    """The properties of the published layout, spelled out."""
    rest = 3 * ((degree + 1) ** 2 - 1)
    return [
        *("x", "y", "z", "nx", "ny", "nz", "f_dc_0", "f_dc_1", "f_dc_2"),
        *(f"f_rest_{i}" for i in range(rest)),
        *("opacity", "scale_0", "scale_1", "scale_2", "rot_0", "rot_1", "rot_2", "rot_3"),
    ]


def records(scene: rift.SplatScene) -> np.ndarray:
    """A scene in the published layout, made as its own trainer makes it."""
    harmonics = scene.sh.transpose(0, 2, 1)
    table = np.concatenate(
        [
            scene.means,
            np.zeros_like(scene.means),
            harmonics[:, :, 0],
            harmonics[:, :, 1:].reshape(len(scene), -1),
            scene.logit_opacities[:, None],
            scene.log_scales,
            scene.quats,
        ],
        axis=1,
    )
    kinds = [(name, "f4") for name in names(scene.degree)]
    return np.ascontiguousarray(table).view(kinds)[:, 0]


def write(path: Path, *elements: tuple[str, np.ndarray], text: bool = False, order: str = "<"):
    described = [PlyElement.describe(values, name) for name, values in elements]
    PlyData(described, text=text, byte_order=order).write(str(path))
    return path


def valid(folder: Path, kind: str, count: int = 7) -> Path:
    path = folder / kind
    if kind == "text.ply":
        return write(path, ("vertex", records(scene(count, 1))), text=True)
    scene(count, 1).save(path)
    return path


def retyped(values: np.ndarray, kinds: list[tuple[str, str]]) -> np.ndarray:
    """The same records with other types, order or extra fields, which count up from zero."""
    found = np.zeros(len(values), kinds)
    for name, _ in kinds:
        known = name in values.dtype.names
        found[name] = values[name] if known else np.arange(len(values)) % 100
    return found


def assert_same(found: rift.SplatScene, wanted: rift.SplatScene) -> None:
    """Equal to the bit."""
    for name in ARRAYS:
        a, b = getattr(found, name), getattr(wanted, name)
        assert a.dtype == np.float32 and a.shape == b.shape, name
        assert a.tobytes() == b.tobytes(), name


def sigmoid(logits: np.ndarray) -> np.ndarray:
    return 1 / (1 + np.exp(-logits.astype(np.float64)))
