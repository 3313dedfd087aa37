"""The command ``rift``: the table of its commands, and what each of them prints.

Every command has a folder with ``settings`` (a dataclass: its options) and ``job``. A command
imports its own settings to parse or to help, and its job only to run; ``rift --help`` imports none.
"""

from __future__ import annotations

import os
import shlex
import shutil
import sys
import textwrap
from collections.abc import Callable, Mapping, Sequence
from contextlib import redirect_stderr
from dataclasses import fields
from importlib import import_module
from itertools import takewhile
from pathlib import Path
from typing import Any, NamedTuple

import tyro

from rift_cl import __version__
from rift_cl.commands.console_table import print_table
from rift_cl.commands.interrupts import gentle_interrupt
from rift_cl.commands.options import gathered
from rift_cl.commands.progress_bar import print_any_text, print_line
from rift_cl.commands.runner import (
    Output,
    Terminated,
    command,
    exit_status,
    ran,
    run_job,
    told,
    watch,
)
from rift_cl.errors import InputError
from rift_cl.own_parts import load_parts

_USAGE = 2
_LOAD = "--load"
# Figures of a run that a line of a terminal has room for.
_FIGURES = 4


class Command(NamedTuple):
    """One command of ``rift``.

    Args:
        run: carries it out and prints what came out.
        module: of its settings, within ``rift_cl.commands``.
        settings: the name of their class.
        summary: one sentence for ``rift --help``; the first one of the class's docstring.
    """

    run: Callable[[Any, Output], None]
    module: str
    settings: str
    summary: str

    def settings_class(self) -> type:
        """The class of the settings; its module is imported now."""
        found = getattr(import_module(f"rift_cl.commands.{self.module}"), self.settings)
        assert isinstance(found, type)
        return found


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command line and return its exit status."""
    arguments = sys.argv[1:] if arguments is None else list(arguments)
    print_any_text()
    return exit_status(lambda: told(lambda: _run(arguments)))


def _run(arguments: Sequence[str]) -> int:
    files, arguments = _own_files(list(arguments))
    load_parts(files)
    first = arguments[0] if arguments else ""
    if first == "--version":
        print(f"rift {__version__}")
        return 0
    if first in ("-h", "--help", "-H", "--help-verbose"):
        print(_overview())
        return 0
    name, rest = _with_capture(*_named(list(arguments)))
    if name in COMMANDS:
        rest = gathered(rest, COMMANDS[name].settings_class())
        entry = _command(name, _earlier(name, rest), rest)
        return _parsed(name, entry, rest)()
    if first == "fit":
        print(_FIT_HELP)
        return 0 if rest else _USAGE
    if first.startswith("--tyro-"):
        # Shell completion needs the options of every command.
        tyro.extras.subcommand_cli_from_dict(
            {name: _command(name) for name in COMMANDS}, prog="rift", args=arguments
        )
    what = f"there is no command {first!r}" if first else "a command is missing"
    print_line(f"rift: {what}; 'rift --help' lists the commands")
    return _USAGE


def _own_files(arguments: list[str]) -> tuple[list[str], list[str]]:
    """The files that are to be run before the command, and the command's words."""
    files = []
    while arguments and arguments[0].partition("=")[0] == _LOAD:
        word = arguments.pop(0)
        if "=" not in word and not arguments:
            raise InputError(f"{_LOAD} is followed by nothing, wanted a Python file")
        files.append(word.partition("=")[2] if "=" in word else arguments.pop(0))
    return files, arguments


def _parsed(
    name: str, entry: Callable[..., Callable[[], int]], rest: Sequence[str]
) -> Callable[[], int]:
    """What a command's arguments ask for; tyro says what is wrong with them and ends the process.

    Below what tyro says of a word too many stands what its writer probably meant by it.
    """
    try:
        run: Callable[[], int] = tyro.cli(entry, prog=f"rift {name}", args=rest)
    except SystemExit as end:
        words = _unknown_words(entry, rest) if end.code == _USAGE else None
        has_out = any(field.name == "out" for field in fields(COMMANDS[name].settings_class()))
        if has_out and words and len(words) == 1 and "--out" not in rest:
            print_line(
                f"rift: {words[0]!r} is one path too many; if 'rift {name}' is to write there, it "
                f"is --out {shlex.quote(words[0])}"
            )
        raise
    return run


def _unknown_words(
    entry: Callable[..., Callable[[], int]], rest: Sequence[str]
) -> list[str] | None:
    """Words of a command line that belong to nothing, up to the first unknown option.

    None where something else is wrong with it, too.
    """
    try:
        with open(os.devnull, "w") as nowhere, redirect_stderr(nowhere):  # noqa: PTH123
            _, unknown = tyro.cli(entry, args=rest, return_unknown_args=True)
    except SystemExit:
        return None
    return list(takewhile(lambda word: not word.startswith("-"), unknown))


