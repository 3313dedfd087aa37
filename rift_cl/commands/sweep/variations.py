"""The runs of a sweep: every combination of its inputs and of the values that are varied."""

from __future__ import annotations

import itertools
import re
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from rift_cl.commands.fit.kind import kind_of_fit
from rift_cl.commands.options import absolute_files
from rift_cl.commands.run_folder.saved_settings import begun_settings, parsed_settings
from rift_cl.commands.sweep.settings import SweepSettings
from rift_cl.errors import InputError
from rift_cl.json_parsing import parse_json

# The setting that an input is for, by the command.
_INPUT = {"reconstruct": "scan", "fit xray": "capture", "fit photos": "capture", "plan": "have"}
# What differs between the runs in any case, or is the sweep's own.
_OWN = (*_INPUT.values(), "out", "resume", "overwrite", "dry_run", "preview", "config", "cluster")
_OWN_TOO = ("view", "device", "part_timeout")
_MOST_RUNS = 10_000
_LONGEST_NAME = 100


@dataclass(frozen=True)
class Variation:
    """A run of a sweep.

    Args:
        name: of its folder.
        job: the command, such as ``fit photos``.
        varied: the texts of what differs between runs, by name.
        settings: of the command.
    """

    name: str
    job: str
    varied: dict[str, str]
    settings: Any


def variations(sweep: SweepSettings) -> list[Variation]:
    """All runs of a sweep, in the order in which values were given.

    Raises:
        InputError: a name or a value is none of the command's, or two runs are the same.
    """
    job, kind = _job(sweep)
    named = [_named(text) for text in (*sweep.fixed, *sweep.vary)]
    names = [name for name, _ in named]
    twice = next((name for name in names if names.count(name) > 1), None)
    if twice is not None:
        raise InputError(f"{twice} is given twice: once in --vary or once in --fixed is enough")
    fixed = {name: _one(name, values) for name, values in named[: len(sweep.fixed)]}
    varied = dict(named[len(sweep.fixed) :])
    earlier = begun_settings(sweep.base, fixed.get("preset"), job, kind, anew=True)
    inputs: Sequence[Path | None] = sweep.inputs or [None]
    count = len(inputs)
    for several_values in varied.values():
        count *= len(several_values)
    if count > _MOST_RUNS:
        raise InputError(f"--vary makes {count} runs, wanted {_MOST_RUNS} at most")
    called = _input_names(sweep.inputs) if len(inputs) > 1 else {}
    runs = []
    for path, values in itertools.product(inputs, itertools.product(*varied.values())):
        texts = dict(zip(varied, values, strict=True))
        given = {
            name: _value(name, text, job, kind, earlier)
            for name, text in {**fixed, **texts}.items()
        }
        shown = {"input": called[path], **texts} if path in called else texts
        name = _folder_name(shown) or "run"
        given |= {} if path is None else {_INPUT[job]: str(path)}
        given |= {"out": str(sweep.out / "runs" / name)}
        settings = parsed_settings(given, job, kind, earlier=earlier)
        # Whole paths, for a worker in another folder; and so that a sweep goes on anywhere.
        settings = absolute_files(replace(settings, device=sweep.device))
        settings.check()
        runs.append(Variation(name, job, shown, settings))
    _check_names(runs)
    return runs


def _job(sweep: SweepSettings) -> tuple[str, type[Any]]:
    """The command, and the class of its settings.

    Raises:
        InputError: some inputs are for one kind of fit and some for the other.
    """
    if sweep.command == "reconstruct":
        from rift_cl.commands.reconstruct.settings import ReconstructSettings

        return "reconstruct", ReconstructSettings
    if sweep.command == "plan":
        from rift_cl.commands.plan.settings import PlanSettings

        return "plan", PlanSettings
    kinds = {kind_of_fit([str(path)]) for path in sweep.inputs}
    if len(kinds) > 1:
        raise InputError("a sweep is of scans or of photographs, these inputs are some of each")
    if kinds == {"xray"}:
        from rift_cl.commands.fit_xray.settings import FitXraySettings

        return "fit xray", FitXraySettings
    from rift_cl.commands.fit_photos.settings import FitPhotosSettings

    return "fit photos", FitPhotosSettings


def _named(text: str) -> tuple[str, list[str]]:
    """A setting's name and the texts of its values."""
    name, equals, values = text.partition("=")
    name = name.strip().removeprefix("--").replace("-", "_")
    if not (name and equals and values):
        raise InputError(f"{text!r} is no setting, wanted NAME=VALUE, such as method=cgls")
    if name in (*_OWN, *_OWN_TOO):
        raise InputError(f"{name} cannot be a setting of the runs: the sweep has its own")
    return name, [value.strip() for value in values.split(",")]


def _one(name: str, values: Sequence[str]) -> str:
    if len(values) != 1:
        raise InputError(f"--fixed {name} has {len(values)} values, wanted one: use --vary")
    return values[0]


def _value(name: str, text: str, job: str, kind: type[Any], earlier: Any) -> Any:
    """A value as the command takes it: a number, true or false, a text, or several of them.

    Raises:
        InputError: there is no such setting, or it takes no such value.
    """
    words = text.split()
    read = [_plain(word) for word in words]
    tries: list[Any] = [read[0]] if len(words) == 1 else []
    tries += [read, text]
    refused: list[InputError] = []
    for value in tries:
        try:
            parsed_settings({name: value}, job, kind, earlier=earlier, open_ended=True)
        except InputError as error:
            refused.append(error)
        else:
            return value
    raise refused[-1]


def _plain(word: str) -> Any:
    try:
        value = parse_json(word)
    except ValueError:
        return word
    return value if isinstance(value, (bool, int, float)) else word


def _input_names(paths: Sequence[Path]) -> dict[Path, str]:
    """Names of inputs that tell them apart: with as many folders before them as it takes."""
    whole = {path: path.absolute() for path in paths}
    beside = Counter(path.with_suffix("") for path in whole.values())
    # The ending tells files of one folder apart.
    last = {
        path: path.name if beside[place.with_suffix("")] > 1 or not path.stem else path.stem
        for path, place in whole.items()
    }
    names = dict(last)
    for folders in range(1, max(len(place.parts) for place in whole.values())):
        alike = Counter(names.values())
        if len(alike) == len(names):
            break
        for path in (path for path, name in names.items() if alike[name] > 1):
            names[path] = "/".join([*whole[path].parts[1:-1][-folders:], last[path]])
    return names


def _folder_name(varied: dict[str, str]) -> str:
    """A name that any file system takes, and a person recognizes."""
    words = (f"{name}={text}" if name != "input" else text for name, text in varied.items())
    return re.sub(r"[^A-Za-z0-9._=+-]+", "-", "_".join(words))[:_LONGEST_NAME].strip(".-")


def _check_names(runs: Sequence[Variation]) -> None:
    seen: dict[str, Variation] = {}
    for run in runs:
        if run.name in seen:
            raise InputError(
                f"two runs would have the folder {run.name!r}: name inputs apart, and give every "
                "value once"
            )
        seen[run.name] = run
