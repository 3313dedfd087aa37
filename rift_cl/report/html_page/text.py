"""Text in a page: what HTML forbids is escaped, numbers are set as people read them."""

from __future__ import annotations

import html
import numbers
import re
from collections.abc import Sequence

_QUANTITY = re.compile(r"[-+−±]?[\d.,]*\d(e[-+−]?\d+)?[%×°]?( [^\s\d]+)?|[-+−]?inf|nan|[-–—]?")
_UNPRINTABLE = re.compile("[\x00-\x08\x0b\x0c\x0e-\x1f\x7f\ud800-\udfff]")


def escape(text: str) -> str:
    """Text that stays text in HTML."""
    # Characters that HTML or UTF-8 forbid reach a report through the names of damaged files.
    return html.escape(_UNPRINTABLE.sub("\N{REPLACEMENT CHARACTER}", text))


def cell(value: object, *, digits: int = 4) -> str:
    """A value as text: integers in full, other numbers with so many digits, None as a dash."""
    if value is None:
        return "\N{EN DASH}"
    if not isinstance(value, numbers.Real) or isinstance(value, numbers.Integral):
        return str(value)
    number = float(value)
    whole = 10**digits - 0.5 <= abs(number) < 1e9
    text = f"{number:.0f}" if whole else f"{number:.{digits}g}"
    return text.replace("-", "\N{MINUS SIGN}")


def table(columns: Sequence[str], rows: Sequence[Sequence[object]], caption: str) -> str:
    """A table; a column in which every cell is a number is set flush right."""
    cells = [[cell(value) for value in row] for row in rows]
    flush = [_is_numeric([row[k] for row in cells]) for k in range(len(columns))]
    head = "".join(_th(c, "col", number=n) for c, n in zip(columns, flush, strict=True))
    body = "\n".join(_row(row, flush) for row in cells)
    title = f"<caption>{escape(caption)}</caption>\n" if caption else ""
    return (
        f'<div class="scroll" role="region" aria-label="{escape(caption or "Table")}" '
        f'tabindex="0">\n<table>\n{title}<thead><tr>{head}</tr></thead>\n'
        f"<tbody>\n{body}\n</tbody>\n</table>\n</div>"
    )


def _is_numeric(cells: Sequence[str]) -> bool:
    return any(cells) and all(_QUANTITY.fullmatch(text) for text in cells)


def _row(cells: Sequence[str], flush: Sequence[bool]) -> str:
    first = _th(cells[0], "row", number=flush[0])
    rest = "".join(
        f'<td class="number">{escape(text)}</td>' if number else f"<td>{escape(text)}</td>"
        for text, number in zip(cells[1:], flush[1:], strict=True)
    )
    return f"<tr>{first}{rest}</tr>"


def _th(text: str, scope: str, *, number: bool) -> str:
    style = ' class="number"' if number else ""
    return f'<th scope="{scope}"{style}>{escape(text)}</th>'
