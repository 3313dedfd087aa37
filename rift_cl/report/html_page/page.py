"""The page itself: blocks of text, tables and pictures, from top to bottom.

All text is escaped here; the caller writes plain text and saves what ``Page.html`` returns.
"""

from __future__ import annotations

import base64
import hashlib
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from urllib.parse import quote

from rift_cl.errors import InputError, ShapeError
from rift_cl.report.html_page import pictures
from rift_cl.report.html_page.pictures import Compared
from rift_cl.report.html_page.script import SCRIPT
from rift_cl.report.html_page.style import STYLE
from rift_cl.report.html_page.text import cell, escape, table


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
        self._pictures = 0

    def section(self, heading: str) -> None:
        """Begin a section."""
        self._blocks.append(f"<h2>{escape(heading)}</h2>")

    def paragraph(self, text: str) -> None:
        """Add a paragraph of plain text."""
        self._blocks.append(f"<p>{escape(text)}</p>")

    def link(self, text: str, file: str) -> None:
        """Add a paragraph that leads to a file beside the page."""
        self._blocks.append(f'<p><a href="{quote(file)}">{escape(text)}</a></p>')

    def code(self, text: str) -> None:
        """Add text in a fixed-width type, line breaks kept."""
        self._blocks.append(f'<pre tabindex="0"><code>{escape(text)}</code></pre>')

    @contextmanager
    def folded(self, summary: str) -> Iterator[None]:
        """Fold away the blocks that are added within, under a line that opens them."""
        self._blocks.append(f"<details>\n<summary>{escape(summary)}</summary>")
        yield
        self._blocks.append("</details>")

    def facts(self, facts: Mapping[str, object]) -> None:
        """Add names and their values, shown as in a table but with six significant digits."""
        pairs = [
            f"<dt>{escape(name)}</dt><dd>{escape(cell(value, digits=6))}</dd>"
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
        self._blocks.append(table(columns, rows, caption))

    def figure(self, picture: bytes | tuple[bytes, bytes], *, caption: str, alt: str) -> None:
        """Add a picture, which a tap or a key enlarges.

        Args:
            picture: a PNG, JPEG, WebP or SVG file's content, or two of which the first is for wide
                pages and the second for those of a telephone. An SVG file begins with its width
                and height in pixels, as those of ``rift_cl.report.plot.figure_svg`` do.
            caption: what the picture shows, printed below it.
            alt: what a person who cannot see the picture should read.

        Raises:
            InputError: the bytes are no such file, or ``alt`` is empty.
        """
        block = pictures.figure(picture, caption=caption, alt=alt, key=self._key())
        self._blocks.append(block)

    def panels(
        self,
        cells: Sequence[bytes | Compared],
        *,
        titles: Sequence[str],
        columns: int,
        caption: str,
        alt: str,
    ) -> None:
        """Add pictures in a grid, each of which can be enlarged, and wipes between two.

        Args:
            cells: the pictures row by row: PNG or JPEG files' contents, or two to compare.
            titles: a text below each; empty for none.
            columns: pictures in a row; two or fewer on a narrow page.
            caption: what the pictures show, printed below them.
            alt: what a person who cannot see the pictures should read; titles follow it.

        Raises:
            InputError: a picture is no such file, ``alt`` is empty, or there is not a title for
                each picture.
        """
        block = pictures.panels(
            cells, titles=titles, columns=columns, caption=caption, alt=alt, key=self._key()
        )
        self._blocks.append(block)

    def slider(
        self,
        frames: Sequence[bytes],
        *,
        labels: Sequence[str],
        start: int,
        caption: str,
        alt: str,
    ) -> None:
        """Add pictures of which a slider shows one; a strip that scrolls where no script runs.

        Args:
            frames: PNG or JPEG files' contents, all of one size.
            labels: a text for each, shown beside the slider.
            start: number of the picture that is shown first.
            caption: what the pictures show, printed below them.
            alt: what a person who cannot see the pictures should read.

        Raises:
            InputError: a picture is no such file, ``alt`` is empty, or there is not a label for
                each picture.
        """
        block = pictures.slider(
            frames, labels=labels, start=start, caption=caption, alt=alt, key=self._key()
        )
        self._blocks.append(block)

    def html(self) -> str:
        """The whole page, to be saved as UTF-8."""
        subtitle = f"\n<p>{escape(self._subtitle)}</p>" if self._subtitle else ""
        policy = "default-src 'none'; img-src data:; style-src 'unsafe-inline'"
        script = ""
        if self._pictures:
            digest = base64.b64encode(hashlib.sha256(SCRIPT.encode()).digest()).decode()
            policy += f"; script-src 'sha256-{digest}'"
            script = f"\n<script>{SCRIPT}</script>"
        return (
            '<!DOCTYPE html>\n<html lang="en">\n<head>\n<meta charset="utf-8">\n'
            f'<meta http-equiv="Content-Security-Policy" content="{policy}">\n'
            '<meta name="viewport" content="width=device-width, initial-scale=1">\n'
            f"<title>{escape(self._title)}</title>\n<style>{STYLE}</style>\n</head>\n"
            f"<body>\n<main>\n<header>\n<h1>{escape(self._title)}</h1>{subtitle}\n</header>\n"
            + "\n".join(self._blocks)
            + f"\n</main>{script}\n</body>\n</html>\n"
        )

    def _key(self) -> str:
        """The name of the next picture within the page."""
        self._pictures += 1
        return f"picture-{self._pictures}"
