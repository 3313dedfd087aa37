"""``--config``: a run begins with the settings of an earlier one, as its config.json has them.

The file is read as if its values had been typed: each becomes an option of the command line and
goes through the same parser, so that a value that cannot be used is refused as it always is.
"""

from __future__ import annotations

import dataclasses
import io
import json
import math
import re
from collections.abc import Sequence
from contextlib import redirect_stderr, redirect_stdout
from pathlib import Path
from typing import Any, TypeVar, get_type_hints

import numpy as np
import tyro
from tyro.conf import Positional

from rift_cl import __version__
from rift_cl.errors import InputError

S = TypeVar("S")
# Options that say how a command runs, not what comes out: they are not repeated.
_NOT_REPEATED = ("config", "dry_run", "overwrite", "preview", "resume", "view")
_MOST_BYTES = 1 << 24


def named_config(arguments: Sequence[str]) -> Path | None:
    """The file that ``--config`` names on a command line, if it does."""
    for place, argument in enumerate(arguments):
        if argument.startswith("--config="):
            return Path(argument.removeprefix("--config="))
        if argument == "--config" and place + 1 < len(arguments):
            return Path(arguments[place + 1])
    return None


def saved_settings(path: Path, job: str, settings: type[S]) -> S:
    """The settings of an earlier run.

    Args:
        path: its config.json.
        job: the command that is to be run again, such as "reconstruct".
        settings: the command's settings.

    Raises:
        InputError: the file cannot be read, is another command's, or holds a setting that this
            version does not have or a value that it does not take.
    """
    try:
        if path.stat().st_size > _MOST_BYTES:
            raise ValueError("it is too large")
        record = json.loads(path.read_text(encoding="utf-8"))
        name, values = record["job"], dict(record["settings"])
    except (OSError, ValueError, LookupError, TypeError) as error:
        raise InputError(
            f"--config {path}: cannot be read as the config.json of an earlier run ({error})"
        ) from error
    if name != job:
        raise InputError(f"--config {path}: is of 'rift {name}', not of 'rift {job}'")
    repeated = {name: value for name, value in values.items() if name not in _NOT_REPEATED}
    version = record.get("rift_cl", __version__)
    by = "" if version == __version__ else f" (written by rift_cl {version})"
    return parsed_settings(repeated, job, settings, where=f"--config {path}{by}: ")


def parsed_settings(
    values: dict[str, Any],
    job: str,
    settings: type[S],
    *,
    earlier: S | None = None,
    where: str = "",
) -> S:
    """Settings of values by their names, which the command line's parser checks.

    Args:
        values: what is given; the rest has its defaults, and so has what is None.
        job: the command.
        settings: its settings.
        earlier: those to begin with, in place of the defaults.
        where: what a sentence about a mistake begins with.

    Raises:
        InputError: there is no such setting, or a value is none that it takes.
    """
    known = {field.name for field in dataclasses.fields(settings)}  # type: ignore[arg-type]
    unknown = sorted(set(values) - known)
    if unknown:
        raise InputError(f"{where}'rift {job}' has no setting {unknown[0]!r}")
    arguments = _as_arguments(values, settings)
    said = io.StringIO()
    try:
        # The parser prints what is wrong before it gives up.
        with redirect_stderr(said), redirect_stdout(said):
            if earlier is not None:
                return tyro.cli(settings, default=earlier, args=arguments)
            return tyro.cli(settings, args=arguments)
    except SystemExit as error:
        named = re.search(r"(?:Error parsing|for argument) '?--([\w-]+)", said.getvalue())
        name = "" if named is None else named[1].replace("-", "_")
        wrong = _as_arguments({name: values[name]}, settings) if name in values else arguments
        raise InputError(f"{where}'rift {job}' does not take {' '.join(wrong)}") from error


def _as_arguments(values: dict[str, Any], settings: type) -> list[str]:
    """The command line that means these values."""
    hints = get_type_hints(settings, include_extras=True)
    positional: list[str] = []
    options: list[str] = []
    for name, value in values.items():
        if value is None:
            continue
        option = "--" + name.replace("_", "-")
        if Positional in getattr(hints[name], "__metadata__", ()):
            positional += map(_word, value if isinstance(value, (list, tuple)) else (value,))
        elif isinstance(value, bool):
            options.append(option if value else f"--no-{option[2:]}")
        elif isinstance(value, (list, tuple)):
            options += [option, *map(_word, value)]
        else:
            options.append(f"{option}={_word(value)}")
    return [*positional, *options]


def _word(value: Any) -> str:
    """A value as it is typed; -1e-05 would be taken for an option, -0.00001 is not."""
    if isinstance(value, float) and math.isfinite(value):
        return np.format_float_positional(value, trim="0")
    return str(value)
