"""Workers begin while the command that wants them gets ready, and load what they need once."""

import os
import subprocess
import sys
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


# Begins the server, and a worker as it says; what the worker prints comes first.
SCRIPT = """
import multiprocessing
import sys

from rift_cl.cluster.fork_server import begin_server


def look():
    print("rift_cl.cluster.on_worker" in sys.modules, flush=True)


if __name__ == "__main__":
    method = begin_server()
    worker = multiprocessing.get_context(method).Process(target=look)
    worker.start()
    worker.join()
    print(method)
"""


def begun(tmp_path, **environment):
    """How the script, run in a folder of its own, began a worker, and what that had loaded."""
    script = tmp_path / "script" / "begin.py"
    script.parent.mkdir()
    script.write_text(SCRIPT)
    (tmp_path / "data").mkdir(exist_ok=True)
    done = subprocess.run(
        [sys.executable, script],
        cwd=tmp_path / "data",
        env={**os.environ, **environment},
        capture_output=True,
        text=True,
        timeout=120,
        check=True,
    )
    loaded, method = done.stdout.split()
    return method, loaded == "True"


def test_the_server_loads_nothing_from_the_current_folder(tmp_path):
    (tmp_path / "data").mkdir()
    mark = tmp_path / "executed"
    for name in ("distributed", "rift_cl"):
        (tmp_path / "data" / f"{name}.py").write_text(f"open({str(mark)!r}, 'w')")
    method, loaded = begun(tmp_path)
    assert not mark.exists()
    assert loaded == (method == "forkserver") == fork_server._SERVES


def test_without_a_place_for_the_servers_socket_workers_are_spawned(tmp_path):
    far = tmp_path / ("far" * 40)
    far.mkdir()
    method, loaded = begun(tmp_path, TMPDIR=str(far))
    assert loaded == (method == "forkserver")


def test_a_worker_has_what_this_process_has_and_what_is_its_own(monkeypatch):
    monkeypatch.setenv("RIFT_CACHE_DIR", "now")
    monkeypatch.setenv("RIFT_MEMORY", "1G")
    monkeypatch.delenv("PYTHONPATH", raising=False)
    environment = fork_server.worker_environment({"RIFT_MEMORY": "1M"})
    wanted = {"RIFT_CACHE_DIR": "now", "RIFT_MEMORY": "1M", "PYTHONPATH": ""}
    assert wanted.items() <= environment.items() and os.environ.keys() <= environment.keys()


def test_a_process_that_lost_a_variable_spawns(monkeypatch):
    monkeypatch.setattr(fork_server, "_SERVES", True)
    monkeypatch.setattr(fork_server.forkserver, "ensure_running", lambda: None)
    monkeypatch.setattr(fork_server.multiprocessing, "set_forkserver_preload", lambda names: None)
    monkeypatch.setattr(fork_server, "_had", set())
    monkeypatch.setenv("RIFT_LOAD", "mine.py")
    assert fork_server.begin_server() == fork_server.begin_server() == "forkserver"
    monkeypatch.delenv("RIFT_LOAD")
    assert fork_server.begin_server() == "spawn"


def test_the_servers_environment_is_its_own(monkeypatch):
    for name in fork_server._ENVIRONMENT:
        monkeypatch.delenv(name, raising=False)
    monkeypatch.setenv("MKL_NUM_THREADS", "7")
    monkeypatch.setenv("PYTHONPATH", "mine")
    monkeypatch.setattr(sys, "path", ["", "/a", f"/b{os.pathsep}/c", "/d"])
    before = dict(os.environ)
    with fork_server._environment():
        assert os.environ["OMP_NUM_THREADS"] == "1" and os.environ["MKL_NUM_THREADS"] == "7"
        # A path that PYTHONPATH cannot name is left out.
        assert os.environ["PYTHONPATH"].split(os.pathsep) == ["/a", "/d"]
    assert dict(os.environ) == before


def loaded(name):
    import sys

    return name in sys.modules, os.getppid()


@pytest.mark.full
@pytest.mark.skipif(not fork_server._SERVES, reason="no server here (wanted Linux, Python 3.11)")
def test_workers_are_forks_of_one_server_that_has_one_thread(monkeypatch):
    # Of an earlier test's variables, without which workers are spawned.
    for name in fork_server._had - os.environ.keys():
        monkeypatch.setenv(name, "")
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


def variable(name):
    return os.environ.get(name)


@pytest.mark.full
def test_workers_have_the_environment_of_their_own_cluster(monkeypatch):
    distributed = pytest.importorskip("distributed", reason=WANTED)
    for value in ("0", "1", None):
        if value is None:
            monkeypatch.delenv("CUDA_VISIBLE_DEVICES")
        else:
            monkeypatch.setenv("CUDA_VISIBLE_DEVICES", value)
        with (
            local_cluster([{}]) as cluster,
            distributed.Client(cluster, set_as_default=False) as client,
        ):
            client.wait_for_workers(1)
            assert list(client.run(variable, "CUDA_VISIBLE_DEVICES").values()) == [value]
