"""COLMAP's steps from photographs to a model, for a Python process that does nothing else.

pycolmap and OpenImageIO each bring libraries of the same names (with pycolmap 4.2 loaded first,
OpenImageIO 3.2 aborts when it closes a PNG), COLMAP tells what it does on the standard error
stream alone, and it cannot be interrupted; none of this matters in a process of its own. Nothing
of the package is imported here but this file.

With pycolmap 4 two runs on one machine give the same model, bit by bit: photographs get their
numbers in the order of their names, before any thread begins, every draw by chance has the seed,
and mapping keeps to one thread, because the sums of several differ in their last digits (which
was seen to move the focal length by 1 part in 7000). Before pycolmap 4 the seed does not reach
the threads that verify matches, and models differ from run to run.
"""

from __future__ import annotations

import importlib
import json
from pathlib import Path
from typing import Any

from rift_cl.json_parsing import parse_json


def pose(job_path: str) -> None:
    """Find poses.

    Args:
        job_path: a JSON file with "images", the folder of the photographs; "names", from what
            each photograph is called there to what the model shall call it; "cameras", lists of
            those photographs that one camera took; "seed"; "exhaustive", the number of
            photographs up to which all pairs are matched; "part", a folder to work in, which
            receives the model's files and ``result.json``.
    """
    job = parse_json(Path(job_path).read_text(encoding="utf-8"))
    pycolmap: Any = importlib.import_module("pycolmap")
    part = Path(job["part"])
    models = _models(pycolmap, job, part)
    result: dict[str, Any] = {"placed": [], "pycolmap": str(pycolmap.__version__)}
    if models:
        best = max(models, key=lambda model: (model.num_reg_images(), model.num_points3D()))
        for image in best.images.values():
            image.name = job["names"][image.name]
        result["placed"] = sorted(best.images[number].name for number in best.reg_image_ids())
        best.write_binary(str(part))
    (part / "result.json").write_text(json.dumps(result), encoding="utf-8")


def _models(pycolmap: Any, job: dict[str, Any], part: Path) -> list[Any]:
    database, images, names = str(part / "database.db"), job["images"], list(job["names"])
    pycolmap.set_random_seed(job["seed"])
    # COLMAP makes its tables in an empty file.
    Path(database).touch()
    for group in job["cameras"]:
        pycolmap.import_images(database, images, pycolmap.CameraMode.SINGLE, group)
    pycolmap.extract_features(database, images, names, device=pycolmap.Device.cpu)
    _match(pycolmap, database, job)
    options = _seeded(pycolmap.IncrementalPipelineOptions(), job["seed"])
    # Of several models, those with fewer photographs would be dropped.
    options.min_model_size = 3
    options.num_threads = options.mapper.num_threads = 1
    (part / "models").mkdir()
    found = pycolmap.incremental_mapping(database, images, str(part / "models"), options=options)
    return list(found.values())


def _match(pycolmap: Any, database: str, job: dict[str, Any]) -> None:
    verification = _seeded(pycolmap.TwoViewGeometryOptions(), job["seed"])
    common = {"device": pycolmap.Device.cpu, "verification_options": verification}
    count = len(job["names"])
    if count > job["exhaustive"]:
        pycolmap.match_sequential(database, **common)
        return
    # The options had another name, and the argument too, before pycolmap 4.
    name = next(n for n in ("pairing", "matching") if hasattr(pycolmap, _pairs(n)))
    options = getattr(pycolmap, _pairs(name))()
    # Progress is told a block at a time.
    options.block_size = max(2, -(-count // 8))
    pycolmap.match_exhaustive(database, **{f"{name}_options": options}, **common)


def _pairs(name: str) -> str:
    return f"Exhaustive{name.capitalize()}Options"


def _seeded(options: Any, seed: int) -> Any:
    parts = [getattr(options, name, None) for name in ("mapper", "triangulation", "ransac")]
    for part in (options, *parts):
        if hasattr(part, "random_seed"):
            part.random_seed = seed
    return options
