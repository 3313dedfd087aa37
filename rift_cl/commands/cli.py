"""The command ``rift``: which commands there are, and what each of them prints.

Every command is a settings dataclass and a job; this file only brings the two together and prints
what the job found to stdout. How a command is run stands in ``runner``.
"""

from __future__ import annotations

import sys
from collections.abc import Callable, Sequence
from contextlib import suppress
from importlib import import_module
from typing import Any

import tyro

from rift_cl import __version__
from rift_cl.commands.console_table import print_table
from rift_cl.commands.interruption import gentle_interrupt
from rift_cl.commands.progress_bar import print_line
from rift_cl.commands.runner import Output, command, exit_status, ran, told, watch


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command line and return its exit status."""
    arguments = sys.argv[1:] if arguments is None else list(arguments)
    return exit_status(lambda: told(lambda: _run(arguments)))


def _run(arguments: Sequence[str]) -> int:
    if list(arguments) == ["--version"]:
        print(f"rift {__version__}")
        return 0
    config = (tyro.conf.OmitArgPrefixes,)
    if arguments and arguments[0] in _COMMANDS:
        name, *rest = arguments
        chosen: Callable[[], int] = tyro.cli(
            _command(name, _earlier(name, rest)), prog=f"rift {name}", args=rest, config=config
        )
        return chosen()
    chosen = tyro.extras.subcommand_cli_from_dict(
        {name: _command(name) for name in _COMMANDS},
        prog="rift",
        description="Tomography and splatting on any OpenCL device.",
        args=arguments,
        config=config,
    )
    return chosen()


def _command(name: str, earlier: Any = None) -> Callable[..., Callable[[], int]]:
    """A command for tyro; of all the commands' modules, only its own is imported."""
    run, home, settings = _COMMANDS[name]
    return command(run, getattr(import_module(f"rift_cl.commands.{home}"), settings), earlier)


def _earlier(name: str, arguments: Sequence[str]) -> Any:
    """The settings of the run that ``--config`` names, which options change; else None."""
    if name not in ("fit", "reconstruct"):
        return None
    from rift_cl.commands.run_folder.saved_settings import named_config, saved_settings

    path, (_, home, settings) = named_config(arguments), _COMMANDS[name]
    found = getattr(import_module(f"rift_cl.commands.{home}"), settings)
    return None if path is None else saved_settings(path, name, found)


def _devices(settings: Any, output: Output) -> None:
    from rift_cl.commands.devices import device_facts

    for name, facts in device_facts():
        print(name)
        for what, value in facts.items():
            print(f"     {what:<10} {value}")


def _demo(settings: Any, output: Output) -> None:
    from rift_cl.commands.demo import COLUMNS, SCORING, DemoJob
    from rift_cl.commands.fit_photos.report import COLUMNS as FIT_COLUMNS
    from rift_cl.commands.fit_photos.report import SCORING as FIT_SCORING
    from rift_cl.commands.fit_photos.report import score_rows

    job = DemoJob(settings)
    watch(job.run(), output)
    print_table(COLUMNS, job.rows, caption=SCORING)
    for name, fit in job.fits.items():
        print_table(FIT_COLUMNS, score_rows(fit.metrics), caption=f"{name}: {FIT_SCORING}")
    print(f"pictures and report.html are in {settings.out}")


def _reconstruct(settings: Any, output: Output) -> None:
    from rift_cl.commands.reconstruct.job import Reconstruction

    job = Reconstruction(settings)
    if not output.quiet:
        job.announce = print_line
    if not ran(job, settings, output):
        return
    if job.metrics:
        print_table(("figure", "value"), job.metrics.items())
    print(job.result)


def _center(settings: Any, output: Output) -> None:
    from rift_cl.commands.center.job import CenterJob

    job = CenterJob(settings)
    if not output.quiet:
        for note in job.scan.notes:
            print_line(note)
    watch(job.run(), output)
    print(f"{job.metrics['center']:.2f}")
    print(f"contact sheet and report.html are in {settings.out}", file=sys.stderr)


