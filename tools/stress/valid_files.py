"""Small valid files that are no scans: pictures, splats, points, cameras, lenses, volumes, runs."""

from __future__ import annotations

import io
import json
import runpy
import tempfile
import zipfile
from collections.abc import Callable
from functools import partial
from importlib.util import find_spec
from pathlib import Path

import numpy as np

from rift_cl.io import open_volume, write_json
from rift_cl.io.captures.point_cloud import write_point_cloud
from rift_cl.io.checkpoint import Checkpoint, save_checkpoint
from rift_cl.io.images.image import write_png
from rift_cl.io.images.pixels import write_pixels
from rift_cl.io.scenes.formats.spz import encode_spz
from rift_cl.io.scenes.splat_scene import SplatScene
from rift_cl.sample.stock_lenses import stock_lens
from stress.valid_folders import FOLDERS
from stress.valid_scans import Kind

_SPLATS = 40


def _written(name: str, write: Callable[[Path], object]) -> bytes:
    """What a function writes under a name."""
    with tempfile.TemporaryDirectory() as folder:
        write(Path(folder, name))
        return Path(folder, name).read_bytes()


def _picture() -> np.ndarray:
    return (np.arange(12 * 16 * 3).reshape(12, 16, 3) % 251 / 250).astype(np.float32)


def _save_png(path: Path) -> None:
    write_png(path, _picture())


def _pixels(format: str, name: str) -> bytes:
    return _written(name, lambda path: write_pixels(path, _picture(), format=format, attributes={}))


def _splats(name: str) -> bytes:
    random = np.random.default_rng(0)
    scene = SplatScene(
        means=random.normal(size=(_SPLATS, 3)),
        log_scales=np.full((_SPLATS, 3), -2.0),
        quats=np.tile([1.0, 0, 0, 0], (_SPLATS, 1)),
        logit_opacities=np.full(_SPLATS, 1.0),
        sh=random.normal(size=(_SPLATS, 1, 3)),
    )
    if name.endswith(".spz"):
        return encode_spz(scene)
    return _written(name, scene.save)


def _points() -> bytes:
    points = np.arange(60.0).reshape(20, 3)
    return _written("a.ply", lambda path: write_point_cloud(path, points, points / 60))


def _transforms() -> bytes:
    pose = np.eye(4).tolist()
    frames = [{"file_path": f"{n}.png", "transform_matrix": pose} for n in range(4)]
    lens = {"fl_x": 50.0, "fl_y": 50, "cx": 8, "cy": 6, "w": 16, "h": 12, "k1": 0.01}
    return json.dumps({**lens, "frames": frames}).encode()


def _camera() -> bytes:
    ranges = {"f_number": [4, 22]}
    camera = {"name": "a", "focal_length": 50, "f_number": 8, "pixel_um": 5, "size": [60, 40]}
    return json.dumps({"cameras": [{**camera, "cost": 2, "ranges": ranges}]}).encode()


def _volume(format: str, name: str) -> bytes:
    def write(path: Path) -> None:
        values = np.arange(4 * 6 * 8, dtype=np.float32).reshape(4, 6, 8)
        with open_volume(path, values.shape, format=format, spacing=0.5, unit="mm") as volume:
            volume.write(0, values)

    return _written(name, write)


def _checkpoint() -> bytes:
    arrays = {"raw.means": np.ones((9, 3), np.float32), "step": np.int64(5)}
    with tempfile.TemporaryDirectory() as folder:
        made = Checkpoint(5, arrays, {"settings": {"steps": 9}})
        path, dated = save_checkpoint(Path(folder), made), io.BytesIO()
        # An archive holds the time; the same seed is to give the same files.
        with zipfile.ZipFile(path) as archive, zipfile.ZipFile(dated, "w") as copy:
            for name in archive.namelist():
                copy.writestr(zipfile.ZipInfo(name), archive.read(name))
        return dated.getvalue()


def _config() -> bytes:
    settings = {"views": 3, "seed": 2, "elevation": [-10, 40], "mode": "volume"}
    return _written(
        "config.json",
        lambda path: write_json(path, {"job": "plan", "complete": True, "settings": settings}),
    )