def _named(arguments: list[str]) -> tuple[str, list[str]]:
    """The command that is meant, and its arguments; ``fit`` alone goes by what it is given."""
    for words in (2, 1):
        name = " ".join(arguments[:words])
        if name in COMMANDS:
            return name, arguments[words:]
    rest = arguments[1:]
    if arguments[:1] == ["fit"] and rest and not {"-h", "--help"} & set(rest):
        from rift_cl.commands.fit.kind import kind_of_fit

        return f"fit {kind_of_fit(rest)}", rest
    return "", rest


def _with_capture(name: str, rest: list[str]) -> tuple[str, list[str]]:
    """A fit and its arguments, also where the name of its capture was taken for the command's.

    ``rift fit photos --out fit`` means the folder ``photos`` where there is one: as a command, it
    would want a capture, and has none.
    """
    folder = name.removeprefix("fit ")
    if folder == name or {"-h", "--help"} & set(rest) or not Path(folder).exists():
        return name, rest
    given = [f"./{folder}", *rest]
    if _parses(name, rest) or not _parses(name, given):
        return name, rest
    return _named(["fit", *given])


def _parses(name: str, rest: Sequence[str]) -> bool:
    return _unknown_words(_command(name, _earlier(name, rest), rest), rest) is not None


def _overview() -> str:
    """The help of ``rift`` itself, which imports no command."""
    width = max(map(len, COMMANDS))
    lines = [f"  {name:<{width}}  {entry.summary}" for name, entry in COMMANDS.items()]
    return "\n".join(
        [
            f"usage: rift [{_LOAD} FILE.py] COMMAND [OPTIONS]",
            "",
            "Tomography and splatting on any OpenCL device.",
            "",
            "commands:",
            *lines,
            "",
            f"{_LOAD} FILE.py runs a file of yours first, which registers filters, losses, angular "
            "bases,\nstrategies or readers; it may be repeated; RIFT_LOAD names such files, too.",
            "",
            "'rift COMMAND --help' lists the options of a command, 'rift --version' tells the "
            "version.",
        ]
    )


def _command(
    name: str, earlier: Any = None, arguments: Sequence[str] = ()
) -> Callable[..., Callable[[], int]]:
    """A command for tyro; of all the commands' modules, only its own settings are imported."""
    run, settings = COMMANDS[name].run, COMMANDS[name].settings_class()
    first = earlier
    if name.startswith("fit "):
        from rift_cl.commands.run_folder.saved_settings import chosen

        first = chosen(settings, earlier, arguments)
    # Without an earlier run only one form of a switch is of use: that which its default is not.
    return command(run, settings, first, twins=earlier is not None)


def _earlier(name: str, arguments: Sequence[str]) -> Any:
    """The settings that options override, of a run (``--config``) or a preset; None if neither."""
    if not any(argument.startswith(("--config", "--preset")) for argument in arguments):
        return None
    from rift_cl.commands.run_folder.saved_settings import (
        begun_settings,
        changes_a_run,
        named_config,
        named_preset,
    )

    given = named_config(arguments), named_preset(arguments)
    anew = changes_a_run(arguments)
    return begun_settings(*given, name, COMMANDS[name].settings_class(), anew=anew)


def _devices(settings: Any, output: Output) -> None:
    from rift_cl.commands.devices.job import device_facts, examine_drivers

    watch(examine_drivers(again=settings.retest), output)
    for name, facts in device_facts():
        _print_facts(name, facts)


def _print_facts(name: str, facts: Mapping[str, str]) -> None:
    """A name, and below it what is known of it."""
    print(name)
    for what, value in facts.items():
        lines = [part for line in value.splitlines() for part in _wrapped(line)]
        for label, line in zip([what, *[""] * len(lines)], lines, strict=False):
            print(f"     {label:<10} {line}")


def _wrapped(line: str) -> list[str]:
    """A line as lines that fit the terminal behind a column of names."""
    width = shutil.get_terminal_size().columns - 16
    # Names and addresses are not broken.
    whole = textwrap.TextWrapper(
        max(width, 40), subsequent_indent="  ", break_long_words=False, break_on_hyphens=False
    )
    return whole.wrap(line)


def _demo(settings: Any, output: Output) -> None:
    from rift_cl.commands.demo.job import COLUMNS, SCORING, DemoJob, what_to_see
    from rift_cl.commands.fit_photos.report import score_table

    job = DemoJob(settings)
    run_job(job, output)
    print_table(COLUMNS, job.rows, caption=f"{SCORING} {what_to_see(job.rows)}")
    for name, fit in job.fits.items():
        columns, rows, caption = score_table(fit.metrics)
        print_table(columns, rows, caption=f"{name}: {caption}")
    print(f"pictures and report.html are in {settings.out}")


