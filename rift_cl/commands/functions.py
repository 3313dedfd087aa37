"""The commands as functions: ``rift.fit``, ``rift.render``, ``rift.plan_views`` and so on.

Each takes what its command takes, by the same names with underscores, checked by the same parser;
runs the same job; and gives back a record of what came out. ``config="run/config.json"`` repeats an
earlier run, whose settings other arguments override. Without ``out`` the files go to a temporary
folder, which is removed with the record that is given back.

Nothing is printed: ``progress`` is called with each ``Report``, and ``progress=True`` shows the
commands' bar, in a notebook below the cell. A run is broken off where ``progress`` returns False.
Then, and where an interrupt breaks off what a command keeps at Ctrl-C, ``StoppedError`` says what
is kept in ``out`` and how to go on; a fit keeps a checkpoint of the step that it was at. An error
that ``progress`` raises ends a run at once. Errors and notes name options as keywords; files, as
commands have them.
"""

from __future__ import annotations

import os
import shutil
import tempfile
import weakref
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, nullcontext
from dataclasses import replace
from pathlib import Path
from typing import Any, Literal, TypeVar, get_args

import numpy as np

from rift_cl.commands.interrupts import gentle_interrupt, plain_interrupt
from rift_cl.commands.progress_bar import show_progress
from rift_cl.commands.python_words import in_python, python_words
from rift_cl.commands.results import (
    AnalyzedViews,
    FittedScene,
    PlannedViews,
    ReconstructedScan,
    RenderedScene,
    Result,
    ScenePage,
    Scored,
)
from rift_cl.commands.run_folder.run_folder import released
from rift_cl.commands.run_folder.saved_settings import (
    begun_settings,
    differing,
    parsed_settings,
    saved_settings,
)
from rift_cl.errors import InputError, StoppedError, WrongTypeError
from rift_cl.io.scans.literals import Kind
from rift_cl.progress import Report

PathLike = str | os.PathLike[str]
Progress = Callable[[Report], object] | bool | None
S = TypeVar("S")
# Options that have a meaning on a command line alone.
_COMMAND_LINE = ("dry_run", "preview")
# Commands that go on from what they kept, and can give back what an earlier run began.
_RESUMED = ("reconstruct", "fit photos", "fit xray")


def reconstruct_scan(
    scan: PathLike, out: PathLike | None = None, *, progress: Progress = None, **settings: Any
) -> ReconstructedScan:
    """Reconstruct a scan, slice by slice, as ``rift reconstruct`` does.

    With ``resume`` a run that is finished is given back as it is.

    Args:
        scan: the scan's file or folder; see ``open_scan``.
        out: folder for the slices, preview.png, report.html, config.json and metrics.json; a
            temporary one when not given.
        progress: is called with a report after every slab or step; breaks off by returning False.
        **settings: the command's options by their names in Python, such as ``center=295.9`` or
            ``method="tv"``; see ``ReconstructSettings``.

    Raises:
        StoppedError: it was broken off by ``progress`` or by an interrupt.
        RiftError: a setting, the scan, the device or the folder cannot be used.
    """
    from rift_cl.commands.reconstruct.choice import reconstruction_of
    from rift_cl.commands.reconstruct.settings import ReconstructSettings
    from rift_cl.commands.reconstruct.volume import volume_path

    if not isinstance(scan, (str, os.PathLike)):
        # Runs that go on, and workers, open the scan again.
        raise InputError(
            f"scan is of the type {type(scan).__name__}, wanted the path of its file: save arrays "
            "by numpy.savez('scan.npz', projections=..., angles=..., pitch=...) and name that file"
        )
    with _folder(out, ReconstructSettings) as (folder, keep):
        given = {"scan": scan, "out": folder, **settings}
        job = reconstruction_of(_settings(given, "reconstruct", ReconstructSettings))
        path = volume_path(job.settings)
        if job.finished:
            record = _finished_run(folder, ReconstructSettings)
            return keep(ReconstructedScan(*record, path=path))
        _run(job, progress)
        record = (folder, job.decided, dict(job.metrics), tuple(job.source.notes))
        return keep(ReconstructedScan(*record, path=path))