def _heic() -> bytes:
    """The tests' own: no package that is wanted here writes HEIC."""
    made = Path(__file__).resolve().parents[2] / "tests" / "io" / "heic_file.py"
    return bytes(runpy.run_path(str(made))["HEIC"])


def _video() -> bytes:
    import av

    def write(path: Path) -> None:
        with av.open(str(path), "w") as container:
            stream = container.add_stream("mpeg4", rate=10)
            stream.width, stream.height, stream.pix_fmt = 32, 24, "yuv420p"
            for number in range(6):
                codes = np.full((24, 32, 3), 30 * number, np.uint8)
                container.mux(stream.encode(av.VideoFrame.from_ndarray(codes, "rgb24")))
            container.mux(stream.encode())

    return _written("a.mp4", write)


def _zemax() -> bytes:
    """A singlet of glass without a name, as Zemax writes it."""
    surfaces = [("0.0", "INFINITY", ""), ("0.02", "4.0", "GLAS ___BLANK 1 0 1.5168 64.17"),
                ("-0.02", "48.0", ""), ("0.0", "0", "")]  # fmt: skip
    lines = ["MODE SEQ", "NAME singlet", "UNIT MM X W X CM MR CPMM", "ENPD 1.0E+1"]
    lines += ["WAVM 1 5.5E-1 1", "PWAV 1"]
    for number, (curvature, thickness, glass) in enumerate(surfaces):
        lines += [f"SURF {number}", "  TYPE STANDARD", f"  CURV {curvature} 0 0 0 0"]
        lines += [f"  DISZ {thickness}", "  DIAM 6.0 0 0 0 1", *["  STOP"] * (number == 1)]
        lines += [f"  {glass}"] * bool(glass)
    return ("\n".join(lines) + "\n").encode()


def _numbers() -> bytes:
    return _written("a.npy", lambda path: np.save(path, np.arange(7.0)))


OTHERS = {
    "PNG": Kind(
        ".png", lambda: _written("a.png", lambda p: write_png(p, _picture())), read="image"
    ),
    "OpenEXR": Kind(".exr", partial(_pixels, "openexr", "a.exr"), read="image"),
    "splats PLY": Kind(".ply", partial(_splats, "a.ply"), read="splats"),
    "splats .splat": Kind(".splat", partial(_splats, "a.splat"), read="splats"),
    "splats SPZ": Kind(".spz", partial(_splats, "a.spz"), read="splats"),
    "points PLY": Kind(".ply", _points, read="points"),
    "transforms JSON": Kind(".json", _transforms, read="capture"),
    "cameras JSON": Kind(".json", _camera, read="cameras"),
    "lens JSON": Kind(".json", lambda: stock_lens("cooke_triplet").read_bytes(), read="lens"),
    "volume HDF5": Kind(".h5", partial(_volume, "h5", "a.h5"), read="volume"),
    "volume TIFF": Kind(".tif", partial(_volume, "tiff-stack", "a.tif"), read="volume"),
    "volume MRC": Kind(".mrc", partial(_volume, "mrc", "a.mrc"), read="volume"),
    "checkpoint": Kind(".npz", _checkpoint, read="checkpoint"),
    "config.json": Kind(".json", _config, read="config"),
    "JPEG": Kind(".jpg", partial(_pixels, "jpeg", "a.jpg"), read="image"),
    "environment HDR": Kind(".hdr", partial(_pixels, "hdr", "a.hdr"), read="image"),
    "Zemax lens": Kind(".zmx", _zemax, read="lens"),
    "numbers NPY": Kind(".npy", _numbers, read="numbers"),
    "numbers text": Kind(".txt", lambda: b"# angles\n0\n1.5\n3e0\n", read="numbers"),
    **FOLDERS,
}
# What extras of the package read.
if find_spec("pi_heif"):
    OTHERS["HEIC"] = Kind(".heic", _heic, read="image")
if find_spec("av"):
    OTHERS["video"] = Kind(".mp4", _video, read="video")
