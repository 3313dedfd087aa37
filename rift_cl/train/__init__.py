"""Training splats: a trainer, its settings, its losses and its strategies.

    import rift_cl as rift
    from rift_cl.train import (
        ImageViews, Parameters, Trainer, TrainSettings, random_points, start_splats
    )

    device = rift.default_device()
    views = ImageViews(device, cameras, images)
    points = random_points(cameras, 10_000, seed=0)
    splats = Parameters.of(device, start_splats(points))
    trainer = Trainer(views, splats, TrainSettings(steps=3000))
    for report in trainer.run():
        print(report.done, report.values["loss"])
    trainer.parameters.drawn    # the splats as rift.Renderer takes them

Public names are looked up when they are first used, so that settings load without the trainer.
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from rift_cl.train.basis_settings import AngularSettings, BasisSettings
    from rift_cl.train.loss.homogenisation import Homogenisation
    from rift_cl.train.loss.image_loss import ImageLoss
    from rift_cl.train.loss.pixel_loss import PIXEL_LOSSES, PixelLoss, register_loss
    from rift_cl.train.parameters import Parameters
    from rift_cl.train.per_view.images import ImageViews
    from rift_cl.train.settings import LearningRates, TrainSettings
    from rift_cl.train.start.points import random_points, start_splats
    from rift_cl.train.strategy import (
        STRATEGIES,
        DefaultSettings,
        McmcSettings,
        Penalties,
        Strategy,
        StrategySettings,
        TrainingRun,
        XraySettings,
        register_strategy,
    )
    from rift_cl.train.trainer import Trainer, TrainingViews
    from rift_cl.train.xray.settings import XrayTrainSettings
    from rift_cl.train.xray.solve_settings import SolveSettings
    from rift_cl.train.xray.trainer import XrayTrainer

_HOMES = {
    "PIXEL_LOSSES": "loss.pixel_loss",
    "STRATEGIES": "strategy",
    "AngularSettings": "basis_settings",
    "BasisSettings": "basis_settings",
    "DefaultSettings": "strategy",
    "Homogenisation": "loss.homogenisation",
    "ImageLoss": "loss.image_loss",
    "ImageViews": "views.images",
    "LearningRates": "settings",
    "McmcSettings": "strategy",
    "Parameters": "parameters",
    "Penalties": "strategy",
    "PixelLoss": "loss.pixel_loss",
    "SolveSettings": "xray.solve_settings",
    "Strategy": "strategy",
    "StrategySettings": "strategy",
    "TrainSettings": "settings",
    "Trainer": "trainer",
    "TrainingRun": "strategy",
    "TrainingViews": "trainer",
    "XraySettings": "strategy",
    "XrayTrainer": "xray.trainer",
    "random_points": "start.points",
    "register_loss": "loss.pixel_loss",
    "register_strategy": "strategy",
    "start_splats": "start.points",
    "XrayTrainSettings": "xray.settings",
}

__all__ = [
    "PIXEL_LOSSES",
    "STRATEGIES",
    "AngularSettings",
    "BasisSettings",
    "DefaultSettings",
    "Homogenisation",
    "ImageLoss",
    "ImageViews",
    "LearningRates",
    "McmcSettings",
    "Parameters",
    "Penalties",
    "PixelLoss",
    "SolveSettings",
    "Strategy",
    "StrategySettings",
    "TrainSettings",
    "Trainer",
    "TrainingRun",
    "TrainingViews",
    "XraySettings",
    "XrayTrainSettings",
    "XrayTrainer",
    "random_points",
    "register_loss",
    "register_strategy",
    "start_splats",
]


def __getattr__(name: str) -> Any:
    if name not in _HOMES:
        raise AttributeError(f"module 'rift_cl.train' has no attribute {name!r}")
    return getattr(import_module(f"rift_cl.train.{_HOMES[name]}"), name)


def __dir__() -> list[str]:
    return list(__all__)