def fit(
    capture: PathLike,
    out: PathLike | None = None,
    *,
    kind: Literal["photos", "xray"] | Kind | None = None,
    progress: Progress = None,
    **settings: Any,
) -> FittedScene:
    """Fit splats to photographs or to an X-ray scan, as ``rift fit`` does.

    Args:
        capture: a capture, a folder of photographs or a video, see ``open_capture``; or a scan,
            see ``open_scan``.
        out: folder for scene.ply, the cameras, report.html, config.json, metrics.json and
            checkpoints; a temporary one when not given.
        kind: which of the two, or what the values of a scan are (counts, transmission or
            attenuation), which says as well that it is one; an X-ray scan where ``capture`` is a
            scan file or describes one, else photographs, when not given.
        progress: is called with a report now and then; breaks off by returning False, with a
            checkpoint from which ``resume=True`` goes on.
        **settings: the command's options by their names in Python, such as ``steps=3000`` or
            ``splats=20_000``; see ``FitPhotosSettings`` and ``FitXraySettings``.

    Raises:
        StoppedError: it was broken off by ``progress`` or by an interrupt.
        RiftError: a setting, the capture, the device or the folder cannot be used.
    """
    from rift_cl.commands.fit.kind import is_scan
    from rift_cl.commands.fit_photos.job import Fit
    from rift_cl.commands.fit_photos.settings import FitPhotosSettings
    from rift_cl.commands.fit_xray.job import XrayFit
    from rift_cl.commands.fit_xray.settings import FitXraySettings

    if kind in get_args(Kind):
        settings["kind"] = kind
    elif kind not in (None, "photos", "xray"):
        raise InputError(
            f"kind is {kind!r}, wanted 'photos' or 'xray', or what the values of a scan are: "
            f"{', '.join(get_args(Kind))}"
        )
    xray = is_scan(Path(capture)) if kind is None else kind != "photos"
    with _folder(out, FitPhotosSettings, FitXraySettings) as (folder, keep):
        given = {"capture": capture, "out": folder, **settings}
        job: Fit | XrayFit
        if xray:
            job = XrayFit(_settings(given, "fit xray", FitXraySettings))
        else:
            job = Fit(_settings(given, "fit photos", FitPhotosSettings))
        notes: list[str] = []
        job.announce = lambda line: notes.append(line.removeprefix("rift: "))
        _run(job, progress)
        record = (folder, job.settled, dict(job.metrics), tuple(notes))
        return keep(FittedScene(*record, scores=job.scores, losses=tuple(job.losses)))


def evaluate(
    scene: PathLike,
    captures: PathLike | Sequence[PathLike] = (),
    out: PathLike | None = None,
    *,
    progress: Progress = None,
    **settings: Any,
) -> Scored:
    """Score a scene by photographs it was not trained on, as ``rift eval`` does.

    Args:
        scene: a fit, its folder, or a file of splats.
        captures: one or more to score it by; the photographs that the fit held out when not given.
        out: folder for report.html, config.json and metrics.json; a temporary one when not given.
        progress: is called with a report for each picture; breaks off by returning False.
        **settings: the command's options by their names in Python; see ``EvalSettings``.

    Raises:
        RiftError: a setting, the scene, a capture or the folder cannot be used.
    """
    from rift_cl.commands.evaluate.job import Evaluation
    from rift_cl.commands.evaluate.settings import EvalSettings

    several = (captures,) if isinstance(captures, (str, os.PathLike)) else tuple(captures)
    with _folder(out, EvalSettings) as (folder, keep):
        given = {"scene": scene, "captures": several, "out": folder, **settings}
        job = Evaluation(_settings(given, "eval", EvalSettings))
        _run(job, progress)
        return keep(
            Scored(folder, job.decided, dict(job.metrics), tuple(job.notes), scores=job.scores)
        )


def render(
    scene: PathLike, out: PathLike | None = None, *, progress: Progress = None, **settings: Any
) -> RenderedScene:
    """Film a scene, or draw it from the cameras of a capture, as ``rift render`` does.

    Args:
        scene: a fit, its folder, or a file of splats.
        out: folder for frames, the film, transforms.json and report.html; a temporary one when not
            given.
        progress: is called with a report for each frame; breaks off by returning False.
        **settings: the command's options by their names in Python, such as ``frames=24`` or
            ``size=(320, 240)``; see ``RenderSettings``.

    Raises:
        RiftError: a setting, the scene, the device or the folder cannot be used.
    """
    from rift_cl.commands.render.job import Render
    from rift_cl.commands.render.settings import RenderSettings

    with _folder(out, RenderSettings) as (folder, keep):
        given = {"scene": scene, "out": folder, **settings}
        job = Render(_settings(given, "render", RenderSettings))
        _run(job, progress)
        record = (folder, job.decided, dict(job.metrics), tuple(job.notes))
        return keep(
            RenderedScene(
                *record,
                cameras=tuple(job.cameras),
                frames=tuple(folder / f"frames/{n:04}.png" for n in range(len(job.cameras))),
                film=None if job.film is None else folder / job.film,
                moving=job.moving,
            )
        )


