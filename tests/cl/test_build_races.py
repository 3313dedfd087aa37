"""Processes that build the same kernels at once, from an empty cache, all succeed."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
from pathlib import Path

import pytest

from rift_cl import __version__
from rift_cl.cl.build.cache_check import remove_damaged

ROOT = Path(__file__).parents[2]


@pytest.mark.full
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
import sys
from rift_cl.cl.build.kernel_cache import build_lock
with build_lock(*sys.argv[1:]):
    print("locked", flush=True)
    sys.stdin.readline()
"""
WAITING = """
import sys
from rift_cl.cl.build.kernel_cache import build_lock
print("wants", flush=True)
with build_lock(*sys.argv[1:]):
    print("has", flush=True)
"""


@pytest.fixture
def start(tmp_path):
    running = []

    def run(code, *kernel):
        process = subprocess.Popen(
            [sys.executable, "-c", code, *kernel],
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
@pytest.mark.parametrize(
    ("held", "wanted"), [((), ("a",)), (("a",), ()), (("a",), ("a",))], ids=("all", "one", "same")
)
def test_lock_keeps_others_out_until_its_holder_ends(start, held, wanted, end):
    holder = start(LOCKED, *held)
    assert holder.stdout.readline() == "locked\n"
    waiting = start(WAITING, *wanted)
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


@pytest.mark.skipif(sys.platform == "win32", reason="there is no PoCL to guard on Windows")
def test_other_kernels_are_built_meanwhile_and_recorded_by_the_last(start, tmp_path):
    holder = start(LOCKED, "a")
    assert holder.stdout.readline() == "locked\n"
    program = tmp_path / "rift_cl" / __version__ / "AB" / "CD" / "program.bc"
    program.parent.mkdir(parents=True)
    program.write_bytes(b"a half")
    assert start(WAITING, "b").communicate(timeout=30)[0] == "wants\nhas\n"
    program.write_bytes(b"a whole")
    holder.communicate("\n", timeout=30)
    assert remove_damaged(program.parents[2]) == 0
    program.write_bytes(b"another")
    assert remove_damaged(program.parents[2]) == 1
