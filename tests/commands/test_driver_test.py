"""A driver that gives wrong numbers, dies or hangs is found out once, worked round, or refused."""

from __future__ import annotations

import datetime
import subprocess
import sys

import numpy as np
import pytest

import rift_cl as rift
from rift_cl.cl import Device
from rift_cl.cl.build import builder, driver_record, program_store, source
from rift_cl.cl.build.driver_record import OTHER_KIND, add_to_record, read_record
from rift_cl.cl.reductions import total
from rift_cl.commands.devices import driver_test
from rift_cl.commands.devices.driver_test import (
    examine_driver,
    findings,
    in_child,
    meet_driver,
    verdict,
)
from rift_cl.commands.devices.families import FAMILIES, stored_results
from rift_cl.commands.devices.family_check import try_family
from rift_cl.errors import DeviceError

RIGHT = {"deviation": 1e-7, "kernels": ["a", "b"]}


@pytest.fixture(autouse=True)
def folder(tmp_path, monkeypatch):
    """No driver is known, and what is found of one is forgotten afterwards."""
    for module in (driver_record, program_store):
        monkeypatch.setattr(module, "cache_folder", lambda: tmp_path)
    return tmp_path


@pytest.fixture
def tested():
    """The default device, with nothing built yet."""
    return _fresh()


def _fresh():
    found = rift.default_device()
    return Device(found._handle, found.selector, traits=found.traits)


def _examined(tested, attempt, families=("one", "two")):
    reports = list(examine_driver(tested, families, attempt))
    assert reports[-1].done == reports[-1].total == len(families)
    return verdict(tested)


def _always(**found):
    return lambda _, families: iter([{"family": name, **found} for name in families])


def test_there_is_a_known_result_for_every_family():
    stored = stored_results()
    assert all(stored[name] for name in FAMILIES)
    arrays = [array for results in stored.values() for array in results.values()]
    assert all(np.isfinite(array).all() and np.abs(array).max() > 0 for array in arrays)


@pytest.mark.parametrize(
    "name", [n if n == "sums" else pytest.param(n, marks=pytest.mark.full) for n in FAMILIES]
)
def test_family_gives_the_known_results_in_a_child(name):
    (found,) = in_child(rift.default_device().selector, [name])
    assert found["family"] == name
    assert found["deviation"] < driver_test.RIGHT


@pytest.mark.parametrize(("days", "age"), [(0, "today"), (1, "yesterday"), (3, "3 days ago")])
def test_driver_that_is_right_is_tested_once(tested, monkeypatch, days, age):
    day = datetime.date(2026, 12, 30)
    monkeypatch.setattr(driver_test, "_today", lambda: day)
    assert verdict(tested) is None
    assert findings(tested) == []
    record = _examined(tested, _always(**RIGHT))
    assert record["way"] == ""
    assert record["refused"] == {}
    monkeypatch.setattr(driver_test, "_today", lambda: day + datetime.timedelta(days))
    (said,) = findings(tested)
    assert said.startswith("2 of 2 families")
    assert f"tested {age} " in said


def test_driver_that_keeps_nothing_is_met_once(tested, monkeypatch):
    families = dict.fromkeys(["one", "two"])
    monkeypatch.setattr("rift_cl.commands.devices.families.FAMILIES", families)
    monkeypatch.setattr(driver_test, "in_child", _always(**RIGHT))
    monkeypatch.setattr(Device, "keeps_programs", True)
    assert not list(meet_driver(tested))
    monkeypatch.setattr(Device, "keeps_programs", False)
    assert [report.done for report in meet_driver(tested)] == [1, 2]
    assert not list(meet_driver(tested))


# Off by a little, and so that the host's square root of the sum fails.
@pytest.mark.full
@pytest.mark.parametrize("fault", ["1.001f * (over_lanes(sum) + tail)", "-1"])
def test_wrong_numbers_are_found_and_refused_by_name(tested, monkeypatch, fault):
    real, wanted = source.kernel_source, stored_results()
    wrong = real("dot_product").replace("over_lanes(sum) + tail", fault)
    monkeypatch.setattr(
        builder, "kernel_source", lambda n: wrong if n == "dot_product" else real(n)
    )

    def attempt(_, families):
        for name in families:
            yield {"family": name, **try_family(tested, FAMILIES[name], wanted[name])}

    record = _examined(tested, attempt, ["sums"])
    assert list(record["refused"]) == ["dot_product"]
    assert "wrong" in findings(tested)[1].lower()
    tested = _fresh()
    x = tested.array(np.ones(5))
    with pytest.raises(DeviceError, match=r"dot_product.*sums"):
        total(tested, x)
    assert np.array_equal(tested.get(tested.array(np.ones(5))), np.ones(5))


