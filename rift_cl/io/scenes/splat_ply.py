"""Splats in the PLY layout of 3D Gaussian splatting (Kerbl et al. 2023), which viewers read.

One element ``vertex`` of floats: x y z, nx ny nz (zero and never read, but where splats reflect
an environment light), f_dc_0 to 2, f_rest_0 to 3 (K - 1) - 1, opacity, scale_0 to 2, rot_0 to 3.
The rest of the harmonics is channel-major: all coefficients of red come before the first of green.

Splats of X-rays have a property ``log_density`` in place of ``opacity``, the natural logarithm of
the density at the peak. To a viewer of photographs their file lacks a property: it can refuse it,
but cannot show it as what it is not.

What splats have beside all that, modes, lobes and light, is in ``rift_cl.io.scenes.splat_basis``;
how they are to be drawn in ``rift_cl.io.scenes.scene_drawing``.
"""

from __future__ import annotations

from collections.abc import Iterator
from io import BufferedReader
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from rift_cl.errors import FileFormatError
from rift_cl.io.boundary import check_claim
from rift_cl.io.scenes.ply_body import read_blocks, record_runs
from rift_cl.io.scenes.ply_header import PlyHeader, read_header
from rift_cl.io.scenes.scene_drawing import SceneDrawing, read_drawing
from rift_cl.io.scenes.splat_basis import SceneBasis, light_comments, read_basis, read_light
from rift_cl.splat.rounded_places import check_rounding, distances_moved
from rift_cl.splat.settings import SplatMode

if TYPE_CHECKING:
    from rift_cl.io.scenes.splat_scene import SplatScene

Arrays = dict[str, NDArray[np.float32]]

# Numbers of spherical harmonics of degree 0 to 4.
COEFFICIENTS = (1, 4, 9, 16, 25)

_NORMALS = ("nx", "ny", "nz")
_STRENGTHS: dict[SplatMode, str] = {"light": "opacity", "xray": "log_density"}
_COMMENT = "comment X-ray splats: log_density is ln of the density at the peak, per unit of length"
_LISTED = 4


def read_ply(
    path: Path, file: BufferedReader, *, budget: int | None
) -> tuple[SplatMode, SceneBasis, SceneDrawing, Arrays]:
    """Read a scene's kind, basis, drawing and arrays from a file that is open at its beginning.

    Raises:
        FileFormatError: the file is damaged, or holds no splats, or places that float32 cannot.
        ResourceLimitError: they are larger than the budget; nothing was allocated.
    """
    header = read_header(path, file)
    mode: SplatMode = "light"
    if _STRENGTHS["xray"] in header.properties and _STRENGTHS["light"] not in header.properties:
        mode = "xray"
    basis = read_basis(path, header.comments, header.properties)
    drawing = read_drawing(path, header.comments)
    if mode == "xray" and drawing.of_light:
        raise FileFormatError(
            f"{path}: says {drawing.words!r} of X-rays, which know none; the file is damaged"
        )
    coefficients = _coefficients(path, header, mode, basis)
    header.check_size(path, file.seek(0, 2))
    longer = not all(header.floats(name) for name in "xyz")
    each = 11 + 3 * coefficients + basis.numbers + longer
    check_claim(path, "the scene", 4 * each * header.count, budget)
    arrays = _empty(header.count, coefficients, basis)
    columns = _columns(arrays, mode, basis)
    if basis.environment:
        arrays["environment"] = read_light(path, header.comments, basis.environment)
    moved = np.zeros(header.count if longer else 0, np.float32)
    start = 0
    for block in read_blocks(path, file, header):
        # A number too large for float32 becomes infinite, and is left out with the others.
        with np.errstate(over="ignore"):
            for name, column in columns.items():
                column[start : start + len(block)] = block[name]
        if longer:
            part = slice(start, start + len(block))
            places = np.stack([block[name].astype(np.float64) for name in "xyz"], axis=1)
            moved[part] = distances_moved(places, arrays["means"][part])
        start += len(block)
    placed = arrays["means"], arrays["log_scales"]
    check_rounding(str(path), moved, *placed, error=FileFormatError)
    return mode, basis, drawing, arrays


