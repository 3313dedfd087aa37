"""One self-contained HTML page: text, tables and pictures in a single file that needs no network.

Reports are mailed, archived and opened years later, so style and pictures are inside the file, no
script runs but the one of a slider, and a content policy in the page forbids every request and any
other script. All text is escaped here; the caller writes plain text and saves what ``Page.html``
returns.
"""

from __future__ import annotations

import base64
import hashlib
import html
import numbers
import re
from collections.abc import Mapping, Sequence

from rift_cl.errors import InputError, ShapeError

_PNG_SIGNATURE = b"\x89PNG\r\n\x1a\n"
_QUANTITY = re.compile(r"[-+−±]?[\d.,]*\d(e[-+−]?\d+)?[%×°]?( [^\s\d]+)?|[-+−]?inf|nan|[-–—]?")
_UNPRINTABLE = re.compile("[\x00-\x08\x0b\x0c\x0e-\x1f\x7f\ud800-\udfff]")

# Shows the sliders, and of each the picture that it points at.
_SLIDER = """
for (const figure of document.querySelectorAll("figure.slider")) {
  const pictures = figure.querySelectorAll("img"), shown = figure.querySelector("output");
  figure.querySelector("input").addEventListener("input", (event) => {
    pictures.forEach((picture, number) => { picture.hidden = number !== +event.target.value; });
    shown.textContent = pictures[event.target.value].dataset.label;
  });
  figure.hidden = false;
}
"""

_STYLE = """
:root { color-scheme: light dark; --ink: #1c1d1f; --soft: #63666b; --line: #d9dbde; --paper: #fff;
  --tint: #f5f6f7; }
@media (prefers-color-scheme: dark) {
  :root { --ink: #e4e5e7; --soft: #9da1a7; --line: #3a3d42; --paper: #17181a; --tint: #212327; } }
* { box-sizing: border-box; }
body { margin: 0; color: var(--ink); background: var(--paper);
  font: 1rem/1.55 system-ui, -apple-system, "Segoe UI", "Noto Sans", "DejaVu Sans", sans-serif; }
main { max-width: 58rem; margin: 0 auto; padding: 3.5rem 1.5rem 5rem; }
header { padding-bottom: 1.25rem; border-bottom: 1px solid var(--line); }
h1 { margin: 0; font-size: 2rem; line-height: 1.2; font-weight: 600; letter-spacing: -0.015em; }
h2 { margin: 3rem 0 0.75rem; font-size: 1.25rem; line-height: 1.3; font-weight: 600; }
p { max-width: 42rem; margin: 0.75rem 0; }
header p { margin: 0.4rem 0 0; color: var(--soft); }
h1, h2, p, figcaption, td, th, dd { overflow-wrap: break-word; }
caption, figcaption { color: var(--soft); font-size: 0.875rem; line-height: 1.45; }
.scroll { overflow-x: auto; margin: 1.5rem 0; }
table { border-collapse: collapse; font-size: 0.9375rem; font-variant-numeric: tabular-nums; }
caption { padding-bottom: 0.5rem; text-align: left; }
th, td { padding: 0.4rem 1.5rem 0.4rem 0; text-align: left; vertical-align: top;
  border-bottom: 1px solid var(--line); }
thead th { font-size: 0.875rem; font-weight: 600; vertical-align: bottom;
  border-bottom-color: var(--soft); }
tbody th { font-weight: 400; }
.number { padding: 0.4rem 0 0.4rem 1.5rem; text-align: right; white-space: nowrap; }
tr > .number:first-child { padding-left: 0; }
.number + :not(.number) { padding-left: 1.5rem; }
figure { margin: 1.75rem 0; }
img { display: block; max-width: 100%; height: auto; background: #fff; }
figcaption { max-width: 42rem; margin-top: 0.5rem; }
[hidden] { display: none !important; }
.slider input { width: min(32rem, 70%); vertical-align: middle; }
.slider output { font-variant-numeric: tabular-nums; }
pre { overflow-x: auto; margin: 1.25rem 0; padding: 0.9rem 1.1rem; background: var(--tint);
  border-radius: 4px; font: 0.85rem/1.5 ui-monospace, Menlo, Consolas, "DejaVu Sans Mono",
  monospace; }
dl { display: grid; grid-template-columns: max-content minmax(0, 1fr); gap: 0.3rem 1.75rem;
  margin: 1.25rem 0; font-size: 0.9375rem; }
dt { color: var(--soft); }
dd { margin: 0; font-variant-numeric: tabular-nums; }
@media (prefers-color-scheme: dark) { img { padding: 0.5rem; border-radius: 4px; } }
@media (max-width: 36rem) {
  main { padding: 2rem 1rem 3rem; }
  dl { grid-template-columns: 1fr; gap: 0; } dd { margin-bottom: 0.6rem; } }
@media print {
  :root { color-scheme: light; --ink: #000; --soft: #444; --line: #bbb; --paper: #fff;
    --tint: #f5f6f7; }
  main { max-width: none; padding: 0; }
  h2 { break-after: avoid; } figure, tr, dl { break-inside: avoid; }
  pre { white-space: pre-wrap; } .scroll { overflow: visible; } }
"""


