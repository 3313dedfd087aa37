"""What is said of workers that cannot do the work, and what becomes of tasks that fail."""

import socket
import sys
import types
from pathlib import Path
from urllib.parse import urlsplit

import pytest

import rift_cl as rift
from rift_cl.cluster import workers
from rift_cl.cluster.address import ClusterAddress
from rift_cl.cluster.local import local_cluster, worker_environments
from rift_cl.cluster.on_worker import look, token
from rift_cl.errors import ClusterError, DeviceLostError, InputError, SettingError

WANTED = "Dask is not installed (pip install dask distributed)"


@pytest.mark.parametrize(
    ("text", "count"),
    [("local:3", 3), ("tcp://10.0.0.1:8786", 0), ("node7:8786", 0), ("tls://[fe80::1]:8786", 0)],
)
def test_addresses(text, count):
    assert ClusterAddress.of(text) == (text, count)


@pytest.mark.parametrize(
    "text", ["local:0", "local:10000", "local", "local:", "10.0.0.1", "http://a:1", "a b:1"]
)
def test_what_is_no_address(text):
    with pytest.raises(InputError, match=r"--cluster is .*local:N"):
        ClusterAddress.of(text)


def test_local_workers_divide_memory_and_cores(monkeypatch):
    device = rift.open_device(memory=6_000)
    for name in ("POCL_MAX_PTHREAD_COUNT", "POCL_CPU_MAX_CU_COUNT"):
        monkeypatch.delenv(name, raising=False)
    monkeypatch.setattr("rift_cl.cluster.local._cores", lambda: 7)
    each = worker_environments(device, device.selector, 3)
    assert len(each) == 3
    for environment in each:
        assert environment["RIFT_DEVICE"] == device.selector
        assert environment["RIFT_MEMORY"] == "2000"
        assert environment["POCL_MAX_PTHREAD_COUNT"] == "2"


@pytest.mark.full
def test_local_workers_listen_on_loopback_alone():
    """Scheduler, dashboard, nanny and worker: whoever reaches one of their ports may run code."""
    pytest.importorskip("distributed", reason=WANTED)
    import psutil

    def listening():
        own = psutil.Process()
        return {
            (end.laddr.ip, end.laddr.port)
            for process in (own, *own.children(recursive=True))
            for end in process.net_connections("inet")
            if end.status == psutil.CONN_LISTEN
        }

    before = listening()
    with local_cluster([{}]) as cluster:
        opened = listening() - before
        known = {urlsplit(url).port for url in (cluster.scheduler_address, cluster.dashboard_link)}
    # The scheduler, its dashboard, the nanny and the worker at least.
    assert known <= {port for _, port in opened} and len(opened) >= 4
    assert {address for address, _ in opened} == {"127.0.0.1"}


def test_a_worker_says_what_it_has(tmp_path):
    with token(tmp_path / "made") as seen:
        known = look(None, [tmp_path, seen])
    assert known["version"] == rift.__version__ and known["device"]
    assert not {"refusal", "unseen"} & set(known)
    assert look("no such device", [seen]) == {
        "version": rift.__version__,
        "host": socket.gethostname(),
        "refusal": look("no such device", [])["refusal"],
        "unseen": str(seen),
    }
    assert not list((tmp_path / "made").iterdir())


class Told:
    """A client whose one worker tells this."""

    def __init__(self, told):
        self.told = told

    def nthreads(self):
        return {"tcp://w:1": 1}

    def run(self, function, *arguments, on_error):
        return {"tcp://w:1": self.told}


GOOD = {"version": rift.__version__, "host": "node", "device": "cpu"}


@pytest.mark.parametrize(
    ("told", "said"),
    [
        (ModuleNotFoundError("No module named 'rift_cl'"), "none that answers.*rift_cl"),
        ({**GOOD, "version": "0.0.1"}, "version 0.0.1 of rift_cl"),
        ({**GOOD, "refusal": "no OpenCL device was found"}, "no OpenCL device was found"),
        ({**GOOD, "unseen": "/data/scan.h5"}, "does not see /data/scan.h5.*share"),
    ],
)
def test_workers_that_cannot(told, said):
    pytest.importorskip("distributed", reason=WANTED)
    found = workers.Workers(Told(told), ClusterAddress("tcp://s:1", 0), None)
    with pytest.raises(ClusterError, match=f"worker tcp://w:1.*{said}"):
        found.check([Path("/data/scan.h5")])
    good = workers.Workers(Told(GOOD), ClusterAddress("tcp://s:1", 0), None)
    assert good.check([]) == {"cpu"}


