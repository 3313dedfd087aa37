"""Pictures in a page: enlarged by a tap or a key, wiped against each other, gone through.

What a picture does it does by HTML and CSS where they can: a hidden checkbox before each enlarges
it, pictures of a slider lie in a strip that scrolls, two that are compared lie side by side. The
page's script makes a slider and a wipe of these, and lets Escape put an enlarged picture back.
"""

from __future__ import annotations

import base64
import re
from collections.abc import Sequence
from dataclasses import dataclass
from io import BytesIO

from rift_cl.errors import InputError
from rift_cl.report.html_page.text import escape

_KINDS = {
    b"\x89PNG\r\n\x1a\n": "png",
    b"\xff\xd8\xff": "jpeg",
    b"<svg ": "svg+xml",
    # Of the formats in such a file a browser shows WebP alone.
    b"RIFF": "webp",
}
_SVG_SIZE = re.compile(rb'<svg [^>]*?width="(\d+)" height="(\d+)"')
# A picture of fewer samples along its longer side is enlarged to squares.
_COARSE = 256


@dataclass(frozen=True)
class Compared:
    """Two pictures of one size, of which a wipe shows the one left and the other right of a line.

    Args:
        before: a PNG or JPEG file's content.
        after: another.
        names: of the two.
    """

    before: bytes
    after: bytes
    names: tuple[str, str]


def figure(picture: bytes | tuple[bytes, bytes], *, caption: str, alt: str, key: str) -> str:
    """A figure of one picture, or of one drawing for wide and one for narrow pages."""
    wide, narrow = picture if isinstance(picture, tuple) else (picture, None)
    shown = _img(wide, alt, "drawing")
    if narrow is not None:
        source = f'<source media="(max-width: 36rem)" srcset="{data_address(narrow)}">'
        shown = f"<picture>{source}{shown}</picture>"
    kind = "" if narrow is None else ' class="adapts"'
    inner = f'<label for="{key}">{shown}</label>'
    return (
        f"<figure{kind}>\n{_enlarged(inner, alt, key)}\n"
        f"<figcaption>{escape(caption)}</figcaption>\n</figure>"
    )


def panels(
    cells: Sequence[bytes | Compared],
    *,
    titles: Sequence[str],
    columns: int,
    caption: str,
    alt: str,
    key: str,
) -> str:
    """A figure of pictures in a grid, fewer in a row on a narrow page."""
    if not cells or len(cells) != len(titles) or columns < 1:
        raise InputError(
            f"panels: there are {len(cells)} pictures, {len(titles)} titles and {columns} columns, "
            "wanted a title for each picture and a column or more"
        )
    inner = "\n".join(
        _panel(shown, title, f"{alt}: {title}" if title else alt, f"{key}-{number}")
        for number, (shown, title) in enumerate(zip(cells, titles, strict=True))
    )
    # Two that belong together stand below each other.
    narrow = 1 if columns <= 2 else 2
    return (
        f'<figure>\n<div class="panels" style="--columns: {columns}; --narrow: {narrow}">\n'
        f"{inner}\n</div>\n<figcaption>{escape(caption)}</figcaption>\n</figure>"
    )


def slider(
    pictures: Sequence[bytes],
    *,
    labels: Sequence[str],
    start: int,
    caption: str,
    alt: str,
    key: str,
) -> str:
    """A figure that shows one of its pictures at a time."""
    if not pictures or len(pictures) != len(labels) or not 0 <= start < len(pictures):
        raise InputError(
            f"slider: there are {len(pictures)} pictures, {len(labels)} labels and the start "
            f"{start}, wanted a label for each picture and one of them to start with"
        )
    frames = "\n".join(
        _img(picture, f"{alt}: {label}", "shown" if number == start else "", label=label)
        for number, (picture, label) in enumerate(zip(pictures, labels, strict=True))
    )
    inner = (
        f'<div class="frames" tabindex="0" role="group" aria-label="{escape(alt)}">\n{frames}\n'
        f'</div>\n<label class="choice"><input type="range" min="0" max="{len(pictures) - 1}" '
        f'value="{start}" autocomplete="off" aria-label="{escape(alt)}"> '
        f"<output>{escape(labels[start])}</output></label>\n{_corner(key)}"
    )
    return (
        f'<figure class="slider">\n{_enlarged(inner, alt, key)}\n'
        f"<figcaption>{escape(caption)}</figcaption>\n</figure>"
    )


