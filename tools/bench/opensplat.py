"""OpenSplat on the same photographs, if it is installed: scored by what it saves on its way.

It is a program of its own, so that it cannot be stopped for a score: its scenes are saved every so
many steps and scored afterwards. Wall time is the time of the file, processor time that of the
whole process by the share of the wall time. It gets the photographs as we see them, the training
views alone, over the same background, and our first points.
"""

from __future__ import annotations

import resource
import shutil
import subprocess
import tempfile
import time
from pathlib import Path
from typing import Any

import numpy as np

from bench.quality import FitCase, Moment, score_splats, scored_pictures
from rift_cl.commands.fit_photos.job import Fit
from rift_cl.errors import InputError
from rift_cl.io import SplatScene, write_text
from rift_cl.io.captures.transforms_record import transforms_of
from rift_cl.io.images.image import write_png
from rift_cl.io.output import write_json
from rift_cl.splat import Renderer, SplatSettings

PROGRAM = "opensplat"
_Y0 = 0.28209479177387814


def moments(case: FitCase, device: str | None, program: str = PROGRAM) -> list[Moment]:
    """Run it once, and score what it saved.

    Raises:
        InputError: it is not installed, or fails.
    """
    if shutil.which(program) is None:
        raise InputError(f"{program} is not installed")
    job = case.job(device)
    pictures = job._pictures(job.training_views)
    unseen = scored_pictures(case, job, pictures)
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        _write_project(folder, job, pictures)
        options = ("-n", case.steps, "-s", case.every, "-d", 1, "-o", folder / "splat.ply")
        command = [program, str(folder), *map(str, options), "--keep-crs"]
        began, before = time.time(), _children_seconds()
        done = subprocess.run(command, capture_output=True, text=True, check=False)
        took, cpu = time.time() - began, _children_seconds() - before
        if done.returncode:
            last = (done.stderr.strip().splitlines() or ["no message"])[-1]
            raise InputError(f"{program} failed: {last}")
        found = []
        for step in range(case.every, case.steps + 1, case.every):
            path = folder / f"splat_{step}.ply"
            wall = path.stat().st_mtime - began
            found.append(Moment(step, cpu * wall / took, wall, _score(path, job, unseen)))
    return found


def _score(path: Path, job: Fit, unseen: Any) -> float:
    # It dilates splats on the screen as 3DGS does.
    renderer = Renderer(SplatSettings(eps2d=0.3), device=job.device)
    return score_splats(renderer, SplatScene.load(path).upload(job.device), unseen)


def _write_project(folder: Path, job: Fit, pictures: Any) -> None:
    names = [f"images/{number:04}.png" for number in range(len(pictures.views))]
    (folder / "images").mkdir()
    for number, name in enumerate(names):
        write_png(folder / name, pictures.shown(pictures.over(number, pictures.behind)))
    record = transforms_of(pictures.cameras, names)
    write_json(folder / "transforms.json", {**record, "ply_file_path": "points.ply"})
    raw, *_ = job._trainer(job.source, pictures).parameters.host()
    colors = np.clip(raw["sh"][:, 0] * _Y0 + 0.5, 0, 1) * 255
    rows = [
        " ".join([*(f"{x:.6g}" for x in mean), *(f"{round(c)}" for c in color)])
        for mean, color in zip(raw["means"].tolist(), colors.tolist(), strict=True)
    ]
    head = ["ply", "format ascii 1.0", f"element vertex {len(rows)}"]
    head += [f"property float {axis}" for axis in "xyz"]
    head += [f"property uchar {color}" for color in ("red", "green", "blue")]
    write_text(folder / "points.ply", "\n".join([*head, "end_header", *rows]) + "\n")


def _children_seconds() -> float:
    used = resource.getrusage(resource.RUSAGE_CHILDREN)
    return used.ru_utime + used.ru_stime
