"""The picture of the packages and of their imports, for docs/explanation/architecture.md.

    python tools/draw_architecture.py                 # writes docs/explanation/architecture.svg
    python tools/draw_architecture.py --table         # prints all counts as a Markdown table

Boxes are the packages of rift_cl, in the layers that the import contract of pyproject.toml names.
An arrow says how many files of one package import another; arrows of few files are left out, and
those to the lowest layer, which everything imports. The same sources give the same bytes.
"""

from __future__ import annotations

import ast
import re
import sys
from collections import Counter
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from html import escape
from pathlib import Path

import tyro

_ROOT = Path(__file__).parents[1]
_PACKAGE = "rift_cl"
_SUBJECTS = {
    "commands": "the command line",
    "interop": "torch, SciPy, gsplat ...",
    "io": "files in and out",
    "report": "HTML reports",
    "reconstruct": "scan to slices",
    "train": "photographs to splats",
    "sampling": "coverage, criteria, planner",
    "operators": "projectors, filters",
    "splat": "render and differentiate",
    "reference": "NumPy test oracles",
    "phantom": "known objects",
    "metrics": "PSNR, SSIM",
    "optics": "lenses, transfer functions",
    "cl": "devices, kernels, memory",
    "geometry": "grids, scans, cameras",
    "basis": "Gaussians, Hermite modes, lobes",
    "registry": "filters ... by name",
    "errors": "named errors",
    "progress": "reports of long work",
    "option_marks": "how settings are options",
    "lazy_names": "names imported at first use",
    "sample": "embedded captures",
}
_STYLE = """
  text { font: 13px system-ui, sans-serif; fill: #1f2328; text-anchor: middle }
  .name { font-weight: 600; font-size: 15px }
  .count { font-size: 11px; fill: #57606a }
  .box { fill: #eaf1fb; stroke: #4a78b5; stroke-width: 1.2 }
  .arrow { fill: none; stroke: #8c6d1f; stroke-opacity: 0.55 }
  .head { fill: #8c6d1f }
  @media (prefers-color-scheme: dark) {
    text { fill: #e6edf3 } .count { fill: #9da7b3 }
    .box { fill: #172a45; stroke: #6c9bd8 }
    .arrow { stroke: #d9b44a } .head { fill: #d9b44a }
  }
"""
_WIDTH, _ROW, _BOX_HEIGHT, _GAP, _ASIDE = 1180.0, 122.0, 48.0, 26.0, 230.0


@dataclass(frozen=True)
class Options:
    """Draw the packages of rift_cl and the imports between them.

    Args:
        out: SVG file to write.
        least: arrows of fewer importing files are not drawn.
        table: print the counts of all pairs as a Markdown table, and draw nothing.
    """

    out: Path = _ROOT / "docs" / "explanation" / "architecture.svg"
    least: int = 3
    table: bool = False


@dataclass(frozen=True)
class Box:
    """A package's place in the picture: its left edge, top edge and width, in pixels."""

    left: float
    top: float
    width: float


def layers(root: Path = _ROOT) -> list[list[str]]:
    """Packages by layer, the highest first, as pyproject.toml's import contract has them."""
    text = (root / "pyproject.toml").read_text(encoding="utf-8")
    listed = re.search(r"^layers = \[(.*?)^\]", text, re.DOTALL | re.MULTILINE)
    if listed is None:
        raise SystemExit("draw_architecture: pyproject.toml has no contract with layers")
    rows = re.findall(r'"([^"]+)"', listed[1])
    return [[name.strip().removeprefix(f"{_PACKAGE}.") for name in row.split("|")] for row in rows]


def imports(root: Path = _ROOT) -> Counter[tuple[str, str]]:
    """How many files of one package import another, by (importing, imported) package."""
    counts: Counter[tuple[str, str]] = Counter()
    for path in sorted((root / _PACKAGE).rglob("*.py")):
        parts = path.relative_to(root / _PACKAGE).with_suffix("").parts
        if len(parts) == 1 and parts[0].startswith("__"):
            continue
        tree = ast.parse(path.read_text(encoding="utf-8"))
        wanted = {found for node in ast.walk(tree) for found in _imported(node)}
        counts.update((parts[0], name) for name in wanted - {parts[0]})
    return counts


def _imported(node: ast.AST) -> Iterator[str]:
    """Packages of rift_cl that a statement imports."""
    if isinstance(node, ast.ImportFrom) and node.module == _PACKAGE:
        yield from (alias.name for alias in node.names)
    names = [node.module or ""] if isinstance(node, ast.ImportFrom) else []
    names += [alias.name for alias in node.names] if isinstance(node, ast.Import) else []
    for name in names:
        head, *rest = name.split(".")
        if head == _PACKAGE and rest:
            yield rest[0]


def files(root: Path = _ROOT) -> Counter[str]:
    """How many files every package has."""
    inside = (path.relative_to(root / _PACKAGE) for path in (root / _PACKAGE).rglob("*.py"))
    return Counter(path.with_suffix("").parts[0] for path in inside)