class Page:
    """A page that grows from top to bottom; every method but ``html`` adds one block.

    Args:
        title: heading of the page and title of its window.
        subtitle: one line under it, for instance the date and the device.

    Raises:
        InputError: ``title`` is empty.
    """

    def __init__(self, title: str, subtitle: str = "") -> None:
        if not title.strip():
            raise InputError("Page: title is empty; a page needs one")
        self._title = title
        self._subtitle = subtitle
        self._blocks: list[str] = []
        self._slides = False

    def section(self, heading: str) -> None:
        """Begin a section."""
        self._blocks.append(f"<h2>{_escape(heading)}</h2>")

    def paragraph(self, text: str) -> None:
        """Add a paragraph of plain text."""
        self._blocks.append(f"<p>{_escape(text)}</p>")

    def code(self, text: str) -> None:
        """Add text in a fixed-width type, line breaks kept."""
        self._blocks.append(f'<pre tabindex="0"><code>{_escape(text)}</code></pre>')

    def facts(self, facts: Mapping[str, object]) -> None:
        """Add names and their values, shown as in a table but with six significant digits."""
        pairs = [
            f"<dt>{_escape(name)}</dt><dd>{_escape(_cell(value, digits=6))}</dd>"
            for name, value in facts.items()
        ]
        self._blocks.append("<dl>\n" + "\n".join(pairs) + "\n</dl>")

    def table(
        self, columns: Sequence[str], rows: Sequence[Sequence[object]], *, caption: str = ""
    ) -> None:
        """Add a table whose first column names its rows.

        Args:
            columns: the headings.
            rows: one cell per column. Text is shown as it is, integers in full, other numbers
                with four significant digits, None as a dash. A column in which every cell is a
                number, with a unit or without, is set flush right.
            caption: what the table shows.

        Raises:
            ShapeError: there is no column, or a row has another number of cells.
        """
        if not columns:
            raise ShapeError("table: columns is empty, wanted at least one heading")
        for index, row in enumerate(rows):
            if len(row) != len(columns):
                raise ShapeError(f"table: rows[{index}] has {len(row)} cells, not {len(columns)}")
        cells = [[_cell(value) for value in row] for row in rows]
        flush = [_is_numeric([row[k] for row in cells]) for k in range(len(columns))]
        head = "".join(_th(c, "col", number=n) for c, n in zip(columns, flush, strict=True))
        body = "\n".join(_row(row, flush) for row in cells)
        title = f"<caption>{_escape(caption)}</caption>\n" if caption else ""
        self._blocks.append(
            f'<div class="scroll" role="region" aria-label="{_escape(caption or "Table")}" '
            f'tabindex="0">\n<table>\n{title}<thead><tr>{head}</tr></thead>\n'
            f"<tbody>\n{body}\n</tbody>\n</table>\n</div>"
        )

    def figure(self, png_bytes: bytes, *, caption: str, alt: str) -> None:
        """Add a picture.

        Args:
            png_bytes: a PNG file's content.
            caption: what the picture shows, printed below it.
            alt: what a person who cannot see the picture should read.

        Raises:
            InputError: the bytes are no PNG file, or ``alt`` is empty.
        """
        if not png_bytes.startswith(_PNG_SIGNATURE):
            raise InputError("figure: png_bytes is no PNG file, wanted its complete content")
        if not alt.strip():
            raise InputError("figure: alt is empty; say in words what the picture shows")
        data = base64.b64encode(png_bytes).decode("ascii")
        self._blocks.append(
            f'<figure>\n<img src="data:image/png;base64,{data}" alt="{_escape(alt)}">\n'
            f"<figcaption>{_escape(caption)}</figcaption>\n</figure>"
        )

    def slider(
        self,
        pictures: Sequence[bytes],
        *,
        labels: Sequence[str],
        start: int,
        caption: str,
        alt: str,
    ) -> None:
        """Add pictures of which a slider shows one; nothing where scripts do not run.

        Args:
            pictures: PNG files' contents, all of one size.
            labels: a text for each, shown beside the slider.
            start: number of the picture that is shown first.
            caption: what the pictures show, printed below them.
            alt: what a person who cannot see the pictures should read.

        Raises:
            InputError: a picture is no PNG file, ``alt`` is empty, or there is not a label for
                each picture.
        """
        if not pictures or len(pictures) != len(labels) or not 0 <= start < len(pictures):
            raise InputError(
                f"slider: there are {len(pictures)} pictures, {len(labels)} labels and the start "
                f"{start}, wanted a label for each picture and one of them to start with"
            )
        if not all(picture.startswith(_PNG_SIGNATURE) for picture in pictures) or not alt.strip():
            raise InputError("slider: wanted complete PNG files, and a text in alt")
        encoded = [base64.b64encode(picture).decode("ascii") for picture in pictures]
        images = "\n".join(
            f'<img src="data:image/png;base64,{data}" alt="{_escape(f"{alt}: {label}")}" '
            f'data-label="{_escape(label)}"{"" if number == start else " hidden"}>'
            for number, (data, label) in enumerate(zip(encoded, labels, strict=True))
        )
        self._slides = True
        self._blocks.append(
            f'<figure class="slider" hidden>\n{images}\n'
            f'<label><input type="range" min="0" max="{len(pictures) - 1}" value="{start}" '
            f'aria-label="{_escape(alt)}"> <output>{_escape(labels[start])}</output></label>\n'
            f"<figcaption>{_escape(caption)}</figcaption>\n</figure>"
        )

    def html(self) -> str:
        """The whole page, to be saved as UTF-8."""
        subtitle = f"\n<p>{_escape(self._subtitle)}</p>" if self._subtitle else ""
        policy = "default-src 'none'; img-src data:; style-src 'unsafe-inline'"
        script = ""
        if self._slides:
            digest = base64.b64encode(hashlib.sha256(_SLIDER.encode()).digest()).decode()
            policy += f"; script-src 'sha256-{digest}'"
            script = f"\n<script>{_SLIDER}</script>"
        return (
            '<!DOCTYPE html>\n<html lang="en">\n<head>\n<meta charset="utf-8">\n'
            f'<meta http-equiv="Content-Security-Policy" content="{policy}">\n'
            '<meta name="viewport" content="width=device-width, initial-scale=1">\n'
            f"<title>{_escape(self._title)}</title>\n<style>{_STYLE}</style>\n</head>\n"
            f"<body>\n<main>\n<header>\n<h1>{_escape(self._title)}</h1>{subtitle}\n</header>\n"
            + "\n".join(self._blocks)
            + f"\n</main>{script}\n</body>\n</html>\n"
        )


