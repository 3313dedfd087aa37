"""Strategies: how splats are added, moved and removed while they are trained.

Four come with the package, by the names of ``STRATEGIES``: ``residual`` moves splats that images
hardly need to where the residual is largest, ``mcmc`` relocates those that have become transparent
(3DGS as MCMC), ``default`` clones, splits and prunes (the original 3DGS), and ``xray`` relocates
X-ray splats, whose densities add up. ``protocol`` says how to write another.
"""

from __future__ import annotations

from dataclasses import MISSING, fields, is_dataclass
from typing import Any

from rift_cl.errors import InputError
from rift_cl.registry import Registry
from rift_cl.train.strategy.default import DefaultSettings, DefaultStrategy
from rift_cl.train.strategy.mcmc import McmcSettings, McmcStrategy
from rift_cl.train.strategy.protocol import Penalties, Strategy, StrategySettings, TrainingRun
from rift_cl.train.strategy.residual import ResidualSettings, ResidualStrategy
from rift_cl.train.strategy.xray import XraySettings, XrayStrategy

__all__ = [
    "STRATEGIES",
    "DefaultSettings",
    "DefaultStrategy",
    "McmcSettings",
    "McmcStrategy",
    "Penalties",
    "ResidualSettings",
    "ResidualStrategy",
    "Strategy",
    "StrategySettings",
    "TrainingRun",
    "XraySettings",
    "XrayStrategy",
    "register_strategy",
]

STRATEGIES: Registry[type[StrategySettings]] = Registry(
    "strategy",
    {
        "residual": ResidualSettings,
        "mcmc": McmcSettings,
        "default": DefaultSettings,
        "xray": XraySettings,
    },
)


def register_strategy(
    name: str, settings: type[StrategySettings], *, replace: bool = False
) -> None:
    """Make a strategy known by a name.

    Args:
        name: what saved settings call it.
        settings: its settings: a dataclass derived from ``StrategySettings``, all of whose fields
            have defaults.
        replace: take the place of one that was registered by that name before.

    Raises:
        InputError: the name is taken, or the settings are no such class, or want a value.
    """
    kinds = isinstance(settings, type), is_dataclass(settings)
    if not (all(kinds) and issubclass(settings, StrategySettings)):
        raise InputError(
            f"register_strategy: {settings!r} is not a dataclass derived from StrategySettings"
        )
    known: Any = settings
    open_ended = [each.name for each in fields(known)
                  if each.default is MISSING and each.default_factory is MISSING]  # fmt: skip
    if open_ended:
        raise InputError(
            f"register_strategy: {settings.__name__}.{open_ended[0]} has no default, which every "
            "setting of a strategy wants"
        )
    STRATEGIES.add(name, settings, replace=replace)
