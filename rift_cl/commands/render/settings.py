"""What ``rift render`` takes, checked before any work."""

from __future__ import annotations

import math
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

from rift_cl.commands.inputs.orbit_input import OrbitInput
from rift_cl.errors import InputError

FilmChoice = Literal["auto", "webm", "mp4", "mp4-h264", "apng"]
_STEEPEST, _WIDEST = 89.0, 170.0
# Pixels along an edge, and frames; more is a slip of the hand.
_LONGEST, MOST_FRAMES = 16384, 100_000


@dataclass(frozen=True)
class RenderSettings(OrbitInput):
    """Render a film of a scene, or the views of a capture.

    The film follows the cameras of the photographs: an orbit if they surround the scene, else
    a path along them and back. A file of splats without cameras gives an orbit.

    Example: rift render fit --out film --frames 120 --depth
    """

    out: Path = Path("rift-render")
    """Folder for frames, film.webm, film.mp4 or animation.png, contact.png, transforms.json,
    key_frames.json and report.html."""
    path: Path | None = None
    """A transforms.json, a COLMAP model, or a fit: draw each of its views, in its order, instead of
    the film; key_frames.json of an earlier film, changed at will, with --between, for another."""
    between: int = 0
    """Frames between each two views of --path."""
    frames: int | None = None
    """Frames of the film; 96 when not given."""
    elevation: float | None = None
    """Of the film's camera above the horizon, in degrees; as the photographs' cameras, or 20, when
    not given."""
    distance: float | None = None
    """Of the film's camera from the scene's middle, in scene units; as the photographs' cameras, or
    so that all is seen, when not given."""
    fov: float | None = None
    """Vertical field of view of the film in degrees; that of the photographs, or 45, when not
    given."""
    aperture: float | None = None
    """Radius of the lens's opening, in scene units, so that one depth alone is sharp; 0 for a
    pinhole. That of the views of --path, or 0, when not given."""
    focus: float | None = None
    """Depth that is sharp, in scene units; that of the views of --path, or of the scene's middle,
    when not given."""
    size: tuple[int, int] | None = None
    """Width and height in pixels; when not given the views' own, or for a film the photographs'
    shape with 640 pixels along its longer edge, or 640 480."""
    rate: float = 24.0
    """Frames of the film in a second."""
    film: FilmChoice = "auto"
    """The film's kind: webm (VP9), mp4 (AV1), mp4-h264 (plays on older machines; its encoder is
    under the GPL), or apng, smaller pictures in an animated PNG. Videos want PyAV (pip install av);
    auto is webm with it and apng without."""
    depth: bool = False
    """Write the expected depth as well: along the camera's axis, in scene units."""
    overwrite: bool = False
    """Replace an earlier rendering in the same folder."""
    dry_run: bool = False
    """Say what would be done, and stop."""

    def check(self) -> None:
        """Check every number's range.

        Raises:
            InputError: one is out of it, or two options contradict each other.
        """
        for name, low, high in (
            ("between", 0, MOST_FRAMES),
            ("frames", 1, MOST_FRAMES),
            ("elevation", -_STEEPEST, _STEEPEST),
            ("fov", 1, _WIDEST),
            ("rate", 0.1, 100),
        ):
            value = getattr(self, name)
            if value is not None and not low <= value <= high:
                raise InputError(f"--{name} is {value}, wanted {low:g} to {high:g}")
        for name in ("distance", "focus"):
            value = getattr(self, name)
            if value is not None and not 0 < value < math.inf:
                raise InputError(f"--{name} is {value}, wanted a positive number")
        if self.aperture is not None and not 0 <= self.aperture < math.inf:
            raise InputError(f"--aperture is {self.aperture}, wanted 0 or a positive number")
        if self.size is not None and not all(1 <= edge <= _LONGEST for edge in self.size):
            shown = " ".join(map(str, self.size))
            raise InputError(f"--size is {shown}, wanted 1 to {_LONGEST} pixels each")
        if self.path is None and self.between:
            raise InputError("--between is about the views of --path: name one")
        if self.path is not None:
            self._check_path()

    def _check_path(self) -> None:
        """What makes a film has no meaning along a path."""
        for name in ("capture", "frames", "elevation", "distance", "up", "fov"):
            if getattr(self, name) is not None:
                raise InputError(f"--{name} is about a film, --path names cameras: leave one out")