def analyze(
    source: PathLike, out: PathLike | None = None, *, progress: Progress = None, **settings: Any
) -> AnalyzedViews:
    """Say what views sampled, what they missed and what to add, as ``rift analyze`` does.

    Args:
        source: a capture, a fit, or a scan.
        out: folder for report.html, config.json, metrics.json and views.csv; a temporary one when
            not given.
        progress: is called with a report after every step; breaks off by returning False.
        **settings: the command's options by their names in Python; see ``AnalyzeSettings``.

    Raises:
        RiftError: a setting, the source, the device or the folder cannot be used.
    """
    from rift_cl.commands.analyze.job import Analysis
    from rift_cl.commands.analyze.settings import AnalyzeSettings

    with _folder(out, AnalyzeSettings) as (folder, keep):
        given = {"source": source, "out": folder, **settings}
        job = Analysis(_settings(given, "analyze", AnalyzeSettings))
        _run(job, progress)
        record = (folder, job.decided, dict(job.metrics), tuple(job.notes))
        return keep(AnalyzedViews(*record, tables=tuple(job.tables), added=tuple(job.added)))


def plan_views(
    views: int = 64, out: PathLike | None = None, *, progress: Progress = None, **settings: Any
) -> PlannedViews:
    """Plan from where to photograph a target, as ``rift plan`` does.

    ``rift.plan`` is the planner itself, which takes a ``Target`` and ``Constraints`` and writes
    nothing.

    Args:
        views: how many to plan; with ``have``, how many more.
        out: folder for transforms.json, views.csv and report.html; a temporary one when not given.
        progress: is called with a report after every step; breaks off by returning False.
        **settings: the command's options by their names in Python, such as ``diameter=60`` or
            ``elevation=(0, 70)``; see ``PlanSettings``.

    Raises:
        RiftError: a setting, a file, the device or the folder cannot be used.
    """
    from rift_cl.commands.plan.job import Planning
    from rift_cl.commands.plan.settings import PlanSettings

    with _folder(out, PlanSettings) as (folder, keep):
        job = Planning(_settings({"views": views, "out": folder, **settings}, "plan", PlanSettings))
        _run(job, progress)
        assert job.found is not None
        record = (folder, job.given.decided, dict(job.metrics), tuple(job.notes))
        return keep(PlannedViews(*record, plan=job.found))


def export(
    scene: PathLike, out: PathLike | None = None, *, progress: Progress = None, **settings: Any
) -> Path:
    """Write a scene as one file for other software, as ``rift export`` does.

    Args:
        scene: a fit, its folder, or a file of splats.
        out: the file; the scene's name in the current folder when not given.
        progress: is called with a report now and then; breaks off by returning False.
        **settings: the command's options by their names in Python, such as ``to="spz"`` or
            ``mesh=True``; see ``ExportSettings``.

    Returns:
        The file.

    Raises:
        RiftError: a setting or the scene cannot be used, or the file is there already.
    """
    from rift_cl.commands.export.export import Export
    from rift_cl.commands.export.mesh import MeshExport
    from rift_cl.commands.export.settings import ExportSettings

    with python_words(ExportSettings):
        parsed = _settings({"scene": scene, "out": out, **settings}, "export", ExportSettings)
        job = MeshExport(parsed) if parsed.mesh else Export(parsed)
        _run(job, progress)
        return job.path


def view(scene: PathLike, out: PathLike | None = None, **settings: Any) -> ScenePage:
    """The scene to turn and to walk through, in a notebook or in any browser.

    Args:
        scene: a fit, its folder, or a file of splats.
        out: the page, which needs no network; a temporary one when not given.
        **settings: those of ``export``.

    Returns:
        A record that a notebook shows as the page itself.

    Raises:
        InputError: viser, which draws it, is not installed; the sentence names the install.
        RiftError: a setting or the scene cannot be used, or the file is there already.
    """
    folder = None if out is not None else Path(tempfile.mkdtemp(prefix="rift-"))
    try:
        page = export(
            scene, out if folder is None else folder / "scene.html", to="html", **settings
        )
    except BaseException:
        if folder is not None:
            shutil.rmtree(folder, ignore_errors=True)
        raise
    made = ScenePage(page)
    if folder is not None:
        weakref.finalize(made, shutil.rmtree, folder, ignore_errors=True)
    return made


