"""A compiler that dies, hangs or refuses takes no process with it, and is asked in another way."""

from __future__ import annotations

import json
import signal
import sys
import time
from pathlib import Path

import numpy as np
import pytest

import rift_cl as rift
from rift_cl.cl.build import guarded_build as guarded_build_module
from rift_cl.cl.build.first_launch import smallest_alike, told_launch, way_of
from rift_cl.cl.build.guarded_build import Built, Request, Worker, guarded_build
from rift_cl.errors import DeviceError

REQUEST = Request("0:0", "device", "probe", "source", ["-w"])
# A child that answers with what it was asked, unless the first lines here make an end of it.
ANSWERS = """
import os, signal, sys, time
from rift_cl.child_process import read_message, write_message
while (asked := read_message(sys.stdin.buffer)) is not None:
    request = asked[0]
    {fate}
    write_message(sys.stdout.buffer, {{"text": request["source"]}}, b"binary")
"""
DIES = "os.kill(os.getpid(), signal.SIGSEGV)"


@pytest.fixture
def worker():
    """Makes a worker whose fate is given as a statement."""
    made = []

    def make(fate, limit=60.0):
        made.append(Worker([sys.executable, "-c", ANSWERS.format(fate=fate)], limit))
        return made[-1]

    yield make
    for each in made:
        each.close()


def test_compiler_that_does_its_work_is_asked_once(worker):
    assert guarded_build(REQUEST, worker("pass")) == Built(b"binary", "", "", "")


def test_compiler_that_dies_is_asked_in_another_way(worker):
    built = guarded_build(REQUEST, worker(f"'noinline' in request['source'] or {DIES}"))
    assert built == Built(b"binary", "noinline", "its compiler died (SIGSEGV)", "")


def test_child_meets_nothing_that_a_dead_one_left_in_its_drivers_cache(worker):
    leaves = "open(os.environ['POCL_CACHE_DIR'] + '/left', 'x')"
    built = guarded_build(REQUEST, worker(f"{leaves}; 'noinline' in request['source'] or {DIES}"))
    assert built.way == "noinline"


@pytest.mark.skipif(sys.platform == "win32", reason="nothing is killed by a signal on Windows")
def test_child_whose_process_is_killed_leaves_nothing_behind(python, tmp_path):
    done = python(
        "from rift_cl.cl.build.guarded_build import Worker\n"
        "import os, signal\n"
        "worker = Worker()\n"
        "worker.answer({'selector': 'none'})\n"
        "print(worker._scratch, flush=True)\n"
        "os.kill(os.getpid(), signal.SIGKILL)\n",
        TMPDIR=str(tmp_path),
    )
    assert done.returncode == -signal.SIGKILL, done.stderr
    place = Path(done.stdout.strip())
    until = time.monotonic() + 120
    while place.exists() and time.monotonic() < until:
        time.sleep(0.1)
    assert not place.exists()


@pytest.mark.full
def test_process_that_ends_leaves_nothing_behind_and_warns_of_nothing(python, tmp_path):
    done = python(
        "import rift_cl as rift\n"
        "device = rift.default_device()\n"
        "x = device.array([1.0, 2.0])\n"
        "device.launch('axpby', (2,), x=x, y=x, a=1.0, b=1.0, size=2, RUN=1, DOUBLE=0)\n"
        "from rift_cl.cl.build.guarded_build import _workers\n"
        "assert _workers\n",
        TMPDIR=str(tmp_path),
        RIFT_CACHE_DIR=str(tmp_path / "cache"),
        PYTHONWARNINGS="error::ResourceWarning",
    )
    assert (done.returncode, done.stderr) == (0, "")
    assert [path.name for path in tmp_path.iterdir()] == ["cache"]


def test_child_that_dies_after_other_work_is_no_verdict(worker):
    twice = worker(f"served = globals().get('served', 0) + 1; served > 1 and {DIES}")
    assert guarded_build(REQUEST, twice).way == ""
    assert guarded_build(REQUEST, twice) == Built(b"binary", "", "", "")


def test_child_that_dies_where_the_disk_is_full_is_no_verdict(worker, monkeypatch):
    monkeypatch.setattr(guarded_build_module, "room", lambda _: 1000.0)
    built = guarded_build(REQUEST, worker(DIES))
    assert (built.passing, built.binary) == (True, None)
    assert "is full" in built.fault


@pytest.mark.parametrize("way", ["noinline", "nothing"])
@pytest.mark.parametrize(
    ("fate", "fault"),
    [
        ("os.kill(os.getpid(), signal.SIGKILL)", "its compiler died (SIGKILL)"),
        (
            "write_message(sys.stdout.buffer, {'error': 'E', 'short of memory': True}); continue",
            "its compiler had no memory",
        ),
    ],
)
def test_what_others_did_to_a_child_is_no_verdict(worker, fate, fault, way):
    built = guarded_build(REQUEST, worker(f"if {way!r} not in request['source']: {fate}"))
    assert (built.fault, built.passing) == (fault, True)
    assert built.binary == (b"binary" if way == "noinline" else None)


LAUNCH = {"size": [1], "local": [1], "offset": None, "arguments": [4, "0800", None]}


