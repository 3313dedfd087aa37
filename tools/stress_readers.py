"""Does any damaged file end the process, hang it, or escape without an error that has a name?

    python tools/stress_readers.py --files 2000 --seed 0 --keep found

Valid files of the kinds in ``KINDS`` (scans as TIFF, MAT, HDF5, NPZ, MRC, Zarr and with scanners'
texts; geometries; pictures, videos, splats, points, cameras, COLMAP models, lenses, volumes,
checkpoints, kept slabs and settings) are damaged by chance: bits flipped, the end cut off, sizes
forged, blocks of one file put into another. Each is read in a child process with a limit of time
and of memory. Prints what became of them; ends with status 1 if one crashed, hung,
or raised anything but one of the package's errors.
"""

from __future__ import annotations

import importlib
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
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import tyro

from stress.damage import damaged
from stress.valid_files import OTHERS
from stress.valid_scans import SCANS

KINDS = {**SCANS, **OTHERS}
_BUDGET = 1 << 28
_FAILURES = ("crash", "hang", "unnamed error")


@dataclass(frozen=True)
class Options:
    """Damage files and see what reading them does.

    Args:
        files: how many, dealt to all kinds.
        seed: of the damage; file i depends on the seed and on i alone.
        first: number of the first file, to repeat one that was found.
        only: kinds to damage, by a part of their names; all if not given.
        seconds: after which a file counts as a hang.
        memory: bytes of address space of the child.
        keep: folder for the files that crash, hang or raise an error without a name.
    """

    files: int = 2000
    seed: int = 0
    first: int = 0
    only: str = ""
    seconds: float = 20.0
    memory: int = 6 << 30
    keep: Path | None = None


def main(options: Options) -> int:
    """Read the files, print the table, and return the exit status."""
    print(f"seed {options.seed}, files {options.first} to {options.first + options.files}")
    tally: dict[str, Counter[str]] = {name: Counter() for name in KINDS}
    with tempfile.TemporaryDirectory(prefix="rift-cl-readers-") as folder:
        reader = Reader(options.memory, options.seconds)
        places = {name: Path(folder, str(number)) for number, name in enumerate(KINDS)}
        for index, name, content in damaged_files(options):
            path = KINDS[name].put(places[name], content)
            outcome, reason = reader.read(path, KINDS[name].read)
            tally[name][outcome] += 1
            if outcome in _FAILURES:
                print(f"file {index} ({name}): {outcome}, {reason}")
                _keep(options.keep, f"{options.seed}-{index}-{name}", content)
        reader.close()
    print(table(tally))
    print(summary(tally))
    return int(any(counts[failure] for counts in tally.values() for failure in _FAILURES))


def damaged_files(options: Options) -> Iterator[tuple[int, str, bytes]]:
    """Number, kind and content of every file."""
    intact = {name: kind.make() for name, kind in KINDS.items()}
    names = [name for name in KINDS if options.only in name]
    if not names:
        raise SystemExit(
            f"stress_readers: --only is {options.only!r}, known are {', '.join(KINDS)}"
        )
    for index in range(options.first, options.first + options.files):
        random = np.random.default_rng([options.seed, index])
        name = names[index % len(names)]
        other = intact[list(KINDS)[random.integers(len(KINDS))]]
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


def summary(tally: dict[str, Counter[str]]) -> str:
    """What became of all files, in a sentence."""
    total = sum(tally.values(), Counter())
    failures = ", ".join(f"{total[failure]} x {failure}" for failure in _FAILURES)
    refused = sum(total.values()) - total["read"] - sum(total[each] for each in _FAILURES)
    return (
        f"{sum(total.values())} damaged files of {len(tally)} kinds: {total['read']} read, "
        f"{refused} refused by name; {failures}"
    )


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

    def read(self, path: Path, how: str = "scan") -> tuple[str, str]:
        """What became of a file: "read", the name of an error, or a failure; and the reason."""
        if self._child is None:
            self._child = self._started()
        child = self._child
        assert child.stdin is not None and child.stdout is not None
        child.stdin.write(f"{how} {path}\n")
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
        child = subprocess.Popen(
            [sys.executable, "-c", f"import stress_readers as s; s.serve({self._memory})"],
            env={**os.environ, "PYTHONPATH": places},
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            text=True,
        )
        # What the libraries take to load is no file's time.
        assert child.stdout is not None
        child.stdout.readline()
        return child


