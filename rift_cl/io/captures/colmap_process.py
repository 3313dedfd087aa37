"""Runs COLMAP in a process of its own, and reads from its log how far it is."""

from __future__ import annotations

import importlib.util
import re
import subprocess
import sys
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

from rift_cl.errors import InputError, not_installed
from rift_cl.io.json_fields import read_json_object
from rift_cl.io.output import write_json, writing
from rift_cl.progress import Report

# Modules come from where they come from here, not from the folder that we happen to be in.
_CODE = (
    "import sys; sys.path[:] = sys.argv[2:]; from rift_cl.io.captures import colmap_steps; "
    "colmap_steps.pose(sys.argv[1])"
)

_FEATURES = re.compile(r"Processed file \[(\d+)/(\d+)\]")
_MATCHED = re.compile(r"(?:Matching|Processing) image \[(\d+)/(\d+)\]")
_BLOCKS = re.compile(r"(?:Matching|Processing) block \[(\d+)/(\d+), (\d+)/(\d+)\]")
_PLACED = re.compile(r"Registering image #\d+ \((?:num_reg_frames=)?(\d+)\)")


def check_pycolmap() -> None:
    """Make sure that pycolmap is installed; it is not loaded.

    Raises:
        InputError: it is not.
    """
    if importlib.util.find_spec("pycolmap") is None:
        raise not_installed("poses of bare photographs are found by", "pycolmap", "pycolmap")


def run_colmap(job: Mapping[str, Any], log: Path) -> Iterator[Report]:
    """Find poses; see ``colmap_steps.pose``. The process ends with this generator.

    Args:
        job: what to do.
        log: a file for what COLMAP says.

    Raises:
        InputError: the process cannot be started, or stopped without a result.
        OutputError: the log cannot be written.
    """
    path = Path(job["part"], "job.json")
    write_json(path, job)
    process = _started([sys.executable, "-c", _CODE, str(path), *sys.path])
    line = b""
    with process:
        try:
            with writing(log), log.open("wb") as kept:
                for line in process.stdout or ():
                    kept.write(line)
                    yield from _reports(line.decode(errors="replace"), len(job["names"]))
            status = process.wait()
        except BaseException:
            process.kill()
            raise
    if status:
        said = line.decode(errors="replace").strip()[:300]
        raise InputError(f"{job['images']}: pycolmap stopped with status {status} ({said})")


def _started(command: list[str]) -> subprocess.Popen[bytes]:
    """A process whose output and errors come through one pipe."""
    pipe = subprocess.PIPE
    try:
        return subprocess.Popen(
            command, stdin=subprocess.DEVNULL, stdout=pipe, stderr=subprocess.STDOUT
        )
    except OSError as error:
        raise InputError(f"pycolmap cannot be run ({error.strerror or error})") from error


def colmap_result(part: Path) -> tuple[list[str], str]:
    """The names of the photographs that COLMAP placed, and pycolmap's version."""
    values = read_json_object(part / "result.json").values
    return list(values["placed"]), str(values["pycolmap"])


def _reports(line: str, photographs: int) -> Iterator[Report]:
    """What a line of the log says about the progress; nothing where we do not know it."""
    if found := _FEATURES.search(line):
        yield Report(int(found[1]), int(found[2]), "photographs searched for features")
    elif found := _MATCHED.search(line):
        yield Report(int(found[1]), int(found[2]), "photographs matched")
    elif found := _BLOCKS.search(line):
        row, rows, column, columns = (int(group) for group in found.groups())
        yield Report((row - 1) * columns + column, rows * columns, "blocks of pairs matched")
    elif found := _PLACED.search(line):
        yield Report(min(int(found[1]) + 1, photographs), photographs, "photographs placed")
