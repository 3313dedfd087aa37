"""Exports of a fit, read back by programs that other people wrote: sizes, errors, pictures.

    npm install --prefix readers @playcanvas/splat-transform
    pip install gsply imagecodecs pygltflib plyfile
    python tools/check_exports.py fit --npm readers --out exports

writes every format, and reads it back: PLY with plyfile, compressed PLY, SPZ and SOG with
splat-transform (PlayCanvas; SPZ by Adobe's and Niantic's own code) and with gsply, glTF with
pygltflib, and the page's own scene out of the page. Printed for each: bytes; the largest errors of
places (scene units), logarithms of scales, rotations (degrees), opacities, first harmonics as
colours, and higher harmonics; and, of the views that were held out, the PSNR of what our renderer
draws of the splats that were read, against what it draws of the fit and against the photographs. A
reader that is not installed is left out, and said.
"""

from __future__ import annotations

import base64
import dataclasses
import importlib
import re
import subprocess
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any

import numpy as np
import tyro
from numpy.typing import NDArray

from rift_cl.cl import Device, default_device
from rift_cl.commands.export.axes import quaternions_of, turned
from rift_cl.commands.export.export import Export
from rift_cl.commands.export.settings import ExportSettings, Target
from rift_cl.commands.inputs.opened_scene import in_display_light
from rift_cl.geometry import Camera
from rift_cl.io import SplatScene, camera_at, read_view
from rift_cl.io.scenes.formats.plain import along_curve, unit_quats
from rift_cl.io.scenes.splat_activations import HARMONIC_0, logits_of, opacities_of
from rift_cl.metrics import psnr
from rift_cl.splat import Renderer

Floats = NDArray[Any]
_COLUMNS = (
    *("format", "bytes", "reader", "place", "ln scale", "turn", "opacity", "colour", "higher"),
    *("fit's pictures", "photographs"),
)
_FORMATS: tuple[Target, ...] = ("ply", "compressed-ply", "spz", "sog", "glb", "html")
# splat-transform gives all that it reads in the axes of PLY files: SPZ's half turned about x.
_HALF_TURN = np.diag([1.0, -1, -1])
_MARK = "KHR_gaussian_splatting"


@dataclass(frozen=True)
class Options:
    """Check exports.

    Args:
        fit: the folder of a fit.
        out: folder for the files.
        npm: folder in which npm installed splat-transform.
        views: cameras that pictures are compared from.
    """

    fit: Annotated[Path, tyro.conf.Positional]
    out: Path = Path("exports")
    npm: Path = Path("readers")
    views: int = 7


def main(options: Options) -> None:
    """Print the table."""
    options.out.mkdir(parents=True, exist_ok=True)
    print(f"| {' | '.join(_COLUMNS)} |")
    print(f"| :-- | --: | :-- |{' --: |' * (len(_COLUMNS) - 3)}")
    for name in _FORMATS:
        path = options.out / f"scene.{name}"
        job = Export(ExportSettings(options.fit, to=name, out=path, overwrite=True))
        for _ in job.run():
            pass
        judge = Judge(job, options.views)
        for reader, read in readers(name, path, options.npm):
            try:
                found = read()
            except (ImportError, FileNotFoundError) as error:
                print(f"| {name} | {path.stat().st_size} | {reader} is not installed ({error}) |")
                continue
            cells = " | ".join(judge.cells(found))
            print(f"| {name} | {path.stat().st_size} | {reader} | {cells} |", flush=True)


class Judge:
    """What an export should be, and pictures of the fit."""

    def __init__(self, job: Export, views: int) -> None:
        self._turn, self._page = job.turn, job.format.suffix == ".html"
        whole = turned(job.plain, job.turn)
        # Files of these keep the splats' order, the others sort them.
        self._wanted = (
            whole if job.format.suffix in (".ply", ".glb", ".html") else along_curve(whole)
        )
        device, known = default_device(), job.scene.cameras
        seen = known.test_views or known.training_views if known is not None else ()
        factor = job.scene.downscale
        self._cameras = [camera_at(view, factor) for view in seen[:views]]
        self._truths = [
            read_view(view, downscale=factor)[..., :3]
            for view in seen[:views]
            if view.image.is_file()
        ]
        self._draw = lambda scene: _drawn(device, job, scene, self._cameras)
        # Exports are in display light, whatever the fit is in.
        light = job.scene.light
        self._pictures = [in_display_light(one, light) for one in self._draw(job.scene.splats)]

    def cells(self, found: SplatScene) -> Iterator[str]:
        """The largest errors, and the PSNR."""
        wanted = self._wanted
        if self._page:
            # A page has units of its own, and ellipsoids without an order of their axes.
            found = _scaled(found, wanted)
        yield f"{np.abs(found.means - wanted.means).max():.1e}"
        scales = [np.sort(scene.log_scales, axis=1) for scene in (found, wanted)]
        yield f"{np.abs(scales[0] - scales[1]).max():.1e}"
        degrees = _turns(unit_quats(found), unit_quats(wanted)).max()
        yield "–" if self._page else f"{degrees:.2f}"
        opacities = [opacities_of(scene.logit_opacities) for scene in (found, wanted)]
        yield f"{np.abs(opacities[0] - opacities[1]).max():.1e}"
        yield f"{HARMONIC_0 * np.abs(found.sh[:, 0] - wanted.sh[:, 0]).max():.1e}"
        if found.degree < wanted.degree:
            yield "lost"
        else:
            yield f"{np.abs(found.sh[:, 1:] - wanted.sh[:, 1:]).max(initial=0):.1e}"
        pictures = self._draw(turned(found, self._turn.T))
        for others in (self._pictures, self._truths):
            scores = [psnr(a, b) for a, b in zip(pictures, others, strict=False)]
            yield f"{np.mean(scores):.1f}" if scores else "–"


def _turns(found: Floats, wanted: Floats) -> Floats:
    """Degrees (N,) between ellipsoids, which half turns about their own axes leave as they are."""
    w, x, y, z = found.T
    same = [(w, x, y, z), (-x, w, z, -y), (-y, -z, w, x), (-z, y, -x, w)]
    cosines = [np.abs(np.einsum("in,ni->n", np.array(quats), wanted)) for quats in same]
    return np.degrees(2 * np.arccos(np.clip(np.max(cosines, axis=0), 0, 1)))


def _scaled(found: SplatScene, wanted: SplatScene) -> SplatScene:
    unit = np.linalg.norm(found.means.astype(float)) / np.linalg.norm(wanted.means.astype(float))
    return dataclasses.replace(
        found, means=found.means / unit, log_scales=found.log_scales - np.log(unit)
    )


def _drawn(
    device: Device, job: Export, scene: SplatScene, cameras: list[Camera]
) -> list[NDArray[np.float32]]:
    settings = dataclasses.replace(
        job.scene.rendering, activation=scene.activation, angular=scene.angular
    )
    renderer, splats = Renderer(settings, device=device), scene.upload(device)
    return [device.get(renderer.forward(splats, camera).image).clip(0, 1) for camera in cameras]


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


if __name__ == "__main__":
    main(tyro.cli(Options))
