"""What travels to another process: operators and settings are pickled as what they are made of.

``tests/operators/test_linear.py`` has those of parallel beams, and sums and products.
"""

import dataclasses
import pickle
from pathlib import Path

import numpy as np
import pytest

import rift_cl as rift
from rift_cl.commands.cli import COMMANDS
from rift_cl.reconstruct import FDK, Katsevich
from rift_cl.reconstruct.direct.filtered_backprojection import unfiltered_backprojection
from rift_cl.splat.settings import SplatSettings
from rift_cl.train import TrainSettings

TURN = np.arange(8) * np.pi / 4
CONE = rift.Cone(TURN, rows=6, bins=8, pitch=1.5, source_to_axis=40, source_to_detector=60)
FAN = rift.Fan(TURN, 8, 1.5, 40, 60)
FLAT, VOLUME = rift.Grid((8, 8)), rift.Grid((8, 8, 8))


def helix():
    angles = np.arange(48) * np.pi / 8
    heights = np.linspace(-8, 8, 48)
    scan = rift.Cone(
        angles, rows=24, bins=16, pitch=1.5, source_to_axis=40, source_to_detector=60,
        heights=heights,
    )  # fmt: skip
    return Katsevich(rift.Projector(rift.Grid((4, 8, 8)), scan))


OPERATORS = {
    "fan": lambda: rift.Projector(FLAT, FAN),
    "cone": lambda: rift.Projector(VOLUME, CONE),
    "vectors": lambda: rift.Projector(VOLUME, CONE.vectors()),
    "FDK of a fan": lambda: FDK(rift.Projector(FLAT, FAN), "hann"),
    "FDK of a cone": lambda: FDK(rift.Projector(VOLUME, CONE), compensate="uniform"),
    "Katsevich": helix,
    "Backprojection": lambda: unfiltered_backprojection(rift.Projector(VOLUME, CONE)),
}


@pytest.mark.once
@pytest.mark.parametrize("name", OPERATORS)
def test_an_operator_travels_before_and_after_its_use(name):
    B = OPERATORS[name]()
    fresh = pickle.dumps(B)
    x = np.random.default_rng(1).random(B.domain, dtype=np.float32)
    wanted = B(x)
    for text in (fresh, pickle.dumps(B)):
        assert len(text) < 20_000
        C = pickle.loads(text)
        assert type(C) is type(B) and repr(C) == repr(B)
        assert np.array_equal(C(x), wanted)


def settings_of(name):
    kind = COMMANDS[name].settings_class()
    given = {
        field.name: (Path("x"),) if "tuple" in str(field.type) else Path("x")
        for field in dataclasses.fields(kind)
        if field.default is field.default_factory is dataclasses.MISSING
    }
    return kind(**given)


@pytest.mark.parametrize("name", [name for name in COMMANDS if name != "cache"])
def test_settings_of_commands_travel(name):
    settings = settings_of(name)
    assert pickle.loads(pickle.dumps(settings)) == settings
    assert repr(pickle.loads(pickle.dumps(settings))) == repr(settings)


@pytest.mark.parametrize("settings", [TrainSettings(), SplatSettings()])
def test_settings_of_the_trainer_travel(settings):
    assert pickle.loads(pickle.dumps(settings)) == settings