def serve(memory: int) -> None:
    """Read the files that are named on standard input, and answer on standard output."""
    resource.setrlimit(resource.RLIMIT_AS, (memory, memory))
    warnings.simplefilter("error")
    # Splats that damage made infinite are told, and are no fault.
    warnings.filterwarnings("ignore", ".*: they are left out")
    for module in ("rift_cl.io", "rift_cl.io.captures.camera_file", "rift_cl.io.checkpoint"):
        importlib.import_module(module)
    print("ready", flush=True)
    for line in sys.stdin:
        how, _, path = line.rstrip("\n").partition(" ")
        print(json.dumps(_outcome(how, Path(path))), flush=True)


def _outcome(how: str, path: Path) -> tuple[str, str]:
    from rift_cl import RiftError

    try:
        wrong = _READ[how](path)
        return ("unnamed error", wrong) if wrong else ("read", "")
    except RiftError as error:
        # A picture's dies in a child, and is told by name; it is a crash all the same.
        if "the decoder " in str(error):
            return "crash", str(error)
        named = str(path.parent) in str(error)
        return (
            (type(error).__name__, "") if named else ("unnamed error", f"{error!r} names no file")
        )
    except Exception as error:
        return "unnamed error", repr(error)


def _read_scan(path: Path) -> str:
    """Open a scan and read its last row and its first; what is wrong with these, if anything is."""
    from rift_cl.io import open_scan

    # Files without flats hold counts, which are refused where nothing is said of them.
    kind = "attenuation" if path.suffix in (".tif", ".mrc") else None
    scan = open_scan(path, kind=kind, budget=_BUDGET)
    scan.read(scan.shape[1] - 1, scan.shape[1])
    rows = scan.read(0, 1).projections
    if rows.shape != (scan.shape[0], 1, scan.shape[2]) or not np.isfinite(scan.angles).all():
        return f"rows of shape {rows.shape} from a scan of {scan.shape}"
    return ""


def _read_other(module: str, function: str, **options: Any) -> Callable[[Path], str]:
    """A function of the package that reads a file, taken from its module when it is used."""

    def read(path: Path) -> str:
        found: Any = importlib.import_module(f"rift_cl.{module}")
        for name in function.split("."):
            found = getattr(found, name)
        found(path, **options)
        return ""

    return read


def _read_config(path: Path) -> str:
    from rift_cl.commands.plan.settings import PlanSettings
    from rift_cl.commands.run_folder.saved_settings import saved_settings

    saved_settings(path, "plan", PlanSettings)
    return ""


def _read_video(path: Path) -> str:
    from rift_cl.io.captures.video import sharpest_frames

    for _ in sharpest_frames(path, path.parent / "frames", 3):
        pass
    return ""


def _read_slabs(path: Path) -> str:
    """Go on with slabs; those that are whole are read."""
    from rift_cl.commands.reconstruct.kept_slabs import SlabFolder

    kept = SlabFolder(path, (4, 5, 6))
    kept.projection(), kept.axis()
    kept.go_on({"rows": "a", "axis": "2.5", "tilt of the axis": "0"})
    return "" if sum(len(slab) for _, slab in kept.slabs()) == kept.done else "slices are missing"


_READ: dict[str, Callable[[Path], str]] = {
    "scan": _read_scan,
    "image": _read_other("io", "read_image", budget=_BUDGET),
    "splats": _read_other("io", "SplatScene.load", budget=_BUDGET),
    "points": _read_other("io.captures.point_cloud", "read_point_cloud"),
    "capture": _read_other("io", "open_capture", photographs=False),
    "cameras": _read_other("io.captures.camera_file", "read_cameras"),
    "lens": _read_other("io", "open_lens"),
    "volume": _read_other("io", "read_volume", budget=_BUDGET),
    "checkpoint": _read_other("io.checkpoint", "load_checkpoint"),
    "config": _read_config,
    "video": _read_video,
    "slabs": _read_slabs,
    "numbers": _read_other("io.number_list", "read_numbers", what="angles"),
}


if __name__ == "__main__":
    sys.exit(main(tyro.cli(Options)))
