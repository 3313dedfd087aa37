"""Workers begin while the command that wants them gets ready, and load what they need once."""

import os
import threading
from contextlib import contextmanager

import pytest

from rift_cl.cluster import fork_server
from rift_cl.cluster.beside import Beside
from rift_cl.cluster.local import local_cluster

WANTED = "Dask is not installed (pip install dask distributed)"


@contextmanager
def noted(notes, go_on=None):
    notes.append(("in", threading.get_ident()))
    if go_on is not None:
        go_on.wait()
    yield "value"
    notes.append(("out", threading.get_ident()))


def test_a_context_is_entered_and_left_in_one_other_thread():
    notes, go_on = [], threading.Event()
    with Beside(noted(notes, go_on)) as begun:
        # What is entered may take as long as it likes.
        go_on.set()
        assert begun.get() == "value"
        begun.leave()
        begun.leave()
    assert [what for what, _ in notes] == ["in", "out"]
    assert len({thread for _, thread in notes} - {threading.get_ident()}) == 1


def test_a_context_that_nobody_asks_for_is_left_too():
    notes = []
    with pytest.raises(KeyError), Beside(noted(notes)):
        raise KeyError("the preparation failed")
    assert [what for what, _ in notes] == ["in", "out"]


@contextmanager
def failing(entered):
    if not entered:
        raise ValueError("not entered")
    yield
    raise ValueError("not left")


def test_what_a_context_raises_is_told_where_it_is_wanted():
    with Beside(failing(False)) as begun, pytest.raises(ValueError, match="not entered"):
        begun.get()
    with pytest.raises(ValueError, match="not left"), Beside(failing(True)):
        pass
    # What went wrong first is what is told.
    with pytest.raises(KeyError), Beside(failing(True)):
        raise KeyError("first")


def test_the_servers_environment_is_its_own(monkeypatch):
    for name in fork_server._ENVIRONMENT:
        monkeypatch.delenv(name, raising=False)
    monkeypatch.setenv("MKL_NUM_THREADS", "7")
    before = dict(os.environ)
    with fork_server._environment():
        assert os.environ["OMP_NUM_THREADS"] == "1" and os.environ["MKL_NUM_THREADS"] == "7"
    assert dict(os.environ) == before


def loaded(name):
    import sys

    return name in sys.modules, os.getppid()


@pytest.mark.full
@pytest.mark.skipif(fork_server.METHOD != "forkserver", reason="no server here (wanted Linux)")
def test_workers_are_forks_of_one_server_that_has_one_thread():
    distributed = pytest.importorskip("distributed", reason=WANTED)
    psutil = pytest.importorskip("psutil")
    with (
        local_cluster([{}, {}]) as cluster,
        distributed.Client(cluster, set_as_default=False) as client,
    ):
        client.wait_for_workers(2)
        told = list(client.run(loaded, "rift_cl.cluster.on_worker").values())
        ((there, parent),) = set(told)
        assert len(told) == 2 and there
        server = psutil.Process(parent)
        assert server.ppid() == os.getpid() and server.num_threads() == 1
