"""Who trains splats in the race: our trainer, and one in plain torch.

Both begin with the same splats and look at the same pictures in the same order; a turn is one pass
over all views. Both have the pictures as codes on the host, and ours sends them to its device anew
for each step, while torch, which works where they are, gets them ready made.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from importlib import import_module
from typing import Any

import numpy as np

import rift_cl as rift
from bench.case import Floats
from bench.contender import Contender
from bench.training_case import VIEWS, TrainingCase


class MissingTorchError(ImportError):
    """Torch is not installed."""


class TrainerContender(Contender):
    """A pass over all views; its result are the losses of the steps."""

    case: TrainingCase
    operations = ("pass",)

    def __init__(self, device: rift.Device, case: TrainingCase) -> None:
        super().__init__(device, case)
        self.losses: list[float] = []

    def leave(self, array: Any) -> Floats:
        """The losses of the steps, which are kept."""
        found = np.array([self.loss_of(value) for value in array], np.float32)
        self.losses += found.tolist()
        return found

    def loss_of(self, value: Any) -> float:
        """A loss as a number."""
        return float(value)

    def rates(self, seconds: float) -> dict[str, float]:
        """Steps per second."""
        return {"steps_per_s": VIEWS / seconds}

    def accuracy(self, outputs: Mapping[str, Floats], *, seed: int) -> dict[str, float | None]:
        """Mean losses of the first and of the last pass, and how many steps there were."""
        first, last = np.mean(self.losses[:VIEWS]), np.mean(self.losses[-VIEWS:])
        return {"first": float(first), "last": float(last), "steps": float(len(self.losses))}


class RiftTrainer(TrainerContender):
    """Ours."""

    name = "rift_cl"
    arrays = "device"
    ours = True

    def __init__(self, device: rift.Device, case: TrainingCase) -> None:
        super().__init__(device, case)
        self._trainer = case.trainer()

    def prepared(self, operation: str) -> Callable[[], Any]:
        """A pass, at whose end everything is waited for."""
        return self._pass

    def loss_of(self, value: Any) -> float:
        """A loss as a number."""
        return float(self.device.get(value)[0])

    def _pass(self) -> list[Any]:
        values = [self._trainer.step() for _ in range(VIEWS)]
        self.device.finish()
        return values


class TorchTiles(TrainerContender):
    """``bench.torch_trainer``, on as many threads as torch takes."""

    name = "torch trainer"
    arrays = "torch"
    threads: int | None = None

    def __init__(self, device: rift.Device, case: TrainingCase) -> None:
        super().__init__(device, case)
        try:
            self._torch = import_module("torch")
        except ImportError as error:
            raise MissingTorchError("torch is missing: pip install 'torch>=2.4,<2.14'") from error
        # Of a trainer of ours: the order of views, and the extent of the scene.
        self._ours = case.trainer()
        self._trainer = import_module("bench.torch_trainer").TorchTrainer(
            *(case.raw, case.settings),
            extent=self._ours.schedule.extent,
            size=self._ours.size,
            threads=self.threads,
        )
        pictures = case.pictures
        self._targets = [self._tensor(pictures.target(number)) for number in range(VIEWS)]
        self._behind = [self._tensor(pictures.background(number)) for number in range(VIEWS)]
        self._taken = 0

    def prepared(self, operation: str) -> Callable[[], Any]:
        """A pass."""
        return lambda: [self._step() for _ in range(VIEWS)]

    def _step(self) -> float:
        number = self._ours.view_at(self._taken)
        self._taken += 1
        camera = self.case.pictures.cameras[number]
        loss: float = self._trainer.step(camera, self._targets[number], self._behind[number])
        return loss

    def _tensor(self, array: Any) -> Any:
        return self._torch.tensor(self.device.get(array))


class TorchTilesAlone(TorchTiles):
    """The same on one thread, which is faster where others take one of the cores."""

    name = "torch trainer, one thread"
    threads = 1


TRAINERS: tuple[type[TrainerContender], ...] = (RiftTrainer, TorchTiles, TorchTilesAlone)