def test_way_that_puts_a_driver_right_is_taken_for_every_kernel(tested, monkeypatch):
    def attempt(_, families):
        good = read_record(tested.identity)["way"] == "noinline"
        for name in families:
            found = RIGHT if good or name == "one" else {"deviation": 0.1, "kernels": ["c"]}
            yield {"family": name, **found}

    record = _examined(tested, attempt)
    assert (record["way"], record["refused"]) == ("noinline", {})
    seen = []
    monkeypatch.setattr(builder, "way_to_build", lambda way, *rest: (seen.append(way), *rest)[1:])
    tested = _fresh()
    total(tested, tested.array(np.ones(5)))
    # The first is for the driver; a workaround for the kernel itself comes on top, here none.
    assert (seen[0], set(seen[1:])) == ("noinline", {""})


def test_kernels_of_the_other_kind_of_device_are_taken_where_they_alone_are_right(tested):
    def attempt(_, families):
        good = read_record(tested.identity)["way"] == OTHER_KIND
        for name in families:
            yield {"family": name, **(RIGHT if good else {"deviation": 0.1, "kernels": ["c"]})}

    record = _examined(tested, attempt)
    assert (record["way"], record["refused"]) == (OTHER_KIND, {})
    assert OTHER_KIND in findings(tested)[1]
    # A device that was opened before goes on with kernels that are wrong.
    with pytest.raises(DeviceError, match="start again"):
        total(tested, tested.array(np.ones(5)))
    again = Device(tested._handle, tested.selector)
    assert again.traits.is_cpu != tested.traits.is_cpu
    assert total(again, again.array(np.ones(5))) == 5


def test_kernels_that_a_right_family_uses_are_not_refused(tested):
    def attempt(_, families):
        yield {"family": "one", **RIGHT}
        yield {"family": "two", "deviation": float("inf"), "kernels": ["b", "c"]}

    assert list(_examined(tested, attempt)["refused"]) == ["c"]


def test_error_of_a_family_is_told_and_refuses_nothing(tested):
    assert _examined(tested, _always(error="no room", kernels=["a"]))["refused"] == {}
    assert findings(tested)[1:] == ["one: no room", "two: no room"]


CHILD = """
import json, os, signal, sys, time
for name in {names!r}:
    if name == "bad":
        {fate}
    print(json.dumps({{"family": name, "deviation": 0.0, "kernels": []}}), flush=True)
"""


@pytest.mark.parametrize(
    ("fate", "said"),
    [
        ("os.kill(os.getpid(), signal.SIGSEGV)", "died (SIGSEGV)"),
        ("sys.exit(3)", "status 3"),
        ("time.sleep(600)", "hung"),
    ],
)
def test_child_that_ends_early_is_a_finding_and_the_rest_is_tried(monkeypatch, fate, said):
    def start(arguments):
        code = CHILD.format(names=arguments[1:], fate=fate)
        command = [sys.executable, "-c", code]
        return subprocess.Popen(command, stdout=subprocess.PIPE, text=True)

    monkeypatch.setattr(driver_test, "_start", start)
    limit = 15.0 if said == "hung" else 60.0
    found = list(in_child("0:0", ["good", "bad", "better"], limit))
    assert [each["family"] for each in found] == ["good", "bad", "better"]
    assert said in found[1]["error"]
    assert "error" not in found[0] and "error" not in found[2]


def test_family_that_kills_its_child_once_is_tried_again(monkeypatch, tmp_path):
    mark = str(tmp_path / "died")
    fate = f"os.path.exists({mark!r}) or (os.mkdir({mark!r}), os.kill(os.getpid(), signal.SIGSEGV))"

    def start(arguments):
        code = CHILD.format(names=arguments[1:], fate=fate)
        return subprocess.Popen([sys.executable, "-c", code], stdout=subprocess.PIPE, text=True)

    monkeypatch.setattr(driver_test, "_start", start)
    found = list(in_child("0:0", ["good", "bad", "better"], 60.0))
    assert [each["family"] for each in found] == ["good", "bad", "better"]
    assert not any("error" in each for each in found)


def test_what_another_release_or_driver_left_is_not_taken(tested, monkeypatch):
    add_to_record(tested.identity, families={}, way="noinline")
    assert read_record(tested.identity)["way"] == "noinline"
    assert read_record({**tested.identity, "driver": "another"}) == {}
    monkeypatch.setattr(driver_record, "__version__", "0.0.1")
    assert read_record(tested.identity) == {}


@pytest.mark.parametrize("content", ["", "[]", "{}", '{"format": 0}'])
def test_record_that_cannot_be_read_is_no_record(tested, folder, content):
    add_to_record(tested.identity, way="noinline")
    (path,) = (folder / "drivers").iterdir()
    path.write_text(content)
    assert read_record(tested.identity) == {}


def test_cache_that_cannot_be_written_costs_the_record_alone(tested, monkeypatch):
    def full(*_):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(driver_record, "write_whole", full)
    assert total(tested, tested.array(np.ones(5))) == 5
