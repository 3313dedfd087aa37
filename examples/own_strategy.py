"""A strategy of your own: splats that have become transparent are removed every few steps.

A strategy is a dataclass of settings and a class of hooks that the trainer calls. The scene is a
white ball in four images. Run it with the number of steps, or give it to ``rift --load``.
"""

import sys
from dataclasses import dataclass

import numpy as np

import rift_cl as rift
from rift_cl.train import (
    ImageViews,
    Parameters,
    Strategy,
    StrategySettings,
    Trainer,
    TrainSettings,
    register_strategy,
    start_splats,
)


@dataclass(frozen=True)
class PruneSettings(StrategySettings):
    """Remove transparent splats."""

    every: int = 20
    """Steps between two removals."""
    min_opacity: float = 0.06
    """Opacity below which splats are removed."""

    def begin(self, parameters, run):
        """The strategy of a run."""
        return Prune(self, run)


class Prune(Strategy):
    """Removes transparent splats."""

    def __init__(self, settings, run):
        super().__init__(run)
        self.settings = settings

    def after_step(self, parameters, frame, gradients, learning_rate):
        """The splats to go on with."""
        if parameters.step % self.settings.every:
            return parameters
        opacities = parameters.device.get(parameters.drawn.opacities)
        return parameters.selected(opacities >= self.settings.min_opacity)


register_strategy("prune", PruneSettings)


def main():
    """Fit with this strategy."""
    device = rift.default_device()
    cameras = []
    for turn in np.arange(4) * np.pi / 2:  # a ring of cameras around the origin, 4 away
        view = np.eye(4)
        view[0, ::2], view[2, ::2] = (np.cos(turn), np.sin(turn)), (-np.sin(turn), np.cos(turn))
        view[2, 3] = 4
        cameras.append(rift.Camera((32, 32), [[32, 0, 16], [0, 32, 16], [0, 0, 1]], view))
    disc = np.hypot(*np.mgrid[-15.5:16, -15.5:16]) < 8
    images = [np.repeat(disc[..., None], 3, axis=2)] * 4  # a white ball before black
    points = np.random.default_rng(0).uniform(-1.2, 1.2, (200, 3))
    splats = Parameters.of(device, start_splats(points))
    steps = int(sys.argv[1]) if sys.argv[1:] else 100
    settings = TrainSettings(steps=steps, strategy=PruneSettings())
    trainer = Trainer(ImageViews(device, cameras, images), splats, settings)
    for report in trainer.run():
        loss = report.values["loss"]
        print(f"step {report.done}: loss {loss:.4f}, {len(trainer.parameters)} splats")


if __name__ == "__main__":
    main()
