"""Processes that build the same kernels at once, from an empty cache, all succeed."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]


def test_concurrent_first_builds_all_succeed():
    # The tool does more rounds by itself; here it is enough to see that the lock is there.
    done = subprocess.run(
        [sys.executable, ROOT / "tools" / "stress_builds.py", "--rounds", "1", "--processes", "4"],
        env={**os.environ, "PYTHONPATH": str(ROOT)},
        capture_output=True,
        text=True,
        timeout=250,
        check=False,
    )
    assert (done.returncode, done.stdout.strip()) == (0, "0 of 4 builds failed"), done.stderr


LOCKED = """
import sys, time
from rift_cl.cl.build.kernel_cache import build_lock
with build_lock():
    print("locked", flush=True)
    sys.stdin.readline()
"""
WAITING = """
from rift_cl.cl.build.kernel_cache import build_lock
print("wants", flush=True)
with build_lock():
    print("has", flush=True)
"""


@pytest.fixture
def start(tmp_path):
    running = []

    def run(code):
        process = subprocess.Popen(
            [sys.executable, "-c", code],
            env={**os.environ, "PYTHONPATH": str(ROOT), "RIFT_CACHE_DIR": str(tmp_path)},
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            text=True,
        )
        running.append(process)
        return process

    yield run
    for process in running:
        process.kill()
        process.communicate()


@pytest.mark.skipif(sys.platform == "win32", reason="there is no PoCL to guard on Windows")
@pytest.mark.parametrize("end", ["released", "killed"])
def test_lock_keeps_others_out_until_its_holder_ends(start, end):
    holder = start(LOCKED)
    assert holder.stdout.readline() == "locked\n"
    waiting = start(WAITING)
    assert waiting.stdout.readline() == "wants\n"
    with pytest.raises(subprocess.TimeoutExpired):
        waiting.wait(timeout=0.3)
    if end == "killed":
        holder.send_signal(signal.SIGKILL)
    else:
        holder.stdin.write("\n")
        holder.stdin.flush()
    assert waiting.communicate(timeout=30)[0] == "has\n"
    assert waiting.returncode == 0
