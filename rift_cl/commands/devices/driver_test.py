"""The test of a driver: small problems of every family of kernels against known results, once.

It runs in a child process, which may die or hang. What is found is kept beside the compiled
kernels, and holds for this driver, its version and this release. A driver that fails is tried again
with all kernels built in another way (``rift_cl.cl.build.guarded_build``), and with those of the
other kind of device, a GPU's on a CPU or the reverse; what no way puts right is refused from then
on, kernel by kernel.
"""

from __future__ import annotations

import datetime
import os
import queue
import subprocess
import sys
import threading
from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import IO, Any

from rift_cl.child_process import death_of
from rift_cl.cl.build.driver_record import (
    OTHER_KIND,
    add_to_record,
    forget_record,
    read_record,
)
from rift_cl.cl.build.guarded_build import WAYS
from rift_cl.cl.build.kernel_features import feature_of
from rift_cl.cl.build.program_store import forget, is_settled, stored_programs
from rift_cl.cl.device import Device
from rift_cl.json_parsing import parse_json
from rift_cl.progress import Report

# Relative deviation (L2) from the known results beyond which numbers are wrong: the worst gradient
# of the drivers that were compared is off by 3e-5.
RIGHT = 3e-4
# Seconds that one family may take, with everything that is compiled for it.
LIMIT = 600.0
# How often a family may kill its child and be tried again: each time another kernel.
_DEATHS = 3

Found = dict[str, Any]
Try = Callable[[str, Sequence[str]], Iterator[Found]]


def is_right(found: Found) -> bool:
    """Whether a family gave the known results."""
    return bool(found.get("deviation", RIGHT) < RIGHT)


def verdict(device: Device) -> dict[str, Any] | None:
    """What the test of a device's driver found, or None where it was not tested."""
    record = read_record(device.identity)
    return record if "families" in record else None


def meet_driver(device: Device) -> Iterator[Report]:
    """Test the driver of a device that a command is about to use, if that was never done.

    A driver that keeps its programs with us is PoCL, whose numbers the known results are: it is
    tested where somebody asks, by ``rift devices``, for there a cold compiler costs the most.
    """
    if verdict(device) is None and not device.keeps_programs:
        from rift_cl.commands.devices.families import FAMILIES

        yield from examine_driver(device, list(FAMILIES))


def examine_driver(
    device: Device, families: Sequence[str], attempt: Try | None = None
) -> Iterator[Report]:
    """Test a driver, keep what is found, and report after each family.

    Args:
        device: any device of that driver.
        families: their names.
        attempt: tries a selector's device on families; a child process if not given.
    """
    driver = device.identity
    forget_record(driver)
    forget(driver)
    best: tuple[str, dict[str, Found]] = ("", {})
    for way in (*WAYS, OTHER_KIND):
        # The child builds in the way that the record tells it.
        add_to_record(driver, way=way)
        results: dict[str, Found] = {}
        for found in (attempt or in_child)(device.selector, families):
            results[found["family"]] = found
            yield Report(len(results), len(families), "tests of the driver")
        if not best[1] or _count(results) > _count(best[1]):
            best = way, results
        if _count(results) == len(families):
            break
    way, results = best
    tested = _today().isoformat()
    add_to_record(driver, way=way, families=results, tested=tested, refused=_refused(results))


def in_child(selector: str, families: Sequence[str], limit: float = LIMIT) -> Iterator[Found]:
    """Try families in a child process, and go on behind one that kills it or hangs in it.

    A family that kills it is tried again: kernels that it died of are now built in another way.
    """
    left, deaths = list(families), Counter[str]()
    while left:
        lines: queue.Queue[str] = queue.Queue()
        process = _start([selector, *left])
        assert process.stdout is not None
        threading.Thread(target=_pump, args=(process.stdout, lines), daemon=True).start()
        try:
            while left and (line := lines.get(timeout=limit)):
                yield parse_json(line)
                left.pop(0)
            if left:
                fault = death_of("it", process.wait())
                deaths[left[0]] += 1
                if deaths[left[0]] > _DEATHS:
                    yield {"family": left.pop(0), "error": fault, "kernels": []}
        except queue.Empty:
            yield {"family": left.pop(0), "error": f"it hung for {limit:.3g} s", "kernels": []}
        finally:
            process.kill()
            process.wait()


def _today() -> datetime.date:
    """The day in UTC, so that a record kept beside a journey has no negative age."""
    return datetime.datetime.now(datetime.timezone.utc).date()


def findings(device: Device) -> list[str]:
    """What ``rift devices`` says of a driver, in sentences; nothing where it was not tested."""
    record = verdict(device)
    if record is None:
        return []
    results: dict[str, Found] = record["families"]
    right = [found["deviation"] for found in results.values() if is_right(found)]
    days = (_today() - datetime.date.fromisoformat(record["tested"])).days
    age = "today" if days < 1 else "yesterday" if days == 1 else f"{days} days ago"
    said = [
        f"{len(right)} of {len(results)} families of kernels give the known results (largest "
        f"deviation {max(right, default=0):.1g}), tested {age} with driver {device.driver}"
    ]
    if record["way"]:
        said.append(f"every kernel is built with a workaround: {record['way']}")
    said += [f"{name}: {_told(found)}" for name, found in results.items() if not is_right(found)]
    for about in stored_programs(device.identity):
        if about["fault"]:
            macros = " ".join(f"{macro}={value}" for macro, value in about["macros"].items())
            refused = "refused" if is_settled(about) else "tried again when it is next wanted"
            taken = f"built with a workaround: {about['way']}" if about["built"] else refused
            said.append(f"{feature_of(about['kernel'])} {macros}: {about['fault']}; {taken}")
    if record["refused"]:
        said.append(f"refused: {', '.join(map(feature_of, record['refused']))}")
    return said


def _told(found: Found) -> str:
    if "error" in found:
        return str(found["error"])
    return f"WRONG numbers, off by {found['deviation']:.1g} of the known results"


def _count(results: dict[str, Found]) -> int:
    return sum(map(is_right, results.values()))


def _refused(results: dict[str, Found]) -> dict[str, str]:
    """The kernels that only families with wrong numbers use, and what is said of each.

    Where an error was raised there is nothing to refuse: no wrong number came of it.
    """
    good = {kernel for found in results.values() if is_right(found) for kernel in found["kernels"]}
    return {
        kernel: f"{name}: {_told(found)}"
        for name, found in results.items()
        if "deviation" in found and not is_right(found)
        for kernel in found["kernels"]
        if kernel not in good
    }


def _start(arguments: list[str]) -> subprocess.Popen[str]:
    root = str(Path(__file__).parents[3])
    path = os.pathsep.join(filter(None, (root, os.environ.get("PYTHONPATH"))))
    return subprocess.Popen(
        [sys.executable, "-m", "rift_cl.commands.devices.family_check", *arguments],
        stdout=subprocess.PIPE,
        stderr=subprocess.DEVNULL,
        env={**os.environ, "PYTHONPATH": path},
        text=True,
    )


def _pump(stream: IO[str], lines: queue.Queue[str]) -> None:
    """Hand lines on until there are no more, which an empty one tells."""
    with stream:
        for line in stream:
            lines.put(line)
    lines.put("")
