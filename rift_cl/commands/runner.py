"""How a command is run: its errors become sentences and exit statuses, its progress goes to stderr.

Exit statuses: 0 ok, 2 usage (an unknown option, or no number where one is wanted), 3 input (a file
or a value that cannot be used), 4 device, 5 output, 130 interrupted (also a run that keeps
what it has done at SIGTERM or SIGHUP), 143 ended by SIGTERM with nothing kept, 129 by SIGHUP.
"""

from __future__ import annotations

import logging
import os
import sys
import traceback
import warnings
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field, make_dataclass
from inspect import Parameter, Signature
from pathlib import Path
from types import FrameType
from typing import Annotated, Any, Literal, NamedTuple, get_args, get_origin

import tyro

from rift_cl.commands.console_table import print_table
from rift_cl.commands.interrupts import heeded, sent
from rift_cl.commands.options import MISSING, ShownOption, assembled, shown_options
from rift_cl.commands.progress_bar import print_line, show_progress
from rift_cl.errors import RiftError, SettingError
from rift_cl.option_marks import EXPERT, Group
from rift_cl.progress import Report

# What Python says where the system gives it no thread.
_NO_THREAD = "can't start new thread"
_INPUT, _DEVICE, _OUTPUT, _INTERRUPTED = 3, 4, 5, 130
# A shell says by 128 and its number which signal ended a command.
_SIGNALLED = 128
# Options have names of their own, whichever group they are in.
_OMITTED: Any = tyro.conf.OmitArgPrefixes
# Options in no group, which the help lists under tyro's own title.
_TITLELESS = "settings"
# What values of these types are called in the help.
_METAVARS: dict[Any, str] = {int: "INT", float: "FLOAT", str: "STR", Path: "PATH"}


@dataclass(frozen=True)
class Output:
    """What is printed while the command runs."""

    quiet: bool = False
    """Show no progress."""
    debug: bool = False
    """Show the traceback of an error."""


class Terminated(KeyboardInterrupt):
    """SIGTERM, which a batch system sends before it kills, or SIGHUP, when a terminal is lost.

    Args:
        number: of the signal.
    """

    def __init__(self, number: int) -> None:
        super().__init__()
        self.status = _SIGNALLED + number


def exit_status(run: Callable[[], int]) -> int:
    """Run a command line; what ends it from outside becomes a sentence and an exit status."""
    try:
        with heeded(sent(), _terminate), _quiet_matplotlib():
            status = run()
        if sys.stdout is not None:
            sys.stdout.flush()
    except KeyboardInterrupt as end:
        ended = end.status if isinstance(end, Terminated) else _INTERRUPTED
        return _say("rift: interrupted; no file is half-written", ended)
    except BrokenPipeError:
        # Whoever read the output has seen enough; the interpreter must not try to flush the rest.
        sys.stdout = open(os.devnull, "w")  # noqa: PTH123, SIM115 - kept open until the end
        return 0
    except OSError as error:
        sys.stdout = open(os.devnull, "w")  # noqa: PTH123, SIM115 - kept open until the end
        what = "standard output" if error.filename is None else error.filename
        return _say(f"rift: {what} cannot be written ({error.strerror})", _OUTPUT)
    return status


@contextmanager
def _quiet_matplotlib() -> Iterator[None]:
    """Keep what Matplotlib says of its folders, in many lines, to those who write programs."""
    log = logging.getLogger("matplotlib")
    level = log.level
    log.setLevel(logging.ERROR)
    try:
        yield
    finally:
        log.setLevel(level)


def told(run: Callable[[], int]) -> int:
    """Run something; warnings, and an error of ours, become a sentence, that an exit status."""
    try:
        with warnings.catch_warnings():
            warnings.showwarning = _show_warning
            return run()
    except RiftError as error:
        return _say(f"rift: {error}", error.exit_status)


def command(
    run: Callable[[Any, Output], None], settings: type, default: Any = None, *, twins: bool = False
) -> Callable[..., Callable[[], int]]:
    """A command for tyro: it takes groups of options and gives back what is to be run.

    Args:
        run: what to do with the settings.
        settings: their class.
        default: settings to begin with, where nothing else is given; the class's own if None.
        twins: give every switch a form that turns it on and one that turns it off, and not only
            the one that its default is not.
    """
    groups: dict[Group, list[_Entry]] = {}
    # Sorting keeps the order of the fields within what is for experts and what is not.
    for option in sorted(shown_options(settings, default), key=lambda one: one.group == EXPERT):
        groups.setdefault(option.group, []).append(_Entry.of(option, twins=twins))
    marks = (_OMITTED,) if twins else (_OMITTED, tyro.conf.FlagCreatePairsOff)
    parameters: dict[str, type] = {
        group.title or _TITLELESS: _class_of(group, entries) for group, entries in groups.items()
    }
    parameters["messages"] = Output

    def prepared(**parts: Any) -> Callable[[], int]:
        given = {
            entry.option.path: entry.value(parts[group.title or _TITLELESS])
            for group, entries in groups.items()
            for entry in entries
        }

        def made() -> Any:
            return assembled(settings, default, given)

        return lambda: _guarded(run, settings, made, parts["messages"])

    kinds = {
        name: Annotated[(kind, tyro.conf.arg(name="" if name == _TITLELESS else name), *marks)]
        for name, kind in parameters.items()
    }
    prepared.__signature__ = Signature(  # type: ignore[attr-defined]
        [Parameter(name, Parameter.KEYWORD_ONLY, annotation=kind) for name, kind in kinds.items()]
    )
    prepared.__annotations__ = kinds
    prepared.__doc__ = settings.__doc__
    return prepared


