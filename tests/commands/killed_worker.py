"""A worker of this machine that is killed, or stopped, while work is spread over several."""

import os
import signal
from contextlib import suppress

import pytest

from rift_cl.cluster import workers


def kill_one(monkeypatch, after, by=signal.SIGKILL):
    """Send one a signal as the task of this number is handed out; the list of tasks that were."""
    psutil = pytest.importorskip("psutil")
    begin, begun = workers._Running.begin, []

    def words_of(process):
        # One that has just ended has none.
        with suppress(psutil.Error):
            return " ".join(process.cmdline())
        return ""

    def killing(self, task, tries=1):
        begin(self, task, tries)
        begun.append(task)
        if len(begun) == after:
            children = psutil.Process().children(recursive=True)
            own = [child for child in children if "spawn_main" in words_of(child)]
            os.kill(own[-1].pid, by)

    monkeypatch.setattr(workers._Running, "begin", killing)
    return begun
