"""Scales and opacities that a file holds as they are: doubted where the numbers are plain."""

from __future__ import annotations

import warnings
from pathlib import Path

import numpy as np
import pytest

import rift_cl as rift


def scene(**changes: np.ndarray) -> rift.SplatScene:
    """A fit of a scene of 3 units."""
    random = np.random.default_rng(7)
    arrays = {
        "means": random.normal(0, 3, (400, 3)),
        "log_scales": random.normal(-3, 0.7, (400, 3)),
        "quats": random.normal(size=(400, 4)),
        "logit_opacities": random.normal(0, 3, 400),
        "sh": np.zeros((400, 1, 3)),
    }
    return rift.SplatScene(**arrays | changes)


def said_of(path: Path, given: rift.SplatScene) -> list[str]:
    given.save(path)
    with warnings.catch_warnings(record=True) as found:
        warnings.simplefilter("always")
        rift.SplatScene.load(path)
    return [str(one.message) for one in found]


def test_scales_and_opacities_as_such_are_doubted(tmp_path: Path) -> None:
    given = scene()
    dense = {"means": given.means / 10, "log_scales": np.exp(given.log_scales)}
    (said,) = said_of(tmp_path / "a.ply", scene(**dense))
    assert "scale_0" in said and "logarithms" in said
    (said,) = said_of(tmp_path / "a.ply", scene(logit_opacities=np.linspace(0.005, 0.995, 400)))
    assert "logits" in said


@pytest.mark.parametrize(
    "unusual",
    ["a fit", "millimetres", "one opacity", "opacities about a half", "few"],
)
def test_scenes_that_may_be_meant_are_not(tmp_path: Path, unusual: str) -> None:
    given = scene()
    changes = {
        "a fit": {},
        # All splats are wider than 1 unit, and the scene is larger alike.
        "millimetres": {"means": 1000 * given.means, "log_scales": given.log_scales + 6.9},
        "one opacity": {"logit_opacities": np.full(400, 0.5)},
        "opacities about a half": {"logit_opacities": np.random.default_rng(0).normal(0, 0.1, 400)},
        "few": {
            name: getattr(given, name)[:50] * 0 + 0.5
            for name in ("means", "log_scales", "quats", "logit_opacities", "sh")
        },
    }[unusual]
    assert not said_of(tmp_path / "a.ply", scene(**changes))
