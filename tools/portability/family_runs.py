"""Running families of problems in a process of their own, which a driver may take with it.

A compiler that dies takes its process along. The parent then knows which family was being run by
what is missing, and starts another process with those that come after it.
"""

from __future__ import annotations

import contextlib
import json
import os
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator, Sequence
from dataclasses import replace
from pathlib import Path
from typing import NamedTuple

import numpy as np

import rift_cl as rift
from portability.problems import FAMILIES, Arrays
from rift_cl.io import write_text

_TOOLS = Path(__file__).parents[1]


class FamilyRun(NamedTuple):
    """What one family gave.

    Args:
        name: of the family.
        arrays: by name; None where it did not come to its end.
        fault: why not, in a line; empty otherwise.
        seconds: that it took, compiling included.
    """

    name: str
    arrays: Arrays | None
    fault: str = ""
    seconds: float = 0.0


def run_families(
    names: Sequence[str], *, device: str | None, as_gpu: bool, tiny: bool, limit: float
) -> Iterator[FamilyRun]:
    """Run families one after the other on one device.

    Args:
        names: of the families.
        device: as RIFT_DEVICE selects it.
        as_gpu: take a CPU for a GPU: one lane, groups of 64.
        tiny: the smallest sizes.
        limit: seconds without a result, after which the process is ended.
    """
    left = list(names)
    while left:
        with tempfile.TemporaryDirectory() as folder:
            fault = _run_child(folder, left, device, as_gpu, tiny, limit)
            while left and (found := _finished(Path(folder), left[0])):
                yield found
                left.pop(0)
        if left:
            yield FamilyRun(left.pop(0), None, fault or "no result")


def _run_child(
    folder: str, names: Sequence[str], device: str | None, as_gpu: bool, tiny: bool, limit: float
) -> str:
    """Run families into a folder; why the process did not come to its end, or nothing."""
    paths = [str(_TOOLS.parent), str(_TOOLS), os.environ.get("PYTHONPATH", "")]
    child = subprocess.Popen(
        [sys.executable, "-m", "portability.family_runs", folder, device or "", str(int(as_gpu)),
         str(int(tiny)), *names],
        env={**os.environ, "PYTHONPATH": os.pathsep.join(filter(None, paths))},
        stdout=subprocess.DEVNULL,
        stderr=subprocess.PIPE,
        text=True,
    )  # fmt: skip
    finished = -1
    while (now := len(list(Path(folder).iterdir()))) > finished:
        finished = now
        with contextlib.suppress(subprocess.TimeoutExpired):
            errors = child.communicate(timeout=limit)[1]
            if child.returncode < 0:
                return f"the process died of {signal.Signals(-child.returncode).name}"
            return errors.strip().splitlines()[-1] if child.returncode else ""
    child.kill()
    child.communicate()
    return f"no result in {limit:.0f} s"


def _finished(folder: Path, name: str) -> FamilyRun | None:
    said, path = folder / f"{name}.json", folder / f"{name}.npz"
    if not said.is_file():
        return None
    found = json.loads(said.read_text())
    if found["fault"]:
        return FamilyRun(name, None, **found)
    with np.load(path) as file:
        return FamilyRun(name, {key: file[key] for key in file.files}, **found)


def _main(folder: str, device: str, as_gpu: str, tiny: str, *names: str) -> None:
    opened = rift.open_device(device or None)
    if int(as_gpu):
        traits = replace(opened.traits, is_cpu=False)
        opened = rift.Device(opened._handle, opened.selector, traits=traits)
    for name in names:
        start, fault = time.perf_counter(), ""
        try:
            np.savez(Path(folder, f"{name}.npz"), **FAMILIES[name](opened, bool(int(tiny))))
        except rift.RiftError as error:
            fault = str(error).splitlines()[0]
        said = {"fault": fault, "seconds": time.perf_counter() - start}
        write_text(Path(folder, f"{name}.json"), json.dumps(said))


if __name__ == "__main__":
    _main(*sys.argv[1:])
