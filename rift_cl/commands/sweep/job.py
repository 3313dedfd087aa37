"""``rift sweep``: one command with many settings or inputs, side by side in one table.

Every run has a folder of its own under ``runs`` and is what the command would make of its settings;
what is there stays there, so that a sweep that was cut off goes on with the runs that are missing.
"""

from __future__ import annotations

import dataclasses
import json
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

from rift_cl.cl.device import Device
from rift_cl.commands.run_folder.run_folder import RunFolder, asked_settings, difference
from rift_cl.commands.run_folder.run_inputs import (
    files_read,
    input_contents,
    named_files,
    without_inputs,
)
from rift_cl.commands.sweep.one_run import is_done, run, steps
from rift_cl.commands.sweep.report import Row, sweep_page, write_table
from rift_cl.commands.sweep.settings import SweepSettings
from rift_cl.commands.sweep.variations import Variation, variations
from rift_cl.errors import CheckpointError, InputError, StoppedError
from rift_cl.json_parsing import parse_json
from rift_cl.progress import Report

_RUNS = "runs"
# What a run reads, beside the settings that decide it.
_INPUTS = "inputs"


class Sweep:
    """A sweep that is planned: every run's settings are checked, nothing is written yet.

    Args:
        settings: what to run.

    Raises:
        RiftError: a setting, the device or the folder cannot be used.
    """

    def __init__(self, settings: SweepSettings) -> None:
        settings.check()
        self.settings = settings
        self.runs = variations(settings)
        self.device: Device = settings.open_device()
        self.folder = RunFolder(
            settings.out, "sweep", overwrite=settings.overwrite, resume=settings.resume
        )
        if not settings.resume:
            for path in settings.inputs:
                self.folder.check_kept("inputs", path, _RUNS)
        self.rows: list[Row] = []
        self.metrics: dict[str, Any] = {}
        self.announce: Callable[[str], None] = lambda line: None
        # What decided the runs of earlier sweeps in the folder, by their names.
        self._before: dict[str, Any] = {}
        # The same of this one, as it was when it began.
        self._now: dict[str, Any] = {}
        # Why runs could not be done, by their names.
        self._refused: dict[str, str] = {}

    @property
    def _job(self) -> str:
        return self.runs[0].job

    def plan(self) -> dict[str, str]:
        """What would be done, for ``--dry-run``."""
        done = sum(is_done(each.settings.out) for each in self.runs) if self.settings.resume else 0
        return {
            "command": f"rift {self._job}",
            "runs": f"{len(self.runs)}, of which {done} are done",
            **{f"run {n}": each.name for n, each in enumerate(self.runs, 1)},
            "device": self.device.name,
            **({} if self.settings.cluster is None else {"workers": self.settings.cluster}),
        }

    def run(self) -> Iterator[Report]:
        """Do it; a report after every run, and within one where this process does it.

        Raises:
            StoppedError: it was broken off, and what was done is kept.
            InputError: no run can be done.
        """
        begin = time.perf_counter()
        self._now = self._decisive()
        self._check_same()
        self.folder.make()
        if not self.settings.resume:
            self.folder.drop(_RUNS)
        self.folder.mark(runs=self._record())
        left = [each for each in self.runs if not is_done(each.settings.out)]
        done = len(self.runs) - len(left)
        yield self._report(done)
        try:
            yield from self._here(left) if self.settings.cluster is None else self._spread(left)
        except KeyboardInterrupt:
            raise StoppedError(
                f"interrupted; {sum(is_done(each.settings.out) for each in self.runs)} of "
                f"{len(self.runs)} runs are kept: the same command with --resume goes on"
            ) from None
        self._finish(time.perf_counter() - begin)

    def _here(self, left: list[Variation]) -> Iterator[Report]:
        """Do runs one after the other."""
        before = len(self.runs) - len(left)
        for done, each in enumerate(left, before):
            try:
                for report in steps(each.job, each.settings):
                    yield self._report(done, report.done / max(report.total, 1))
            except InputError as error:
                self._refuse(each, str(error))
            yield self._report(done + 1)

    def _spread(self, left: list[Variation]) -> Iterator[Report]:
        """Do runs on the workers of a cluster, a whole one on each."""
        from rift_cl.cluster.address import ClusterAddress
        from rift_cl.cluster.on_worker import token
        from rift_cl.cluster.workers import Task, cluster_workers, quiet_dask

        settings, done = self.settings, len(self.runs) - len(left)
        local = ClusterAddress.of(settings.cluster or "").workers > 0
        where = settings.cluster or "", self.device, settings.device, settings.part_timeout
        with quiet_dask(), cluster_workers(*where) as workers:
            workers.wait()
            self.announce(workers.sentence)
            with token(settings.out.absolute() / _RUNS) as seen:
                workers.check([*_files(left), seen])
            tasks = []
            for each in left:
                own: dict[str, Any] = {"device": None, "memory": None} if local else {}
                own = {name: value for name, value in own.items() if hasattr(each.settings, name)}
                given = dataclasses.replace(each.settings, **own)
                tasks.append(Task(f"run {each.name}", (each.job, given)))
            by_name = {f"run {each.name}": each for each in left}
            for come in workers.each(run, tasks):
                if come is None:
                    continue
                if come[1]:
                    self._refuse(by_name[come[0].name], come[1])
                done += 1
                yield self._report(done)

    @property
    def refusal(self) -> str:
        """A sentence about the runs that could not be done; empty where all were."""
        if not self._refused:
            return ""
        name, why = next(iter(self._refused.items()))
        return (
            f"{len(self._refused)} of {len(self.runs)} runs could not be done: sweep.csv has why. "
            f"The first is {name}: {why}"
        )

    def _refuse(self, each: Variation, why: str) -> None:
        self._refused[each.name] = why
        self.announce(f"run {each.name}: {why}")

    def _report(self, done: int, more: float = 0.0) -> Report:
        count = len(self.runs)
        return Report(done, count, "runs", work=(done + min(more, 1.0), count))

    def _record(self) -> dict[str, Any]:
        """What decides each run that is there or will be, by its name."""
        return {**self._before, **self._now}

    def _decisive(self) -> dict[str, Any]:
        """What decides each run of this sweep, by its name: settings, and files as they are."""
        contents: dict[tuple[Any, ...], dict[str, Any]] = {}
        found = {}
        for each in self.runs:
            # Most runs read the same files, which may be many.
            read = tuple(named_files(each.settings))
            if read not in contents:
                contents[read] = input_contents(each.settings, self.settings.out)
            asked = without_inputs(_decisive(each.settings), contents[read])
            decisive = {**asked, _INPUTS: contents[read]}
            found[each.name] = parse_json(json.dumps(decisive, default=str))
        return found

    def _check_same(self) -> None:
        """Make sure that runs which are there are of these settings and files.

        Raises:
            CheckpointError: one is not.
        """
        if not self.settings.resume:
            return
        try:
            path = self.settings.out / "config.json"
            self._before = dict(parse_json(path.read_text(encoding="utf-8"))["runs"])
        except (OSError, ValueError, LookupError, TypeError):
            return
        for name, now in self._now.items():
            differs = difference(*map(_flat, (self._before.get(name, now), now)))
            if differs is not None:
                raise CheckpointError(
                    f"{self.settings.out}: its run {name} {differs}, or begin anew with --overwrite"
                )

    def _finish(self, seconds: float) -> None:
        """Write the table and the report."""
        self.rows = [Row.of(each, self._refused.get(each.name, "")) for each in self.runs]
        if len(self._refused) == len(self.runs):
            name, why = next(iter(self._refused.items()))
            raise InputError(
                f"no run can be done; {name}: {why}; mend --vary or --fixed, or the inputs"
            )
        self.metrics = {
            "runs": len(self.runs),
            "refused": self._refused,
            "seconds": seconds,
            "figures": {row.run.name: row.figures for row in self.rows},
        }
        write_table(self.settings.out / "sweep.csv", self.rows)
        page = sweep_page(self._job, self.rows)
        self.folder.finish(
            self.settings, self.metrics, page, self.device, asked=self.settings, runs=self._record()
        )


def _decisive(settings: Any) -> dict[str, Any]:
    """What decides a run: what its command says, or else all that was asked for."""
    own = getattr(settings, "decisive", None)
    return asked_settings(settings) if own is None else dict(own())


def _flat(decisive: dict[str, Any]) -> dict[str, Any]:
    """What decides a run, its settings and what it read, by name."""
    inputs = decisive.get(_INPUTS)
    settings = {name: value for name, value in decisive.items() if name != _INPUTS}
    return {**settings, **(inputs if isinstance(inputs, dict) else {})}


def _files(runs: list[Variation]) -> list[Path]:
    """The files and folders that runs read."""
    named = (path for each in runs for path in files_read(each.settings))
    return [path for path in dict.fromkeys(named) if path.exists()]
