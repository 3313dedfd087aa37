"""How a command is run: its errors become sentences and exit statuses, its progress goes to stderr.

Exit statuses: 0 ok, 2 usage (an unknown option, or no number where one is wanted), 3 input (a file
or a value that cannot be used), 4 device, 5 output, 130 interrupted.
"""

from __future__ import annotations

import contextlib
import io
import os
import signal
import sys
import threading
import traceback
import warnings
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, fields
from inspect import Parameter, Signature
from types import FrameType
from typing import Annotated, Any, Literal

import tyro

from rift_cl.commands.console_table import print_table
from rift_cl.commands.options import join_help_lines, option_groups
from rift_cl.commands.progress_bar import print_line, show_progress
from rift_cl.errors import InputError, RiftError, SettingError
from rift_cl.progress import Report

_INPUT, _OUTPUT, _INTERRUPTED = 3, 5, 130
# Groups of values, and one of further groups, whose options have names of their own.
_OMITTED, _UNNAMED = tyro.conf.OmitArgPrefixes, tyro.conf.arg(name="")


@dataclass(frozen=True)
class Output:
    """What is printed while the command runs."""

    quiet: bool = False
    """Show no progress."""
    debug: bool = False
    """Show the traceback of an error."""


def exit_status(run: Callable[[], int]) -> int:
    """Run a command line; what ends it from outside becomes a sentence and an exit status."""
    try:
        status = run()
        if sys.stdout is not None:
            sys.stdout.flush()
    except KeyboardInterrupt:
        return _say("rift: interrupted; no file is half-written", _INTERRUPTED)
    except BrokenPipeError:
        # Whoever read the output has seen enough; the interpreter must not try to flush the rest.
        sys.stdout = open(os.devnull, "w")  # noqa: PTH123, SIM115 - kept open until the end
        return 0
    except OSError as error:
        sys.stdout = open(os.devnull, "w")  # noqa: PTH123, SIM115 - kept open until the end
        return _say(f"rift: the output cannot be written ({error.strerror})", _OUTPUT)
    return status


def told(run: Callable[[], int]) -> int:
    """Run something; an error of ours becomes one sentence and an exit status."""
    try:
        return run()
    except RiftError as error:
        return _say(f"rift: {error}", error.exit_status)


def parsed(parse: Callable[[], Callable[[], int]], settings: type) -> Callable[[], int]:
    """What a command line means; what its settings refuse is raised by the name of the option.

    Raises:
        RiftError: a value is out of its range.
        SystemExit: help was shown, or an option is unknown; that was said.
    """
    said = io.StringIO()
    try:
        with contextlib.redirect_stderr(said):
            return parse()
    except SystemExit as end:
        error: BaseException | None = end
        while error is not None and not isinstance(error, RiftError):
            error = error.__context__
        if isinstance(error, SettingError):
            raise InputError(_sentence(error, settings)) from None
        if error is not None:
            raise error from None
        print(said.getvalue(), end="", file=sys.stderr)
        raise


def command(
    run: Callable[[Any, Output], None],
    settings: type,
    default: Any = None,
    kinds: Iterable[tuple[str, Sequence[str], str, str]] = (),
) -> Callable[..., Callable[[], int]]:
    """A command for tyro: it takes groups of options and gives back what is to be run.

    Args:
        run: what to do with the settings.
        settings: their class; the help lists its options by ``option_groups``.
        default: settings to begin with, where nothing else is given; the class's own if None.
        kinds: options that were heeded already, in ``default``: their name, choices, what was
            chosen, and help.
    """
    groups = {
        group.group if hasattr(group, "group") else "": group for group in option_groups(settings)
    }
    for group in (*groups.values(), Output):
        join_help_lines(group)
    parameters = [
        Parameter(
            title or "settings",
            Parameter.KEYWORD_ONLY,
            annotation=Annotated[group, _OMITTED if title else _UNNAMED],
            default=Parameter.empty if default is None else _part(default, group),
        )
        for title, group in groups.items()
    ]
    talk = Parameter(
        "messages", Parameter.KEYWORD_ONLY, annotation=Annotated[Output, _OMITTED], default=Output()
    )

    heeded = [
        Parameter(
            name,
            Parameter.KEYWORD_ONLY,
            annotation=Annotated[Literal[tuple(choices)], tyro.conf.arg(help=text)],
            default=usual,
        )
        for name, choices, usual, text in kinds
    ]
    names = [parameter.name for parameter in parameters]

    def prepared(*, messages: Output, **parts: Any) -> Callable[[], int]:
        values = {name: value for part in names for name, value in _values(parts[part]).items()}
        return lambda: _guarded(run, settings(**values), messages)

    every = (*parameters, *heeded, talk)
    prepared.__signature__ = Signature(every)  # type: ignore[attr-defined]
    prepared.__annotations__ = {entry.name: entry.annotation for entry in every}
    prepared.__doc__ = settings.__doc__
    return prepared


def _part(settings: Any, group: type) -> Any:
    """The options of one group, with the values of some settings."""
    return group(**{field.name: getattr(settings, field.name) for field in fields(group)})


def _values(part: Any) -> dict[str, Any]:
    return {field.name: getattr(part, field.name) for field in fields(part)}


def watch(reports: Iterable[Report], output: Output) -> None:
    """Run a generator of reports to its end, and show progress unless quiet."""
    show_progress(reports, quiet=output.quiet)


def ran(job: Any, settings: Any, output: Output) -> bool:
    """Run a job, or say what it would do; whether it was run."""
    if settings.dry_run:
        print_table(("what", "plan"), job.plan().items())
        return False
    run_job(job, output)
    return True


def run_job(job: Any, output: Output) -> None:
    """Run a job, behind the test of a driver that is new here."""
    # Imported when used, so that a command's help loads no device layer.
    from rift_cl.commands.devices.driver_test import meet_driver

    device = getattr(job, "device", None)
    if device is not None:
        watch(meet_driver(device), output)
    watch(job.run(), output)


def _guarded(run: Callable[[Any, Output], None], settings: Any, output: Output) -> int:
    """Run a command; an error becomes one sentence and an exit status."""
    try:
        with warnings.catch_warnings():
            warnings.showwarning = _show_warning
            run(settings, output)
    except RiftError as error:
        if output.debug:
            traceback.print_exc()
        return _say(f"rift: {_sentence(error, type(settings))}", error.exit_status)
    except MemoryError as error:
        return _say(f"rift: there is too little memory for this ({error}): ask for less", _INPUT)
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


@contextmanager
def gentle_interrupt(stop: Callable[[], None]) -> Iterator[None]:
    """Call ``stop`` at the first Ctrl-C; the second breaks off at once, as usual."""
    if threading.current_thread() is not threading.main_thread():
        yield  # Signals are the main thread's.
        return
    usual = signal.getsignal(signal.SIGINT)

    def heard(number: int, frame: FrameType | None) -> None:
        signal.signal(signal.SIGINT, usual)
        stop()
        print_line("rift: stopping after this step; Ctrl-C again stops at once")

    signal.signal(signal.SIGINT, heard)
    try:
        yield
    finally:
        signal.signal(signal.SIGINT, usual)
