"""What ``rift samples`` takes."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

from tyro.conf import Positional

from rift_cl.option_marks import Auto


@dataclass(frozen=True)
class SamplesSettings:
    """List sample captures and open data sets, or put one of them into a folder.

    Captures of the package are copied. An open data set is downloaded over https and kept only if
    its size and its SHA-256 are those that are listed; a download that broke off goes on where it
    stopped. Without a network give the file that you fetched elsewhere by --file. Nothing is
    downloaded without a name.

    Example: rift samples ornament --out capture
    """

    name: Annotated[str, Positional] = ""
    """Which one. Default: all are listed."""
    out: Auto[Path] = None
    """Folder to put it into; it must not hold the same file already. Default: a folder of the
    sample's name."""
    file: Auto[Path] = None
    """A file of this data set on this computer, to be checked and copied, not downloaded."""