def _escape(text: str) -> str:
    # Characters that HTML or UTF-8 forbid reach a report through the names of damaged files.
    return html.escape(_UNPRINTABLE.sub("\N{REPLACEMENT CHARACTER}", text))


def _cell(value: object, *, digits: int = 4) -> str:
    if value is None:
        return "\N{EN DASH}"
    if not isinstance(value, numbers.Real) or isinstance(value, numbers.Integral):
        return str(value)
    number = float(value)
    whole = 10**digits - 0.5 <= abs(number) < 1e9
    text = f"{number:.0f}" if whole else f"{number:.{digits}g}"
    return text.replace("-", "\N{MINUS SIGN}")


def _is_numeric(cells: Sequence[str]) -> bool:
    return any(cells) and all(_QUANTITY.fullmatch(cell) for cell in cells)


def _row(cells: Sequence[str], flush: Sequence[bool]) -> str:
    first = _th(cells[0], "row", number=flush[0])
    rest = "".join(
        f'<td class="number">{_escape(cell)}</td>' if number else f"<td>{_escape(cell)}</td>"
        for cell, number in zip(cells[1:], flush[1:], strict=True)
    )
    return f"<tr>{first}{rest}</tr>"


def _th(text: str, scope: str, *, number: bool) -> str:
    style = ' class="number"' if number else ""
    return f'<th scope="{scope}"{style}>{_escape(text)}</th>'
