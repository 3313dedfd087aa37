"""OpenCL does not survive fork: a forked child is told so at once, a spawned one works."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

pytestmark = pytest.mark.skipif(not hasattr(os, "fork"), reason="no fork on this system")

BEFORE = {
    "enumeration": "held = rift.devices()[0]; array = None",
    "context": "held = rift.devices()[0]; array = held.array(np.ones(4))",
    "launch": "held = rift.devices()[0]; array = held.array(np.ones(4)); self_test(held)",
}
IN_CHILD = (
    "held.array(np.ones(4))",
    "held.get(array) if array is not None else held.queue",
    "held.finish()",
    "held.release()",
    "held.launch('plane_split', (1, 1, 1))",
    "rift.Device(held._handle, held.selector).array(np.ones(4))",
    "rift.devices()",
    "rift.default_device()",
    "pickle.loads(pickle.dumps(held)).array(np.ones(4))",
    "pickle.loads(pickle.dumps(rift.Projector(GRID, SCAN, device=held)))(np.ones((4, 4)))",
)
PROGRAM = """
import os, pickle, signal, warnings
import numpy as np, rift_cl as rift
from rift_cl.cl.self_test import self_test
GRID, SCAN = rift.Grid((4, 4)), rift.Parallel(np.linspace(0, 3, 5), 6)
warnings.simplefilter("ignore")  # newer Pythons warn of fork in a process with threads
{before}
for use in {in_child!r}:
    child = os.fork()
    if child == 0:
        signal.alarm(5)
        try:
            eval(use)
        except rift.RiftError as error:
            named = type(error).__name__ == "ForkedContextError" and "spawn" in str(error)
            os._exit(42 if named else 1)
        os._exit(0)
    if os.waitstatus_to_exitcode(os.waitpid(child, 0)[1]) != 42:
        print("not told of", use)
print(self_test(held).passed)
"""


@pytest.mark.parametrize("before", BEFORE)
def test_forked_child_gets_a_named_error_and_the_parent_works_on(python, before):
    done = python(PROGRAM.format(before=BEFORE[before], in_child=IN_CHILD))
    assert (done.stdout.strip(), done.stderr) == ("True", "")


@pytest.mark.full
def test_fork_before_the_first_use_works(python):
    done = python(
        "import os, rift_cl as rift\n"
        "from rift_cl.cl.self_test import self_test\n"
        "child = os.fork()\n"
        "passed = self_test(rift.default_device()).passed\n"
        "if child == 0: os._exit(0 if passed else 1)\n"
        "print(passed, os.waitstatus_to_exitcode(os.waitpid(child, 0)[1]))"
    )
    assert done.stdout.split() == ["True", "0"], done.stderr


def test_forked_child_may_still_exit_in_the_ordinary_way(python):
    done = python(
        "import os, sys, warnings, numpy as np, rift_cl as rift\n"
        "warnings.simplefilter('ignore')\n"
        "array = rift.default_device().array(np.ones(1000))\n"
        "child = os.fork()\n"
        "if child == 0: sys.exit(7)\n"
        "print(os.waitstatus_to_exitcode(os.waitpid(child, 0)[1]))"
    )
    assert done.stdout.split() == ["7"], done.stderr


@pytest.mark.full
@pytest.mark.parametrize(
    "operator",
    ["A", "A.T", "2 * A.T @ A", "FilteredBackprojection(A) @ A", "rift.vstack(A, A)"],
)
def test_a_forked_pool_is_told_and_does_not_wait_for_ever(python, operator):
    done = python(
        "import multiprocessing, signal, warnings, numpy as np, rift_cl as rift\n"
        "from rift_cl.reconstruct import FilteredBackprojection\n"
        "warnings.simplefilter('ignore')\n"
        "signal.alarm(100)\n"
        "A = rift.Projector(rift.Grid((4, 4)), rift.Parallel(np.linspace(0, 3, 5), 6))\n"
        f"A = {operator}\n"
        "A(np.ones(A.domain))\n"
        "with multiprocessing.get_context('fork').Pool(2) as pool:\n"
        "    try:\n"
        "        pool.map(A, [np.ones(A.domain)] * 3)\n"
        "    except rift.RiftError as error:\n"
        "        print(type(error).__name__)\n"
    )
    assert done.stdout.split() == ["ForkedContextError"], done.stderr


@pytest.mark.full
def test_spawned_worker_works_on_the_device_it_is_sent(tmp_path):
    script = tmp_path / "spawning.py"
    script.write_text(
        "import multiprocessing\n"
        "import numpy as np, rift_cl as rift\n"
        "def double(device):\n"
        "    return device.selector, float(device.get(device.array(np.ones(5))).sum())\n"
        "if __name__ == '__main__':\n"
        "    device = rift.devices()[0]\n"
        "    device.array(np.ones(3))\n"
        "    with multiprocessing.get_context('spawn').Pool(2) as pool:\n"
        "        print(pool.map(double, [device, device]) == [(device.selector, 5.0)] * 2)\n"
    )
    done = subprocess.run(
        [sys.executable, str(script)],
        env={**os.environ, "PYTHONPATH": str(Path(__file__).parents[2])},
        capture_output=True,
        text=True,
        timeout=60,
        check=False,
    )
    assert done.stdout.split() == ["True"], done.stderr
