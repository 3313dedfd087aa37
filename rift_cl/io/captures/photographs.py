"""Bare photographs become a capture: COLMAP finds out where each was taken.

The result is a COLMAP model in a folder of its own, which ``open_capture`` reads together with
the photographs where they are; nothing is written beside them.
"""

from __future__ import annotations

import os
import shutil
from collections.abc import Generator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from rift_cl.errors import InputError, RiftError
from rift_cl.io.captures.capture_paths import CaptureFolder
from rift_cl.io.captures.colmap_process import check_pycolmap, colmap_result, run_colmap
from rift_cl.io.captures.photograph_folder import (
    Photograph,
    photograph_names,
    photographs_in,
    shown,
    whole_photographs,
    with_headers,
)
from rift_cl.io.captures.pose_record import POSE_RECORD
from rift_cl.io.images.heic import check_heic
from rift_cl.io.images.image_format import HEIC, SUFFIXES
from rift_cl.io.json_fields import read_json_object
from rift_cl.io.output import make_folder, staged_folder, write_json, writing
from rift_cl.progress import Report

# Fewer do not tell where the scene is from where the lens is.
_FEWEST = 3
_MODEL = ("cameras.bin", "images.bin", "points3D.bin")
_EXTRA = ("frames.bin", "rigs.bin", "colmap.log")
_LEFT_OVER = ("database.db", "database.db-shm", "database.db-wal", "job.json", "result.json")
_FOLDERS = ("copies", "models")


@dataclass(frozen=True)
class PosedPhotographs:
    """Where the poses of photographs are.

    Args:
        model: the folder of the COLMAP model; ``open_capture(model, images=folder)`` opens it.
        placed: the photographs that have a pose, by name.
        missing: those that have none, and why.
    """

    model: Path
    placed: tuple[str, ...]
    missing: Mapping[str, str]


def check_photographs(folder: str | os.PathLike[str]) -> list[str]:
    """Make sure that poses can be looked for; no photograph is read.

    Args:
        folder: the folder of the photographs, or one that has them in ``images``.

    Returns:
        The names of its photographs.

    Raises:
        InputError: there are fewer than three, there is no such folder, or pycolmap is missing, or
            pi-heif where there is HEIC.
    """
    names = photograph_names(photographs_in(Path(folder)))
    heic = next((name for name in names if SUFFIXES[Path(name).suffix.lower()] == HEIC), None)
    if heic is not None:
        check_heic(Path(folder, heic))
    if len(names) < _FEWEST:
        raise InputError(
            f"{folder}: holds {len(names)} photographs, poses can be found from {_FEWEST} on"
        )
    check_pycolmap()
    return names


