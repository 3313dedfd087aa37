"""Run the stress tools and print docs/reliability.md: each promise, its test, the figure, its date.

    python tools/report_reliability.py --only "damaged files" --page docs/reliability.md
    python tools/report_reliability.py --share 0.1

Counts are those of a full run; ``--share`` makes them smaller. The page shows the commands that
were run. Commands and figures of promises that are not run are kept as the page has them. Ends with
status 1 if a tool found a promise broken.
"""

from __future__ import annotations

import re
import subprocess
import sys
from collections.abc import Callable
from dataclasses import dataclass
from datetime import datetime, timezone
from pathlib import Path
from typing import NamedTuple

import tyro

_HERE = Path(__file__).resolve().parent
_NOT_RUN = "not run yet"
_HEAD = """# Reliability

What holds when files are damaged, processes are killed, builds collide and viewers are attacked.
Each row is a promise, the command that was run, what it printed last, and when.
`python tools/report_reliability.py` runs them all and prints this page.

| promise | tried by | found | on |
| :-- | :-- | :-- | :-- |
"""
_FOOT = """
The kinds of files are those of `KINDS` in `tools/stress_readers.py`. Not among them: TXRM.
"""
_ROW = re.compile(r"^\| (.+?) \| `(.+?)` \| (.+?) \| (.*?) \|$", re.MULTILINE)


class Promise(NamedTuple):
    """What is promised, and what tries it.

    Args:
        name: what holds.
        tool: file in this folder; the last line that it prints is the figure.
        count: option of the tool that says how often it tries.
        full: that often in a full run.
    """

    name: str
    tool: str
    count: str
    full: int

    def command(self, tries: int) -> str:
        """The tool with a number of tries, as the page shows it."""
        return f"{self.tool} {self.count} {tries}"


class Found(NamedTuple):
    """A row of the page.

    Args:
        command: the tool and how often it tried.
        figure: the last line that it printed.
        date: day of the run.
    """

    command: str
    figure: str
    date: str


PROMISES = (
    Promise(
        "damaged files of the kinds that are tried end in a named error",
        "stress_readers.py",
        "--files",
        98_000,
    ),
    Promise(
        "a command that is killed at any moment and resumed leaves the same bytes",
        "stress_resumes.py",
        "--kills",
        100,
    ),
    Promise(
        "a disk that is full from any write on ends a command with a sentence; --resume goes on",
        "stress_disk.py",
        "--tries",
        400,
    ),
    Promise(
        "processes that build the same kernels at once all succeed",
        "stress_builds.py",
        "--rounds",
        50,
    ),
    Promise(
        "nothing that a page sends ends the viewer or is printed, and strangers see nothing of it",
        "stress_viewer.py",
        "--messages",
        20_000,
    ),
)


@dataclass(frozen=True)
class Options:
    """Run the stress tools and write the page.

    Args:
        page: the page to write; its figures are kept for what is not run.
        only: promises to run, by a part of their names; all if not given.
        share: of the full counts.
    """

    page: Path = _HERE.parent / "docs" / "reliability.md"
    only: str = ""
    share: float = 1.0


def main(options: Options) -> int:
    """Run the tools, write the page, and return the exit status."""
    text = options.page.read_text(encoding="utf-8") if options.page.exists() else ""
    known = {name: Found(*rest) for name, *rest in _ROW.findall(text)}
    broken = 0
    for promise in PROMISES:
        if options.only in promise.name:
            count = max(1, round(options.share * promise.full))
            figure, status = found(promise, count)
            broken |= status
            today = datetime.now(timezone.utc).date().isoformat()
            known[promise.name] = Found(promise.command(count), figure, today)
    options.page.write_text(page(known), encoding="utf-8")
    return broken


def found(
    promise: Promise,
    tries: int,
    run: Callable[..., subprocess.CompletedProcess[str]] = subprocess.run,
) -> tuple[str, int]:
    """What a tool printed last, and whether it found the promise broken (1) or not (0)."""
    command = [sys.executable, str(_HERE / promise.tool), promise.count, str(tries)]
    done = run(command, stdout=subprocess.PIPE, text=True, check=False)
    lines = done.stdout.strip().splitlines() or [f"ended with status {done.returncode}"]
    return ("" if done.returncode == 0 else "BROKEN: ") + lines[-1], int(done.returncode != 0)


def page(known: dict[str, Found]) -> str:
    """The page of all promises, with what is known of them."""
    rows = []
    for promise in PROMISES:
        last = known.get(promise.name, Found(promise.command(promise.full), _NOT_RUN, ""))
        rows.append(f"| {promise.name} | `{last.command}` | {last.figure} | {last.date} |\n")
    return _HEAD + "".join(rows) + _FOOT


if __name__ == "__main__":
    sys.exit(main(tyro.cli(Options)))
