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

    def is_worker(process):
        """Spawned, or forked by the server, whose words it has; one that has ended is none."""
        with suppress(psutil.Error):
            words = " ".join(process.cmdline())
            forked = "forkserver" in words and process.ppid() != os.getpid()
            return forked or "spawn_main" in words
        return False

    def killing(self, task, tries=1):
        begin(self, task, tries)
        begun.append(task)
        if len(begun) == after:
            children = psutil.Process().children(recursive=True)
            os.kill([child for child in children if is_worker(child)][-1].pid, by)

    monkeypatch.setattr(workers._Running, "begin", killing)
    return begun
