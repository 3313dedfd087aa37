"""How many first builds fail when several processes build the same kernels at once?

    python tools/stress_builds.py --rounds 17 --processes 6

Each round starts with an empty kernel cache. PoCL loses such builds now and then; the lock in
``rift_cl/cl/build/kernel_cache.py`` is there to prevent that, and ``--without-lock`` shows the
driver alone. Ends with status 1 if any build failed.
"""

from __future__ import annotations

import os
import subprocess
import sys
import tempfile
from dataclasses import dataclass

import tyro

_BUILD = """
import rift_cl as rift
from rift_cl.cl.self_test import self_test
found = self_test(rift.default_device())
raise SystemExit(None if found.passed else found.detail)
"""
_WITHOUT_LOCK = """
import contextlib
from rift_cl.cl import program
from rift_cl.cl.build import builder
program.build_lock = builder.build_lock = contextlib.nullcontext
builder._PAUSES = (0.0,)
"""


@dataclass(frozen=True)
class Options:
    """Build the same kernels in several processes at once, from an empty cache, many times.

    Args:
        rounds: how often.
        processes: how many at once.
        limit: seconds after which a process counts as failed.
        without_lock: leave our protection out, to see what the driver does by itself.
    """

    rounds: int = 17
    processes: int = 6
    limit: float = 120.0
    without_lock: bool = False


def main(options: Options) -> int:
    """Run every round, print what failed and the count, and return the exit status."""
    failures = [failure for _ in range(options.rounds) for failure in one_round(options)]
    for failure in failures:
        print(failure)
    print(f"{len(failures)} of {options.rounds * options.processes} builds failed")
    return 1 if failures else 0


def one_round(options: Options) -> list[str]:
    """Start every process on one empty cache and return how each failed one ended."""
    code = (_WITHOUT_LOCK if options.without_lock else "") + _BUILD
    with tempfile.TemporaryDirectory(prefix="rift-cl-stress-") as folder:
        environment = {**os.environ, "RIFT_CACHE_DIR": folder}
        environment.pop("POCL_CACHE_DIR", None)
        started = [
            subprocess.Popen(
                [sys.executable, "-c", code], env=environment, stderr=subprocess.PIPE, text=True
            )
            for _ in range(options.processes)
        ]
        ends = [_end(process, options.limit) for process in started]
    return [end for end in ends if end]


def _end(process: subprocess.Popen[str], limit: float) -> str:
    try:
        _, said = process.communicate(timeout=limit)
    except subprocess.TimeoutExpired:
        process.kill()
        process.communicate()
        return f"no end after {limit} s"
    if process.returncode == 0 and not said:
        return ""
    return f"status {process.returncode}: {(said.strip().splitlines() or [''])[-1]}"


if __name__ == "__main__":
    sys.exit(main(tyro.cli(Options)))
