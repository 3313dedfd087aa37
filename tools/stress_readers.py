"""Does any damaged scan end the process, hang it, or escape without an error that has a name?

    python tools/stress_readers.py --files 2000 --seed 0 --keep found

Valid TIFF, MAT (versions 5 and 7.3), HDF5 (Data Exchange, NXtomo), NPZ and MRC files are damaged by
chance: bits flipped, the end cut off, sizes forged, blocks of one file put into another. Each is
opened and one row of it read in a child process with a limit of time and of memory. Prints what
became of them; ends with status 1 if one crashed, hung, or raised anything but one of the package's
errors.
"""

from __future__ import annotations

import json
import os
import resource
import selectors
import signal
import subprocess
import sys
import tempfile
import warnings
from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import tyro

from stress.damage import damaged
from stress.valid_scans import KINDS

_BUDGET = 1 << 28
_FAILURES = ("crash", "hang", "unnamed error")


@dataclass(frozen=True)
class Options:
    """Damage scans and see what reading them does.

    Args:
        files: how many.
        seed: of the damage; file i depends on the seed and on i alone.
        first: number of the first file, to repeat one that was found.
        seconds: after which a file counts as a hang.
        memory: bytes of address space of the child.
        keep: folder for the files that crash, hang or raise an error without a name.
    """

    files: int = 2000
    seed: int = 0
    first: int = 0
    seconds: float = 20.0
    memory: int = 6 << 30
    keep: Path | None = None


def main(options: Options) -> int:
    """Read the files, print the table, and return the exit status."""
    print(f"seed {options.seed}, files {options.first} to {options.first + options.files}")
    tally: dict[str, Counter[str]] = {name: Counter() for name in KINDS}
    with tempfile.TemporaryDirectory(prefix="rift-cl-readers-") as folder:
        reader = Reader(options.memory, options.seconds)
        for index, name, content in damaged_files(options):
            path = Path(folder, f"scan{KINDS[name].suffix}")
            path.write_bytes(content)
            outcome, reason = reader.read(path)
            tally[name][outcome] += 1
            if outcome in _FAILURES:
                print(f"file {index} ({name}): {outcome}, {reason}")
                _keep(options.keep, f"{options.seed}-{index}-{path.name}", content)
        reader.close()
    print(table(tally))
    return int(any(counts[failure] for counts in tally.values() for failure in _FAILURES))


def damaged_files(options: Options) -> Iterator[tuple[int, str, bytes]]:
    """Number, kind and content of every file."""
    intact = {name: kind.make() for name, kind in KINDS.items()}
    names = list(KINDS)
    for index in range(options.first, options.first + options.files):
        random = np.random.default_rng([options.seed, index])
        name = names[index % len(names)]
        other = intact[names[random.integers(len(names))]]
        yield index, name, KINDS[name].pack(damaged(random, intact[name], other))


def table(tally: dict[str, Counter[str]]) -> str:
    """What became of the files, a line for each kind."""
    errors = sorted({key for counts in tally.values() for key in counts} - {"read", *_FAILURES})
    columns = ["read", *errors, *_FAILURES]
    rows = [["", *columns]]
    rows += [[name, *(str(counts[key]) for key in columns)] for name, counts in tally.items()]
    total = sum(tally.values(), Counter())
    rows.append(["all", *(str(total[key]) for key in columns)])
    widths = [max(len(row[i]) for row in rows) for i in range(len(rows[0]))]
    lines = [[cell.rjust(width) for cell, width in zip(row, widths, strict=True)] for row in rows]
    return "\n".join("  ".join(line) for line in lines)


def _keep(folder: Path | None, name: str, content: bytes) -> None:
    if folder is not None:
        folder.mkdir(parents=True, exist_ok=True)
        (folder / name).write_bytes(content)


class Reader:
    """A child process that reads one file after the other, and is replaced when it ends.

    Args:
        memory: bytes of its address space.
        seconds: that one file may take.
    """

    def __init__(self, memory: int, seconds: float) -> None:
        self._memory = memory
        self._seconds = seconds
        self._child: subprocess.Popen[str] | None = None

    def read(self, path: Path) -> tuple[str, str]:
        """What became of a file: "read", the name of an error, or a failure; and the reason."""
        if self._child is None:
            self._child = self._started()
        child = self._child
        assert child.stdin is not None and child.stdout is not None
        child.stdin.write(f"{path}\n")
        child.stdin.flush()
        with selectors.DefaultSelector() as selector:
            selector.register(child.stdout, selectors.EVENT_READ)
            answer = child.stdout.readline() if selector.select(self._seconds) else None
        if answer:
            outcome, reason = json.loads(answer)
            return outcome, reason
        if answer is None:
            self.close()
            return "hang", f"not read after {self._seconds:g} s"
        status = child.wait(self._seconds)
        self.close()
        return "crash", signal.Signals(-status).name if status < 0 else f"exit status {status}"

    def close(self) -> None:
        """End the child."""
        if self._child is not None:
            self._child.kill()
            self._child.communicate()
            self._child = None

    def _started(self) -> subprocess.Popen[str]:
        here = Path(__file__).absolute()
        places = os.pathsep.join((str(here.parents[1]), str(here.parent)))
        return subprocess.Popen(
            [sys.executable, "-c", f"import stress_readers as s; s.serve({self._memory})"],
            env={**os.environ, "PYTHONPATH": places},
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            text=True,
        )


def serve(memory: int) -> None:
    """Read the files that are named on standard input, and answer on standard output."""
    resource.setrlimit(resource.RLIMIT_AS, (memory, memory))
    warnings.simplefilter("error")
    for line in sys.stdin:
        print(json.dumps(_outcome(Path(line.rstrip("\n")))), flush=True)


def _outcome(path: Path) -> tuple[str, str]:
    from rift_cl import RiftError
    from rift_cl.io import open_scan

    try:
        # Files without flats hold counts, which are refused where nothing is said of them.
        kind = "attenuation" if path.suffix in (".tif", ".mrc") else None
        scan = open_scan(path, kind=kind, budget=_BUDGET)
        scan.read(scan.shape[1] - 1, scan.shape[1])
        rows = scan.read(0, 1).projections
        if rows.shape != (scan.shape[0], 1, scan.shape[2]) or not np.isfinite(scan.angles).all():
            return "unnamed error", f"rows of shape {rows.shape} from a scan of {scan.shape}"
        return "read", ""
    except RiftError as error:
        named = str(path.parent) in str(error)
        return (
            (type(error).__name__, "") if named else ("unnamed error", f"{error!r} names no file")
        )
    except Exception as error:
        return "unnamed error", repr(error)


if __name__ == "__main__":
    sys.exit(main(tyro.cli(Options)))