def test_no_scheduler_answers(monkeypatch):
    pytest.importorskip("distributed", reason=WANTED)
    monkeypatch.setattr(workers, "_ANSWER", 0.3)
    with socket.socket() as held:
        # Bound and not listening: nobody else can answer there.
        held.bind(("127.0.0.1", 0))
        address = f"tcp://127.0.0.1:{held.getsockname()[1]}"
        with (
            pytest.raises(ClusterError, match="no Dask scheduler answers"),
            workers.cluster_workers(address, rift.open_device(), None),
        ):
            pass


def test_workers_that_do_not_start(monkeypatch):
    pytest.importorskip("distributed", reason=WANTED)

    def fail(environments):
        raise RuntimeError("Nanny failed to start.")

    monkeypatch.setattr(workers, "local_cluster", fail)
    with (
        pytest.raises(ClusterError, match=r"the worker processes do not start.*__main__"),
        workers.cluster_workers("local:1", rift.open_device(), None),
    ):
        pass


def test_dask_that_is_not_there(monkeypatch):
    monkeypatch.setitem(sys.modules, "distributed", None)
    with (
        pytest.raises(InputError, match=r"needs Dask.*pip install dask distributed"),
        workers.cluster_workers("local:1", rift.open_device(), None),
    ):
        pass


_tries: dict[str, int] = {}


def task(name, times):
    """Lose the device so many times, then do it."""
    _tries[name] = _tries.get(name, 0) + 1
    if _tries[name] <= times:
        raise DeviceLostError(f"{name} is gone")
    return _tries[name]


@pytest.fixture
def in_process(monkeypatch):
    """Workers that are threads of this process; nothing begins them anew."""
    distributed = pytest.importorskip("distributed", reason=WANTED)
    with distributed.Client(
        processes=False, n_workers=2, threads_per_worker=1, dashboard_address=None,
        set_as_default=False,
    ) as client:  # fmt: skip
        found = workers.Workers(client, ClusterAddress("tcp://s:1", 0), None)
        found.begun_anew = []
        monkeypatch.setattr(found, "_begin_anew", found.begun_anew.append)
        yield found


def test_a_device_that_is_lost_is_begun_anew(in_process):
    _tries.clear()
    wanted = [workers.Task(f"slices {n}", (f"{n}", 2 * (n == 3))) for n in range(20)]
    done = dict(filter(None, in_process.each(task, wanted)))
    assert [done[one] for one in wanted] == [3 if n == 3 else 1 for n in range(20)]
    assert len(in_process.begun_anew) == 2 and all(in_process.begun_anew)
    _tries.clear()
    with pytest.raises(DeviceLostError, match="0 is gone"):
        list(in_process.each(task, [workers.Task("slice 0", ("0", 9))]))


def test_few_tasks_are_handed_out_at_a_time(in_process):
    taken = []

    def tasks():
        for n in range(100):
            taken.append(n)
            yield workers.Task(f"{n}", (f"few {n}", 0))

    done = 0
    for come in in_process.each(task, tasks()):
        done += come is not None
        assert len(taken) - done <= 5
    assert done == 100


def test_a_worker_of_another_version_that_comes_late(in_process, monkeypatch):
    monkeypatch.setattr(workers, "__version__", "0.0.1")
    with pytest.raises(ClusterError, match=r"worker .*wanted 0\.0\.1"):
        list(in_process.each(task, [workers.Task("slice 0", ("late", 0))]))


def test_all_tasks_that_ended_their_workers_are_named(in_process, monkeypatch):
    killed = lambda come, running, killers: killers.append(come.task.name)  # noqa: E731
    monkeypatch.setattr(in_process, "_result", killed)
    wanted = [workers.Task(f"slice {n}", (f"killed {n}", 0)) for n in range(2)]
    with pytest.raises(ClusterError, match=r"(?=.*slice 0)(?=.*slice 1).*--resume"):
        list(in_process.each(task, wanted))


