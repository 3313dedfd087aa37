"""What programs of other people read of exported splats, as scenes; see ``check_exports.py``."""

from __future__ import annotations

import base64
import importlib
import re
import subprocess
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rift_cl.commands.export.axes import quaternions_of, turned
from rift_cl.io import SplatScene
from rift_cl.io.scenes.splat_activations import HARMONIC_0, logits_of

Floats = NDArray[Any]
# splat-transform gives all that it reads in the axes of PLY files: SPZ's half turned about x.
_HALF_TURN = np.diag([1.0, -1, -1])
_MARK = "KHR_gaussian_splatting"


def readers(name: str, path: Path, npm: Path) -> list[tuple[str, Callable[[], SplatScene]]]:
    """Who reads a format, and how; each raises what it raises where it is not installed."""
    if name == "ply":
        return [("plyfile", lambda: _from_ply(path))]
    if name == "glb":
        return [("pygltflib", lambda: _from_glb(path))]
    if name == "html":
        return [("the page's own scene", lambda: _from_page(path))]
    return [
        ("splat-transform", lambda: _transformed(path, name, npm)),
        ("gsply", lambda: _from_gsply(path, name)),
    ]


def _transformed(path: Path, name: str, npm: Path) -> SplatScene:
    """What splat-transform reads, by way of a PLY file that it writes."""
    program = npm / "node_modules/@playcanvas/splat-transform/bin/cli.mjs"
    if not program.is_file():
        raise FileNotFoundError(program)
    # It knows formats by their names' endings.
    given = path.with_name("given" + {"compressed-ply": ".compressed.ply"}.get(name, f".{name}"))
    given.write_bytes(path.read_bytes())
    back = path.with_name("back.ply")
    command = ["node", str(program), "-q", "-w", str(given), str(back)]
    subprocess.run(command, check=True, capture_output=True)
    scene = _from_ply(back)
    return turned(scene, _HALF_TURN) if name == "spz" else scene


def _from_ply(path: Path) -> SplatScene:
    vertex = importlib.import_module("plyfile").PlyData.read(str(path))["vertex"]
    names = [prop.name for prop in vertex.properties]
    rest = sum(name.startswith("f_rest_") for name in names) // 3

    def rows(*wanted: str) -> Floats:
        return np.column_stack([vertex[name] for name in wanted])

    first = rows("f_dc_0", "f_dc_1", "f_dc_2")[:, None]
    higher = [
        np.stack([vertex[f"f_rest_{c * rest + k}"] for c in range(3)], 1) for k in range(rest)
    ]
    return _scene(
        rows("x", "y", "z"),
        rows("scale_0", "scale_1", "scale_2"),
        rows("rot_0", "rot_1", "rot_2", "rot_3"),
        vertex["opacity"],
        np.concatenate([first, *(one[:, None] for one in higher)], axis=1),
    )


def _from_gsply(path: Path, name: str) -> SplatScene:
    gsply = importlib.import_module("gsply")
    if name == "sog":
        data = importlib.import_module("gsply.sog_reader").sogread(str(path))
    else:
        data = (gsply.read_spz if name == "spz" else gsply.plyread)(str(path))
    higher = np.zeros((len(data.means), 0, 3)) if data.shN is None else data.shN
    sh = np.concatenate([np.asarray(data.sh0)[:, None], higher], axis=1)
    return _scene(data.means, data.scales, data.quats, np.ravel(data.opacities), sh)


def _from_glb(path: Path) -> SplatScene:
    file = importlib.import_module("pygltflib").GLTF2().load(str(path))
    primitive, blob = file.meshes[0].primitives[0], file.binary_blob()
    attributes = vars(primitive.attributes)

    def rows(name: str) -> Floats:
        accessor = file.accessors[attributes[name]]
        view = file.bufferViews[accessor.bufferView]
        width = {"SCALAR": 1, "VEC3": 3, "VEC4": 4}[accessor.type]
        values = np.frombuffer(blob, "<f4", accessor.count * width, view.byteOffset)
        return values.reshape(-1, width)

    names = [f"{_MARK}:SH_DEGREE_{d}_COEF_{m}" for d in range(4) for m in range(2 * d + 1)]
    return _scene(
        rows("POSITION"),
        np.log(rows(f"{_MARK}:SCALE")),
        np.roll(rows(f"{_MARK}:ROTATION"), 1, axis=1),
        logits_of(rows(f"{_MARK}:OPACITY")[:, 0]),
        np.stack([rows(name) for name in names if name in attributes], axis=1),
    )


def _from_page(path: Path) -> SplatScene:
    """The splats of a page as viser packs them: places, halves of covariances, four bytes."""
    packed = re.search(r'__VISER_EMBED_DATA__="([^"]*)"', path.read_text(encoding="utf-8"))
    assert packed is not None
    inner = importlib.import_module("zstandard").ZstdDecompressor()
    plain = inner.decompress(base64.b64decode(packed[1])[8:], max_output_size=1 << 32)
    # The one large buffer is the splats': eight words each, at the end.
    length = int.from_bytes(plain[:8], "little")
    record = importlib.import_module("msgspec.msgpack").decode(plain[8 : 8 + length])
    count = max(record["binaryBufferLengths"]) // 32
    table = np.frombuffer(plain, "<u4", 8 * count, len(plain) - 32 * count).reshape(-1, 8)
    halves = np.ascontiguousarray(table[:, 4:7]).view("<f2").astype(float)
    spread = halves[:, [0, 1, 2, 1, 3, 4, 2, 4, 5]].reshape(-1, 3, 3)
    values, vectors = np.linalg.eigh(spread)
    vectors[:, :, 0] *= np.linalg.det(vectors)[:, None]
    colors = np.ascontiguousarray(table[:, 7]).view("u1").reshape(-1, 4) / 255
    return _scene(
        np.ascontiguousarray(table[:, :3]).view("<f4"),
        0.5 * np.log(np.maximum(values, 1e-12)),
        quaternions_of(vectors),
        logits_of(colors[:, 3]),
        ((colors[:, None, :3] - 0.5) / HARMONIC_0),
    )


def _scene(means: Floats, scales: Floats, quats: Floats, logits: Floats, sh: Floats) -> SplatScene:
    """A scene of what was read; opacities of 0 and 1 come as infinite logits."""
    return SplatScene(means, scales, quats, np.clip(logits, -20, 20), np.asarray(sh, np.float32))
