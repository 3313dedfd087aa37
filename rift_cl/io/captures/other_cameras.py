"""Cameras of programs whose files are not read: recognised, and not passed over unsaid.

Whoever has such a file has poses already. A sentence says which program's they are and how they
come into a form that is read, whether the file itself is named or the folder that it lies in.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from contextlib import suppress
from dataclasses import dataclass
from fnmatch import fnmatchcase
from itertools import islice
from pathlib import Path

# A mark lies within so many bytes; of a folder, so many files are looked into.
_START, _LOOKED_INTO = 1 << 16, 100
_EXPORT = "export them as a COLMAP model and name its folder"
_WRITE = "write them as a transforms.json and name that"


@dataclass(frozen=True)
class OtherProgram:
    """A program whose cameras are not read.

    Args:
        name: what it, or the layout of its files, is called.
        files: pattern that names of its files fit, in lower case.
        mark: pattern that the beginning of such a file has.
        way: what to do to use its cameras.
    """

    name: str
    files: str
    mark: re.Pattern[bytes]
    way: str = _EXPORT


def _nerfstudio(kind: str) -> str:
    return f"'ns-process-data {kind}' of nerfstudio makes a transforms.json of them: name that"


# Patterns that take time in proportion to what they are matched with, whatever it holds.
_ROW = rb"[ \t]*" + rb"[ \t]+".join([rb"[-+.\deE]{1,40}"] * 4) + rb"[ \t]*\r?\n"
_PROGRAMS = (
    OtherProgram(
        "LLFF",
        "poses_bounds*.npy",
        re.compile(rb"\x93NUMPY"),
        "they come from a COLMAP model: put its folder 'sparse' beside the photographs",
    ),
    OtherProgram("IDR and NeuS", "*.npz", re.compile(rb"PK.*(?:world|scale)_mat_", re.S), _WRITE),
    OtherProgram(
        "OpenSfM",
        "*.json",
        re.compile(rb'\s*\[\s*\{.*"(?:shots|reference_lla|projection_type)"', re.S),
        "'opensfm export_colmap' makes a COLMAP model of them: name its folder",
    ),
    OtherProgram(
        "3D Gaussian splatting (INRIA)",
        "*.json",
        re.compile(rb'\s*\[\s*\{[^]]*"img_name"'),
        "they come from the COLMAP model, or the transforms.json, that was fitted: name that",
    ),
    OtherProgram(
        "Record3D",
        "metadata*.json",
        re.compile(rb'\s*\{.*"(?:poses|initPose|perFrameIntrinsicCoeffs)"', re.S),
        _nerfstudio("record3d"),
    ),
    OtherProgram(
        "Polycam", "*.json", re.compile(rb'\s*\{[^{]*"t_[012][0-3]"'), _nerfstudio("polycam")
    ),
    OtherProgram("Meshroom", "*.sfm", re.compile(rb"\s*\{")),
    OtherProgram(
        "Tanks and Temples",
        "*.log",
        re.compile(rb"\s*\d+[ \t]+\d+[ \t]+-?\d+[ \t]*\r?\n(?:" + _ROW + rb"){4}"),
        _WRITE,
    ),
    OtherProgram("RealityCapture", "*.csv", re.compile(rb"#?\s*name\s*,\s*x\s*,\s*y\b", re.I)),
    OtherProgram(
        "Metashape",
        "*.xml",
        re.compile(rb"\s*(?:<\?[^>]*>\s*)?<document\b.*<(?:chunk|sensor)", re.S),
    ),
    OtherProgram("Bundler", "*.out", re.compile(rb"# Bundle file")),
    OtherProgram("VisualSFM", "*.nvm", re.compile(rb"NVM_V")),
)
# Endings that tell the program without a look into the file.
_TELLING = (".csv", ".nvm", ".out", ".sfm", ".xml")
# Folders that Polycam has a file for each camera in.
_POLYCAM = ("keyframes/corrected_cameras", "keyframes/cameras", "corrected_cameras", "cameras")


def other_program(path: Path) -> OtherProgram | None:
    """The program whose cameras a file holds, by its name and beginning, if it is one of these."""
    name = path.name.lower()
    fitting = [program for program in _PROGRAMS if fnmatchcase(name, program.files)]
    if not fitting or not path.is_file():
        return None
    with suppress(OSError), path.open("rb") as file:
        start = file.read(_START)
        return next((program for program in fitting if program.mark.match(start)), None)
    return None


def way_out(path: Path) -> str:
    """What to do with a file that may hold cameras of a program; the end of a sentence."""
    if path.suffix.lower() not in _TELLING:
        return ""
    name = path.name.lower()
    program = next(program for program in _PROGRAMS if fnmatchcase(name, program.files))
    return f"; if it holds cameras of {program.name}, {program.way}"


def other_cameras(folder: Path) -> list[str]:
    """What cameras of other programs lie in a folder, or beside its folder of photographs.

    Args:
        folder: of photographs, or with ``images`` in it.

    Returns:
        A sentence for each program.
    """
    found = dict[str, str]()
    for place in (folder, folder / "images"):
        for path in _candidates(place):
            if program := other_program(path):
                shown = path if path.parent == place else path.parent
                found.setdefault(
                    program.name,
                    f"{shown} holds cameras of {program.name}, which are not read; to use them, "
                    f"{program.way}",
                )
    return list(found.values())


def _candidates(folder: Path) -> Iterator[Path]:
    """Files that may hold cameras; of Polycam's, which has one for each, a single one."""
    with suppress(OSError):
        names = (program.files for program in _PROGRAMS if program.name != "Polycam")
        patterns = tuple(dict.fromkeys(names))
        fitting = (
            path
            for path in sorted(folder.iterdir())
            if any(fnmatchcase(path.name.lower(), pattern) for pattern in patterns)
        )
        yield from islice(fitting, _LOOKED_INTO)
    for place in _POLYCAM:
        yield from islice(sorted((folder / place).glob("*.json")), 1)