def pose_photographs(
    folder: str | os.PathLike[str],
    work: str | os.PathLike[str],
    *,
    seed: int = 0,
    exhaustive: int = 150,
) -> Generator[Report, None, PosedPhotographs]:
    """Find the poses of photographs of one scene, with COLMAP on the CPU.

    Photographs of one size that EXIF says one camera took at one focal length, or of which EXIF
    says nothing, share a camera with one coefficient of distortion. Its focal length begins with
    EXIF's, where all photographs are 8-bit PNG or JPEG without alpha; else COLMAP sees copies and
    begins with 1.2 times the longer edge. Damaged photographs are left out. See ``colmap_steps``
    for how far the seed goes.

    Args:
        folder: the photographs, in it or in ``images`` there; other folders are not looked into.
        work: a folder for the model, made or replaced as a whole at the end; if it holds the
            model of the same photographs, by names, sizes and times, that one is taken.
        seed: of all that COLMAP draws by chance.
        exhaustive: up to so many photographs all pairs are matched; of more, each is matched with
            those that are near in the order of names, as frames of a film are.

    Returns:
        Where the model is; of several parts that do not hang together, the largest.

    Raises:
        InputError: pycolmap is missing, there are fewer than three usable photographs, or COLMAP
            finds no poses.
        PathEscapeError: a photograph is a link that leads out of the folder.
        OutputError: the model cannot be written.
    """
    place, work = photographs_in(Path(folder)), Path(work).absolute()
    names = photograph_names(place)
    order = {"photographs": _stamps(place, names), "seed": seed, "exhaustive": exhaustive}
    earlier = _earlier(work, order)
    if earlier is not None:
        yield Report(len(earlier.placed), len(names), "photographs placed")
        return earlier
    check_photographs(folder)
    make_folder(work.parent)
    left_out: dict[str, str] = {}
    with staged_folder(work, _strange) as part:
        job = yield from _job(place, names, part, left_out)
        yield from run_colmap(job | {"seed": seed, "exhaustive": exhaustive}, part / "colmap.log")
        placed, version = colmap_result(part)
        if len(placed) < _FEWEST:
            raise InputError(
                f"{place.path}: no poses could be found for {len(job['names'])} photographs; "
                "they have to be sharp, show texture and overlap their neighbours by half or more"
            )
        for name in {shown(name) for name in names} - {*placed, *left_out}:
            left_out[name] = "nothing in it could be matched with the photographs that have poses"
        with writing(part):
            _clean(part)
        missing = dict(sorted(left_out.items()))
        found = {"upright": True, "pycolmap": version, "placed": placed, "missing": missing}
        write_json(part / POSE_RECORD, order | found)
    return PosedPhotographs(work, tuple(placed), missing)


def _job(
    place: CaptureFolder, names: Sequence[str], part: Path, left_out: dict[str, str]
) -> Generator[Report, None, dict[str, Any]]:
    """What COLMAP is told: photographs, under the names that it sees, by their cameras."""
    photographs = with_headers(place, names, left_out)
    copies = None if all(one.plain for one in photographs) else part / "copies"
    whole: list[Photograph] = []
    yield from whole_photographs(photographs, copies, whole, left_out)
    if len(whole) < _FEWEST:
        first = next((f"{name}: {reason}" for name, reason in left_out.items()), "")
        raise InputError(
            f"{place.path}: {len(whole)} of {len(names)} photographs can be used, poses can be "
            f"found from {_FEWEST} on; the first trouble is: {first}"
        )
    seen = {one.name if copies is None else f"{one.name}.png": one for one in whole}
    cameras: dict[tuple[object, ...], list[str]] = {}
    for name, one in seen.items():
        cameras.setdefault(one.camera, []).append(name)
    return {
        "images": str(copies or place.path),
        "names": {name: one.name for name, one in seen.items()},
        "cameras": list(cameras.values()),
        "part": str(part),
    }


def _stamps(place: CaptureFolder, names: Sequence[str]) -> list[list[Any]]:
    """What tells that photographs are those of an earlier run."""
    found = [(name, (place.path / name).stat()) for name in names]
    return [[shown(name), status.st_size, status.st_mtime_ns] for name, status in found]


def _earlier(work: Path, order: Mapping[str, Any]) -> PosedPhotographs | None:
    """The finished work of an earlier run for the same photographs, or None."""
    if not all((work / name).is_file() for name in (*_MODEL, POSE_RECORD)):
        return None
    try:
        record = read_json_object(work / POSE_RECORD).values
    except RiftError:
        return None
    placed, missing = record.get("placed"), record.get("missing")
    same = all(record.get(name) == value for name, value in order.items())
    if not (same and isinstance(placed, list) and isinstance(missing, dict)):
        return None
    return PosedPhotographs(work, tuple(placed), missing)


def _clean(part: Path) -> None:
    """Leave the model, its record and the log."""
    for name in _LEFT_OVER:
        (part / name).unlink(missing_ok=True)
    for name in _FOLDERS:
        shutil.rmtree(part / name, ignore_errors=True)


def _strange(names: list[str]) -> str | None:
    ours = {*_MODEL, *_EXTRA, *_LEFT_OVER, *_FOLDERS, POSE_RECORD, f"{POSE_RECORD}.part"}
    return next((name for name in names if name not in ours), None)
