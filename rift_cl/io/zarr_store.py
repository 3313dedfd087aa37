"""What is checked of a Zarr store, a folder of small files, before Zarr reads any of them."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from rift_cl.errors import FileFormatError, PathEscapeError
from rift_cl.json_parsing import parse_json

# Headers of groups and arrays, of Zarr 2 and of Zarr 3.
GROUP_2, ARRAY_2, NODE_3 = ".zgroup", ".zarray", "zarr.json"
_LARGEST_HEADER = 1 << 20
# Decoders that only unpack bytes. Others, such as "pickle", would run what the file says.
_CODECS = {"blosc", "bytes", "crc32c", "gzip", "lz4", "zlib", "zstd"}


def read_header(path: Path) -> dict[str, Any]:
    """A header, or a file of attributes.

    Raises:
        FileFormatError: it is too long, or no object.
    """
    if path.stat().st_size > _LARGEST_HEADER:
        raise FileFormatError(f"{path}: is too long for the header of a Zarr store")
    value = parse_json(path.read_text(encoding="utf-8"))
    if not isinstance(value, dict):
        raise FileFormatError(f"{path}: is no header of a Zarr store")
    return value


def check_entries(path: Path) -> None:
    """Refuse what leads out of a store, and what reading would wait at.

    Raises:
        PathEscapeError: a link leads outside.
        FileFormatError: an entry is neither a file nor a folder.
    """
    root = path.resolve()
    for entry in path.rglob("*"):
        if entry.is_symlink() and not entry.resolve().is_relative_to(root):
            raise PathEscapeError(f"{path}: {entry.name!r} leads outside the store; copy it in")
        if not (entry.is_file() or entry.is_dir()):
            raise FileFormatError(f"{path}: {entry.name!r} is neither a file nor a folder")


def check_codecs(path: Path) -> None:
    """Refuse an array whose chunks are packed by anything but a plain compressor.

    Raises:
        FileFormatError: it is.
    """
    for header in (path / NODE_3, path / ARRAY_2):
        if header.exists():
            strange = _codecs(header) - _CODECS
            if strange:
                raise FileFormatError(
                    f"{path}: is packed with {sorted(strange)}, wanted some of {sorted(_CODECS)}"
                )


def _codecs(header: Path) -> set[str]:
    meta = read_header(header)
    codecs = [*meta.get("codecs", []), meta.get("compressor"), *(meta.get("filters") or [])]
    names = (codec.get(key) for codec in codecs if codec for key in ("name", "id"))
    return {str(name) for name in names if name is not None}
