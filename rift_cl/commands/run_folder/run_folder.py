"""The output folder of a long command: settings, metrics, pictures and report.

``config.json`` holds the settings, the device and the version, so that the run can be repeated;
``metrics.json`` holds its figures; ``report.html`` shows both, and the pictures, in one file,
with settings at their defaults folded away.
"""

from __future__ import annotations

import os
import platform
import shutil
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from datetime import datetime, timezone
from fnmatch import fnmatch
from importlib.metadata import version
from pathlib import Path
from typing import Any

from rift_cl import __version__
from rift_cl.cl.device import Device
from rift_cl.commands.run_folder.run_inputs import FREE, input_contents, without_inputs
from rift_cl.commands.run_folder.saved_settings import (
    ASKED,
    DIGEST,
    LOADED,
    asked_before,
    digest_of,
    options_of,
    record_of,
    whole_paths,
)
from rift_cl.errors import CheckpointError, InputError, OutputError
from rift_cl.io.file_content import Content
from rift_cl.io.folder_lock import LOCK_NAME, keep, let_go
from rift_cl.io.json_fields import read_json_object
from rift_cl.io.output import PART, json_text, make_folder, write_json, write_text, writing
from rift_cl.json_parsing import parse_json
from rift_cl.own_parts import loaded_parts
from rift_cl.report.html_page import Page

_CONFIG = "config.json"
# Says of an unfinished run that nothing of an earlier one is left.
_CLEARED = "cleared"
# What it read, by the names of options.
_INPUTS = "inputs"

# Endings of files that people may have meant to name by --out.
_OF_FILES = (
    *(".gif", ".jpeg", ".jpg", ".mov", ".mp4", ".png", ".webm", ".webp"),
    *(".csv", ".glb", ".h5", ".hdf5", ".html", ".json", ".nii", ".npy", ".npz", ".obj", ".pdf"),
    *(".nii.gz", ".ply", ".raw", ".spz", ".tif", ".tiff", ".vti", ".zip"),
)


