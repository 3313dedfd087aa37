"""``--pitch`` and ``--unit`` beside the lengths that a file has: converted, named or refused."""

from __future__ import annotations

import json
from pathlib import Path

import h5py
import numpy as np
import pytest

from rift_cl.commands.center.settings import CenterSettings
from rift_cl.commands.cli import main
from rift_cl.commands.inputs.scan_lengths import with_lengths
from rift_cl.errors import InputError
from rift_cl.geometry import Cone
from rift_cl.io import open_scan, read_volume
from rift_cl.io.volumes import read_volume_place
from rift_cl.io.volumes.layout import VolumePlace

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
def high(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Rows three times as far apart as bins, in millimetres: six of them, and a ball of 1 per mm.

    Means over pixels of line integrals through a ball of radius 8 bins about row 2.5.
    """
    path = tmp_path_factory.mktemp("high") / "scan.npz"
    fine = (np.arange(8) + 0.5) / 8 - 0.5
    v = (3 * (np.arange(6)[:, None] - 2.5 + fine)).reshape(-1, 1)
    u = (np.arange(BINS)[:, None] - (BINS - 1) / 2 + fine).reshape(1, -1)
    chord = 2 * np.sqrt(np.maximum(64 - u**2 - v**2, 0)).reshape(6, 8, BINS, 8).mean(axis=(1, 3))
    stack = np.broadcast_to(0.1 * chord, (VIEWS, 6, BINS)).astype(np.float32)
    angles = np.arange(VIEWS) * np.pi / VIEWS
    np.savez(path, projections=stack, angles=angles, pitch=[0.3, 0.1], unit=np.array("mm"))
    return path


@pytest.fixture(scope="module")
def bare(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A scan whose file says nothing of lengths."""
    path = tmp_path_factory.mktemp("bare") / "scan.npz"
    np.savez(path, projections=disc(), angles=np.arange(VIEWS) * np.pi / VIEWS)
    return path


def run(scan: Path, out: Path, *options: object) -> int:
    words = ("reconstruct", scan, "--out", out, "--kind", "attenuation", "--center", 15.5)
    return main([str(word) for word in (*words, "--format", "h5", "--quiet", *options)])


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


@pytest.mark.full
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


@pytest.mark.full
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


def in_unit(tmp_path: Path, unit: str, pitch: float = 50.0) -> Path:
    """A scan whose file says its pitch in a unit."""
    path = tmp_path / "scan.npz"
    angles = np.arange(VIEWS) * np.pi / VIEWS
    np.savez(path, projections=disc(), angles=angles, pitch=pitch, unit=np.array(unit))
    return path


@pytest.mark.parametrize("unit", ["micrometers", "MICRONS", "Micron", "Micrometres", "um"])
def test_words_for_units_may_be_capital_and_plural(tmp_path: Path, unit: str) -> None:
    scan = with_lengths(open_scan(in_unit(tmp_path, unit), kind="attenuation"), None, "mm")
    assert scan.pitch == pytest.approx(0.05) and scan.unit == "mm"


@pytest.mark.parametrize("unit", ["Mm", "Um", "M", "a", "um/px", "pixel"])
def test_a_unit_that_is_not_known_is_not_given_another_name(tmp_path: Path, unit: str) -> None:
    file = open_scan(in_unit(tmp_path, unit), kind="attenuation")
    with pytest.raises(InputError, match="--pitch"):
        with_lengths(file, None, "mm")
    scan = with_lengths(file, 0.05, "mm")
    assert scan.unit == "mm" and repr(unit) in scan.notes[-1]
    np.savez(
        tmp_path / "fan.npz",
        projections=disc()[:, :1],
        angles=np.arange(VIEWS) / 7,
        sid=60.0,
        sdd=120.0,
        pitch=2.0,
        unit=np.array(unit),
    )
    with pytest.raises(InputError, match="--geometry"):
        with_lengths(open_scan(tmp_path / "fan.npz", kind="attenuation"), 0.05, "mm")


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


def place_of(out: Path) -> VolumePlace:
    return read_volume_place(out / "volume.h5")


def test_slices_are_as_far_apart_as_rows(high: Path, tmp_path: Path) -> None:
    assert run(high, tmp_path / "a") == 0
    place, volume = place_of(tmp_path / "a"), read_volume(tmp_path / "a" / "volume.h5")
    assert place.spacing == pytest.approx((0.3, 0.1, 0.1)) and place.origin[0] == 0
    ball = 4 / 3 * np.pi * 0.8**3
    assert volume.sum() * np.prod(place.spacing) == pytest.approx(ball, rel=0.05)
    again = ("--config", tmp_path / "a" / "config.json", "--out", tmp_path / "b", "--quiet")
    assert main([str(word) for word in ("reconstruct", *again)]) == 0
    assert place_of(tmp_path / "b") == place
    np.testing.assert_array_equal(read_volume(tmp_path / "b" / "volume.h5"), volume)


@pytest.mark.parametrize(
    ("options", "spacing", "first"),
    [
        (("--rows", 2, 4), (0.3, 0.1, 0.1), 0.6),
        (("--binning", 2), (0.6, 0.2, 0.2), 0.15),
        (("--unit", "um"), (300, 100, 100), 0),
        (("--unit", "um", "--pitch", 50), (150, 50, 50), 0),
        (("--pixel", 0.2), (0.3, 0.2, 0.2), 0),
    ],
)
def test_the_ratio_of_rows_to_bins_is_that_of_the_file(
    high: Path,
    tmp_path: Path,
    options: tuple[object, ...],
    spacing: tuple[float, ...],
    first: float,
    capsys: pytest.CaptureFixture[str],
) -> None:
    assert run(high, tmp_path / "out", *options) == 0
    place = place_of(tmp_path / "out")
    assert place.spacing == pytest.approx(spacing) and place.origin[0] == pytest.approx(first)
    if "--pitch" in options:
        assert "between rows changes alike" in " ".join(capsys.readouterr().err.split())


def test_the_plan_names_the_height_of_voxels(
    high: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert run(high, tmp_path / "out", "--dry-run") == 0
    assert "0.3 x 0.1 x 0.1 mm (z, y, x)" in " ".join(capsys.readouterr().out.split())


@pytest.mark.full
@pytest.mark.parametrize("format", ["tiff", "tiff-stack", "zarr", "mrc"])
@pytest.mark.each
def test_every_format_has_the_height_of_slices(high: Path, tmp_path: Path, format: str) -> None:
    import mrcfile
    import tifffile

    out = tmp_path / "out"
    assert run(high, out, "--format", format) == 0
    if format == "zarr":
        assert read_volume_place(out / "volume.zarr").spacing == pytest.approx((0.3, 0.1, 0.1))
    elif format == "mrc":
        with mrcfile.open(out / "volume.mrc") as file:
            size = file.voxel_size
            assert float(size.z / size.x) == pytest.approx(3)
    else:
        path = out / "volume.tif" if format == "tiff-stack" else next((out / "slices").iterdir())
        with tifffile.TiffFile(path) as file:
            assert file.imagej_metadata["spacing"] == pytest.approx(0.3)
            count, length = file.pages[0].tags["XResolution"].value
            assert length / count == pytest.approx(0.1)


@pytest.mark.full
def test_phase_is_retrieved_of_pixels_as_high_as_they_are(high: Path, tmp_path: Path) -> None:
    """Rows that are farther apart show less of the fringes, so that other values come out."""
    phase = ("--delta-beta", 500, "--energy", 20, "--propagation", 2e5)
    with np.load(high) as file:
        arrays = dict(file)
    square = tmp_path / "square.npz"
    np.savez(square, **{**arrays, "pitch": 0.1})
    assert run(high, tmp_path / "a", *phase) == run(square, tmp_path / "b", *phase) == 0
    volumes = [read_volume(tmp_path / name / "volume.h5") for name in "ab"]
    # Of square pixels rows are taken to be nearer than they are, and mix more.
    steepness = [float(np.abs(np.diff(v[:, 12:20, 12:20], axis=0)).mean()) for v in volumes]
    assert steepness[0] > 1.05 * steepness[1]


@pytest.mark.full
def test_phase_retrieval_in_another_unit_is_doubted(high: Path, tmp_path: Path) -> None:
    phase = ("--delta-beta", 500, "--propagation", 2e5)
    for name, energy in (("keV", 20), ("eV", 20000)):
        assert run(high, tmp_path / name, *phase, "--energy", energy, "--rows", 2, 3) == 0
        assumed = json.loads((tmp_path / name / "metrics.json").read_text())["assumed"]
        doubts = [said for said in assumed if said.startswith("Doubt: photons of")]
        assert len(doubts) == (name == "eV")


def heights(out: Path) -> tuple[float, ...]:
    return read_volume_place(out / "volume.h5").spacing


@pytest.mark.full
@pytest.mark.parametrize(
    ("scan", "options", "spacing"),
    [
        ("bare", (), (2.5, 1, 1)),
        ("bare", ("--pitch", 2, "--unit", "mm"), (2.5, 2, 2)),
        ("bare", ("--pitch", 2, "--unit", "mm", "--binning", 2), (5, 4, 4)),
        ("bare", ("--binning", 2), (5, 2, 2)),
        ("metres", ("--unit", "um"), (2.5, 6.5, 6.5)),
        ("metres", ("--unit", "um", "--pitch", 13), (2.5, 13, 13)),
        ("high", (), (2.5, 0.1, 0.1)),
        ("high", ("--unit", "um", "--pitch", 50), (2.5, 50, 50)),
    ],
)
def test_rows_are_as_far_apart_as_a_person_says(request, tmp_path, scan, options, spacing):
    path = request.getfixturevalue(scan)
    assert run(path, tmp_path / "a", "--row-pitch", 2.5, *options) == 0
    assert heights(tmp_path / "a") == pytest.approx(spacing)
    told = " ".join(json.loads((tmp_path / "a" / "metrics.json").read_text())["assumed"])
    assert ("--row-pitch 2.5 takes the place of" in told) == (scan == "high")
    again = ("--config", tmp_path / "a" / "config.json", "--out", tmp_path / "b", "--quiet")
    assert main([str(word) for word in ("reconstruct", *again)]) == 0
    assert heights(tmp_path / "b") == pytest.approx(spacing)


@pytest.mark.parametrize("length", [0, -1, float("nan"), float("inf")])
def test_a_distance_between_rows_that_is_none_is_refused(bare, length):
    with pytest.raises(InputError, match="--row-pitch is"):
        with_lengths(open_scan(bare), None, None, length)


def test_the_search_for_the_axis_takes_the_rows_so_far_apart(bare):
    settings = CenterSettings(scan=bare, kind="attenuation", row_pitch=2.5)
    assert settings.open_scan().aspect == 2.5