class Scheduled:
    """A client that does nothing with what it is given."""

    def __init__(self):
        self.keys = []

    def submit(self, *given, pure):
        self.keys.append(f"{len(self.keys)}")
        return types.SimpleNamespace(key=self.keys[-1], add_done_callback=lambda put: None)

    def nthreads(self):
        return {"a": 1}

    def processing(self):
        return {"a": self.keys}

    def restart_workers(self, them):
        raise ValueError("Restarting workers requires a nanny to be used")


def running(*sizes):
    """Tasks of these sizes that are handed out."""
    handed = workers._Running(Scheduled(), task)
    handed.fill((workers.Task("", (), size) for size in sizes), len(sizes))
    return handed


def test_a_worker_hangs_by_the_size_of_its_tasks():
    handed = running(1, 8, 8)
    assert handed.hanging({"a": ["0", "1"], "b": ["2"]}, 0) == []
    assert handed.hanging({"a": ["0", "1"], "b": ["2"]}, 9000) == []
    handed.took(workers.Task("", (), 2), 20.0)
    handed.took(workers.Task("", (), 0), 9e9)
    # The first of its two is done: the second begins.
    assert handed.hanging({"a": ["1"], "b": []}, 9000) == []
    assert handed.hanging({"a": ["1"], "b": ["2"]}, 9000 + 20 * 10 * 8) == []
    assert handed.hanging({"a": ["1"], "b": ["2"]}, 9001 + 20 * 10 * 8) == ["a"]
    # That was told; the other began when it had something.
    assert handed.hanging({"a": ["1"], "b": ["2"]}, 9002 + 20 * 10 * 8) == []
    assert handed.hanging({"a": ["1"], "b": ["2"]}, 9001 + 2 * 20 * 10 * 8) == ["b"]


def test_a_time_that_is_said_holds_for_every_task():
    handed = workers._Running(Scheduled(), task, 5.0)
    handed.fill(iter([workers.Task("", (), 0)]), 1)
    assert handed.hanging({"a": ["0"], "b": []}, 0) == handed.hanging({"a": ["0"]}, 5) == []
    assert handed.hanging({"a": ["0"]}, 6) == ["a"]


def test_nobody_hangs_over_a_run_of_a_sweep():
    handed = running(0)
    handed.took(workers.Task("", (), 1), 1.0)
    assert handed.hanging({"a": ["0"]}, 0) == handed.hanging({"a": ["0"]}, 1e9) == []


def test_a_worker_that_hangs_without_a_nanny_ends_the_command(monkeypatch):
    pytest.importorskip("distributed", reason=WANTED)
    handed = running(1)
    handed.took(workers.Task("", (), 1), 1e-3)
    found = workers.Workers(handed._client, ClusterAddress("tcp://s:1", 0), None)
    monkeypatch.setattr(workers, "_WHO", -1.0)
    found._look_around(handed)
    monkeypatch.setattr(workers, "_HANGS_FROM", -1.0)
    monkeypatch.setattr(workers, "_HANGS", -1.0)
    with pytest.raises(ClusterError, match=r"worker a: hangs.*nanny"):
        found._look_around(handed)


def test_a_worker_of_several_threads(monkeypatch):
    pytest.importorskip("distributed", reason=WANTED)
    client = Told(GOOD)
    monkeypatch.setattr(client, "nthreads", lambda: {"tcp://w:1": 4})
    with pytest.raises(ClusterError, match=r"worker tcp://w:1: has 4 threads.*--nthreads 1"):
        workers.Workers(client, ClusterAddress("tcp://s:1", 0), None)


def test_tls_without_certificates():
    pytest.importorskip("distributed", reason=WANTED)
    with (
        pytest.raises(ClusterError, match=r"distributed\.comm\.tls"),
        workers.cluster_workers("tls://127.0.0.1:9", rift.open_device(), None),
    ):
        pass


def test_errors_travel():
    import pickle

    error = pickle.loads(pickle.dumps(SettingError("Settings", "steps", "is -1")))
    assert (error.settings, error.name, error.said) == ("Settings", "steps", "is -1")
    assert str(error) == "Settings: steps is -1"
