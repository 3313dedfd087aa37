"""Notebooks of pages whose code can be run, such as the tutorials.

    python tools/make_notebooks.py --out notebooks
    python tools/make_notebooks.py docs/tutorials/scan.md --out notebooks --execute

Text becomes cells of text, blocks of ``python`` cells of code, and blocks of ``bash`` cells that a
shell runs. With ``--execute`` each notebook is run from top to bottom, in an empty folder,
and keeps what its cells gave. What is written depends on the pages alone, but for those outputs.
jupytext is needed, and for ``--execute`` nbclient and ipykernel: pip install jupytext nbclient
ipykernel.
"""

from __future__ import annotations

import os
import re
import shlex
import sys
import tempfile
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any

import tyro

ROOT = Path(__file__).parents[1]
TUTORIALS = ROOT / "docs" / "tutorials"
_BLOCK = re.compile(r"^```(?:bash|sh)\n(.*?)^```", re.DOTALL | re.MULTILINE)
_LINK = re.compile(r"\]\((?!https?:|#)([^)\s]+)\)")
# Seconds that one cell may take.
_PATIENCE = 1200


@dataclass(frozen=True)
class Options:
    """What is made.

    Args:
        pages: Markdown files; all tutorials with code if not given.
        out: folder for the notebooks.
        execute: whether they are run.
    """

    pages: Annotated[tuple[Path, ...], tyro.conf.Positional] = ()
    out: Path = Path("notebooks")
    execute: bool = False


def main(options: Options) -> int:
    """Write the notebooks; the exit status says whether all that were run ran."""
    failed = 0
    options.out.mkdir(parents=True, exist_ok=True)
    for page in options.pages or tutorials():
        book = notebook(page)
        fault = executed(book) if options.execute else ""
        path = options.out / f"{page.stem}.ipynb"
        write(book, path)
        failed += bool(fault)
        print(f"{path}: {len(book.cells)} cells{f', FAULT {fault}' if fault else ''}")
    return 1 if failed else 0


def tutorials() -> list[Path]:
    """The tutorials in which there is code."""
    return [page for page in sorted(TUTORIALS.glob("*.md")) if "\n```python" in page.read_text()]


def notebook(page: Path) -> Any:
    """A page as a notebook without outputs."""
    import jupytext

    text = _BLOCK.sub(_shell, page.read_text(encoding="utf-8"))
    book = jupytext.reads(_with_links(text, page), fmt="md")
    for number, cell in enumerate(book.cells):
        # Otherwise each is named by chance.
        cell.id = f"cell-{number}"
    book.metadata["kernelspec"] = {
        "name": "python3",
        "display_name": "Python 3",
        "language": "python",
    }
    book.metadata.pop("jupytext", None)
    return book


def _shell(block: re.Match[str]) -> str:
    """A block of commands as a cell, which a command that fails ends."""
    return f"```python\n%%script bash -e\n{block[1]}```"


def _with_links(text: str, page: Path) -> str:
    """Links to other pages, and pictures, by their place in the repository."""

    def placed(link: re.Match[str]) -> str:
        path, hash_, heading = link[1].partition("#")
        target = (page.parent / path).resolve()
        if not target.is_relative_to(ROOT):
            return link[0]
        return f"](../{target.relative_to(ROOT).as_posix()}{hash_}{heading})"

    return _LINK.sub(placed, text)


def executed(book: Any) -> str:
    """Run a notebook, which keeps the outputs; the fault that ended it, or nothing."""
    import nbclient

    with tempfile.TemporaryDirectory(prefix="rift-notebook-") as name:
        commands, folder = Path(name, "commands"), Path(name, "work")
        for each in (commands, folder):
            each.mkdir()
        rift = commands / "rift"
        rift.write_text(f'#!/bin/sh\nexec {shlex.quote(sys.executable)} -m rift_cl "$@"\n')
        rift.chmod(0o755)
        # The command is that of this checkout, installed or not, and so are modules.
        added = {"PATH": str(commands), "PYTHONPATH": str(ROOT)}
        environment = {
            **os.environ,
            **{k: os.pathsep.join(filter(None, [v, os.environ.get(k)])) for k, v in added.items()},
        }
        client = nbclient.NotebookClient(
            book,
            timeout=_PATIENCE,
            startup_timeout=_PATIENCE,
            resources={"metadata": {"path": str(folder)}},
        )
        try:
            client.execute(env=environment)
        except nbclient.exceptions.CellExecutionError as error:
            return f"{error.ename}: {error.evalue}"
    return ""


def write(book: Any, path: Path) -> None:
    """Write a notebook."""
    import nbformat

    path.write_text(nbformat.writes(book), encoding="utf-8")


if __name__ == "__main__":
    raise SystemExit(main(tyro.cli(Options, description=__doc__)))
