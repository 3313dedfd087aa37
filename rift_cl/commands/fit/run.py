"""What all fits share: training, checkpoints, stopping between steps, and resuming.

``Fit`` (photographs) and ``XrayFit`` (projections) add what they read, how they score, and what
they leave behind.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Iterator
from typing import Any, Generic, TypeVar

from rift_cl.cl.discovery import open_device
from rift_cl.commands.fit.checkpoints import CheckpointSchedule, FitCheckpoints
from rift_cl.commands.fit.inputs import FitInput
from rift_cl.commands.fit.settings import FitSettings
from rift_cl.commands.fit_photos.scores import ViewScore
from rift_cl.commands.run_folder.run_folder import RunFolder
from rift_cl.errors import CheckpointError, RiftError, StoppedError
from rift_cl.progress import Report
from rift_cl.train.trainer import REPORT_EVERY, Trainer

S = TypeVar("S", bound=FitSettings)


class FitRun(ABC, Generic[S]):
    """A fit that is planned; nothing is written yet.

    Args:
        settings: what to do.

    Raises:
        RiftError: a setting makes no sense, the folder is in use, or the fit in it cannot go on.
    """

    def __init__(self, settings: S) -> None:
        settings.check()
        self.settings = settings
        # With a value for all that was left open, once it is decided.
        self.settled = settings
        self.folder = RunFolder(
            settings.out,
            settings.job,
            overwrite=settings.overwrite,
            resume=settings.resume,
            settings=settings,
        )
        self.device = open_device(settings.device, settings.budget())
        self.checkpoints = FitCheckpoints(
            settings.out / "checkpoints", settings.decisive(), self.device.name
        )
        self._goes_on = settings.resume and self.checkpoints.find()
        if settings.resume and not self._goes_on:
            self._demand_a_beginning()
        self.losses: list[tuple[int, float]] = []
        self.scores: dict[str, list[ViewScore]] = {}
        self.metrics: dict[str, Any] = {}
        # What config.json holds besides the settings, from when the training begins.
        self.decided: dict[str, Any] = {}
        self.announce: Callable[[str], None] = lambda line: None
        self._stopping = False

    def run(self) -> Iterator[Report]:
        """Do it; a report now and then.

        A fit that is refused before it leaves anything leaves no folder either, so that the next
        try is no second one.

        Raises:
            StoppedError: ``stop`` was called; a checkpoint was kept.
        """
        try:
            yield from self._work()
        except StoppedError:
            raise
        except RiftError:
            self.folder.discard()
            raise

    @abstractmethod
    def _work(self) -> Iterator[Report]:
        """What a kind of fit does, from reading what is fitted to its report."""

    def stop(self) -> None:
        """Break off after the step that is being taken; ``run`` then keeps a checkpoint."""
        self._stopping = True

    @abstractmethod
    def _inputs(self) -> list[FitInput]:
        """What is fitted, by its contents."""

    def _begin(self, trainer: Trainer) -> None:
        """Bring the trainer to where the fit goes on, or make the folder that of a new one."""
        if self.settings.checkpoint_every or self.settings.resume:
            self.checkpoints.fitted(self._inputs())
        self.checkpoints.decided = self.settled.decisive()
        if self.settings.resume:
            if not self._goes_on:
                self.announce(
                    f"rift: {self.settings.out}: no checkpoint to go on from: from step 0"
                )
            self.losses = self.checkpoints.restore(trainer)
        else:
            self.folder.mark(**self.decided)
            self.folder.drop("checkpoints", "environment.exr")

    def _trained(self, trainer: Trainer, pictures: Any) -> Iterator[Report]:
        """Train, with a checkpoint now and then, at the end, and when broken off."""
        every, minutes = self.settings.checkpoint_every, self.settings.checkpoint_minutes
        schedule = CheckpointSchedule(every, minutes, trainer.parameters.step)
        for report in self._reports(trainer, pictures):
            if report.done % REPORT_EVERY == 0 or report.done == report.total:
                self.losses.append((report.done, report.values["loss"]))
            ended = self._stopping or report.done == report.total
            kept = schedule.due(report.done, ended=ended)
            if kept:
                self.checkpoints.save(trainer, self.losses)
            yield report
            # Whoever was told of this step may have asked for the end by then.
            if self._stopping and not kept and schedule.due(report.done, ended=True):
                self.checkpoints.save(trainer, self.losses)
            self._heed(report.done)

    def _demand_a_beginning(self) -> None:
        """Refuse to replace a finished fit that kept no checkpoint by one that begins anew."""
        if self.folder.is_complete and not self.folder.finished:
            raise CheckpointError(
                f"{self.settings.out}: this fit is finished and kept no checkpoint, so that it "
                "cannot be trained on: begin anew with --overwrite"
            )

    @property
    def steps(self) -> int:
        """Steps that the fit will have in the end."""
        return self.settings.training.steps

    @property
    def _history(self) -> list[tuple[int, int]]:
        """The stages of the fit; see ``fit_checkpoints.History``."""
        return [*self.checkpoints.history, (self.steps, self.steps)]

    def _reports(self, trainer: Trainer, pictures: Any) -> Iterator[Report]:
        """The trainer's reports, in a browser as well if that was asked for."""
        if not self.settings.view:
            return trainer.run(lambda: self._stopping)
        from rift_cl.commands.view.watched import watched

        title = self.settings.capture.name
        asked = (trainer, pictures, lambda: self._stopping)
        return watched(*asked, title=title, announce=self.announce)

    def _heed(self, step: int) -> None:
        """Break off if that was asked for."""
        if not self._stopping:
            return
        where = f"interrupted after step {step} of {self.steps}"
        if not self.settings.checkpoint_every:
            raise StoppedError(f"{where}; nothing was kept, since --checkpoint-every is 0")
        raise StoppedError(f"{where}; to go on: {self.settings.command()}")
