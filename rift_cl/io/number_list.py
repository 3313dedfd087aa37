"""Lists of numbers in files of their own: angles of views, rotation axes of rows."""

from __future__ import annotations

import re
from collections.abc import Callable
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from rift_cl.errors import FileFormatError, InputError, ShapeError
from rift_cl.io.boundary import check_claim, reading
from rift_cl.io.npy_file import load_npy

Numbers = NDArray[np.float64]

SUFFIXES = (".txt", ".csv", ".npy")
# Eight million numbers: no scan has more, and a forged header may not ask for gigabytes.
_LONGEST = 64 << 20


def read_numbers(path: Path, what: str) -> Numbers:
    """Read a list of numbers.

    Args:
        path: a NumPy array (.npy), or text (.txt, .csv) of numbers that stand one to a line or
            all in one line; what follows ``#`` is a comment.
        what: what the numbers are, in a sentence, such as "angles".

    Raises:
        InputError: there is no such file, or it is named as neither.
        FileFormatError: it holds something else.
        ResourceLimitError: it is far longer than any such list.
    """
    if path.suffix.lower() not in SUFFIXES:
        raise InputError(f"{path}: {what} are read from {', '.join(SUFFIXES)}")
    with reading(path, f"the list of {what}"):
        if not path.is_file() and path.exists():
            raise InputError(f"{path}: is not a file")
        return _array(path, what) if path.suffix.lower() == ".npy" else text_numbers(path, what)


def text_numbers(path: Path, what: str) -> Numbers:
    """Numbers of a text file, one to a line or all in one line."""
    return table_numbers(path, what)[0]


def table_numbers(
    path: Path,
    what: str,
    column: str | None = None,
    called: Callable[[str], bool] = lambda name: False,
) -> tuple[Numbers, str]:
    """Numbers of a text file, of which a table has them in one of its columns.

    Args:
        path: text whose numbers stand one to a line, all in one line, or in a column; cells are
            parted by semicolons, commas, tabs or spaces, and what follows ``#`` is a comment.
        what: what the numbers are, in a sentence.
        column: name of the column by the table's first line, or its number from 1.
        called: whether a column of that name is the one, where none is said.

    Returns:
        The numbers, and the name of their column; empty where it has none.

    Raises:
        FileFormatError: a line holds something else, or it is not told which column is meant.
        ResourceLimitError: it is far longer than any such list.
    """
    check_claim(path, f"the list of {what}", path.stat().st_size, _LONGEST)
    lines = path.read_text(encoding="utf-8-sig").splitlines()
    texts = [(index, line.split("#")[0].strip(" \t,;")) for index, line in enumerate(lines, 1)]
    filled = [(index, text) for index, text in texts if text]
    whole = len(filled) == 1 and column is None
    rows = [(at, re.split(r"[\s,;]+", text) if whole else _cells(text)) for at, text in filled]
    width = max((len(cells) for _, cells in rows), default=0)
    if column is None and (width <= 1 or whole):
        return np.array([_number(path, at, word, what) for at, row in rows for word in row]), ""
    header = rows[0][1] if rows and not any(map(is_number, rows[0][1])) else []
    place = _place(path, column, header, width, called, rows)
    body = rows[1:] if header else rows
    short = [at for at, row in body if len(row) <= place]
    if short:
        raise FileFormatError(f"{path}: line {short[0]} has no column {place + 1}")
    values = [_number(path, at, row[place], what) for at, row in body]
    return np.array(values), header[place] if header else ""


def _cells(line: str) -> list[str]:
    """The cells of a line; with semicolons between them, commas may be those of decimals."""
    if ";" in line:
        cells = [cell.strip() for cell in line.split(";")]
        return [re.sub(r"^([+-]?\d+),(\d+)$", r"\1.\2", cell) for cell in cells]
    if "," in line:
        return [cell for part in line.split(",") for cell in (part.split() or [""])]
    return [cell.strip() for cell in line.split("\t")] if "\t" in line else line.split()


def is_number(word: str) -> bool:
    """Whether a word is a number in decimal digits, or NaN or infinity."""
    try:
        float(word)
    except ValueError:
        return False
    return True


def _place(
    path: Path,
    column: str | None,
    header: list[str],
    width: int,
    called: Callable[[str], bool],
    rows: list[tuple[int, list[str]]],
) -> int:
    """Which column of a table is meant, counted from 0."""
    if column is not None:
        if column in header:
            return header.index(column)
        if column.isdecimal() and 1 <= int(column) <= width:
            return int(column) - 1
    found = [place for place, name in enumerate(header) if column is None and called(name)]
    if len(found) == 1:
        return found[0]
    line, cells = next((row for row in rows if len(row[1]) > 1), rows[0] if rows else (1, []))
    named = f" called {', '.join(map(repr, header))}" if header else ""
    asked = "" if column is None else f", none of them {column!r}"
    raise FileFormatError(
        f"{path}: line {line} ({' '.join(cells)[:60]!r}) holds {len(cells)} columns{named}{asked}: "
        f"name the one that is meant as {path.name}:COLUMN, by its name or its number from 1, or "
        "write one number to a line, with a point in decimals"
    )


def _number(path: Path, line: int, word: str, what: str) -> float:
    try:
        return float(word)
    except ValueError:
        raise FileFormatError(
            f"{path}: line {line} holds {word[:40]!r}, wanted one of the {what}; put # before "
            "lines that hold none"
        ) from None


def _array(path: Path, what: str) -> Numbers:
    values = load_npy(path, f"the list of {what}", _LONGEST)
    if values.size != max(values.shape, default=1):
        raise ShapeError(f"{path}: has shape {values.shape}, wanted {what} along one axis")
    return values.reshape(values.size)
