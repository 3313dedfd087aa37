"""Vectors that turn about another axis than x = y = 0, on which volumes and targets are centred."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from rift_cl.commands.cli import main
from rift_cl.geometry import Cone

AWAY = np.array([50.0, -20.0, 7.0])


@pytest.fixture(scope="module")
def aside(tmp_path_factory: pytest.TempPathFactory) -> list[str]:
    """A scan of a full turn about another axis, and the option that names its vectors."""
    folder = tmp_path_factory.mktemp("aside")
    views = Cone(np.arange(12) * np.pi / 6, 6, 16, 1.0, 100.0, 400.0).vectors()
    places = views.source + AWAY, views.middle + AWAY, views.across, views.down
    np.save(folder / "scan.npy", np.ones((12, 6, 16), np.float32))
    np.savetxt(folder / "vectors.txt", np.concatenate(places, axis=1))
    return [str(folder / "scan.npy"), "--geometry", str(folder / "vectors.txt")]


@pytest.mark.each
@pytest.mark.parametrize(
    "words",
    [
        ("reconstruct", "--method", "cgls", "--kind", "attenuation"),
        ("analyze",),
        ("fit", "xray", "--kind", "attenuation"),
        ("plan", "--views", "2", "--have"),
    ],
)
def test_commands_refuse_them_and_say_what_to_subtract(
    words: tuple[str, ...], aside: list[str], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main([*words, *aside, "--out", str(tmp_path / "out"), "--dry-run"]) == 3
    assert "subtract (50, -20, 0)" in capsys.readouterr().err
