"""Run what a page of the documentation shows: its Python and its commands, from top to bottom.

    python tools/run_page.py docs/tutorials/scan.md --out folder

Blocks of Python share their names; lines of a block of commands run one after the other. All run in
the folder, so that a page finds what it wrote. Blocks of other languages are shown, not run, and so
are those that import torch or JAX where there is none.
"""

from __future__ import annotations

import os
import re
import shlex
import sys
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from importlib.util import find_spec
from pathlib import Path
from typing import Any, NamedTuple

import tyro

from rift_cl.commands.cli import main as rift

_MISSING = [f"import {name}" for name in ("torch", "jax") if find_spec(name) is None]
_BLOCK = re.compile(r"^```(\w+)\n(.*?)^```$", re.MULTILINE | re.DOTALL)


@dataclass(frozen=True)
class Options:
    """Run the code and the commands of a page.

    Args:
        page: Markdown file.
        out: folder to run in; it is made where there is none.
    """

    page: tyro.conf.Positional[Path]
    out: Path = Path("page")


class Block(NamedTuple):
    """A block that runs.

    Args:
        language: ``python`` or ``bash``.
        text: what it says.
        line: where it begins on the page.
    """

    language: str
    text: str
    line: int


def blocks(page: Path, changes: Mapping[str, str] | None = None) -> Iterator[Block]:
    """The blocks of a page that run.

    Args:
        page: Markdown file.
        changes: texts to put in the place of others, such as fewer steps of a fit.

    Raises:
        ValueError: the page does not say what is to be changed.
    """
    text = page.read_text(encoding="utf-8")
    for old, new in (changes or {}).items():
        if old not in text:
            raise ValueError(f"{page} does not say {old!r}")
        text = text.replace(old, new)
    for found in _BLOCK.finditer(text):
        skipped = any(line in found[2] for line in _MISSING)
        if found[1] in ("python", "bash") and not skipped:
            yield Block(found[1], found[2], text.count("\n", 0, found.start()) + 2)


def run_page(
    page: Path,
    folder: Path,
    changes: Mapping[str, str] | None = None,
    given: Mapping[str, Any] | None = None,
) -> dict[str, Any]:
    """Run the blocks of a page in a folder.

    Args:
        page: Markdown file.
        folder: is made where there is none.
        changes: as for ``blocks``.
        given: names that the page's Python takes as there.

    Returns:
        The names that its Python left.

    Raises:
        RuntimeError: a command ended with another status than 0.
    """
    names: dict[str, Any] = {"__name__": page.stem, **(given or {})}
    with inside(folder):
        for block in blocks(page.absolute(), changes):
            where = f"{page}:{block.line}"
            if block.language == "python":
                exec(compile("\n" * (block.line - 1) + block.text, str(page), "exec"), names)
            else:
                run_commands(block.text, where)
    return names


def run_commands(text: str, where: str) -> None:
    """Run lines of commands of ours, one after the other.

    Raises:
        RuntimeError: a line is no command of ours, or ended with another status than 0.
    """
    for line in text.replace("\\\n", " ").splitlines():
        words = shlex.split(line, comments=True)
        if words and words[0] != "rift":
            raise RuntimeError(f"{where}: {words[0]} is no command of ours; use a block of text")
        if words and (status := rift(words[1:])):
            raise RuntimeError(f"{where}: '{line}' ended with status {status}")


@contextmanager
def inside(folder: Path) -> Iterator[None]:
    """Work in a folder, and come back (contextlib.chdir is of Python 3.11)."""
    before = Path.cwd()
    folder.mkdir(parents=True, exist_ok=True)
    os.chdir(folder)
    try:
        yield
    finally:
        os.chdir(before)


def main() -> int:
    """Run with the command line's arguments; the exit status."""
    options = tyro.cli(Options)
    run_page(options.page.absolute(), options.out)
    return 0


if __name__ == "__main__":
    sys.exit(main())
