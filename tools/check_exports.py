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

import dataclasses
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any

import numpy as np
import tyro
from numpy.typing import NDArray

from export_readers import readers
from rift_cl.cl import Device, default_device
from rift_cl.commands.export.axes import turned
from rift_cl.commands.export.export import Export
from rift_cl.commands.export.settings import ExportSettings, Target
from rift_cl.commands.inputs.opened_scene import in_display_light
from rift_cl.geometry import Camera
from rift_cl.io import SplatScene, camera_at, read_view
from rift_cl.io.scenes.formats.plain import along_curve, unit_quats
from rift_cl.io.scenes.splat_activations import HARMONIC_0, opacities_of
from rift_cl.metrics import psnr
from rift_cl.splat import Renderer

Floats = NDArray[Any]
_COLUMNS = (
    *("format", "bytes", "reader", "place", "ln scale", "turn", "opacity", "colour", "higher"),
    *("fit's pictures", "photographs"),
)
_FORMATS: tuple[Target, ...] = ("ply", "compressed-ply", "spz", "sog", "glb", "html")


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


if __name__ == "__main__":
    main(tyro.cli(Options))
