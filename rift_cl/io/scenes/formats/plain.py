"""What every encoder needs of plain splats: unit quaternions, opacities, an order in space.

Splats are put along Morton's curve: neighbours in the file are then neighbours in space, so that a
chunk of them spans little and compresses well. The order of splats has no meaning to a viewer, who
sorts them by depth.
"""

from __future__ import annotations

import dataclasses

import numpy as np
from numpy.typing import NDArray

from rift_cl.errors import InputError
from rift_cl.io.scenes.splat_basis import SceneBasis
from rift_cl.io.scenes.splat_scene import SplatScene

Floats = NDArray[np.float64]

# Bits of a cell's number along each axis.
_BITS = 21
# Masks and shifts that spread 21 bits so that two free ones follow each.
_SPREAD = (
    (32, 0x1F00000000FFFF),
    (16, 0x1F0000FF0000FF),
    (8, 0x100F00F00F00F00F),
    (4, 0x10C30C30C30C30C3),
    (2, 0x1249249249249249),
)


def check_plain(scene: SplatScene, degree: int) -> None:
    """Check that a format can hold the scene.

    Raises:
        InputError: it holds no splats, densities, modes, lobes, an activation, linear light, or
            harmonics above ``degree``.
    """
    if scene.mode == "xray":
        raise InputError("the scene holds densities of X-rays, which no viewer of splats draws")
    if not len(scene):
        raise InputError("the scene holds no splats, there is nothing to write")
    if not SceneBasis.of(scene).plain:
        raise InputError(f"the format holds no {SceneBasis.of(scene).named}: convert it first")
    if scene.light != "display":
        raise InputError(f"the format holds no light {scene.light}: convert it first")
    if scene.degree > degree:
        raise InputError(f"the format holds harmonics to degree {degree}, not {scene.degree}")


def rows_of(scene: SplatScene, rows: NDArray[np.intp]) -> SplatScene:
    """Some of the splats of a plain scene, in this order."""
    names = ("means", "log_scales", "quats", "logit_opacities", "sh")
    return dataclasses.replace(scene, **{name: getattr(scene, name)[rows] for name in names})


def unit_quats(scene: SplatScene) -> Floats:
    """(N, 4) rotations (w, x, y, z) of length 1 whose largest component is positive."""
    quats = scene.quats.astype(np.float64)
    lengths = np.linalg.norm(quats, axis=1, keepdims=True)
    quats = np.where(lengths > 0, quats / np.where(lengths > 0, lengths, 1), [1.0, 0, 0, 0])
    largest = np.take_along_axis(quats, np.abs(quats).argmax(1)[:, None], 1)
    return np.asarray(quats * np.where(largest < 0, -1, 1))


def smallest_three(quats: Floats) -> tuple[NDArray[np.intp], Floats]:
    """The number of the largest component (N,), and the others (N, 3) in their order."""
    largest = np.abs(quats).argmax(1)
    others = np.array([[k for k in range(4) if k != one] for one in range(4)])[largest]
    return largest, np.take_along_axis(quats, others, 1)


def along_curve(scene: SplatScene) -> SplatScene:
    """The same splats in the order of Morton's curve."""
    means = scene.means.astype(np.float64)
    low, high = means.min(0), means.max(0)
    span = np.where(high > low, high - low, 1)
    cells = ((means - low) / span * (2**_BITS - 1)).astype(np.uint64)
    code = np.zeros(len(scene), np.uint64)
    for axis in range(3):
        code |= _spread(cells[:, axis]) << np.uint64(axis)
    return rows_of(scene, np.argsort(code, kind="stable"))


def _spread(values: NDArray[np.uint64]) -> NDArray[np.uint64]:
    for shift, mask in _SPREAD:
        values = (values | values << np.uint64(shift)) & np.uint64(mask)
    return values
