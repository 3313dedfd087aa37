"""Which views of a ring are trained on and which are for scoring, by two protocols at once.

The paper takes N views evenly along the ring and holds every 8th of them out. Then the gap round a
test picture, and the set of test pictures, change with N, so that points of one curve cannot be
compared. A fixed test set, every 8th view of the whole ring, mends that. To have both from one fit,
a view that would be trained on but is in the fixed set gives way to the next one that is free.
"""

from __future__ import annotations

import json
import shutil
from collections.abc import Collection, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from paper.plan import Ornament
from rift_cl.errors import InputError
from rift_cl.io import make_folder, open_capture, read_image, write_json, write_png

EVERY = 8


@dataclass(frozen=True)
class Choice:
    """Places along the ring.

    Args:
        trained: of the views that are trained on.
        held_out: of every 8th of the chosen views, as in the paper.
        fixed: of the views that are never trained on, however many are chosen.
    """

    trained: tuple[int, ...]
    held_out: tuple[int, ...]
    fixed: tuple[int, ...]


def choose_views(count: int, total: int, fixed: Collection[int]) -> Choice:
    """Choose ``count`` of the ``total`` views of a ring, evenly, every 8th of them held out.

    Raises:
        InputError: there are not so many views, or too few are free.
    """
    if not 2 <= count <= total:
        raise InputError(f"--counts has {count}, wanted 2 to the {total} views of the ring")
    chosen = [k * total // count for k in range(count)]
    held_out, wanted = chosen[::EVERY], [v for k, v in enumerate(chosen) if k % EVERY]
    taken = {*held_out, *fixed, *wanted}
    trained = []
    for view in wanted:
        place = _nearest_free(view, total, taken) if view in fixed else view
        if place is None:
            raise InputError(
                f"--counts has {count}: of the {total} views too few are outside the fixed test "
                "set; take fewer, or all of them"
            )
        taken.add(place)
        trained.append(place)
    return Choice(tuple(sorted(trained)), tuple(held_out), tuple(sorted(fixed)))


def _nearest_free(view: int, total: int, taken: Collection[int]) -> int | None:
    """The nearest view along the ring that nobody has, the later one first."""
    for away in range(1, total):
        for near in ((view + away) % total, (view - away) % total):
            if near not in taken:
                return near
    return None


def fixed_views(ornament: Ornament) -> tuple[int, tuple[int, ...]]:
    """The number of views of the ring, and the places of those that are for scoring alone.

    Raises:
        InputError: a view of the test capture is none of the ring's.
    """
    ring = open_capture(ornament.ring).views
    if ornament.test is None:
        return len(ring), tuple(range(0, len(ring), EVERY))
    centers = np.array([view.camera.center for view in ring])
    tests = np.array([view.camera.center for view in open_capture(ornament.test).views])
    away = np.linalg.norm(tests[:, None] - centers, axis=2)
    if away.min(axis=1).max() > 1e-6 * np.linalg.norm(centers - centers.mean(axis=0), axis=1).max():
        raise InputError(f"{ornament.test}: has views that are none of {ornament.ring}'s")
    return len(ring), tuple(sorted(set(away.argmin(axis=1).tolist())))


def write_capture(source: Path, places: Sequence[int], folder: Path, *, noise: float = 0.0) -> Path:
    """Write some views of a capture as one of its own, under names that tell their places.

    Args:
        source: the folder of the capture.
        places: of the views in it.
        folder: of the new one.
        noise: standard deviation of white noise that is added to the colours, in display light;
            a view gets the same each time. What leaves [0, 1] is clipped, codes have 8 bit.

    Raises:
        InputError: the folder has views of another capture.
        OutputError: it cannot be written.
    """
    file = folder / "transforms.json"
    top = json.loads((source / "transforms.json").read_text(encoding="utf-8"))
    origin = str(source.absolute())
    if file.exists() and json.loads(file.read_text(encoding="utf-8")).get("source") != origin:
        raise InputError(f"{folder}: has views of another capture than {origin}; change --out")
    make_folder(folder / "images")
    frames, views = [], open_capture(source).views
    for place in places:
        image = views[place].image
        name = f"images/{place:04d}{'.png' if noise else image.suffix}"
        if noise:
            write_png(folder / name, _noisy(read_image(image), noise, seed=place))
        else:
            shutil.copyfile(image, folder / name)
        frames.append({**top["frames"][place], "file_path": name})
    write_json(file, {**top, "source": origin, "frames": frames})
    return folder


def _noisy(pixels: NDArray[np.float32], deviation: float, *, seed: int) -> NDArray[np.float32]:
    drawn = np.random.default_rng(seed).normal(0, deviation, (*pixels.shape[:2], 3))
    return np.concatenate([pixels[..., :3] + np.float32(drawn), pixels[..., 3:]], axis=2)
