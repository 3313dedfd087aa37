"""Everything that a new device has to show, in one command and one file.

    python tools/bench_gpu.py --device radeon --out radeon
    python tools/bench_gpu.py --device radeon --out radeon --only families kernels --quick

It compares 22 families of kernels with PoCL (``tools/compare_drivers.py``), runs the tests that use
a device, and measures the kernels beside other packages as far as those are installed
(``tools/bench_kernels.py --peers``). What they say is shown meanwhile. OUT.json holds every
figure, OUT.md the tables, both with the device's name; a part that fails or hangs is told there and
does not stop the others. Ends with status 1 if one did.
"""

from __future__ import annotations

import json
import os
import queue
import subprocess
import sys
import tempfile
import threading
import time
from collections import deque
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import IO, Any, Literal

import tyro

import rift_cl as rift
from bench.command import say
from bench.surroundings import surroundings
from bench.table import Table, markdown_lines
from bench.tables import tables
from rift_cl.io import write_text

_TOOLS = Path(__file__).parent
_TESTS = ("cl", "operators", "splat", "train", "sampling", "reconstruct")
_LINES = 15


@dataclass(frozen=True)
class Options:
    """Try a device from end to end: numbers, tests, speed.

    Args:
        out: path of the result without its ending; .json and .md are written.
        device: which OpenCL device, as RIFT_DEVICE selects it; the default one if not given.
        quick: small families, one case of each test, one size and few repeats.
        only: parts to run, of families, tests and kernels; all if not given.
        workers: processes that run tests at the same time.
        against: reference of the families: a device, or an NPZ file of compare_drivers.py --save.
        limit: seconds without a line from a part, after which it is given up.
    """

    out: Path
    device: str | None = None
    quick: bool = False
    only: tuple[Literal["families", "tests", "kernels"], ...] = ()
    workers: int = 1
    against: str = "pocl"
    limit: float = 3600.0


def main(options: Options) -> int:
    """Run the parts one after the other and write what is known after each; the exit status."""
    try:
        device = rift.open_device(options.device)
    except rift.RiftError as error:
        say(f"bench_gpu: {error}")
        return error.exit_status
    command = " ".join(("python tools/bench_gpu.py", *sys.argv[1:]))
    record: dict[str, Any] = {**surroundings(device), "command": command, "parts": {}}
    with tempfile.TemporaryDirectory() as folder:
        for name, arguments in _parts(options, device.selector, Path(folder)):
            if options.only and name not in options.only:
                continue
            say(f"{name}: {' '.join(arguments)}")
            found = Path(folder, f"{name}.json")
            record["parts"][name] = _run(arguments, found, device.selector, options.limit)
            write_text(options.out.with_suffix(".json"), json.dumps(record, indent=1) + "\n")
            write_text(options.out.with_suffix(".md"), _page(record))
    failed = [name for name, part in record["parts"].items() if part["status"]]
    say(f"failed: {', '.join(failed)}" if failed else "all passed")
    return int(bool(failed))


def _parts(options: Options, device: str, folder: Path) -> Iterator[tuple[str, list[str]]]:
    """Each part's name and command; what it finds out goes to NAME.json in the folder."""
    quick = options.quick
    families = [str(_TOOLS / "compare_drivers.py"), "--device", device]
    families += ["--against", options.against, "--json", str(folder / "families.json")]
    yield "families", [sys.executable, *families, *(["--tiny"] if quick else [])]
    tests = [str(_TOOLS.parent / "tests" / name) for name in _TESTS]
    pytest = [sys.executable, "-m", "pytest", "-q", "-m", "plain" if quick else "full"]
    yield "tests", [*pytest, "-n", str(options.workers), "--timeout", str(options.limit), *tests]
    kernels = [str(_TOOLS / "bench_kernels.py"), "--device", device, "--peers"]
    kernels += ["--json", str(folder / "kernels.json")]
    yield "kernels", [sys.executable, *kernels, *(["--quick"] if quick else [])]


def _run(arguments: list[str], path: Path, device: str, limit: float) -> dict[str, Any]:
    """Run a part and show what it says: its exit status, seconds, last lines, and what it wrote."""
    start = time.perf_counter()
    paths = [str(_TOOLS.parent), os.environ.get("PYTHONPATH", "")]
    own = {"RIFT_DEVICE": device, "PYTHONPATH": os.pathsep.join(filter(None, paths))}
    process = subprocess.Popen(
        arguments,
        cwd=_TOOLS.parent,
        env={**os.environ, **own, "PYTHONUNBUFFERED": "1"},
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
        errors="replace",
    )
    assert process.stdout is not None
    lines: queue.Queue[str] = queue.Queue()
    threading.Thread(target=_pump, args=(process.stdout, lines), daemon=True).start()
    said: deque[str] = deque(maxlen=_LINES)
    try:
        while line := lines.get(timeout=limit):
            said.append(line.rstrip("\n"))
            say(said[-1])
        process.wait()
    except queue.Empty:
        said.append(f"no line in {limit:.3g} s: given up")
    finally:
        process.kill()
        process.wait()
    return {
        "command": " ".join(arguments),
        "status": process.returncode,
        "seconds": round(time.perf_counter() - start, 1),
        "said": list(said),
        "found": json.loads(path.read_text(encoding="utf-8")) if path.is_file() else None,
    }


def _pump(stream: IO[str], lines: queue.Queue[str]) -> None:
    """Hand lines on until there are no more, which an empty one tells."""
    with stream:
        for line in stream:
            lines.put(line)
    lines.put("")


def _page(record: dict[str, Any]) -> str:
    device, parts = record["device"], record["parts"]
    lines = [
        f"# {device['name']}",
        "",
        f"rift_cl {record['version']} on {device['name']} ({device['platform']}, driver "
        f"{device['driver']}, {device['compute_units']} compute units), {record['date']}, by "
        f"`{record['command']}`.",
    ]
    shown = [
        Table(
            "Parts",
            ("part", "exit status", "s"),
            [(name, str(part["status"]), str(part["seconds"])) for name, part in parts.items()],
        )
    ]
    families = parts.get("families", {}).get("found")
    if families:
        rows = [
            (row["family"], row["difference"], row["worst array"], str(row["s"]))
            for row in families["families"]
        ]
        head = ("family", "relative L2 difference", "worst array", "s")
        shown.append(Table(f"Families of kernels against {families['against']}", head, rows))
    lines += markdown_lines(shown)
    for name, part in parts.items():
        if name == "tests" or part["status"]:
            lines += ["", f"## {name}: the last lines", "", "```", *part["said"], "```"]
    kernels = parts.get("kernels", {}).get("found")
    if kernels:
        lines += markdown_lines(tables(kernels))
    return "\n".join(lines) + "\n"


if __name__ == "__main__":
    raise SystemExit(main(tyro.cli(Options)))
