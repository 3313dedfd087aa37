"""Which format a picture has: its content says so, and its name has to agree."""

from __future__ import annotations

from pathlib import Path

from rift_cl.errors import FileFormatError

HEIC = "heic"
# Brands of pictures that are coded in HEVC, which is what libheif decodes there.
_BRANDS = (b"heic", b"heix", b"heim", b"heis", b"mif1")
SUFFIXES = {
    ".png": "png",
    ".exr": "openexr",
    ".tif": "tiff",
    ".tiff": "tiff",
    ".jpg": "jpeg",
    ".jpeg": "jpeg",
    ".jpe": "jpeg",
    ".jfif": "jpeg",
    ".hdr": "hdr",
    ".heic": HEIC,
    ".heif": HEIC,
}
# Pictures of formats that are not read: raw files of cameras, and what the web uses.
UNREAD = (
    *(".arw", ".cr2", ".cr3", ".dng", ".nef", ".orf", ".pef", ".raf", ".raw", ".rw2", ".srw"),
    *(".avif", ".bmp", ".gif", ".jp2", ".jxl", ".psd", ".tga", ".webp"),
)
_SIGNATURES = {
    b"\x89PNG\r\n\x1a\n": "png",
    b"\x76\x2f\x31\x01": "openexr",
    b"II*\0": "tiff",
    b"MM\0*": "tiff",
    b"II+\0": "tiff",
    b"MM\0+": "tiff",
    b"\xff\xd8\xff": "jpeg",
    b"#?RADIANCE": "hdr",
    b"#?RGBE": "hdr",
}


def image_format(path: Path) -> str:
    """OpenImageIO's name for the format of a file, by its content.

    Raises:
        FileFormatError: content and name do not agree, or the format is not known.
    """
    with path.open("rb") as file:
        start = file.read(16)
    content = next((name for mark, name in _SIGNATURES.items() if start.startswith(mark)), None)
    if start[4:8] == b"ftyp" and start[8:12] in _BRANDS:
        content = HEIC
    if content is None or SUFFIXES.get(path.suffix.lower()) != content:
        raise FileFormatError(_disagreement(path, content))
    return content


def _disagreement(path: Path, content: str | None) -> str:
    """What is wrong with a picture's name or content, and what to do."""
    if content is not None:
        ending = next(suffix for suffix, format in SUFFIXES.items() if format == content)
        way = f"rename it to end in {ending}"
    elif path.suffix.lower() in UNREAD:
        return f"{path}: is of a format that is not read: convert it to PNG or JPEG"
    else:
        way = "an image is .png, .exr, .tif, .jpg, .hdr or .heic and what its name says"
    return (
        f"{path}: the content is {content or 'of no known format'}, the name says "
        f"{path.suffix or 'nothing'}: {way}"
    )