class RunFolder:
    """A run's folder.

    Args:
        path: the folder; made when it is not there.
        job: the command's name.
        overwrite: whether an earlier run of the same command may be replaced.
        resume: whether one that is there is gone on with.
        settings: those that were given, by which a run that is there is known for the same; None
            where the command knows it otherwise.

    ``finished`` says whether such a run is there and came to its end, ``unfinished`` whether it was
    cut off, and whatever is there was made by it.

    Raises:
        OutputError: the folder cannot be made, or holds something that would be lost.
    """

    def __init__(
        self,
        path: Path,
        job: str,
        *,
        overwrite: bool = False,
        resume: bool = False,
        settings: Any = None,
    ) -> None:
        self.path = path
        self._job = job
        self._asked = None if settings is None else asked_settings(settings)
        # As it is when the run begins: what changes meanwhile is found by the next one.
        self._inputs = {} if settings is None else input_contents(settings, path)
        self._overwrite = overwrite
        self._seen = self._config_stamp()
        ending = next((each for each in _OF_FILES if path.name.lower().endswith(each)), "")
        stem = path.name[: len(path.name) - len(ending)]
        if ending and stem and not path.is_dir():
            raise OutputError(
                f"{path}: ends as a file does, and is to be the folder of all that a run writes; "
                f"name one, such as --out {stem}"
            )
        above = next(parent for parent in path.absolute().parents if parent.exists())
        if not above.is_dir():
            raise OutputError(f"{path}: {above} is no folder; name another place (--out)")
        with writing(path):
            used = path.exists() and (not path.is_dir() or any(map(_is_used, path.iterdir())))
        if used and _record_of(path).get("job") != job:
            raise OutputError(f"{path}: holds other things already; name another folder (--out)")
        if used and not (overwrite or resume):
            raise OutputError(
                f"{path}: holds an earlier run; name another folder (--out) or add --overwrite"
            )
        looks = used and resume and settings is not None
        self._other = self._difference() if looks else None
        there = looks and self._other is None
        self.finished = there and self.is_complete
        self.unfinished = there and _record_of(path).get(_CLEARED) is True
        self._cleared = self.unfinished

    @classmethod
    def of(cls, settings: Any, job: str) -> RunFolder:
        """The folder of a run that its settings, and what they name, decide.

        Args:
            settings: those of the command, with ``out``, ``overwrite`` and ``resume``.
            job: the command's name.

        Raises:
            InputError: a run is to be gone on with and to be replaced.
            OutputError: the folder cannot be made, or holds something that would be lost.
            CheckpointError: the run to go on with is another.
        """
        if settings.resume and settings.overwrite:
            raise InputError("--resume continues what --overwrite discards: give one of them")
        given = {"overwrite": settings.overwrite, "resume": settings.resume}
        folder = cls(settings.out, job, **given, settings=settings)
        if folder._other is not None:
            raise CheckpointError(
                f"{settings.out}: {folder._other}, or begin anew with --overwrite"
            )
        return folder

    def _difference(self) -> str | None:
        """Why the run that is there is not that of the settings, in words; None where it may be."""
        if not (self.path / _CONFIG).is_file():
            return None
        record = _record_of(self.path)
        before, inputs = record.get(ASKED), record.get(_INPUTS)
        if not isinstance(before, dict):
            return "the run there does not say what it was asked for: name another --out"
        read = inputs if isinstance(inputs, dict) else {}
        was = {"rift_cl": record.get("rift_cl"), **without_inputs(before, read), **read}
        asked = without_inputs(self._asked or {}, self._inputs)
        differs = difference(was, {"rift_cl": __version__, **asked, **self._inputs})
        return None if differs is None else f"the run there {differs}"

    @property
    def is_complete(self) -> bool:
        """Whether it holds a run that came to its end."""
        return _record_of(self.path).get("complete") is True

    def make(self) -> None:
        """Make the folder, and mark it as ours if no earlier run did: the first thing written.

        From here on no other process writes into it, until ``release``.

        Raises:
            OutputError: another process does, or did since this run looked at what is there.
        """
        make_folder(self.path)
        keep(self.path)
        stamp = self._config_stamp()
        # The demo removes the fits of an earlier one: a run that is gone can be replaced.
        gone = self._overwrite and stamp is None
        if stamp != self._seen and not gone:
            self.release()
            raise OutputError(
                f"{self.path}: another run has written here meanwhile: begin this one again"
            )
        begun_by_other = self._overwrite and not self.is_complete
        if begun_by_other or not (self.path / _CONFIG).exists():
            self.mark()

    def mark(self, **decided: Any) -> None:
        """Say that the folder is this command's, and that its run is not finished.

        Args:
            **decided: what the configuration is to hold already, by name.
        """
        mark = {"job": self._job, "complete": False, "rift_cl": __version__}
        asked = {} if self._asked is None else {ASKED: self._asked, _INPUTS: self._inputs}
        cleared = {_CLEARED: True} if self._cleared else {}
        write_json(self.path / _CONFIG, {**mark, **asked, **cleared, **decided})

    def release(self) -> None:
        """Let other processes write into the folder."""
        let_go(self.path)

    def _config_stamp(self) -> str | None:
        try:
            return _stamp(self.path / _CONFIG)
        except OSError:
            return None

    def discard(self) -> None:
        """Remove the folder if a failed run left nothing in it but the mark."""
        self.release()
        if self.path.is_dir() and [entry.name for entry in self.path.iterdir()] == [_CONFIG]:
            (self.path / _CONFIG).unlink()
            self.path.rmdir()

    def drop(self, *patterns: str) -> None:
        """Remove what an earlier run left under names that this one does not write again."""
        for pattern in patterns:
            for entry in self.path.glob(pattern):
                with writing(entry):
                    shutil.rmtree(entry) if entry.is_dir() else entry.unlink()

    def begin(self, *patterns: str) -> None:
        """Mark the folder and drop what an earlier run left, unless that is to be gone on with.

        Args:
            *patterns: names that this run writes, and finds as it left them if it is cut off.
        """
        if not self.unfinished:
            self.mark()
            self.drop(*patterns)
            self._cleared = True
            self.mark()

    def check_kept(self, name: str, file: Path, *patterns: str) -> None:
        """Make sure that what is read is not what ``drop`` removes.

        Args:
            name: the option that names it.
            file: what is read, a file or a folder.
            *patterns: what is given to ``drop``.

        Raises:
            InputError: it is this folder, or would be removed with these names.
        """
        read, own = (Path(os.path.realpath(path)) for path in (file, self.path))
        if not read.is_relative_to(own):
            return
        inner = read.relative_to(own).parts
        if not inner or any(fnmatch(inner[0], pattern) for pattern in patterns):
            raise InputError(
                f"--{name} {file} lies in --out, where it would be replaced: copy it to another "
                "folder, or name another --out"
            )

    def finish(
        self,
        settings: Any,
        metrics: Mapping[str, Any],
        page: Page,
        device: Device,
        *,
        asked: Any = None,
        **decided: Any,
    ) -> None:
        """Write the report, the metrics and, last, the configuration.

        Args:
            settings: those that would repeat the run.
            metrics: its figures.
            page: the report, to which settings and environment are added.
            device: where it ran.
            asked: the settings that were given, where ``settings`` holds what was decided too.
            **decided: what else the configuration is to hold, by name.
        """
        given = {} if asked is None else {ASKED: _changed(asked)}
        given |= {} if self._asked is None else {_INPUTS: self._inputs}
        given |= {LOADED: loaded} if (loaded := loaded_parts()) else {}
        config = {
            "job": self._job,
            "complete": True,
            "rift_cl": __version__,
            "settings": (record := parse_json(json_text(record_of(settings)))),
            DIGEST: digest_of(record),
            **given,
            **decided,
            "environment": environment(device),
        }
        _show_settings(page, settings, asked)
        with page.folded("Environment"):
            page.facts(environment(device))
        # Whoever is cut off between these files leaves no run that looks finished.
        self.mark(**decided)
        write_text(self.path / "report.html", page.html())
        write_json(self.path / "metrics.json", metrics)
        write_json(self.path / _CONFIG, config)
        self.release()


