"""A device that hangs ends the command with a sentence; one that is slow does not."""

from __future__ import annotations

import os
import subprocess
import sys

import pytest

from rift_cl.cl.failures import named_errors
from rift_cl.cl.watchdog import VARIABLE, Call, Patience, _calls, patience_with
from rift_cl.errors import InputError

# A job whose kernel never ends, as a command runs one.
HANGS = """
import sys
from types import SimpleNamespace
import numpy as np, pyopencl as cl
import rift_cl as rift
from rift_cl.commands.runner import Output, run_job, told

device = rift.default_device()
source = "kernel void endless(global volatile int *stop) { while (!*stop) ; }"
kernel = cl.Program(device.context, source).build().endless
stop = device.zeros((1,), np.int32)

def run():
    kernel(device.queue, (1,), None, stop.base_data)
    yield from ()
    stop.get() if sys.argv[1] == "get" else device.finish()

job = SimpleNamespace(device=device, run=run)
sys.exit(told(lambda: run_job(job, Output(quiet=True)) or 0))
"""


@pytest.mark.full
@pytest.mark.parametrize("how", ["finish", "download"])
def test_an_endless_kernel_ends_the_command_with_a_sentence(how):
    done = subprocess.run(
        [sys.executable, "-c", HANGS.replace("stop.get()", "device.get(stop)"), how[:3]],
        env={**os.environ, VARIABLE: "0.5"},
        capture_output=True,
        text=True,
        timeout=120,
        check=False,
    )
    assert done.returncode == 4, done.stderr
    assert done.stderr.count("has not answered for 0.5 s while") == 1
    assert "Traceback" not in done.stderr and "--resume goes on" in done.stderr


def test_a_call_is_given_up_when_it_is_found_too_often():
    patience, call = Patience(looks=2), Call("copying", "a")
    # Equal calls, one after the other, are not one call.
    for _ in range(9):
        assert patience.look({1: Call("copying", "a")}) is None
    assert [patience.look({1: call, 2: Call("copying", "a")}) for _ in range(4)][-1] is call
    assert Patience(looks=2).look({}) is None


def test_calls_are_noted_while_they_last():
    with pytest.raises(ZeroDivisionError), named_errors("copying", "a"):
        with named_errors("waiting", "b"):
            assert list(_calls.values()) == [Call("waiting", "b")]
        assert list(_calls.values()) == [Call("copying", "a")]
        raise ZeroDivisionError
    assert not _calls


def test_the_time_is_said_by_the_environment(monkeypatch, device):
    monkeypatch.delenv(VARIABLE, raising=False)
    assert patience_with(device) == (0 if device.kind == "CPU" else 1800)
    monkeypatch.setenv(VARIABLE, "7")
    assert patience_with(device) == 7
    for wrong in ("-1", "long", "nan", "inf"):
        monkeypatch.setenv(VARIABLE, wrong)
        with pytest.raises(InputError, match=f"{VARIABLE} is '{wrong}'"):
            patience_with(device)