def picture(root: Path = _ROOT, least: int = 3) -> str:
    """The SVG text: boxes in layers, and an arrow for every pair with at least so many files."""
    rows, sizes, counted = layers(root), files(root), imports(root)
    if len(rows) > 1 and all(sizes[name] == 1 for name in rows[-2]):
        rows = [*rows[:-2], [*rows[-2], *rows[-1]]]
    names = {name for row in rows for name in row}
    known = {pair: count for pair, count in counted.items() if {*pair} <= names}
    lowest = {(upper, lower) for upper, lower in known if lower in rows[-1]}
    drawn = {pair: known[pair] for pair in known.keys() - lowest if known[pair] >= least}
    boxes = _boxes(rows, Counter(lower for _, lower in drawn))
    height = len(rows) * _ROW - (_ROW - _BOX_HEIGHT) + 20
    lines = [
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {_WIDTH:.0f} {height:.0f}" '
        f'role="img" aria-label="Packages of {_PACKAGE} and the imports between them">',
        f"<style>{_STYLE}</style>",
        *_arrows(boxes, drawn),
    ]
    for name, box in boxes.items():
        middle = box.left + box.width / 2
        noun = "file" if sizes[name] == 1 else "files"
        lines += [
            f'<g id="{escape(name)}">',
            f'<rect class="box" x="{box.left:.1f}" y="{box.top:.1f}" width="{box.width:.1f}" '
            f'height="{_BOX_HEIGHT:.0f}" rx="6"/>',
            f'<text class="name" x="{middle:.1f}" y="{box.top + 20:.1f}">{escape(name)} '
            f'<tspan class="count">{sizes[name]} {noun}</tspan></text>',
            f'<text x="{middle:.1f}" y="{box.top + 38:.1f}">{escape(_SUBJECTS.get(name, ""))}'
            "</text>",
            "</g>",
        ]
    return "\n".join([*lines, "</svg>"]) + "\n"


def _boxes(rows: list[list[str]], arrows: Counter[str]) -> dict[str, Box]:
    """Places in the picture; the lone box of a layer stands aside, so that arrows pass it."""
    found = {}
    for number, row in enumerate(rows):
        widths = [_width(name, arrows[name]) for name in row]
        spread = (_WIDTH - sum(widths)) / (len(row) + 1)
        gap = max(_GAP, spread)
        left = (_WIDTH - sum(widths) - gap * (len(row) - 1)) / 2
        if len(row) == 1:
            left += _ASIDE if number % 2 else -_ASIDE
        for name, width in zip(row, widths, strict=True):
            found[name] = Box(left, 10 + number * _ROW, width)
            left += width + gap
    return found


def _width(name: str, arrows: int) -> float:
    """Of the box that a package's name, its subject and the numbers of its arrows fit into."""
    text = max(7.2 * len(_SUBJECTS.get(name, "")), 9.0 * len(name) + 70) + 26
    return max(text, 24.0 * (arrows + 1))


def _arrows(boxes: dict[str, Box], drawn: dict[tuple[str, str], int]) -> Iterator[str]:
    """Arrows leave a box's lower edge and reach another's upper edge in the order of their ends."""
    starts = _ends(boxes, drawn, own=0)
    stops = _ends(boxes, drawn, own=1)
    for (upper, lower), count in sorted(drawn.items()):
        x, y = starts[upper, lower], boxes[upper].top + _BOX_HEIGHT
        to_x, to_y = stops[upper, lower], boxes[lower].top - 6
        bend = (to_y - y) / 2
        width = 0.8 + count**0.5 / 2.5
        yield (
            f'<path class="arrow" stroke-width="{width:.1f}" d="M{x:.1f} {y:.1f}C{x:.1f} '
            f'{y + bend:.1f} {to_x:.1f} {to_y - bend:.1f} {to_x:.1f} {to_y:.1f}">'
            f"<title>{count} files of {upper} import {lower}</title></path>"
        )
        yield f'<path class="head" d="M{to_x - 4:.1f} {to_y - 2:.1f}h8l-4 8z"/>'
        yield f'<text class="count" x="{to_x:.1f}" y="{to_y - 6:.1f}">{count}</text>'


def _ends(
    boxes: dict[str, Box], drawn: Iterable[tuple[str, str]], *, own: int
) -> dict[tuple[str, str], float]:
    """Where each arrow touches the box at its end ``own`` (0 the start, 1 the head): an x."""
    found = {}
    for name, box in boxes.items():
        mine = sorted(
            (pair for pair in drawn if pair[own] == name),
            key=lambda pair: (boxes[pair[1 - own]].left + boxes[pair[1 - own]].width / 2, pair),
        )
        for place, pair in enumerate(mine):
            found[pair] = box.left + box.width * (place + 1) / (len(mine) + 1)
    return found


def table(root: Path = _ROOT) -> str:
    """All counts in Markdown: a row for the importing package, a column for the imported one."""
    names = [name for row in layers(root) for name in row]
    counts = imports(root)
    columns = [name for name in names if any(counts[row, name] for row in names)]
    lines = [
        f"| files of ... that import | {' | '.join(columns)} |",
        f"| :-- |{' --: |' * len(columns)}",
    ]
    for row in names:
        cells = [str(counts[row, name] or "") for name in columns]
        if any(cells):
            lines.append(f"| {row} | {' | '.join(cells)} |")
    return "\n".join(lines) + "\n"


def main() -> int:
    """Run with the command line's arguments; the exit status."""
    options = tyro.cli(Options)
    if options.table:
        sys.stdout.write(table())
    else:
        options.out.write_text(picture(least=options.least), encoding="utf-8", newline="\n")
    return 0


if __name__ == "__main__":
    sys.exit(main())
