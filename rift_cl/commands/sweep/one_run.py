"""One run of a sweep, in this process or on a worker."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

from rift_cl.commands.fit_photos.scores import ViewScore
from rift_cl.commands.run_folder.run_folder import released
from rift_cl.errors import ClusterError, DeviceError, InputError
from rift_cl.io.output import atomic_path
from rift_cl.json_parsing import parse_json
from rift_cl.progress import Report

# A held-out view of a fit, beside the preview of a reconstruction.
PICTURE = "view.jpg"


def steps(job: str, settings: Any) -> Iterator[Report]:
    """Do a run, or go on with it where it was begun; a report after each of its steps.

    Args:
        job: the command.
        settings: its settings.

    Raises:
        RiftError: it cannot be done.
    """
    # Seen here and now: a worker that was lost may have begun it.
    settings = replace(settings, resume=settings.out.exists())
    made = _of_command(job, settings)
    with released(made):
        yield from made.run()
    # Fits alone have scores.
    for scores in getattr(made, "scores", {}).values():
        _leave_picture(settings.out / PICTURE, scores)
        return


def run(job: str, settings: Any) -> str:
    """The same without reports; called on a worker.

    Returns:
        Why the input or its settings do not allow it; empty where it is done.

    Raises:
        RiftError: it cannot be done here, whatever the settings.
    """
    try:
        for _ in steps(job, settings):
            pass
    except (ClusterError, DeviceError):
        raise
    except InputError as error:
        return str(error)
    return ""


def is_done(folder: Path) -> bool:
    """Whether the run in a folder came to its end."""
    try:
        record = parse_json((folder / "config.json").read_text(encoding="utf-8"))
        return bool(record["complete"])
    except (OSError, ValueError, LookupError, TypeError):
        return False


def _of_command(job: str, settings: Any) -> Any:
    """What does a command's work, ready to run."""
    if job == "reconstruct":
        from rift_cl.commands.reconstruct.choice import reconstruction_of

        return reconstruction_of(settings)
    if job == "plan":
        from rift_cl.commands.plan.job import Planning

        return Planning(settings)
    if job == "fit xray":
        from rift_cl.commands.fit_xray.job import XrayFit

        return XrayFit(settings)
    from rift_cl.commands.fit_photos.job import Fit

    return Fit(settings)


def _leave_picture(path: Path, scores: list[ViewScore]) -> None:
    """Leave the first picture that was scored, as it was drawn."""
    from rift_cl.report.plot import jpeg

    if scores:
        image = scores[0].image
        window = (0.0, 1.0) if image.ndim == 3 else (float(image.min()), float(image.max()) or 1.0)
        with atomic_path(path) as part:
            part.write_bytes(jpeg(image, window=window))
