"""Paths that are written inside a capture, followed only as far as the capture's own folder.

A capture is passed from hand to hand, and whoever opens it has not read it: a name in it must not
lead to any other file of the machine, by ``..``, by an absolute path or by a symbolic link.
"""

from __future__ import annotations

import os.path
import reprlib
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path, PureWindowsPath

from rift_cl.errors import FileFormatError, InputError, PathEscapeError, RiftError

# Folders of masks beside the photographs, or beside their folder.
MASK_FOLDERS = ("masks", "mask")
_MASK_SUFFIXES = (".png", ".jpg", ".jpeg", ".tif", ".tiff")
# NeRF's synthetic captures leave the extension out; all of them are PNG.
_SUFFIXES = ("", ".png", ".jpg", ".jpeg", ".exr", ".tif", ".tiff", ".hdr")


@dataclass(frozen=True)
class CaptureFolder:
    """The folder that the names of a capture are looked for in.

    Args:
        root: the folder of the capture, absolute and without ``..``; no name leads out of it.
        below: the folder in it that names start from.
        complete: whether files that are named must be there.
    """

    root: Path
    below: str = ""
    complete: bool = True

    def file(self, where: str, name: str) -> Path:
        """The file of that name.

        Args:
            where: the place that names it, for errors.
            name: its path from this folder; a backslash counts as a slash.

        Raises:
            PathEscapeError: it lies outside the folder.
            InputError: it is not there, and the folder is to be complete.
        """
        found = self._find(where, name, ("",))
        if found is None and self.complete:
            there = self._named(name, "").exists()
            why = "no file (a folder, a pipe or a device)" if there else f"not in {self.path}"
            raise InputError(f"{where}: leads to {_short(name)}, which is {why}")
        return found or self._named(name, "")

    def image(self, where: str, name: str) -> Path:
        """The image of that name, which may lack its extension; errors are those of ``file``."""
        found = self._find(where, name, _SUFFIXES)
        if found is None and self.complete:
            raise InputError(f"{where}: the image {_short(name)} is not in {self.path}")
        return found or self._named(name, "")

    def optional(self, where: str, *names: str) -> Path | None:
        """The first of these files that is there, or None."""
        found = (self._find(where, name, ("",)) for name in names)
        return next((path for path in found if path is not None), None)

    def name_of(self, path: Path) -> str:
        """What a file of the folder is called in it."""
        if path.is_relative_to(self.path):
            return path.relative_to(self.path).as_posix()
        return path.resolve().relative_to(self._real).as_posix()

    @property
    def path(self) -> Path:
        """The folder that names start from."""
        return self.root / self.below

    @cached_property
    def _real(self) -> Path:
        return self.root.resolve()

    def _find(self, where: str, name: str, suffixes: tuple[str, ...]) -> Path | None:
        plain = name.replace("\\", "/")
        if not plain.strip("/") or "\0" in plain or PureWindowsPath(plain).drive:
            raise PathEscapeError(f"{where}: {_short(name)} is no path inside {self.root}")
        try:
            for suffix in suffixes:
                path = self._named(name, suffix)
                self._demand_inside(where, name, path)
                if path.is_file():
                    return path
        except RiftError:
            raise
        except (OSError, ValueError, RuntimeError) as error:
            reason = getattr(error, "strerror", None) or type(error).__name__
            raise FileFormatError(
                f"{where}: {_short(name)} cannot be followed as a path ({reason})"
            ) from error
        return None

    def _named(self, name: str, suffix: str) -> Path:
        return Path(os.path.normpath(self.path / (name.replace("\\", "/") + suffix)))

    def _demand_inside(self, where: str, name: str, path: Path) -> None:
        if path.resolve().is_relative_to(self._real):
            return
        link = self._link_out(path)
        if link is None:
            raise PathEscapeError(
                f"{where}: leads to {_short(name)}, which is outside the folder {self.root}; put "
                "that file there and mend the path"
            )
        raise PathEscapeError(
            f"{where}: {link} is a link to {link.resolve()}, outside the folder {self.root}, and "
            "is not followed: in a capture of strangers it could lead to any file. Put there what "
            "it leads to ('cp -rL' copies a folder with all that its links lead to)"
        )

    def _link_out(self, path: Path) -> Path | None:
        """The link on the way to a path inside the folder by which it leads out, if one does."""
        if not path.is_relative_to(self.root):
            return None
        way = [path, *path.parents]
        inside = reversed(way[: way.index(self.root)])
        return next((p for p in inside if not p.resolve().is_relative_to(self._real)), None)


def mask_beside(name: str) -> str:
    """What the mask of a photograph is called that lies beside it."""
    return str(Path(name).with_name(f"{Path(name).stem}_mask.png"))


def mask_of(where: str, images: CaptureFolder, name: str) -> Path | None:
    """The mask of a photograph, found by its name; None where there is none.

    Looked for, in this order, are ``masks/NAME.EXT.png`` as COLMAP calls it, ``masks/NAME.png``,
    the same as ``.jpg``, ``.jpeg``, ``.tif`` and ``.tiff``, all of these in ``mask``, both beside
    the folder ``images``, and ``NAME_mask.png`` beside the photograph.

    Args:
        where: the place that names the photograph, for errors.
        images: the folder that names start from.
        name: the photograph's path from there.

    Raises:
        PathEscapeError: it is a link that leads out of the capture.
    """
    names = masks_named(name)
    for folder in MASK_FOLDERS:
        # Most captures have none, and a look for each of the names takes time.
        if (images.root / folder).is_dir():
            found = CaptureFolder(images.root, folder).optional(where, *names)
            if found is not None:
                return found
    return images.optional(where, mask_beside(name.replace("\\", "/")))


def masks_named(name: str) -> tuple[str, ...]:
    """What the mask of a photograph may be called in a folder of masks, likeliest first."""
    plain = Path(name.replace("\\", "/"))
    inner = Path(*plain.parts[1:]) if plain.parts[0] == "images" else plain
    return tuple(
        f"{start}{suffix}" for suffix in _MASK_SUFFIXES for start in (inner, inner.with_suffix(""))
    )


def _short(name: str) -> str:
    return reprlib.repr(name)
