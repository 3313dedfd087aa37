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

from typing import TYPE_CHECKING

from rift_cl.lazy_names import lazy_names

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
        ResidualSettings,
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
    "ResidualSettings",
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

__getattr__, __dir__ = lazy_names(
    __name__,
    {
        "basis_settings": ("AngularSettings", "BasisSettings"),
        "loss.homogenisation": ("Homogenisation",),
        "loss.image_loss": ("ImageLoss",),
        "loss.pixel_loss": ("PIXEL_LOSSES", "PixelLoss", "register_loss"),
        "parameters": ("Parameters",),
        "settings": ("LearningRates", "TrainSettings"),
        "start.points": ("random_points", "start_splats"),
        "strategy": (
            "DefaultSettings",
            "McmcSettings",
            "Penalties",
            "ResidualSettings",
            "STRATEGIES",
            "Strategy",
            "StrategySettings",
            "TrainingRun",
            "XraySettings",
            "register_strategy",
        ),
        "trainer": ("Trainer", "TrainingViews"),
        "per_view.images": ("ImageViews",),
        "xray.settings": ("XrayTrainSettings",),
        "xray.solve_settings": ("SolveSettings",),
        "xray.trainer": ("XrayTrainer",),
    },
)
