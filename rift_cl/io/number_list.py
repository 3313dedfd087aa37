"""Lists of numbers in files of their own: angles of views, rotation axes of rows."""

from __future__ import annotations

import re
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
    check_claim(path, f"the list of {what}", path.stat().st_size, _LONGEST)
    lines = path.read_text(encoding="utf-8-sig").splitlines()
    rows = [re.split(r"[\s,;]+", line.split("#")[0].strip(" \t,;")) for line in lines]
    filled = [(index, row) for index, row in enumerate(rows, 1) if row != [""]]
    for index, row in filled:
        if len(row) > 1 and len(filled) > 1:
            raise FileFormatError(
                f"{path}: line {index} holds {len(row)} numbers, wanted one to a line"
            )
    return np.array([_number(path, index, word, what) for index, row in filled for word in row])


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