def _panel(shown: bytes | Compared, title: str, alt: str, key: str) -> str:
    if isinstance(shown, Compared):
        inner = _wipe(shown, alt) + _corner(key)
    else:
        inner = f'<label for="{key}">{_img(shown, alt)}</label>'
    name = f'\n<p class="title">{escape(title)}</p>' if title else ""
    return f'<div class="panel">\n{_enlarged(inner, alt, key)}{name}\n</div>'


def _wipe(pair: Compared, alt: str) -> str:
    left, right = (escape(name) for name in pair.names)
    wide, high = _size(pair.before)
    return (
        f'<div class="pair" style="--w: {wide}; --h: {high}">\n'
        f"{_img(pair.before, f'{alt}, {pair.names[0]}', 'before')}\n"
        f"{_img(pair.after, f'{alt}, {pair.names[1]}', 'after')}\n"
        f"<span>{left}</span><span>{right}</span>\n"
        f'<input type="range" min="0" max="100" value="50" autocomplete="off" '
        f'aria-label="{escape(alt)}: {left} on the left, {right} on the right of the line">\n'
        "</div>"
    )


def _enlarged(inner: str, alt: str, key: str) -> str:
    """What fills the window while its checkbox is on."""
    if not alt.strip():
        raise InputError("a picture's alt is empty; say in words what it shows")
    return (
        f'<input class="zoom" type="checkbox" id="{key}" autocomplete="off" '
        f'aria-label="Enlarge: {escape(alt)}">\n<div class="stage">\n{inner}\n</div>'
    )


def _corner(key: str) -> str:
    return f'<label class="corner" for="{key}" aria-hidden="true">+</label>'


def _img(content: bytes, alt: str, kind: str = "", *, label: str = "") -> str:
    wide, high = _size(content)
    coarse = "coarse" if max(wide, high) < _COARSE and "svg" not in _kind(content) else ""
    card = "card" if kind == "drawing" and "svg" not in _kind(content) else ""
    words = " ".join(filter(None, [kind, coarse, card]))
    named = f' class="{words}"' if words else ""
    data = f' data-label="{escape(label)}"' if label else ""
    return (
        f'<img{named} src="{data_address(content)}" alt="{escape(alt)}"{data} width="{wide}" '
        f'height="{high}" style="--w: {wide}; --h: {high}">'
    )


def data_address(content: bytes) -> str:
    """A picture as the address of an image in HTML."""
    return f"data:image/{_kind(content)};base64,{base64.b64encode(content).decode('ascii')}"


def _kind(content: bytes) -> str:
    for beginning, kind in _KINDS.items():
        if content.startswith(beginning):
            return kind
    raise InputError("a picture is no PNG, JPEG, WebP or SVG file, wanted its complete content")


def _size(content: bytes) -> tuple[int, int]:
    """Width and height, of a drawing as it is meant to be shown."""
    if _kind(content) == "svg+xml":
        found = _SVG_SIZE.match(content)
        if found is None:
            raise InputError("an SVG file does not begin with its width and height in pixels")
        return int(found[1]), int(found[2])
    from PIL import Image, UnidentifiedImageError

    try:
        with Image.open(BytesIO(content)) as image:
            return image.size
    except (UnidentifiedImageError, OSError, SyntaxError, ValueError) as error:
        raise InputError(f"a picture is no complete PNG, JPEG or WebP file ({error})") from error