R = TypeVar("R", bound=Result)


@contextmanager
def _folder(out: PathLike | None, *settings: type) -> Iterator[tuple[Path, Callable[[R], R]]]:
    """A command's folder, and what makes a run's record one for Python.

    A temporary folder goes with the record. Its notes, and errors, name options as keywords.

    Args:
        out: the folder; a temporary one when None.
        *settings: classes of the settings that the options are from.
    """
    with python_words(*settings), _own_or_temporary(out) as (folder, keep):
        yield (
            folder,
            lambda record: keep(
                replace(record, notes=tuple(in_python(note, *settings) for note in record.notes))
            ),
        )


@contextmanager
def _own_or_temporary(out: PathLike | None) -> Iterator[tuple[Path, Callable[[R], R]]]:
    """The folder, and what ties a temporary one to the record that is given back."""
    if out is not None:
        yield Path(out), lambda record: record
        return
    folder = Path(tempfile.mkdtemp(prefix="rift-"))

    def tied(record: R) -> R:
        record.remove_with_record()
        return record

    try:
        yield folder, tied
    except StoppedError:
        shutil.rmtree(folder, ignore_errors=True)
        raise StoppedError("interrupted; nothing was kept, since no out was given") from None
    except BaseException:
        shutil.rmtree(folder, ignore_errors=True)
        raise


def _finished_run(
    folder: Path, settings: type[S]
) -> tuple[Path, S, dict[str, Any], tuple[str, ...]]:
    """What a reconstruction left in its folder, as ``ReconstructedScan`` has it.

    Raises:
        InputError: its files are damaged.
    """
    from rift_cl.io.json_fields import read_json_object

    metrics = dict(read_json_object(folder / "metrics.json").values)
    notes = (*metrics.pop("assumed", ()), f"{folder}: the reconstruction is complete already")
    decided = saved_settings(folder / "config.json", "reconstruct", settings)
    return folder, decided, metrics, notes


def _settings(given: dict[str, Any], job: str, settings: type[S]) -> S:
    """The settings of a command.

    Raises:
        InputError: there is no such setting, or a value is none that it takes.
    """
    alone = (*_COMMAND_LINE, *(() if job in _RESUMED else ("resume",)))
    for name in alone:
        if given.get(name):
            raise InputError(f"{name} is for 'rift {job}' on a command line alone: leave it out")
    plain = {name: _plain(value) for name, value in given.items()}
    config, preset = plain.pop("config", None), plain.get("preset")
    path = None if config is None else Path(config)
    earlier = begun_settings(path, preset, job, settings)
    found = parsed_settings(plain, job, settings, earlier=earlier)
    if path is None or not differing(earlier, found):
        return found
    anew = begun_settings(path, preset, job, settings, anew=True)
    return parsed_settings(plain, job, settings, earlier=anew)


def _plain(value: Any) -> Any:
    """A value as a command line could have it: records are their folders, arrays lists."""
    if isinstance(value, os.PathLike):
        return os.fspath(value)
    if isinstance(value, (np.ndarray, np.generic)):
        return value.tolist()
    return tuple(map(_plain, value)) if isinstance(value, (list, tuple)) else value


def _run(job: Any, progress: Progress) -> None:
    """Run a job to its end, or to where a caller or an interrupt breaks it off.

    Raises:
        StoppedError: it was broken off.
        WrongTypeError: the progress is nothing that a report can be given to.
    """
    stop = getattr(job, "stop", None)
    heeded = nullcontext() if stop is None else gentle_interrupt(stop, plain_interrupt())
    with released(job), heeded:
        if not (isinstance(progress, bool) or progress is None or callable(progress)):
            raise WrongTypeError(
                f"progress is {progress!r}, wanted True, or a function that takes each Report"
            )
        reports = job.run()
        if isinstance(progress, bool) or progress is None:
            show_progress(reports, quiet=not progress)
            return
        for report in reports:
            if progress(report) is False:
                _break_off(reports, stop)


def _break_off(reports: Any, stop: Callable[[], None] | None) -> None:
    """Do to a job what Ctrl-C does between two of its reports.

    Raises:
        StoppedError: it has ended by that; one with a ``stop`` ends after the step it is taking.
    """
    if stop is not None:
        stop()
        return
    try:
        reports.throw(KeyboardInterrupt)
    except KeyboardInterrupt:
        raise StoppedError("interrupted; no file is half-written") from None