def encode_ply(scene: SplatScene) -> tuple[int, Iterator[bytes]]:
    """A scene as the bytes of a file: how many they are, and the blocks that they come in."""
    basis = SceneBasis.of(scene)
    columns = _columns(vars(scene), scene.mode, basis)
    names = list(columns)
    names[3:3] = () if basis.environment else _NORMALS
    lines = ["ply", "format binary_little_endian 1.0", f"element vertex {len(scene)}"]
    if scene.mode == "xray":
        lines.insert(2, _COMMENT)
    if scene.environment is not None:
        lines[2:2] = light_comments(scene.environment)
    drawing = SceneDrawing.of(scene)
    if not drawing.usual:
        lines.insert(2, drawing.comment)
    if not basis.plain:
        lines.insert(2, basis.comment)
    lines += [f"property float {name}" for name in names]
    header = "\n".join([*lines, "end_header", ""]).encode()
    record = np.dtype([(name, "<f4") for name in names])
    return len(header) + len(scene) * record.itemsize, _encoded(header, record, columns)


def _encoded(
    header: bytes, record: np.dtype[np.void], columns: dict[str, NDArray[np.float32]]
) -> Iterator[bytes]:
    yield header
    runs = record_runs(len(columns["x"]), record)
    block = np.zeros(runs[0].stop if runs else 0, record)
    for run in runs:
        part = block[: run.stop - run.start]
        for name, column in columns.items():
            part[name] = column[run]
        yield part.tobytes()


def scene_shapes(
    count: int, coefficients: int, basis: SceneBasis | None = None
) -> dict[str, tuple[int, ...]]:
    """The shapes of a scene's arrays by their names."""
    more = {} if basis is None else basis.shapes(count)
    return {
        "means": (count, 3),
        "log_scales": (count, 3),
        "quats": (count, 4),
        "logit_opacities": (count,),
        "sh": (count, coefficients, 3),
        **more,
    }


def _columns(
    arrays: dict[str, Any], mode: SplatMode, basis: SceneBasis
) -> dict[str, NDArray[np.float32]]:
    """Views of the arrays by the names of the properties, in the order of the file."""
    means, sh, quats = arrays["means"], arrays["sh"], arrays["quats"]
    # Coefficients of lobes are none of harmonics, and have a name of their own.
    rest = 0 if basis.linear else sh.shape[1] - 1
    columns: dict[str, NDArray[np.float32]] = dict(zip("xyz", means.T, strict=True))
    if basis.environment:
        columns |= dict(zip(_NORMALS, arrays["normals"].T, strict=True))
    columns |= {f"f_dc_{c}": sh[:, 0, c] for c in range(3)}
    columns |= {f"f_rest_{c * rest + k}": sh[:, 1 + k, c] for c in range(3) for k in range(rest)}
    columns[_STRENGTHS[mode]] = arrays["logit_opacities"]
    columns |= {f"scale_{i}": column for i, column in enumerate(arrays["log_scales"].T)}
    columns |= {f"rot_{i}": column for i, column in enumerate(quats.T)}
    return columns | basis.columns(arrays)


def _empty(count: int, coefficients: int, basis: SceneBasis) -> Arrays:
    return {
        name: np.empty(shape, np.float32)
        for name, shape in scene_shapes(count, coefficients, basis).items()
    }


def _coefficients(path: Path, header: PlyHeader, mode: SplatMode, basis: SceneBasis) -> int:
    """The number of harmonics or lobes, after a look whether every property is there."""
    rest = sum(name.startswith("f_rest_") for name in header.properties)
    if rest % 3 or 1 + rest // 3 not in COEFFICIENTS:
        raise FileFormatError(
            f"{path}: has {rest} properties f_rest, wanted 0, 9, 24, 45 or 72 (degree 0 to 4)"
        )
    if rest and basis.linear:
        raise FileFormatError(f"{path}: has both harmonics, f_rest_0.., and lobes; it is damaged")
    coefficients = basis.linear or 1 + rest // 3
    wanted = _columns(_empty(0, coefficients, basis), mode, basis)
    missing = [name for name in wanted if name not in header.properties]
    if missing:
        more = ", ..." if len(missing) > _LISTED else ""
        raise FileFormatError(
            f"{path}: lacks {', '.join(missing[:_LISTED])}{more}; it holds points or a mesh, or "
            "splats of another layout than that of 3D Gaussian splatting"
        )
    return coefficients