@contextmanager
def released(job: Any) -> Iterator[None]:
    """Let others have a job's folder at the end, however it ends."""
    try:
        yield
    finally:
        folder = getattr(job, "folder", None)
        if folder is not None:
            folder.release()


def environment(device: Device) -> dict[str, str]:
    """The facts on which the figures of a run may depend."""
    return {
        "device": device.name,
        "platform": device.platform,
        "driver": device.driver,
        "python": platform.python_version(),
        **{name: version(name) for name in ("numpy", "scipy", "pyopencl")},
        "system": f"{platform.system()} {platform.machine()}",
        "rift_cl": __version__,
        "date": datetime.now(timezone.utc).isoformat(timespec="seconds"),
    }


def _record_of(path: Path) -> dict[str, Any]:
    """What a folder says of the run that it holds; nothing where it holds none."""
    try:
        return dict(read_json_object(path / _CONFIG).values)
    except InputError:
        return {}


def job_of(path: Path) -> str:
    """The command whose run a folder holds, such as "reconstruct"; empty where it holds none."""
    return str(_record_of(path).get("job", ""))


def is_unfinished(path: Path, job: str) -> bool:
    """Whether a folder holds a run of a command that did not come to its end."""
    record = _record_of(path)
    return record.get("job") == job and record.get("complete") is False


def difference(before: Mapping[str, Any], run: Mapping[str, Any]) -> str | None:
    """How a run differs from the one before by what decides it, the first of it, in words."""
    made, now = before.get("rift_cl"), run.get("rift_cl")
    if made != now:
        return f"was made by version {made or 'unknown'}, this is {now}: install that one"
    for name in sorted({*before, *run}):
        had, has = before.get(name), run.get(name)
        content, was = Content.read(has), Content.read(had)
        if content is not None and was is not None:
            if not was.is_same(content):
                return _other_content(was, content)
        elif content is not None:
            return (
                f"had {name} {had or 'unsaid'}, this one reads {content.place}: repeat its "
                "options, unless another version made it"
            )
        elif had != has:
            return f"had {name} {had}, this one has {has}: repeat its options"
    return None


def _other_content(before: Content, now: Content) -> str:
    """What two runs read that is not the same, in words."""
    if before.place == now.place:
        return f"read {now.place}, which was changed since: name another --out"
    return f"read {before.place}, and {now.place} holds something else: name another --out"


def _is_used(entry: Path) -> bool:
    """Whether an entry of a folder is more than what a run leaves that was killed early."""
    return entry.name not in (_CONFIG + PART, LOCK_NAME)


def asked_settings(settings: Any) -> dict[str, Any]:
    """The settings that differ from their defaults and decide what comes out, as JSON has them."""
    asked = parse_json(json_text(_changed(settings)))
    return {name: value for name, value in asked.items() if name not in FREE}


def _stamp(path: Path) -> str:
    state = path.stat()
    return f"{state.st_size} bytes of {state.st_mtime_ns} ns"


def _show_settings(page: Page, settings: Any, asked: Any = None) -> None:
    """Add a table of settings to a report.

    Args:
        page: the report.
        settings: those that would repeat the run, a dataclass.
        asked: those that were given, of the same class: what differs was decided by the run. If
            None, nothing was.
    """
    rows: list[tuple[str, str, str]] = []
    defaults: dict[str, str] = {}
    before = {} if asked is None else {option.name: option.value for option in options_of(asked)}
    for option in options_of(settings):
        name, value = option.name.replace("_", "-"), option.value
        given = before.get(option.name, value)
        if _alike(value, given) and _alike(value, option.default):
            defaults[name] = _words(value)
        else:
            source = "asked for" if _alike(value, given) else "decided"
            rows.append((name, _words(value), source))
    page.section("Settings")
    if rows:
        page.table(("setting", "value", "how it was chosen"), rows)
    if defaults:
        with page.folded(f"{len(defaults)} settings at their defaults"):
            page.facts(defaults)


def _changed(settings: Any) -> dict[str, Any]:
    """The settings that were given, by name: of a run that is repeated, those of the first."""
    before = asked_before(settings)
    if before is not None:
        return before
    return {
        option.name: whole_paths(option.value)
        for option in options_of(settings)
        if option.value != option.default
    }


def _alike(one: Any, other: Any) -> bool:
    """Whether two values mean the same."""
    if isinstance(one, Path) and isinstance(other, Path):
        return one.absolute() == other.absolute()
    if isinstance(one, tuple) and isinstance(other, tuple) and len(one) == len(other):
        return all(map(_alike, one, other))
    return bool(one == other)


def _words(value: Any) -> str:
    if isinstance(value, Path):
        # A report is passed on: whose folder it was stands in config.json alone.
        return value.name or str(value)
    if value is None or value == ():
        return "not given"
    if isinstance(value, bool):
        return "yes" if value else "no"
    if isinstance(value, float):
        return f"{value:g}"
    if isinstance(value, (tuple, list)):
        return ", ".join(_words(entry) for entry in value)
    return str(value)
