"""A fit that can be watched in a browser while it runs."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator

from rift_cl.jobs.fit_pictures import CapturePictures
from rift_cl.jobs.scene_bounds import bounds_of_cameras
from rift_cl.jobs.viewer import SplatViewer
from rift_cl.progress import Report
from rift_cl.train.trainer import Trainer


def watched(
    reports: Iterable[Report],
    trainer: Trainer,
    pictures: CapturePictures,
    *,
    title: str,
    announce: Callable[[str], None],
) -> Iterator[Report]:
    """The reports of a trainer, with a page that is drawn anew at each of them.

    Drawing changes no bit of the fit: the trainer's own thread does it between two steps.
    """
    bounds, behind = bounds_of_cameras(pictures.cameras), pictures.behind
    with SplatViewer(bounds, background=behind, light=pictures.light, title=title) as viewer:
        announce(f"{viewer.url} shows the fit")
        for report in reports:
            viewer.serve(trainer.parameters.drawn, trainer.renderer, changed=True)
            yield report
