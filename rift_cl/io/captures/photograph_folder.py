"""The photographs of a folder that nobody has posed: which they are, and whether they are whole.

Programs that find poses decode photographs by themselves, each in its own way. Here every one is
decoded first, by the reader that a fit will use, so that what is damaged is left out beforehand;
and where one is of a kind that such a program may read otherwise than we do, or EXIF wants it
turned before it is shown, copies of plain 8-bit colours, upright, are made of all.
"""

from __future__ import annotations

import hashlib
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from rift_cl.errors import InputError, PathEscapeError, RiftError
from rift_cl.io.boundary import check_claim, reading
from rift_cl.io.captures.capture_paths import CaptureFolder, mask_beside, mask_of
from rift_cl.io.captures.view_image import check_colors, read_photograph, upright
from rift_cl.io.images.display_light import to_display
from rift_cl.io.images.image_format import SUFFIXES, UNREAD
from rift_cl.io.images.picture_header import PictureHeader
from rift_cl.io.images.pixels import write_pixels
from rift_cl.io.images.read_picture import read_picture_header
from rift_cl.io.output import check_space, writing
from rift_cl.progress import Report

# Formats that every release of COLMAP reads code for code.
_PLAIN = (".png", ".jpg", ".jpeg")


@dataclass(frozen=True)
class Photograph:
    """A photograph whose header was read.

    Args:
        name: its name in its folder.
        path: the file.
        header: what it says about itself.
    """

    name: str
    path: Path
    header: PictureHeader

    @property
    def plain(self) -> bool:
        """Any program reads the same 8-bit colours from it."""
        header = self.header
        kind = header.eight_bit and not (header.alpha or header.linear)
        return kind and header.orientation == 1 and self.path.suffix.lower() in _PLAIN

    @property
    def camera(self) -> tuple[object, ...]:
        """Photographs that have this in common were taken through one lens."""
        return (*self.header.shown_size, *self.header.taken_by)


def photographs_in(folder: Path) -> CaptureFolder:
    """Where the photographs of a folder lie: in ``images`` there, or else in itself."""
    root = folder.absolute()
    root = root.resolve() if ".." in root.parts else root
    return CaptureFolder(root, "images" if (root / "images").is_dir() else "")


def photograph_names(place: CaptureFolder) -> list[str]:
    """Names of the photographs in a folder, in order; folders inside it are not looked into.

    Hidden files are none, nor are masks that lie beside their photographs (see ``mask_of``).

    Raises:
        InputError: there is no such folder, or it may not be read.
    """
    names = [name for name in _file_names(place) if Path(name).suffix.lower() in SUFFIXES]
    shown = [name for name in names if not name.startswith(".")]
    masks = {mask_beside(name) for name in shown}
    return [name for name in shown if name not in masks]


def other_files(place: CaptureFolder) -> list[str]:
    """Names of the files in a folder that are no photographs and no masks, in order.

    Raises:
        InputError: there is no such folder, or it may not be read.
    """
    names = photograph_names(place)
    ours = {*names, *map(mask_beside, names)}
    rest = [name for name in _file_names(place) if name not in ours]
    return [shown(name) for name in rest if not _unread(name)]


def unread_photographs(place: CaptureFolder) -> list[str]:
    """Names of the files in a folder that are photographs of formats that are not read, in order.

    Raises:
        InputError: there is no such folder, or it may not be read.
    """
    return [shown(name) for name in _file_names(place) if _unread(name)]


def _unread(name: str) -> bool:
    return Path(name).suffix.lower() in UNREAD and not name.startswith(".")


def _file_names(place: CaptureFolder) -> list[str]:
    with reading(place.path, "the folder"):
        return sorted(entry.name for entry in place.path.iterdir() if entry.is_file())


def shown(name: str) -> str:
    """A name as text that can be written, whatever bytes the disk has for it."""
    return name.encode("utf-8", "backslashreplace").decode()


def with_headers(
    place: CaptureFolder, names: Sequence[str], left_out: dict[str, str]
) -> list[Photograph]:
    """Read the headers of photographs, one of each that there are several copies of.

    Args:
        place: their folder.
        names: their names.
        left_out: receives, by name, why a photograph cannot be used.

    Raises:
        PathEscapeError: a photograph is a link that leads out of the folder.
    """
    found: list[Photograph] = []
    contents: dict[bytes, list[str]] = {}
    for name in names:
        try:
            if not name.isprintable() or "\\" in name:
                raise InputError(f"{place.path}: {name!r} is no name that a model can hold")
            path = place.file(str(place.path), name)
            header = read_picture_header(path)
            check_colors(path, header)
            contents.setdefault(_digest(path), []).append(name)
        except PathEscapeError:
            raise
        except RiftError as error:
            left_out[shown(name)] = shown(_reason(place.path / name, error))
        else:
            found.append(Photograph(name, path, header))
    kept = {_kept(place, copies): copies for copies in contents.values()}
    for name, copies in kept.items():
        reason = f"is the same photograph as {name}"
        left_out.update((copy, reason) for copy in copies if copy != name)
    return [one for one in found if one.name in kept]


def _kept(place: CaptureFolder, copies: Sequence[str]) -> str:
    """The name of the one that has a mask, or else the shortest: what a copy adds to it goes."""
    return min(copies, key=lambda name: (mask_of(str(place.path), place, name) is None, len(name)))


def _reason(path: Path, error: RiftError) -> str:
    """What an error says about a file, without its path."""
    return str(error).removeprefix(f"{path}: ").replace(str(path), path.name)


def _digest(path: Path) -> bytes:
    """Of the bytes of a file."""
    with reading(path, "the photograph"):
        return hashlib.sha256(path.read_bytes()).digest()


def whole_photographs(
    photographs: Sequence[Photograph],
    copies: Path | None,
    whole: list[Photograph],
    left_out: dict[str, str],
) -> Iterator[Report]:
    """Decode photographs, and make copies where they are wanted.

    Args:
        photographs: the photographs.
        copies: a folder for 8-bit PNG copies, named with ``.png`` appended; None for none. Alpha
            is multiplied into them, light beyond 1 is cut.
        whole: receives those that can be decoded.
        left_out: receives, by name, why one cannot.

    Raises:
        OutputError: the copies cannot be written.
    """
    if copies is not None:
        with writing(copies):
            copies.mkdir()
        check_space(copies, sum(3 * np.prod(one.header.size, dtype=int) for one in photographs))
    for count, photograph in enumerate(photographs):
        try:
            codes = _codes(photograph)
        except RiftError as error:
            left_out[photograph.name] = _reason(photograph.path, error)
        else:
            whole.append(photograph)
            if copies is not None:
                path = copies / f"{photograph.name}.png"
                with writing(path):
                    write_pixels(path, codes, format="png", attributes={})
        yield Report(count + 1, len(photographs), "photographs read")


def _codes(photograph: Photograph) -> NDArray[np.uint8]:
    """8-bit colours (y, x, 3) in display light, over black."""
    path, header = photograph.path, photograph.header
    height, width = header.size
    need = 4 * (header.channels + 8) * height * width
    check_claim(path, "the photograph, with a copy of it,", need, None)
    with reading(path, "the photograph"):
        image = upright(read_photograph(path, header, None), header.orientation)
        if header.linear:
            to_display(image[..., :3])
        if header.alpha:
            image[..., :3] *= image[..., 3:]
        return np.rint(np.clip(image[..., :3], 0, 1) * 255).astype(np.uint8)