def _fit(settings: Any, output: Output) -> None:
    from rift_cl.commands.fit_photos import report as fit_report
    from rift_cl.commands.fit_photos.job import Fit
    from rift_cl.commands.fit_xray import scores as xray_scores
    from rift_cl.commands.fit_xray.job import XrayFit

    xray = settings.mode == "xray"
    job, table = (XrayFit(settings), xray_scores) if xray else (Fit(settings), fit_report)
    job.announce = print_line
    with gentle_interrupt(job.stop):
        done = ran(job, settings, output)
    if not done:
        return
    print_table(table.COLUMNS, table.score_rows(job.metrics), caption=table.SCORING)
    print(f"scene.ply{', slices' if xray else ''} and report.html are in {settings.out}")


def _eval(settings: Any, output: Output) -> None:
    from rift_cl.commands.evaluate.job import Evaluation
    from rift_cl.commands.evaluate.report import score_table
    from rift_cl.commands.fit_photos.report import SCORING

    job = Evaluation(settings)
    if not ran(job, settings, output):
        return
    print_table(*score_table(job.metrics), caption=SCORING)
    print(f"report.html and metrics.json are in {settings.out}")


def _render(settings: Any, output: Output) -> None:
    from rift_cl.commands.render.job import Render

    job = Render(settings)
    _say_assumed(job.notes)
    if not ran(job, settings, output):
        return
    shown = ", ".join(filter(None, ["frames", job.film]))
    print(f"{shown} and report.html are in {settings.out}")


def _view(settings: Any, output: Output) -> None:
    from rift_cl.commands.view.job import ViewJob

    # Ctrl-C is the usual way to end it, and nothing is lost by it.
    with ViewJob(settings) as job, suppress(KeyboardInterrupt):
        _say_assumed(job.notes)
        print(f"{job.url} shows {settings.scene}; Ctrl-C ends it", flush=True)
        watch(job.run(), Output(quiet=True))


def _export(settings: Any, output: Output) -> None:
    from rift_cl.commands.export.export import Export
    from rift_cl.commands.export.mesh import MeshExport

    job = MeshExport(settings) if settings.mesh else Export(settings)
    if not output.quiet:
        job.announce = lambda note: print_line(f"rift: {note}")
    if ran(job, settings, output):
        print(job.result)


def _analyze(settings: Any, output: Output) -> None:
    from rift_cl.commands.analyze.job import Analysis

    job = Analysis(settings)
    _say_assumed(job.notes)
    if not ran(job, settings, output):
        return
    for columns, rows, caption in job.tables:
        print_table(columns, rows, caption=caption)
    print(f"report.html and metrics.json are in {settings.out}")


def _plan(settings: Any, output: Output) -> None:
    from rift_cl.commands.plan.job import Planning
    from rift_cl.commands.plan.report import caption_of, worth_table

    job = Planning(settings)
    _say_assumed(job.notes)
    if not ran(job, settings, output):
        return
    print_table(*worth_table(job.metrics), caption=caption_of(job.metrics))
    print(job.verdict)
    print(f"transforms.json, views.csv and report.html are in {settings.out}")


def _say_assumed(notes: Sequence[str]) -> None:
    for note in notes:
        print_line(f"rift: {note}")


def _cache(settings: Any, output: Output) -> None:
    from rift_cl.commands.cache import run_cache

    print(run_cache(settings))


# What runs each command, and where its settings are.
_COMMANDS: dict[str, tuple[Callable[[Any, Output], None], str, str]] = {
    "devices": (_devices, "devices", "DevicesSettings"),
    "demo": (_demo, "demo", "DemoSettings"),
    "reconstruct": (_reconstruct, "reconstruct.settings", "ReconstructSettings"),
    "center": (_center, "center.job", "CenterSettings"),
    "fit": (_fit, "fit_photos.settings", "FitSettings"),
    "eval": (_eval, "evaluate.job", "EvalSettings"),
    "render": (_render, "render.settings", "RenderSettings"),
    "view": (_view, "view.job", "ViewSettings"),
    "export": (_export, "export.settings", "ExportSettings"),
    "analyze": (_analyze, "analyze.settings", "AnalyzeSettings"),
    "plan": (_plan, "plan.settings", "PlanSettings"),
    "cache": (_cache, "cache", "CacheSettings"),
}


if __name__ == "__main__":
    sys.exit(main())
