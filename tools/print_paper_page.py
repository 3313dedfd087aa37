"""Pictures and tables of docs/explanation/paper.md, from the results of tools/reproduce_paper.py.

    python tools/reproduce_paper.py --quick --out paper
    python tools/print_paper_page.py --results paper

Nothing is computed here: what the page shows between its marks is what a figure's own file holds,
with the device and the date of that file. Figures without a file there stay as they are.
"""

from __future__ import annotations

import io
import json
import re
import sys
from dataclasses import dataclass
from importlib import import_module
from pathlib import Path
from typing import Any

import tyro
from PIL import Image

_ROOT = Path(__file__).parents[1]
PAGE = _ROOT / "docs" / "explanation" / "paper.md"
# Bytes and pixels across of a picture, at most.
_BYTES, _WIDTH = 150_000, 1200


@dataclass(frozen=True)
class Options:
    """Print the page of the paper's figures.

    Args:
        results: folder that tools/reproduce_paper.py wrote.
        page: the page, whose marks say what goes where.
        pictures: folder of the pictures.
    """

    results: Path = Path("paper")
    page: Path = PAGE
    pictures: Path = _ROOT / "docs" / "pictures"


class Shown:
    """Takes down what a figure shows on its page of a report."""

    def __init__(self) -> None:
        self.pictures: list[bytes] = []
        self.tables: list[tuple[Any, Any]] = []

    def figure(self, picture: bytes, **_: Any) -> None:
        """A picture."""
        self.pictures.append(picture)

    def table(self, columns: Any, rows: Any, **_: Any) -> None:
        """A table."""
        self.tables.append((columns, rows))

    def paragraph(self, *_: Any) -> None:
        """A text, which the page says in its own words."""


def print_page(options: Options) -> str:
    """The page with its tables; its pictures are written."""
    text = options.page.read_text(encoding="utf-8")
    for name, number in re.findall(r"!\[[^\]]*\]\([^)]*paper-(\w+)-(\d)\.png\)", text):
        if not (options.results / f"{name}.json").is_file():
            continue
        picture = _small(_shown(options.results, name)[0].pictures[int(number)])
        (options.pictures / f"paper-{name}-{number}.png").write_bytes(picture)

    def table(found: re.Match[str]) -> str:
        if not (options.results / f"{found[1]}.json").is_file():
            return found[0]
        shown, about = _shown(options.results, found[1])
        columns, rows = shown.tables[0]
        lines = [_row(columns), _row([" --: "] * len(columns)), *map(_row, rows)]
        return f"<!-- printed: {found[1]} -->\n{chr(10).join(lines)}\n\n{about}\n<!-- end -->"

    return re.sub(r"<!-- printed: (\w+) -->.*?<!-- end -->", table, text, flags=re.DOTALL)


def _shown(results: Path, name: str) -> tuple[Shown, str]:
    record = json.loads((results / f"{name}.json").read_text(encoding="utf-8"))
    shown = Shown()
    import_module(f"paper.{name}").show(shown, record["result"])
    around = record["environment"]
    return shown, f"`--only {name}`, {around['device']}, {around['date'][:10]}."


def _row(cells: Any) -> str:
    return "| " + " | ".join(f"{c:.4g}" if isinstance(c, float) else str(c) for c in cells) + " |"


def _small(png: bytes) -> bytes:
    """The picture no wider than a page, with as many colours as let it stay small."""
    picture = Image.open(io.BytesIO(png)).convert("RGB")
    found = png
    for width, colours in ((_WIDTH, 256), (_WIDTH, 64), (900, 64), (700, 64), (500, 64)):
        smaller = picture.copy()
        smaller.thumbnail((width, 4 * width))
        buffer = io.BytesIO()
        smaller.quantize(colours, dither=Image.Dither.NONE).save(buffer, "PNG", optimize=True)
        found = buffer.getvalue()
        if len(found) <= _BYTES:
            break
    return found


def main() -> int:
    """Run with the command line's arguments; the exit status."""
    options = tyro.cli(Options)
    options.page.write_text(print_page(options), encoding="utf-8", newline="\n")
    return 0


if __name__ == "__main__":
    sys.exit(main())