def test_launch_that_no_way_survives_refuses_a_kernel_only_when_processes_died_twice(worker):
    dies = worker(f"request['launches'] and {DIES}")
    assert guarded_build(REQUEST._replace(launches=[LAUNCH]), dies) == Built(b"binary", "", "", "")
    twice = guarded_build(REQUEST._replace(launches=[LAUNCH, LAUNCH]), dies)
    assert twice == Built(None, "", "its compiler died (SIGSEGV)", "")


def test_launch_whose_child_somebody_ends_refuses_no_kernel(worker):
    ends = worker("request['launches'] and os.kill(os.getpid(), signal.SIGKILL)")
    twice = REQUEST._replace(launches=[LAUNCH, LAUNCH])
    assert guarded_build(twice, ends) == Built(b"binary", "", "", "")


def test_launch_that_dies_of_its_numbers_alone_is_no_fault_of_the_compiler(worker):
    fate = f"request['launches'][0]['arguments'] != [4, '0000', None] and {DIES}"
    built = guarded_build(REQUEST._replace(launches=[LAUNCH]), worker(fate))
    assert built == Built(b"binary", "", "", "")


def test_compiler_that_hangs_is_ended(worker):
    fault, answer, _ = worker("time.sleep(600)", limit=0.2).ask(REQUEST._asdict())
    assert fault == "its compiler hung for 0.2 s"
    assert answer is None


def test_compiler_that_always_hangs_is_waited_for_no_longer_than_twice_the_limit(monkeypatch):
    class Hanging(Worker):
        now = 0.0

        def ask(self, request, limit=None):
            self.now += limit
            return "its compiler hung", None, b""

    hangs = Hanging(limit=300.0)
    monkeypatch.setattr(guarded_build_module.time, "monotonic", lambda: hangs.now)
    assert guarded_build(REQUEST, hangs).binary is None
    assert 300 < hangs.now < 600
    hangs.now = 0.0
    # Once with the launches of those who died of them, and once without.
    guarded_build(REQUEST._replace(launches=[LAUNCH]), hangs)
    assert hangs.now < 1200


def test_compiler_that_can_do_it_in_no_way_is_told_of(worker):
    died = Built(None, "", "its compiler died (SIGSEGV)", "")
    assert guarded_build(REQUEST, worker(DIES)) == died


def test_compiler_that_ends_the_process_is_told_of(worker):
    assert "status 3" in guarded_build(REQUEST, worker("sys.exit(3)")).fault


@pytest.mark.parametrize("noise", ["b'hello, I am a driver'", "b'\\0\\0\\0\\2[]'", "b'\\xff' * 9"])
def test_child_that_talks_nonsense_is_no_answer(worker, noise):
    said = f"sys.stdout.buffer.write({noise}); sys.stdout.flush(); sys.exit(0)"
    assert guarded_build(REQUEST, worker(said)).binary is None


def test_child_that_cannot_be_started_is_a_named_error():
    with pytest.raises(DeviceError, match="cannot be started"):
        guarded_build(REQUEST, Worker(["/there/is/no/such/program"]))


# Crashes when it is launched, unless it is built with the workaround that redefines "static".
LATE = """
#ifdef static
#define PLACE p
#else
#define PLACE (__global int *)where
#endif
__kernel void probe(__global int *p, ulong where) { *PLACE = 1; }
"""


@pytest.mark.parametrize(
    ("size", "local", "alike"),
    [
        ([1024, 7], [64, 1], [64, 1]),
        ([65_536], [64], [65_536]),
        ([100_032, 3], [64, 1], [65_536, 1]),
        ([64, 70_000], [64, 1], [64, 65_535]),
    ],
)
def test_a_repeated_grid_is_the_smallest_that_is_compiled_for_alike(size, local, alike):
    assert smallest_alike(size, local) == alike
    assert way_of(alike, None) == way_of(size, None)


@pytest.mark.full
@pytest.mark.parametrize(("offset", "died"), [(None, True), ([4], True), (None, False)])
def test_our_own_child_repeats_a_launch_that_a_process_died_of(offset, died):
    device = rift.default_device()
    launch = told_launch(
        [np.int64(8)], [4], offset, [(None, device.zeros((4,)).base_data), (np.uint64, 8)]
    )
    launches = [json.loads(json.dumps(launch))] if died else []
    child = Worker()
    request = Request(device.selector, device.name, "probe", LATE, ["-cl-std=CL1.2"], launches)
    try:
        built = guarded_build(request, child)
    finally:
        child.close()
    assert (built.way, "died" in built.fault) == (("noinline", True) if died else ("", False))
    assert built.binary


@pytest.mark.full
def test_our_own_child_compiles_and_tells_what_does_not():
    import pyopencl as cl

    device = rift.default_device()
    child = Worker()
    source = "__kernel void probe(__global int *p) { *p = 1; }"
    right = Request(device.selector, device.name, "probe", source, ["-cl-std=CL1.2"])
    try:
        built = guarded_build(right, child)
        wrong = guarded_build(right._replace(source="nonsense"), child)
        elsewhere = guarded_build(right._replace(device="another"), child)
    finally:
        child.close()
    assert (built.way, built.fault) == ("", "")
    program = cl.Program(device.context, device.context.devices, [built.binary]).build()
    assert program.kernel_names == "probe"
    assert wrong.binary is None
    assert "error" in wrong.log
    assert elsewhere.binary is None