def _reconstruct(settings: Any, output: Output) -> None:
    from rift_cl.commands.reconstruct.choice import reconstruction_of

    job = reconstruction_of(settings)
    job.announce = print_line
    if not ran(job, settings, output):
        return
    if job.metrics:
        # Imported when used: it loads pictures, which a preview or a plan may do without.
        from rift_cl.commands.reconstruct.report import figures

        print_table(("figure", "value"), figures(job).items())
    print(job.result)


def _center(settings: Any, output: Output) -> None:
    from rift_cl.commands.center.job import CenterJob

    job = CenterJob(settings)
    _print_notes(job.notes)
    if not ran(job, settings, output):
        return
    if "doubt" in job.metrics:
        _print_notes([job.metrics["doubt"]])
    if "tilt_degrees" in job.metrics:
        tilt = job.metrics["tilt_degrees"]
        _print_notes(
            [
                f"the axis leans by {tilt:.3g} degrees, which moves it in other rows: 'rift "
                f"reconstruct' turns projections by that where it finds the axis itself; beside "
                f"--center it wants --tilt {tilt:.3g}"
            ]
        )
    low, high = job.metrics["interval"]
    # Apart from the bin, which a script reads from standard output.
    print(f"95 % interval: {low:.2f} to {high:.2f}", file=sys.stderr)
    print(f"{job.metrics['center']:.2f}")
    print(f"contact sheet and report.html are in {settings.out}", file=sys.stderr)


def _fit_photos(settings: Any, output: Output) -> None:
    from rift_cl.commands.fit_photos import report
    from rift_cl.commands.fit_photos.job import Fit

    if _fitted(Fit(settings), report, output):
        print(f"scene.ply and report.html are in {settings.out}")


def _fit_xray(settings: Any, output: Output) -> None:
    from rift_cl.commands.fit_xray import scores
    from rift_cl.commands.fit_xray.job import XrayFit

    if _fitted(XrayFit(settings), scores, output):
        print(f"scene.ply, slices and report.html are in {settings.out}")


def _fitted(job: Any, table: Any, output: Output) -> bool:
    """Run a fit and print its scores; whether it was run."""
    job.announce = print_line
    with gentle_interrupt(job.stop):
        done = ran(job, job.settings, output)
    if done:
        columns, rows, caption = table.score_table(job.metrics)
        if rows:  # None where nothing was held out.
            print_table(columns, rows, caption=caption)
    return done


def _eval(settings: Any, output: Output) -> None:
    from rift_cl.commands.evaluate.job import Evaluation
    from rift_cl.commands.fit_photos.report import score_table

    job = Evaluation(settings)
    if not ran(job, settings, output):
        return
    columns, rows, caption = score_table(job.metrics)
    print_table(columns, rows, caption=caption)
    _print_notes(job.notes)
    print(f"report.html and metrics.json are in {settings.out}")


def _render(settings: Any, output: Output) -> None:
    from rift_cl.commands.render.job import Render

    job = Render(settings)
    told = job.notes
    _print_notes(told)
    if not ran(job, settings, output):
        return
    _print_notes([note for note in job.notes if note not in told])
    shown = ", ".join(filter(None, ["frames", job.film]))
    print(f"{shown} and report.html are in {settings.out}")


def _view(settings: Any, output: Output) -> None:
    from rift_cl.commands.view.job import ViewJob

    with ViewJob(settings) as job:
        _print_notes(job.notes)
        print(f"{job.url} shows {settings.scene}; Ctrl-C ends it", flush=True)
        try:
            watch(job.run(), Output(quiet=True))
        except Terminated:
            raise
        except KeyboardInterrupt:
            # Ctrl-C is the usual way to end it, and nothing is lost by it.
            return


def _export(settings: Any, output: Output) -> None:
    from rift_cl.commands.export.export import Export
    from rift_cl.commands.export.mesh import MeshExport

    job = MeshExport(settings) if settings.mesh else Export(settings)
    job.announce = lambda note: print_line(f"rift: {note}")
    if ran(job, settings, output):
        print(job.result)


def _analyze(settings: Any, output: Output) -> None:
    from rift_cl.commands.analyze.job import Analysis

    job = Analysis(settings)
    _print_notes(job.notes)
    if not ran(job, settings, output):
        return
    for columns, rows, caption in job.tables:
        print_table(columns, rows, caption=caption)
    for sentence in job.sentences:
        print(sentence)
    print(f"report.html and metrics.json are in {settings.out}")


