"""A fit that can be watched in a browser while it runs."""

from __future__ import annotations

from collections.abc import Callable, Iterator

from rift_cl.commands.fit_photos.pictures import CapturePictures
from rift_cl.commands.inputs.scene_bounds import bounds_of_cameras
from rift_cl.commands.view.photographs import photographs_in_work
from rift_cl.commands.view.viewer import SplatViewer
from rift_cl.commands.view.wish import kinds_of
from rift_cl.progress import Report
from rift_cl.train.trainer import Trainer


def watched(
    trainer: Trainer,
    pictures: CapturePictures,
    stopped: Callable[[], bool],
    *,
    title: str,
    announce: Callable[[str], None],
) -> Iterator[Report]:
    """The reports of ``trainer.run(stopped)``, with a page that is drawn between its steps.

    Drawing changes no bit of the fit: the trainer's own thread does it between two steps. Whatever
    goes wrong with the page is said once, and the fit goes on.
    """
    window = _Window(trainer, announce)
    window.heed(lambda: window.open(pictures, title))

    def looked_at() -> bool:
        window.heed(window.draw)
        return stopped()

    try:
        for report in trainer.run(looked_at):
            window.tell(report)
            yield report
    finally:
        window.heed(window.close)


class _Window:
    """The page of a fit, if it could be opened."""

    def __init__(self, trainer: Trainer, announce: Callable[[str], None]) -> None:
        self._trainer, self._announce = trainer, announce
        self._viewer: SplatViewer | None = None
        self._failed = False

    def heed(self, work: Callable[[], None]) -> None:
        """Do something with the page; that it fails is said the first time."""
        try:
            work()
        except Exception as error:
            if not self._failed:
                words = f"{type(error).__name__}: {error}".splitlines()[0]
                self._announce(f"rift: warning: the fit cannot be shown ({words}), but goes on")
            self._failed = True

    def open(self, pictures: CapturePictures, title: str) -> None:
        # Projections of X-rays are no photographs to lay over a picture.
        photographed = isinstance(pictures, CapturePictures)
        photographs = photographs_in_work(pictures) if photographed else ()
        self._viewer = SplatViewer(
            bounds_of_cameras(pictures.cameras),
            photographs=photographs,
            port=0,
            background=pictures.behind,
            light=pictures.light,
            title=title,
            kinds=kinds_of(self._trainer.renderer.settings),
        )
        self._announce(f"{self._viewer.url} shows the fit")

    def tell(self, report: Report) -> None:
        """Say how far the fit is."""
        if self._viewer is not None:
            loss = report.values.get("loss")
            words = "" if loss is None else f", loss {loss:.4g}"
            self._viewer.state = f"step {report.done} of {report.total}{words}"

    def draw(self) -> None:
        """Draw what the page asks for; the splats are another step further."""
        if self._viewer is not None:
            self._viewer.serve(self._trainer.parameters.drawn, self._trainer.renderer, changed=True)

    def close(self) -> None:
        if self._viewer is not None:
            self._viewer.close()
