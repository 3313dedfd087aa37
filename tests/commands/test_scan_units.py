"""``--pitch`` and ``--unit`` beside the lengths that a file has: converted, named or refused."""

from __future__ import annotations

import json
from pathlib import Path

import h5py
import numpy as np
import pytest

from rift_cl.commands.cli import main
from rift_cl.commands.inputs.scan_lengths import with_lengths
from rift_cl.errors import InputError
from rift_cl.geometry import Cone
from rift_cl.io import open_scan, read_volume

VIEWS, BINS, INPUT = 40, 32, 3
PITCH = 6.5e-6
RADIUS = 10.0


def disc() -> np.ndarray:
    """Line integrals of a disc of density 1 per bin, two rows of it."""
    places = np.arange(BINS) - (BINS - 1) / 2
    chord = 2 * np.sqrt(np.maximum(RADIUS**2 - places**2, 0))
    return np.broadcast_to(chord, (VIEWS, 2, BINS)).astype(np.float32)


@pytest.fixture(scope="module")
def metres(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """NXtomo with its pitch in metres."""
    path = tmp_path_factory.mktemp("units") / "nx.h5"
    with h5py.File(path, "w") as file:
        entry = file.create_group("entry1/tomo_entry")
        entry["instrument/detector/data"] = disc()
        entry["instrument/detector/image_key"] = np.zeros(VIEWS)
        entry["instrument/detector/x_pixel_size"] = PITCH
        entry["instrument/detector/x_pixel_size"].attrs["units"] = "m"
        entry["sample/rotation_angle"] = np.arange(VIEWS) * 180 / VIEWS
        entry["sample/rotation_angle"].attrs["units"] = "degree"
    return path


@pytest.fixture(scope="module")
def bare(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A scan whose file says nothing of lengths."""
    path = tmp_path_factory.mktemp("bare") / "scan.npz"
    np.savez(path, projections=disc(), angles=np.arange(VIEWS) * np.pi / VIEWS)
    return path


def run(scan: Path, out: Path, *options: object) -> int:
    words = ("reconstruct", scan, "--out", out, "--kind", "attenuation", "--center", 15.5)
    return main([str(word) for word in (*words, *options, "--format", "h5", "--quiet")])


def settings_of(out: Path) -> dict[str, object]:
    return dict(json.loads((out / "config.json").read_text())["settings"])


@pytest.mark.parametrize(("unit", "pitch"), [("um", 6.5), ("mm", 6.5e-3), ("m", 6.5e-6)])
def test_a_unit_converts_the_pitch_of_the_file(
    metres: Path, tmp_path: Path, unit: str, pitch: float, capsys: pytest.CaptureFixture[str]
) -> None:
    assert run(metres, tmp_path / "a", "--unit", unit) == 0
    printed = " ".join(capsys.readouterr().out.split())
    assert f"{pitch:.4g} {unit}" in printed and f"per {unit}" in printed
    found = settings_of(tmp_path / "a")
    assert found["pitch"] == pytest.approx(pitch) and found["unit"] == unit
    volume = read_volume(tmp_path / "a" / "volume.h5")
    assert volume[0, 14:18, 14:18].mean() == pytest.approx(1 / pitch, rel=0.03)
    again = ("--config", tmp_path / "a" / "config.json", "--out", tmp_path / "b", "--quiet")
    assert main([str(word) for word in ("reconstruct", *again)]) == 0
    np.testing.assert_array_equal(read_volume(tmp_path / "b" / "volume.h5"), volume)


@pytest.mark.parametrize(
    ("options", "word"),
    [
        (("--pitch", 6.5), "--unit m"),
        (("--unit", "furlong"), "furlong"),
        (("--unit", "Um"), "um"),
    ],
)
def test_lengths_that_do_not_fit_a_file_with_a_unit_are_refused(
    metres: Path,
    tmp_path: Path,
    options: tuple[object, ...],
    word: str,
    capsys: pytest.CaptureFixture[str],
) -> None:
    assert run(metres, tmp_path / "out", *options) == INPUT
    assert word in capsys.readouterr().err and not (tmp_path / "out").exists()


def test_a_unit_without_a_length_is_refused(
    bare: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert run(bare, tmp_path / "out", "--unit", "um") == INPUT
    assert "--pitch" in capsys.readouterr().err
    assert run(bare, tmp_path / "bins") == 0
    assumed = json.loads((tmp_path / "bins" / "metrics.json").read_text())["assumed"]
    assert "lengths are in bins" in " ".join(assumed)
    assert run(bare, tmp_path / "out", "--unit", "um", "--pitch", 6.5) == 0
    assert settings_of(tmp_path / "out")["unit"] == "um"


def test_a_pitch_without_a_unit_is_said_to_have_none(
    bare: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    named = ("--pitch", 6.5, "--unit", "um")
    rows = [(("--pitch", 6.5), True), (named, False), (("--pitch", 1), False)]
    for number, (options, told) in enumerate(rows):
        assert run(bare, tmp_path / str(number), *options) == 0
        printed = " ".join("".join(capsys.readouterr()).split())
        assert ("in a unit without a name: --unit" in printed) == told
    assert settings_of(tmp_path / "0")["unit"] == ""


@pytest.mark.parametrize("rows", [1, 3])
def test_a_fan_and_a_cone_are_converted_whole(tmp_path: Path, rows: int) -> None:
    lengths = {"source_to_axis": 60.0, "source_to_detector": 120.0, "pitch": 2.0}
    lines = [f"{name}: {value}" for name, value in lengths.items()]
    text = "\n".join((*lines, "unit: mm", "projections: scan.npz"))
    (tmp_path / "geometry.yaml").write_text(text)
    angles = 2 * np.pi * np.arange(VIEWS) / VIEWS
    np.savez(tmp_path / "scan.npz", projections=disc()[:, :1].repeat(rows, 1), angles=angles)
    file = open_scan(tmp_path / "geometry.yaml", kind="attenuation")
    scan = with_lengths(file, None, "um")
    found = scan.fan if scan.cone is None else scan.cone
    assert found is not None and scan.pitch == 2000.0 and scan.unit == "um"
    assert not isinstance(found, Cone) or found.pitch == (2000.0, 2000.0)
    assert (found.source_to_axis, found.source_to_detector) == (6e4, 12e4)
    with pytest.raises(InputError, match="--unit mm"):
        with_lengths(file, 1.0, None)