def _plan(settings: Any, output: Output) -> None:
    from rift_cl.commands.plan.job import Planning
    from rift_cl.commands.plan.report import caption_of, worth_table

    job = Planning(settings)
    _print_notes(job.notes)
    if not ran(job, settings, output):
        return
    print_table(*worth_table(job.metrics), caption=caption_of(job.metrics))
    print(job.verdict)
    more = "" if job.vectors is None else ", vectors.txt"
    unit = f" (one unit is {job.file_unit:g} mm)" if job.file_unit != 1 else ""
    print(f"transforms.json{unit}, views.csv{more} and report.html are in {settings.out}")


def _sweep(settings: Any, output: Output) -> None:
    from rift_cl.commands.sweep.job import Sweep
    from rift_cl.commands.sweep.report import score_table

    job = Sweep(settings)
    if not output.quiet:
        job.announce = lambda note: print_line(f"rift: {note}")
    if not ran(job, settings, output):
        return
    print_table(*score_table(job.rows, most=_FIGURES))
    if job.refusal:
        print(job.refusal)
    print(f"report.html, sweep.csv and the folders of the runs are in {settings.out}")


def _print_notes(notes: Sequence[str]) -> None:
    for note in notes:
        print_line(f"rift: {note}")


def _samples(settings: Any, output: Output) -> None:
    from rift_cl.commands.samples.job import put_sample, sample_facts

    if settings.name:
        print(put_sample(settings))
        return
    for name, facts in sample_facts():
        _print_facts(name, facts)


def _cache(settings: Any, output: Output) -> None:
    from rift_cl.commands.cache.job import run_cache

    print(run_cache(settings))


_FIT_HELP = """usage: rift fit photos CAPTURE [OPTIONS]
       rift fit xray SCAN [OPTIONS]
       rift fit CAPTURE [OPTIONS]

Fit splats to photographs, or Gaussian densities to an X-ray scan.

'rift fit CAPTURE' chooses by what it is given: a scan file is fitted as X-rays, everything else as
photographs. 'rift fit photos --help' and 'rift fit xray --help' list the options."""
COMMANDS = {
    "reconstruct": Command(
        _reconstruct,
        "reconstruct.settings",
        "ReconstructSettings",
        "Reconstruct a scan of parallel, fan or cone beams.",
    ),
    "center": Command(
        _center,
        "center.settings",
        "CenterSettings",
        "Find the rotation axis of a scan.",
    ),
    "fit photos": Command(
        _fit_photos,
        "fit_photos.settings",
        "FitPhotosSettings",
        "Fit splats to photographs.",
    ),
    "fit xray": Command(
        _fit_xray,
        "fit_xray.settings",
        "FitXraySettings",
        "Fit Gaussian densities to the projections of a parallel-beam or cone-beam X-ray scan.",
    ),
    "eval": Command(
        _eval,
        "evaluate.settings",
        "EvalSettings",
        "Score a scene on held-out photographs, or on other captures of it.",
    ),
    "render": Command(
        _render,
        "render.settings",
        "RenderSettings",
        "Render a film of a scene, or the views of a capture.",
    ),
    "view": Command(
        _view,
        "view.settings",
        "ViewSettings",
        "Show a scene in a web browser on this computer, until Ctrl-C.",
    ),
    "export": Command(
        _export,
        "export.settings",
        "ExportSettings",
        "Write a scene as a web page, as splats or as a mesh for other software.",
    ),
    "analyze": Command(
        _analyze,
        "analyze.settings",
        "AnalyzeSettings",
        "Analyze how views sample a target: coverage, resolution limits, and views to add.",
    ),
    "plan": Command(
        _plan,
        "plan.settings",
        "PlanSettings",
        "Plan camera poses that minimize what remains uncertain about a target.",
    ),
    "sweep": Command(
        _sweep,
        "sweep.settings",
        "SweepSettings",
        "Run a command with many settings or inputs, and compare the results in one table.",
    ),
    "demo": Command(
        _demo,
        "demo.settings",
        "DemoSettings",
        "Reconstruct a phantom and fit splats to two small sample captures.",
    ),
    "samples": Command(
        _samples,
        "samples.settings",
        "SamplesSettings",
        "List sample captures and open data sets, or put one of them into a folder.",
    ),
    "devices": Command(
        _devices,
        "devices.settings",
        "DevicesSettings",
        "List every OpenCL device, its properties and a self-test; a star marks the default "
        "device.",
    ),
    "cache": Command(
        _cache,
        "cache.settings",
        "CacheSettings",
        "Show where compiled kernels are kept and how much disk space they take, or remove them.",
    ),
}


if __name__ == "__main__":
    sys.exit(main())
