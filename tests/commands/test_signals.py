"""What a batch system sends is heeded as Ctrl-C is, and nobody's handlers stay changed."""

from __future__ import annotations

import os
import signal
from contextlib import nullcontext
from types import SimpleNamespace

import pytest

from rift_cl.commands.cli import main
from rift_cl.commands.fit import checkpoints
from rift_cl.commands.fit.checkpoints import CheckpointSchedule
from rift_cl.commands.interrupts import gentle_interrupt
from rift_cl.commands.runner import exit_status

HEEDED = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)


@pytest.fixture(autouse=True)
def handlers():
    """The handlers are those of before, whatever was heard.

    As of a program in a terminal: a background job ignores Ctrl-C, and one of nohup's SIGHUP.
    """
    usual = {number: signal.getsignal(number) for number in HEEDED}
    signal.signal(signal.SIGINT, signal.default_int_handler)
    signal.signal(signal.SIGHUP, signal.SIG_DFL)
    before = [signal.getsignal(number) for number in HEEDED]
    yield
    after = [signal.getsignal(number) for number in HEEDED]
    for number, handler in usual.items():
        signal.signal(number, handler)
    assert after == before


@pytest.mark.parametrize(("number", "status"), [(signal.SIGTERM, 143), (signal.SIGHUP, 129)])
def test_a_command_that_is_ended_ends_with_a_sentence(number, status, capsys):
    def run():
        os.kill(os.getpid(), number)
        raise AssertionError("went on")

    assert exit_status(run) == status
    assert "interrupted" in capsys.readouterr().err


@pytest.mark.parametrize(("number", "status"), [(signal.SIGINT, 0), (signal.SIGTERM, 143)])
def test_a_page_ends_well_at_ctrl_c_alone(number, status, monkeypatch, capsys):
    def run():
        os.kill(os.getpid(), number)
        yield

    page = SimpleNamespace(url="here", notes=(), run=run)
    monkeypatch.setattr("rift_cl.commands.view.job.ViewJob", lambda settings: nullcontext(page))
    assert main(["view", "scene.ply"]) == status


def test_an_interrupted_command_has_a_status_of_its_own():
    def run():
        raise KeyboardInterrupt

    assert exit_status(run) == 130


def test_a_lost_terminal_ends_nothing_under_nohup():
    usual = signal.signal(signal.SIGHUP, signal.SIG_IGN)
    try:
        with gentle_interrupt(lambda: pytest.fail("asked to stop")):
            assert exit_status(lambda: os.kill(os.getpid(), signal.SIGHUP) or 0) == 0
    finally:
        signal.signal(signal.SIGHUP, usual)


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM, signal.SIGHUP])
def test_a_fit_is_asked_to_stop_first_and_made_to_the_second_time(number, capsys):
    asked = []

    def run():
        with gentle_interrupt(lambda: asked.append(number)):
            os.kill(os.getpid(), number)
            assert asked == [number]
            os.kill(os.getpid(), number)
        raise AssertionError("went on")

    assert exit_status(run) in (129, 130, 143)
    assert asked == [number] and "stopping after this step" in capsys.readouterr().err


def test_checkpoints_are_due_by_steps_by_minutes_and_at_the_end(monkeypatch):
    now = [100.0]
    monkeypatch.setattr(checkpoints.time, "monotonic", lambda: now[0])
    schedule = CheckpointSchedule(1000, 10.0, 50)
    assert not schedule.due(1049, ended=False) and schedule.due(1050, ended=False)
    now[0] += 599
    assert not schedule.due(1060, ended=False)
    now[0] += 1
    assert schedule.due(1061, ended=False) and not schedule.due(1062, ended=False)
    assert schedule.due(1063, ended=True)
    now[0] += 1e6
    assert not CheckpointSchedule(1000, 0.0, 0).due(1, ended=False)
    assert not CheckpointSchedule(0, 10.0, 0).due(5000, ended=True)
