"""The settings of ``rift render``, checked before any work."""

from __future__ import annotations

import math
from dataclasses import dataclass
from pathlib import Path
from typing import ClassVar, Literal

from rift_cl.commands.inputs.orbit_input import OrbitInput
from rift_cl.commands.options import ResumableRun
from rift_cl.errors import InputError
from rift_cl.option_marks import Auto

FilmChoice = Literal["auto", "webm", "mp4", "mp4-h264", "apng"]
# Pixels along an edge, and frames; more is a slip of the hand.
_LONGEST, MOST_FRAMES = 16384, 100_000
# Least and greatest values, elevation and field of view in degrees.
LIMITS = {
    "between": (0.0, MOST_FRAMES),
    "frames": (1.0, MOST_FRAMES),
    "elevation": (-89.0, 89.0),
    "fov": (1.0, 170.0),
    "rate": (0.1, 100.0),
}


@dataclass(frozen=True, kw_only=True)
class CameraOptions:
    """The cameras to render from."""

    group: ClassVar[str] = "camera"

    path: Auto[Path] = None
    """Render the views of this capture (a transforms.json, a COLMAP model, a fit, or a camera path
    of nerfstudio), in its order, instead of a film; those of a COLMAP model by their names, in
    which frame2 comes before frame10. With --between, the key_frames.json of an earlier film,
    edited, gives another film."""
    between: int = 0
    """Number of frames to interpolate between consecutive views of --path."""
    frames: Auto[int] = None
    """Number of frames of the film. Default: 96."""
    elevation: Auto[float] = None
    """Elevation of the film's camera above the horizon, in degrees. Default: that of the
    photographs, or 20."""
    distance: Auto[float] = None
    """Distance of the film's camera from the scene's centre, in scene units. Default: that of the
    photographs, or such that the whole scene is visible."""
    fov: Auto[float] = None
    """Vertical field of view of the film, in degrees. Default: that of the photographs, or 45."""
    aperture: Auto[float] = None
    """Radius of the lens aperture, in scene units (0 = pinhole). Default: that of the views of
    --path, or 0."""
    focus: Auto[float] = None
    """Depth in focus, in scene units. Default: that of the views of --path, or of the scene's
    centre."""


@dataclass(frozen=True, kw_only=True)
class FrameOutput:
    """What is written."""

    group: ClassVar[str] = "output"

    out: Path = Path("rift-render")
    """Folder for the frames, film.webm, film.mp4 or animation.png, contact.png, transforms.json,
    key_frames.json and report.html."""
    size: Auto[tuple[int, int]] = None
    """Width and height of a frame in pixels. Default: those of the views of --path; for a film 640
    pixels along the longer edge, in the shape of the photographs, or 640 480."""
    rate: float = 24.0
    """Frame rate of the film, in frames per second."""
    film: FilmChoice = "auto"
    """Format of the film: webm (VP9), mp4 (AV1), mp4-h264 (for older players; its encoder is under
    the GPL), or apng (a smaller animated PNG). Videos need PyAV (pip install av); auto is webm
    where it is installed, otherwise apng."""
    depth: bool = False
    """Also write the expected depth along the camera's axis, in scene units."""
    normals: bool = False
    """Also write normals, in the scene's axes: the splats' shortest axes on the side that is seen,
    which tell of a surface where splats are flat (rift fit photos --surface.normal-consistency): of
    length 1 as OpenEXR, and as a PNG that is dark where little covers a pixel."""


@dataclass(frozen=True)
class RenderSettings(ResumableRun, FrameOutput, CameraOptions, OrbitInput):
    """Render a film of a scene, or the views of a capture.

    The film follows the cameras of the photographs: an orbit if they surround the scene, else
    a path along them and back. A file of splats without cameras gives an orbit.

    Example: rift render fit --out film --frames 120 --depth
    """

    def check(self) -> None:
        """Check every number's range.

        Raises:
            InputError: one is out of it, or two options contradict each other.
        """
        for name, (low, high) in LIMITS.items():
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
            raise InputError("--between interpolates the views of --path: add --path")
        if self.path is not None:
            self._check_path()

    def _check_path(self) -> None:
        """Options of a film do not apply to the views of a capture."""
        for name in ("capture", "frames", "elevation", "distance", "up", "fov"):
            if getattr(self, name) is not None:
                raise InputError(f"--{name} applies to a film, --path names cameras: leave one out")
