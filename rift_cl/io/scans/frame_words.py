"""Words in the names of files, folders and arrays that say what frames they hold."""

from __future__ import annotations

import re
from typing import Literal

FrameKind = Literal["projections", "flats", "darks"]

WORDS: dict[FrameKind, frozenset[str]] = {
    "flats": frozenset(
        ("flat", "flats", "flatfield", "flatfields", "ff", "white", "whites", "bright", "brights")
    ).union(("openbeam", "ob", "ref", "refs", "reference", "references")),
    "darks": frozenset(("dark", "darks", "darkfield", "darkfields", "df")),
}
CALIBRATION = WORDS["flats"] | WORDS["darks"]
FILLERS = frozenset(
    ("field", "fields", "frame", "frames", "image", "images", "before", "after", "pre", "post")
)


def words_of(name: str) -> frozenset[str]:
    """The words of a name, in small letters."""
    return frozenset(re.findall("[a-z]+", re.sub(r"(?<=[a-z])(?=[A-Z])", " ", name).lower()))


def is_said(kind: FrameKind, name: str) -> bool:
    """Whether the name of an array says this kind of frame, and nothing else."""
    words = words_of(name) - FILLERS - {"data"}
    return bool(words) and words <= WORDS[kind]