class _Entry(NamedTuple):
    """An option as tyro is told of it.

    Args:
        option: the option.
        field: its name in a class of options.
        kind: its type there.
        default: its value where nothing is given.
        negated: whether it is a switch that turns off what is on.
    """

    option: ShownOption
    field: str
    kind: Any
    default: Any
    negated: bool

    @classmethod
    def of(cls, option: ShownOption, *, twins: bool) -> _Entry:
        above, dot, last = option.name.replace("_", "-").rpartition(".")
        negated = option.default is True and not twins
        name = above + dot + ("no-" if negated else "") + last
        hint = "(on by default; this option turns it off)" if negated else _hint_of(option)
        taken = _metavar_of(option.kind)
        mark = tyro.conf.arg(name=name, help=option.help, help_behavior_hint=hint, metavar=taken)
        kind: Any = Annotated[option.kind, mark]
        default = False if negated else option.default
        return cls(option, "__".join(option.path), kind, default, negated)

    def value(self, part: Any) -> Any:
        """What was given for it, or its default."""
        found = _at_home(getattr(part, self.field))
        return not found if self.negated else found


def _at_home(value: Any) -> Any:
    """A value with paths that begin with a tilde as a shell makes them, which leaves --out=~/a."""
    if isinstance(value, tuple):
        return tuple(map(_at_home, value))
    if isinstance(value, Path) and value.parts[:1] == ("~",):
        return value.expanduser()
    return value


def _hint_of(option: ShownOption) -> str | None:
    """The default of a number, for people: 1 / 14 in four digits; None leaves others to tyro."""
    kind = option.kind
    while get_origin(kind) is Annotated:
        kind = get_args(kind)[0]
    number = kind is float and isinstance(option.default, float)
    return f"(default: {option.default:.4g})" if number else None


def _metavar_of(kind: Any) -> str | None:
    """What an option that may be left to the run takes, for people; None leaves it to tyro.

    tyro would name the value that stands for nothing given as well: ``{None}|FLOAT``.
    """
    while get_origin(kind) is Annotated:
        kind = get_args(kind)[0]
    taken = [part for part in get_args(kind) if part is not type(None)]
    if type(None) not in get_args(kind) or len(taken) != 1:
        return None
    if get_origin(taken[0]) is Literal:
        return f"{{{','.join(map(str, get_args(taken[0])))}}}"
    words = get_args(taken[0]) if get_origin(taken[0]) is tuple else taken
    named = ["..." if word is ... else _METAVARS.get(word, "") for word in words]
    return " ".join(named) if all(named) else None


def _class_of(group: Group, entries: Iterable[_Entry]) -> type:
    """A class with the options of a group."""
    members: list[Any] = [
        (entry.field, entry.kind)
        if any(entry.default is missing for missing in MISSING)
        else (entry.field, entry.kind, field(default=entry.default))
        for entry in entries
    ]
    return make_dataclass("Options", members, kw_only=True, namespace={"__doc__": group.about})


def watch(reports: Iterable[Report], output: Output) -> None:
    """Run a generator of reports to its end, and show progress unless quiet."""
    show_progress(reports, quiet=output.quiet)


def ran(job: Any, settings: Any, output: Output) -> bool:
    """Run a job, or say what it would do or that it is done; whether it was run."""
    if settings.dry_run:
        print_table(("what", "plan"), job.plan().items())
        return False
    folder = getattr(job, "folder", None)
    if folder is not None and folder.finished:
        print_line(f"rift: {settings.out}: this run is finished; --overwrite begins it anew")
        return False
    run_job(job, output)
    return True


def run_job(job: Any, output: Output) -> None:
    """Run a job, behind the test of a driver that is new here."""
    # Imported when used, so that a command's help loads no device layer.
    from rift_cl.cl.watchdog import patience_with, watched
    from rift_cl.commands.devices.driver_test import meet_driver
    from rift_cl.commands.run_folder.run_folder import released

    device = getattr(job, "device", None)
    if device is not None:
        watch(meet_driver(device), output)
    patience = 0.0 if device is None else patience_with(device)
    with released(job), watched(patience, _end):
        watch(job.run(), output)


def _end(sentence: str) -> None:
    """End the process at once, without what other threads would have to be waited for."""
    os._exit(_say(f"rift: {sentence}; --resume goes on where something was kept", _DEVICE))


def _guarded(
    run: Callable[[Any, Output], None], settings: type, made: Callable[[], Any], output: Output
) -> int:
    """Make the settings and run a command; an error becomes one sentence and an exit status."""
    try:
        run(made(), output)
    except RiftError as error:
        if output.debug:
            traceback.print_exc()
        return _say(f"rift: {_sentence(error, settings)}", error.exit_status)
    except MemoryError as error:
        return _say(f"rift: there is too little memory for this ({error}): ask for less", _INPUT)
    except RuntimeError as error:
        if _NO_THREAD not in str(error):
            raise
        return _say(f"rift: {error}: let this process have more memory or threads (ulimit)", _INPUT)
    return 0


def _sentence(error: RiftError, settings: type) -> str:
    """What an error says, with the option in place of a field of the settings."""
    if not isinstance(error, SettingError):
        return str(error)
    # Imported when used: a command that refuses nothing needs no tree of settings.
    from rift_cl.commands.run_folder.saved_settings import option_of

    option = option_of(error, settings)
    return str(error) if option is None else f"--{option.replace('_', '-')} {error.said}"


def _say(sentence: str, status: int) -> int:
    print_line(sentence)
    return status


def _show_warning(message: Warning | str, *_: Any, **__: Any) -> None:
    print_line(f"rift: warning: {message}")


def _terminate(number: int, frame: FrameType | None) -> None:
    raise Terminated(number)
