"""``rift reconstruct`` of fans: by their own rays, about an axis that the data tell."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from fan_scenes import AXIS, DETECTOR, KINDS, fan, sinogram

from rift_cl import Grid
from rift_cl.commands.cli import main
from rift_cl.io import read_volume
from rift_cl.phantom import Ellipsoid, render

SIZE, CENTER = 120, 71.3
# Half a turn and the fan, and all round.
SPANS = {"short": np.arange(150) * np.deg2rad(205) / 150, "turn": np.arange(180) * np.pi / 90}


def run(*arguments: object) -> int:
    return main([str(argument) for argument in arguments])


def save(path: Path, y: np.ndarray, angles: np.ndarray, **more: object) -> None:
    lengths = {"source_to_axis": AXIS, "source_to_detector": DETECTOR, "pitch": 1.0}
    np.savez(path, projections=y[:, None], angles=angles, **lengths, **more)


def truth(kind: str) -> np.ndarray:
    """The slice in samples as far apart as bins are at the axis."""
    parts = [
        Ellipsoid((0.0, y / 1.5, x / 1.5), (1.0, b / 1.5, a / 1.5), turned, value)
        for value, x, y, a, b, turned in KINDS[kind]
    ]
    return render(parts, Grid((SIZE, SIZE), 1 / 1.5))


def reconstructed(path: Path, out: Path, *options: object) -> tuple[np.ndarray, str]:
    """The slice that the command leaves, and what it assumed."""
    plain = ("--kind", "attenuation", "--size", SIZE, "--out", out, "--quiet")
    assert run("reconstruct", path, *plain, *options) == 0
    said = " ".join(json.loads((out / "metrics.json").read_text())["assumed"])
    return read_volume(out / "slices")[0], said


def error(image: np.ndarray, kind: str) -> float:
    """Root mean square in the disc that every view sees, as a share of the object's."""
    away = np.arange(SIZE) - (SIZE - 1) / 2
    right, inside = truth(kind), np.hypot(away[:, None], away) < 56
    return float(np.sqrt(np.mean((image - right)[inside] ** 2) / np.mean(right[inside] ** 2)))


@pytest.mark.parametrize("span", ["short", "turn"])
def test_axis_and_sense_of_a_fan_are_the_datas(tmp_path: Path, span: str) -> None:
    """Angles run down and the wrong way round, and the file has the axis at the middle."""
    scan = fan(SPANS[span][::-1], CENTER)
    save(tmp_path / "fan.npz", sinogram(KINDS["parts"], scan), -scan.angles)
    image, said = reconstructed(tmp_path / "fan.npz", tmp_path / "out")
    assert error(image, "parts") < 0.2
    assert image[55:65, 64:72].mean() == pytest.approx(
        truth("parts")[55:65, 64:72].mean(), rel=0.02
    )
    assert "angles run the other way round" in said and "resampled" not in said
    config = json.loads((tmp_path / "out" / "config.json").read_text())
    assert config["settings"]["center"] == pytest.approx(CENTER, abs=0.1)
    assert config["settings"]["reversed"]
    again = ("--config", tmp_path / "out" / "config.json", "--out", tmp_path / "again", "--quiet")
    assert run("reconstruct", *again) == 0
    np.testing.assert_array_equal(read_volume(tmp_path / "again" / "slices")[0], image)


@pytest.mark.full
@pytest.mark.parametrize("center", [48.6, 110.4])
def test_a_fan_displaced_by_a_third_reaches_to_the_farther_end(
    tmp_path: Path, center: float
) -> None:
    scan = fan(SPANS["turn"], center)
    save(tmp_path / "fan.npz", sinogram(KINDS["parts"], scan), scan.angles)
    image, said = reconstructed(tmp_path / "fan.npz", tmp_path / "out")
    assert error(image, "parts") < 0.2
    assert "slices extend to the farther end" in said and "Wang" in said
    out = tmp_path / "whole"
    options = ("--kind", "attenuation", "--center", center)
    assert run("reconstruct", tmp_path / "fan.npz", "--out", out, *options) == 0
    bins = int(np.ceil(160 + abs(159 - 2 * center)))
    assert read_volume(out / "slices").shape == (1, bins, bins)


@pytest.mark.parametrize("options", [(), ("--method", "cgls", "--steps", 12)])
def test_a_part_of_a_turn_is_taken_as_it_is(tmp_path: Path, options: tuple[object, ...]) -> None:
    """Filtered backprojection wants parallel views that are whole; steps take any rays."""
    scan = fan(SPANS["short"][:60], CENTER)
    save(tmp_path / "fan.npz", sinogram(KINDS["parts"], scan), scan.angles)
    _, said = reconstructed(tmp_path / "fan.npz", tmp_path / "out", "--center", CENTER, *options)
    assert ("resampled" in said) == (not options)
    assert "have no view" in said


@pytest.mark.full
@pytest.mark.parametrize("span", ["turn", "short"])
def test_an_object_wider_than_the_fan_is_continued(tmp_path: Path, span: str) -> None:
    kind, scan = "wider than the detector", fan(SPANS[span], 79.5)
    save(tmp_path / "fan.npz", sinogram(KINDS[kind], scan), scan.angles)
    away = np.arange(SIZE) - (SIZE - 1) / 2
    border = np.abs(np.hypot(away[:, None], away) - 54) < 3
    bias = []
    for pad in ("auto", "off"):
        options = ("--center", 79.5, "--pad", pad)
        image, said = reconstructed(tmp_path / "fan.npz", tmp_path / pad, *options)
        assert ("extrapolated" in said) == (pad == "auto")
        bias.append(abs((image - truth(kind))[border].mean()))
    assert bias[0] < 0.7 * bias[1]


def test_a_round_object_does_not_tell_the_sense(tmp_path: Path) -> None:
    scan = fan(SPANS["turn"], 75.0)
    ring = [(1.0, 0.0, 0.0, 40.0, 40.0, 0.0), (-0.5, 0.0, 0.0, 20.0, 20.0, 0.0)]
    save(tmp_path / "fan.npz", sinogram(ring, scan), scan.angles, center=(0.0, 80.0))
    _, said = reconstructed(tmp_path / "fan.npz", tmp_path / "out")
    assert "sense of rotation cannot be told" in said


def test_data_without_contrast_leave_the_axis_to_the_file(tmp_path: Path) -> None:
    scan = fan(SPANS["turn"], 75.0)
    y = np.ones((scan.views, scan.bins), np.float32)
    save(tmp_path / "fan.npz", y, scan.angles, center=(0.0, 75.0))
    _, said = reconstructed(tmp_path / "fan.npz", tmp_path / "out")
    assert "The axis was taken to be that of the file, bin 75.00" in said


@pytest.mark.full
def test_lengths_in_two_units_are_doubted(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """By the quiet as well, who want no progress and yet would not miss a doubt."""
    scan = fan(SPANS["turn"], 75.0)
    save(tmp_path / "fan.npz", sinogram(KINDS["parts"], scan), scan.angles)
    _, said = reconstructed(tmp_path / "fan.npz", tmp_path / "out", "--size", 8)
    assert "in one unit of length" not in said
    with np.load(tmp_path / "fan.npz") as file:
        np.savez(tmp_path / "two.npz", **{**file, "pitch": 1e-3})
    _, said = reconstructed(tmp_path / "two.npz", tmp_path / "two", "--size", 8)
    assert "in one unit of length" in said
    printed = capsys.readouterr()
    assert "in one unit of length" in printed.out + printed.err
