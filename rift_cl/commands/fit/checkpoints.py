"""A fit that can be broken off at any moment and taken up again, to the same bits.

What a checkpoint says of its fit is compared with what is asked for now: to go on with other
settings would give splats that nobody could account for. The number of steps alone may grow: from
there on the fit goes by the schedules of the longer one, and its checkpoints and report say since
when.
"""

from __future__ import annotations

import time
import warnings
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from rift_cl import __version__
from rift_cl.commands.fit.inputs import FitInput
from rift_cl.errors import CheckpointError
from rift_cl.io.checkpoint import Checkpoint, newest_checkpoint, save_checkpoint
from rift_cl.train.trainer import Trainer

Losses = list[tuple[int, float]]
# Stages of a fit: the step that each ended with, and the steps of the fit whose schedules it had.
History = list[tuple[int, int]]


class CheckpointSchedule:
    """When a fit keeps a checkpoint: by steps, by the clock, and when it ends.

    When it was kept changes no bit of the fit.

    Args:
        every: steps between two; 0 keeps none at all.
        minutes: after which there is one before those steps are over; 0 goes by steps alone.
        step: that the fit begins with.
    """

    def __init__(self, every: int, minutes: float, step: int) -> None:
        self._every, self._seconds = every, 60 * minutes if minutes else float("inf")
        self._step, self._time = step, time.monotonic()

    def due(self, step: int, *, ended: bool) -> bool:
        """Whether there is to be one after a step, which is then taken for kept."""
        late = time.monotonic() >= self._time + self._seconds
        due = bool(self._every) and (ended or late or step >= self._step + self._every)
        if due:
            self._step, self._time = step, time.monotonic()
        return due


class FitCheckpoints:
    """The checkpoints of one fit.

    Args:
        folder: where they are.
        decisive: what decides the fit's result, as it was asked for; JSON. In ``decided`` is the
            same with what the fit decided by itself, or the one that goes on: on another device
            it might decide otherwise.
        device: the device's name, on which the bits depend as well.
    """

    def __init__(self, folder: Path, decisive: dict[str, Any], device: str) -> None:
        self.folder = folder
        self._facts: dict[str, Any] = {
            "settings": decisive,
            "rift_cl": __version__,
            "device": device,
        }
        self._found: Checkpoint | None = None
        self._inputs: tuple[FitInput, ...] = ()
        self.history: History = []
        self.decided: dict[str, Any] = decisive

    def find(self) -> bool:
        """Read the newest whole checkpoint, and make sure that it can be gone on with.

        Returns:
            Whether there is one.

        Raises:
            CheckpointError: it belongs to a fit with other settings or has more steps than are
                asked for, or all are damaged.
        """
        found, problems = newest_checkpoint(self.folder)
        for problem in problems:
            warnings.warn(f"{problem}: going on from the one before", stacklevel=2)
        if found is None:
            return False
        self._compare(found.facts)
        self.history = self._stages(found)
        before = found.facts["settings"]
        self.decided = found.facts.get("decided", before)
        self._facts["settings"] = {**before, "steps": self._facts["settings"]["steps"]}
        self._found = found
        return True

    def fitted(self, inputs: Sequence[FitInput]) -> None:
        """Say what the fit is fitted to, before ``restore`` or ``save``."""
        self._inputs = tuple(inputs)

    def save(self, trainer: Trainer, losses: Losses) -> None:
        """Write one.

        Raises:
            OutputError: it cannot be written; those before it are still there.
        """
        arrays = trainer.state()
        if losses:
            arrays["losses"] = np.array(losses, float)
        inputs = [each.digest for each in self._inputs]
        more = {"decided": self.decided, "history": self.history, "inputs": inputs}
        facts = {**self._facts, **more}
        save_checkpoint(self.folder, Checkpoint(trainer.parameters.step, arrays, facts))

    def restore(self, trainer: Trainer) -> Losses:
        """Bring a trainer to the checkpoint that was found; one that has not begun if none was.

        Returns:
            The losses up to there.

        Raises:
            CheckpointError: it is of a fit to other things (``fitted``).
        """
        found, self._found = self._found, None
        if found is None:
            return []
        self._compare_inputs(found.facts.get("inputs"))
        arrays = dict(found.arrays)
        losses = arrays.pop("losses", np.empty((0, 2)))
        trainer.restore(arrays)
        return [(int(step), float(loss)) for step, loss in losses]

    def _compare(self, facts: Any) -> None:
        before, now = facts.get("settings", {}), self._facts["settings"]
        # What is fitted is compared by its contents; checkpoints of old say where it was, too.
        names = (before.keys() | now.keys()) - {"steps", "capture", "geometry"}
        # A size that is left open now is that of the fit, whether it was given or decided then.
        if now.get("downscale") is None:
            names -= {"downscale"}
        # What was decided then may be said now.
        decided = facts.get("decided", {})
        differing = sorted(
            k for k in names if now.get(k) not in (before.get(k), decided.get(k, before.get(k)))
        )
        if differing:
            name = differing[0]
            raise CheckpointError(
                f"{self.folder}: the fit to resume had {name} {before.get(name)!r}, now it is "
                f"{now.get(name)!r}: give the same settings, or begin anew with --overwrite"
            )
        for name in ("device", "rift_cl"):
            if facts.get(name) != self._facts[name]:
                warnings.warn(
                    f"the fit began with {name} {facts.get(name)!r} and goes on with "
                    f"{self._facts[name]!r}: the last bits may differ",
                    stacklevel=3,
                )

    def _compare_inputs(self, before: Any) -> None:
        """Make sure that what is fitted is what was fitted up to the checkpoint."""
        now = [each.digest for each in self._inputs]
        if before is None or before == now:
            return
        changed = "what is fitted"
        if isinstance(before, list) and len(before) == len(now):
            changed = next(
                each.name
                for each, was in zip(self._inputs, before, strict=True)
                if each.digest != was
            )
        raise CheckpointError(
            f"{self.folder}: {changed} was changed since the fit to resume began: put back what "
            "was there, name another --out, or begin anew with --overwrite"
        )

    def _stages(self, found: Checkpoint) -> History:
        """The stages before the one that begins or goes on now."""
        steps, asked = found.facts["settings"].get("steps"), self._facts["settings"]["steps"]
        if found.step > asked:
            raise CheckpointError(
                f"{self.folder}: the fit to resume has {found.step} steps, --steps is {asked}: ask "
                "for more, or begin anew with --overwrite"
            )
        earlier = [(int(until), int(of)) for until, of in found.facts.get("history", [])]
        return earlier if steps == asked else [*earlier, (found.step, int(steps))]
