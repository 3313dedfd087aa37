"""What a file of splats says of how they were fitted, where that is not how files are drawn.

Colours in linear light are no display codes, and splats that were dimmed as they were widened
(antialiased, Mip-Splatting) are too opaque without it. One comment in the header of a PLY file says
so: ``rift-cl drawing: light linear, antialiased, eps2d 0.1``, with whatever differs from display
light and splats that are not dimmed. A file without it is drawn as files always were.

Of X-rays it says ``eps2d`` alone: 0 where the splats hold that variance already, and their sum is
the density that was scored.
"""

from __future__ import annotations

import math
import re
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, cast, get_args

from rift_cl.errors import FileFormatError, InputError
from rift_cl.geometry.numbers import one_number
from rift_cl.io.images.display_light import LightKind

_MARK = "rift-cl drawing:"
_PART = re.compile(r"(light) (display|linear)|(antialiased)|(eps2d) ([0-9][0-9.e+-]{0,30})")
_SHOWN = 60


@dataclass(frozen=True)
class SceneDrawing:
    """How the splats of a scene were fitted, and are to be drawn.

    Args:
        light: that colours are in, and splats are blended in.
        antialiased: whether splats are dimmed as ``eps2d`` widens them; see ``SplatSettings``.
        eps2d: that they are to be drawn with, in square pixels of what they were fitted to; None
            where that is not said.
    """

    light: LightKind = "display"
    antialiased: bool = False
    eps2d: float | None = None

    @classmethod
    def of(cls, scene: Any) -> SceneDrawing:
        """That of a ``SplatScene``.

        Raises:
            InputError: a value is none that there is, or has no meaning for X-rays.
        """
        if scene.light not in get_args(LightKind):
            raise InputError(f"SplatScene: light is {scene.light!r}, wanted display or linear")
        eps2d = scene.eps2d
        if eps2d is not None and not 0 <= one_number(eps2d) < math.inf:
            raise InputError(f"SplatScene: eps2d is {eps2d!r}, wanted a number >= 0, or None")
        found = cls(
            scene.light, bool(scene.antialiased), None if eps2d is None else one_number(eps2d)
        )
        if scene.mode == "xray" and found.of_light:
            raise InputError(
                f"SplatScene: splats of X-rays know no {found.words}: leave out light and "
                "antialiased"
            )
        return found

    @property
    def usual(self) -> bool:
        """Whether there is nothing to say."""
        return self == SceneDrawing()

    @property
    def of_light(self) -> bool:
        """Whether it says what has a meaning for photographs alone."""
        return self.light != "display" or self.antialiased

    @property
    def words(self) -> str:
        """What there is, in the words of a header's comment."""
        parts = [f"light {self.light}"] if self.light != "display" else []
        parts += ["antialiased"] if self.antialiased else []
        parts += [] if self.eps2d is None else [f"eps2d {self.eps2d!r}"]
        return ", ".join(parts)

    @property
    def comment(self) -> str:
        """The line of a header that says it."""
        return f"comment {_MARK} {self.words}"


def read_drawing(path: Path, comments: Sequence[str]) -> SceneDrawing:
    """What the comments of a header say of how splats are drawn.

    Raises:
        FileFormatError: they say something that has no meaning, or say it twice.
    """
    said = [line[len(_MARK) :].strip() for line in comments if line.startswith(_MARK)]
    if not said:
        return SceneDrawing()
    if len(said) > 1:
        raise FileFormatError(f"{path}: has {len(said)} comments '{_MARK}', wanted one")
    found: dict[str, str] = {}
    for part in said[0].split(","):
        match = _PART.fullmatch(part.strip())
        name = next(filter(None, match.groups()), "") if match else ""
        if match is None or name in found:
            raise _meaningless(path, said[0])
        found[name] = part.split()[-1]
    try:
        eps2d = float(found["eps2d"]) if "eps2d" in found else None
    except ValueError as error:
        raise _meaningless(path, said[0]) from error
    if eps2d is not None and not math.isfinite(eps2d):
        raise _meaningless(path, said[0])
    return SceneDrawing(
        cast(LightKind, found.get("light", "display")), "antialiased" in found, eps2d
    )


def _meaningless(path: Path, said: str) -> FileFormatError:
    return FileFormatError(
        f"{path}: its comment '{_MARK} {said[:_SHOWN]}' has no meaning; the file is damaged, or of "
        "a newer version"
    )
