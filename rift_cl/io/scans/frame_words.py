"""Words in the names of files, folders and arrays that say what frames they hold."""

from __future__ import annotations

import re
from typing import Literal

FrameKind = Literal["projections", "flats", "darks"]

WORDS: dict[FrameKind, frozenset[str]] = {
    "flats": frozenset(
        ("flat", "flats", "flatfield", "flatfields", "ff", "white", "whites", "bright", "brights")
    ).union(("open", "openbeam", "ob", "ref", "refs", "reference", "references")),
    "darks": frozenset(("dark", "darks", "darkfield", "darkfields", "df", "black", "blacks")),
}
CALIBRATION = WORDS["flats"] | WORDS["darks"]
FILLERS = frozenset(
    ("field", "fields", "frame", "frames", "image", "images", "before", "after", "pre", "post")
).union(("beam", "current"))
# What projections are called, where nothing but a name tells of them.
_PROJECTIONS = frozenset(
    ("projection", "projections", "proj", "projs", "sinogram", "sinograms", "sino", "sinos")
).union(("data", "frames", "images", "radiographs", "counts", "intensity", "tomo"))
_ANGLES = frozenset(("angle", "angles", "theta", "thetas"))
_OF_ANGLES = frozenset(
    ("rotation", "projection", "view", "deg", "degree", "degrees", "rad", "radian", "radians")
)


def words_of(name: str) -> frozenset[str]:
    """The words of a name, in small letters."""
    return frozenset(re.findall("[a-z]+", re.sub(r"(?<=[a-z])(?=[A-Z])", " ", name).lower()))


def is_said(kind: FrameKind, name: str) -> bool:
    """Whether the name of an array says this kind of frame, and nothing else."""
    words = words_of(name) - FILLERS - {"data"}
    return bool(words) and words <= WORDS[kind]


def says_projections(name: str) -> bool:
    """Whether the name of an array is one that projections have."""
    words = words_of(name) - {"raw"}
    return bool(words) and words <= _PROJECTIONS


def says_angles(name: str) -> bool:
    """Whether the name of an array says angles of views, and perhaps their unit."""
    words = words_of(name)
    return bool(words & _ANGLES) and words <= _ANGLES | _OF_ANGLES
