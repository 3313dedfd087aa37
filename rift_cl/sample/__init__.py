"""Small captures that come with the package, so that a fit can be seen before one has pictures.

One shows a glossy ornament with hairs and fibres from a ring of cameras, the other a wall from its
front. They were rendered by ``tools/render_ornament.py`` and ``tools/render_one_sided.py``; the
commands are in the ``README.txt`` of each.
"""

from __future__ import annotations

from importlib.resources import files
from pathlib import Path

_ORNAMENT = "ornament"
_OFF_PATH = "off_path"
_WALL = "wall"


def ornament() -> Path:
    """The folder of 60 views of the ornament on a ring, with its transforms.json.

    The package must lie on a disk as it does when pip installs it, not in a zip file.
    """
    return Path(str(files(__name__) / _ORNAMENT))


def ornament_off_path() -> Path:
    """The folder of 8 views of the ornament from elsewhere, with its transforms.json."""
    return ornament() / _OFF_PATH


def wall() -> Path:
    """The folder of 24 views of a wall from its front, with transforms.json and sparse points."""
    return Path(str(files(__name__) / _WALL))
