"""The command ``rift``: settings from the command line, progress to stderr, results to stdout.

Every command is a settings dataclass and a job; this file only turns arguments into the one, runs
the other, and turns errors into a sentence and an exit status: 0 ok, 2 usage (an unknown option, or
no number where one is wanted), 3 input (a file or a value that cannot be used), 4 device, 5 output,
130 interrupted.
"""

from __future__ import annotations

import os
import sys
import traceback
import warnings
from collections.abc import Callable, Iterable, Sequence
from contextlib import suppress
from dataclasses import dataclass
from typing import Annotated, Any

import tyro

from rift_cl import __version__
from rift_cl.console_table import print_table
from rift_cl.errors import RiftError
from rift_cl.interruption import gentle_interrupt
from rift_cl.progress import Report
from rift_cl.progress_bar import print_line, show_progress

_INPUT, _OUTPUT, _INTERRUPTED = 3, 5, 130


@dataclass(frozen=True)
class Output:
    """How a command talks."""

    quiet: bool = False
    """Show no progress."""
    debug: bool = False
    """Show the traceback of an error."""


Talk = Annotated[Output, tyro.conf.arg(name="")]


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command line and return its exit status."""
    arguments = sys.argv[1:] if arguments is None else list(arguments)
    try:
        status = _run(arguments)
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


def _run(arguments: Sequence[str]) -> int:
    if list(arguments) == ["--version"]:
        print(f"rift {__version__}")
        return 0
    command: Callable[[], int] = tyro.extras.subcommand_cli_from_dict(
        _commands(),
        prog="rift",
        description="Tomography and splatting on any OpenCL device.",
        args=arguments,
        config=(tyro.conf.OmitArgPrefixes,),
    )
    return command()


def _commands() -> dict[str, Callable[..., Callable[[], int]]]:
    from rift_cl.jobs.cache import CacheSettings
    from rift_cl.jobs.center import CenterSettings
    from rift_cl.jobs.demo import DemoSettings
    from rift_cl.jobs.devices import DevicesSettings
    from rift_cl.jobs.evaluate import EvalSettings
    from rift_cl.jobs.fit_settings import FitSettings
    from rift_cl.jobs.reconstruct_settings import ReconstructSettings
    from rift_cl.jobs.render_settings import RenderSettings
    from rift_cl.jobs.view import ViewSettings

    return {
        "devices": _command(_devices, DevicesSettings),
        "demo": _command(_demo, DemoSettings),
        "reconstruct": _command(_reconstruct, ReconstructSettings),
        "center": _command(_center, CenterSettings),
        "fit": _command(_fit, FitSettings),
        "eval": _command(_eval, EvalSettings),
        "render": _command(_render, RenderSettings),
        "view": _command(_view, ViewSettings),
        "cache": _command(_cache, CacheSettings),
    }


def _command(
    run: Callable[[Any, Output], None], settings: type
) -> Callable[..., Callable[[], int]]:
    """A command for tyro: it takes settings and gives back what is to be run."""

    def command(settings: Any, output: Any = Output()) -> Callable[[], int]:
        return lambda: _guarded(run, settings, output)

    command.__annotations__ = {
        "settings": Annotated[settings, tyro.conf.arg(name="")],
        "output": Talk,
    }
    command.__doc__ = settings.__doc__
    return command


def _guarded(run: Callable[[Any, Output], None], settings: Any, output: Output) -> int:
    """Run a command; an error becomes one sentence and an exit status."""
    try:
        with warnings.catch_warnings():
            warnings.showwarning = _show_warning
            run(settings, output)
    except RiftError as error:
        if output.debug:
            traceback.print_exc()
        return _say(f"rift: {error}", error.exit_status)
    except MemoryError as error:
        return _say(f"rift: there is too little memory for this ({error}): ask for less", _INPUT)
    return 0


def _say(sentence: str, status: int) -> int:
    print_line(sentence)
    return status


def _show_warning(message: Warning | str, *_: Any, **__: Any) -> None:
    print_line(f"rift: warning: {message}")


def _watch(reports: Iterable[Report], output: Output) -> None:
    show_progress(reports, quiet=output.quiet)


def _ran(job: Any, settings: Any, output: Output) -> bool:
    """Run a job, or say what it would do; whether it was run."""
    if settings.dry_run:
        print_table(("what", "plan"), job.plan().items())
        return False
    _watch(job.run(), output)
    return True


def _devices(settings: Any, output: Output) -> None:
    from rift_cl.jobs.devices import device_facts

    for name, facts in device_facts():
        print(name)
        for what, value in facts.items():
            print(f"     {what:<10} {value}")


def _demo(settings: Any, output: Output) -> None:
    from rift_cl.jobs.demo import COLUMNS, SCORING, DemoJob
    from rift_cl.jobs.fit_report import COLUMNS as FIT_COLUMNS
    from rift_cl.jobs.fit_report import SCORING as FIT_SCORING
    from rift_cl.jobs.fit_report import score_rows

    job = DemoJob(settings)
    _watch(job.run(), output)
    print_table(COLUMNS, job.rows, caption=SCORING)
    if job.fit is not None:
        print_table(FIT_COLUMNS, score_rows(job.fit.metrics), caption=FIT_SCORING)
    print(f"pictures and report.html are in {settings.out}")


def _reconstruct(settings: Any, output: Output) -> None:
    from rift_cl.jobs.reconstruct import Reconstruction

    job = Reconstruction(settings)
    if not output.quiet:
        job.announce = print_line
    if not _ran(job, settings, output):
        return
    print_table(("figure", "value"), job.metrics.items())
    print(job.result)


def _center(settings: Any, output: Output) -> None:
    from rift_cl.jobs.center import CenterJob

    job = CenterJob(settings)
    _watch(job.run(), output)
    print(f"{job.metrics['center']:.2f}")
    print(f"contact sheet and report.html are in {settings.out}", file=sys.stderr)


def _fit(settings: Any, output: Output) -> None:
    from rift_cl.jobs import fit_report, xray_scores
    from rift_cl.jobs.fit import Fit
    from rift_cl.jobs.xray_fit import XrayFit

    xray = settings.mode == "xray"
    job, table = (XrayFit(settings), xray_scores) if xray else (Fit(settings), fit_report)
    job.announce = print_line
    with gentle_interrupt(job.stop):
        ran = _ran(job, settings, output)
    if not ran:
        return
    print_table(table.COLUMNS, table.score_rows(job.metrics), caption=table.SCORING)
    print(f"scene.ply{', slices' if xray else ''} and report.html are in {settings.out}")


def _eval(settings: Any, output: Output) -> None:
    from rift_cl.jobs.evaluate import Evaluation
    from rift_cl.jobs.evaluate_report import score_table
    from rift_cl.jobs.fit_report import SCORING

    job = Evaluation(settings)
    if not _ran(job, settings, output):
        return
    print_table(*score_table(job.metrics), caption=SCORING)
    print(f"report.html and metrics.json are in {settings.out}")


def _render(settings: Any, output: Output) -> None:
    from rift_cl.jobs.render import Render

    job = Render(settings)
    if not _ran(job, settings, output):
        return
    print(f"frames, animation.png and report.html are in {settings.out}")


def _view(settings: Any, output: Output) -> None:
    from rift_cl.jobs.view import ViewJob

    # Ctrl-C is the usual way to end it, and nothing is lost by it.
    with ViewJob(settings) as job, suppress(KeyboardInterrupt):
        print(f"{job.url} shows {settings.scene}; Ctrl-C ends it", flush=True)
        _watch(job.run(), Output(quiet=True))


def _cache(settings: Any, output: Output) -> None:
    from rift_cl.jobs.cache import run_cache

    print(run_cache(settings))


if __name__ == "__main__":
    sys.exit(main())
