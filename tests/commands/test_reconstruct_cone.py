"""``rift reconstruct`` of cone beams: quantitative, repeatable, and what it refuses."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.ndimage import gaussian_filter

import rift_cl as rift
from rift_cl.commands.cli import main
from rift_cl.commands.inputs.scan_axis import doubted_vectors
from rift_cl.commands.inputs.told_axis import axis_of_cone
from rift_cl.errors import InputError
from rift_cl.geometry import Cone, Grid, Vectors
from rift_cl.geometry.leaning import leaning
from rift_cl.io import open_scan, read_volume
from rift_cl.phantom import Ellipsoid, project

VIEWS, ROWS, BINS, PITCH, R, S = 60, 20, 28, 2.0, 60.0, 120.0
CENTER = 14.2


def run(*arguments: object) -> int:
    return main([str(argument) for argument in arguments])


@pytest.fixture(scope="module")
def ball(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A ball of 0.02 per length off the middle, through a cone whose axis is off the middle."""
    angles = 2 * np.pi * np.arange(VIEWS) / VIEWS
    cone = Cone(angles, ROWS, BINS, PITCH, R, S, ((ROWS - 1) / 2, CENTER))
    part = Ellipsoid.ball(6.0, 0.02, (0.5, 1.0, -2.0))
    path = tmp_path_factory.mktemp("cone") / "ball.npz"
    np.savez(
        path,
        projections=project([part], Grid((2, 2, 2)), cone),
        angles=angles,
        source_to_axis=R,
        source_to_detector=S,
        pitch=PITCH,
    )
    return path


@pytest.mark.full
@pytest.mark.parametrize("center", [(CENTER, 9.5), (9.5, CENTER)])
def test_a_row_and_a_bin_in_another_order_are_doubted(
    ball: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str], center: tuple[float, float]
) -> None:
    with np.load(ball) as made:
        arrays = {name: made[name][:, :8] if made[name].ndim == 3 else made[name] for name in made}
    np.savez(tmp_path / "few.npz", **arrays, center=center)
    assert run("reconstruct", tmp_path / "few.npz", "--out", tmp_path / "a", "--size", "8") == 0
    said = capsys.readouterr().err
    assert ("off the detector's rows 0 to 7" in said) == (center[0] > 7.5)


def middle_of(volume: np.ndarray) -> float:
    """Mean well inside the ball, whose middle is one voxel off the grid's or two."""
    z, y, x = np.indices(volume.shape) - (np.array(volume.shape)[:, None, None, None] - 1) / 2
    inside = (z - 0.5) ** 2 + (y - 1) ** 2 + (x + 2) ** 2 < 16
    return float(volume[inside].mean())


def test_a_ball_has_its_density(ball: Path, tmp_path: Path) -> None:
    common = ("reconstruct", ball, "--center", CENTER, "--unit", "mm", "--quiet")
    assert run(*common, "--out", tmp_path / "a", "--format", "h5") == 0
    volume = read_volume(tmp_path / "a" / "volume.h5")
    assert volume.shape[0] == ROWS
    assert middle_of(volume) == pytest.approx(0.02, rel=0.02)
    config = json.loads((tmp_path / "a" / "config.json").read_text())
    assert config["settings"]["center"] == CENTER and config["settings"]["pixel"] == 1.0
    metrics = json.loads((tmp_path / "a" / "metrics.json").read_text())
    assert "Feldkamp" in " ".join(metrics["assumed"])
    assert "source" in (tmp_path / "a" / "report.html").read_text()
    again = ("--config", tmp_path / "a" / "config.json", "--out", tmp_path / "b", "--quiet")
    assert run("reconstruct", *again) == 0
    np.testing.assert_array_equal(read_volume(tmp_path / "b" / "volume.h5"), volume)
    assert run(*common, "--out", tmp_path / "c", "--rows", 4, 9, "--roi", 3, 20, 5, 21) == 0
    part = read_volume(tmp_path / "c" / "slices")
    whole = volume[4:9, 5:21, 3:20]
    assert part.shape == whole.shape
    assert np.corrcoef(part.ravel(), whole.ravel())[0, 1] > 0.99


def test_a_helix_has_its_density(tmp_path: Path) -> None:
    turns = np.arange(3 * VIEWS) / VIEWS - 1.5
    angles, heights = 2 * np.pi * turns, 8.0 * turns
    cone = Cone(angles, ROWS, BINS, PITCH, R, S, heights=heights)
    lengths = {"source_to_axis": R, "source_to_detector": S, "pitch": PITCH}
    views = project([Ellipsoid.ball(6.0, 0.02)], Grid((2, 2, 2)), cone)
    scan = {"projections": views, "angles": angles, "heights": heights, **lengths}
    np.savez(tmp_path / "helix.npz", **scan)
    command = ("reconstruct", tmp_path / "helix.npz", "--unit", "mm", "--quiet")
    assert run(*command, "--out", tmp_path / "a", "--format", "h5") == 0
    volume = read_volume(tmp_path / "a" / "volume.h5")
    z, y, x = np.indices(volume.shape) - (np.array(volume.shape)[:, None, None, None] - 1) / 2
    assert volume[z**2 + y**2 + x**2 < 16].mean() == pytest.approx(0.02, rel=0.02)
    metrics = json.loads((tmp_path / "a" / "metrics.json").read_text())
    assert "Katsevich" in " ".join(metrics["assumed"])
    assert "sense of rotation, the sign of the heights" in " ".join(metrics["assumed"])


def test_axis_and_sense_are_found(ball: Path, tmp_path: Path) -> None:
    """A file that is wrong about both: the middle for the axis, the other sense of rotation."""
    found = rift.reconstruct_scan(ball, tmp_path / "a", reversed=True)
    assert found.settings.center == pytest.approx(CENTER, abs=0.1)
    assert not found.settings.reversed and "reversed" in " ".join(found.notes)
    assert middle_of(found.read()) == pytest.approx(0.02, rel=0.03)


@pytest.mark.full
@pytest.mark.parametrize("said", ["lean", "tilt"])
def test_an_axis_that_leans_is_turned(tmp_path: Path, said: str) -> None:
    """A detector that is turned by 4 degrees gives the volume of the upright one, once told so."""
    parts = [Ellipsoid.ball(3.0, 0.02, (z, 1.0, -2.0)) for z in (-5.0, 5.0)]
    angles = 2 * np.pi * np.arange(VIEWS) / VIEWS
    cone = Cone(angles, 36, 44, 1.25, R, S, (17.5, 22.2))
    lengths = {"source_to_axis": R, "source_to_detector": S, "pitch": 1.25}
    lines = [f"{name}: {value}" for name, value in (*lengths.items(), ("lean", 4))]
    (tmp_path / "lean.yaml").write_text("\n".join(lines))
    told = {"tilt": 4.0} if said == "tilt" else {"geometry": tmp_path / "lean.yaml"}
    runs = {"upright": (cone, {}), "turned": (leaning(cone, np.deg2rad(4)), told)}
    runs["untold"] = (runs["turned"][0], {})
    smooth = {}
    for name, (scan, options) in runs.items():
        views = project(parts, Grid((2, 2, 2)), scan)
        np.savez(tmp_path / f"{name}.npz", projections=views, angles=angles, **lengths)
        found = rift.reconstruct_scan(tmp_path / f"{name}.npz", center=22.2, **options)
        # Balls have edges, which interpolation between bins does not keep.
        smooth[name] = gaussian_filter(found.read(), 1.5)
        assert found.settings.tilt == pytest.approx(4 if name == "turned" else 0)
    off = {name: np.linalg.norm(image - smooth["upright"]) for name, image in smooth.items()}
    assert off["turned"] < 0.5 * off["untold"]


def test_the_axis_of_a_detector_that_leans_is_found_where_it_is(tmp_path: Path) -> None:
    """Its rows see the object's lower part at one end and its upper one at the other."""
    parts = [
        Ellipsoid.ball(7.0, 0.02, (0.0, 1.0, -2.0)),
        Ellipsoid.ball(3.0, 0.03, (4.0, 6.0, 3.0)),
        Ellipsoid.ball(2.0, 0.05, (-3.0, -7.0, 1.0)),
    ]
    angles = 2 * np.pi * np.arange(60) / 60
    cone = Cone(angles, 36, 44, 1.25, R, S, (17.5, 22.2))
    lengths = {"source_to_axis": R, "source_to_detector": S, "pitch": 1.25}
    for lean in (4.0, -4.0):
        views = project(parts, Grid((2, 2, 2)), leaning(cone, np.deg2rad(lean)))
        np.savez(tmp_path / "scan.npz", projections=views, angles=angles)
        lines = [f"{name}: {value}" for name, value in (*lengths.items(), ("lean", lean))]
        (tmp_path / "lean.yaml").write_text("\n".join(lines))
        geometry = str(tmp_path / "lean.yaml")
        scan = rift.open_scan(tmp_path / "scan.npz", geometry=geometry, kind="attenuation")
        axis = axis_of_cone(scan, None, None)
        assert axis.center == pytest.approx(22.2, abs=0.03)
        # What the file says of the lean is kept, where data have nothing against it.
        assert axis.tilt == pytest.approx(lean)


@pytest.mark.parametrize("flipped", ["across", "down"])
def test_vectors_that_the_data_contradict_are_doubted(tmp_path: Path, flipped: str) -> None:
    """Images whose bins, or rows, run the other way belong to vectors that do so as well."""
    cone = Cone(2 * np.pi * np.arange(VIEWS) / VIEWS, ROWS, BINS, PITCH, R, S)
    balls = [Ellipsoid.ball(4.0, 0.02, (0.5, 5.0, -4.0)), Ellipsoid.ball(2.5, 0.03, (0.5, -3, 6))]
    straight, y = cone.vectors(), project(balls, Grid((2, 2, 2)), cone)
    turned = y[:, :, ::-1] if flipped == "across" else y[:, ::-1]
    vectors = replace(straight, **{flipped: -getattr(straight, flipped)})
    columns = [getattr(vectors, name) for name in ("source", "middle", "across", "down")]
    np.save(tmp_path / "vectors.npy", np.concatenate(columns, axis=1))
    path = tmp_path / "scan.npz"
    for images, right in ((turned, True), (turned[:, :, ::-1], False)):
        np.savez(path, projections=images, angles=cone.angles)
        scan = open_scan(path, geometry=tmp_path / "vectors.npy", kind="attenuation")
        assert isinstance(scan.cone, Vectors)
        said = doubted_vectors(scan, scan.cone)
        assert not said if right else "mirrored" in said[0]


def test_center_of_a_cone(ball: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert run("center", ball, "--out", tmp_path / "a", "--quiet") == 0
    assert float(capsys.readouterr().out) == pytest.approx(CENTER, abs=0.1)
    assert "sense of rotation" in (tmp_path / "a" / "report.html").read_text()


@pytest.mark.parametrize("method", ["cgls", pytest.param("sirt", marks=pytest.mark.full)])
def test_methods_that_take_steps(ball: Path, tmp_path: Path, method: str) -> None:
    found = rift.reconstruct_scan(ball, tmp_path / "a", method=method, center=CENTER, steps=8)
    assert found.metrics["steps"] == 8 and found.metrics["residual"] > 0
    assert middle_of(found.read()) == pytest.approx(0.02, rel=0.12)


@pytest.mark.full
@pytest.mark.parametrize("method", ["cgls", "fbp"])
def test_an_object_longer_than_the_detector_is_told(tmp_path: Path, method: str) -> None:
    """Rays through the first row leave a volume that is as high as rows are at the axis."""
    angles = 2 * np.pi * np.arange(40) / 40
    cone = Cone(angles, 12, 32, 2.0, R, S)
    rod = [Ellipsoid((0, 0, 0), (5000.0, 9.0, 9.0), 0.0, 0.02)]
    path = tmp_path / "rod.npz"
    lengths = {"source_to_axis": R, "source_to_detector": S, "pitch": 2.0}
    np.savez(path, projections=project(rod, Grid((2, 2, 2)), cone), angles=angles, **lengths)
    given: dict[str, Any] = {"center": 15.5, "kind": "attenuation", "method": method}
    given |= {"steps": 12, "rows": (0, 9)} if method == "cgls" else {}
    found = rift.reconstruct_scan(path, tmp_path / "out", **given)
    assert "not all views see 2 slices at the lower end" in " ".join(found.notes)
    volume = found.read()
    if method == "cgls":
        # 1.49 times the density without the slices beyond.
        assert volume.shape[0] == 9
        levels = volume[:, 12:20, 12:20].mean(axis=(1, 2))
        assert levels.max() < 1.25 * 0.02 and levels[-1] == pytest.approx(0.02, rel=0.02)


@pytest.mark.full
def test_an_object_beyond_one_end_alone_is_told_of_that_end(tmp_path: Path) -> None:
    angles = 2 * np.pi * np.arange(24) / 24
    part = [Ellipsoid((10, 0, 0), (12.0, 9.0, 9.0), 0.0, 0.02)]
    views = project(part, Grid((2, 2, 2)), Cone(angles, 12, 32, 2.0, R, S))
    lengths = {"source_to_axis": R, "source_to_detector": S, "pitch": 2.0}
    np.savez(tmp_path / "part.npz", projections=views, angles=angles, **lengths)
    given: dict[str, Any] = {"center": 15.5, "kind": "attenuation"}
    found = rift.reconstruct_scan(tmp_path / "part.npz", tmp_path / "out", **given)
    (note,) = (note for note in found.notes if "not all views" in note)
    assert "beyond the last row" in note and "2 slices at the upper end" in note
    assert "lower" not in note


@pytest.mark.full
@pytest.mark.parametrize("last", [1.0, 3.0])
def test_air_that_is_off_zero_is_no_object_that_goes_on(
    ball: Path, tmp_path: Path, last: float
) -> None:
    """Neither beyond a side of the detector nor beyond its first and its last row."""
    with np.load(ball) as made:
        arrays = dict(made)
    arrays["projections"] += 0.07 * np.linspace(1, last, VIEWS, dtype=np.float32)[:, None, None]
    np.savez(tmp_path / "weak.npz", **arrays)
    given: dict[str, Any] = {"center": CENTER, "kind": "attenuation"}
    said = " ".join(rift.reconstruct_scan(tmp_path / "weak.npz", tmp_path / "out", **given).notes)
    assert "background" in said and "reaches beyond" not in said


@pytest.mark.full
def test_binning_keeps_the_density(ball: Path, tmp_path: Path) -> None:
    found = rift.reconstruct_scan(ball, tmp_path / "a", center=CENTER, binning=2, pixel=1.0)
    assert middle_of(found.read()) == pytest.approx(0.02, rel=0.05)


@pytest.fixture(scope="module")
def tall(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A scan whose volume is eight times as large as its projections."""
    angles = 2 * np.pi * np.arange(8) / 8
    cone = Cone(angles, 64, 64, 2.0, 160.0, 320.0)
    views = project([Ellipsoid.ball(14.0, 0.02, (3.0, 1.0, -2.0))], Grid((2, 2, 2)), cone)
    lengths = {"source_to_axis": 160.0, "source_to_detector": 320.0, "pitch": 2.0}
    path = tmp_path_factory.mktemp("tall") / "ball.npz"
    np.savez(path, projections=views, angles=angles, **lengths)
    return path


@pytest.mark.full
@pytest.mark.parametrize("method", ["fbp", "backproject"])
def test_a_volume_larger_than_the_memory_is_made_in_slabs(
    tall: Path, tmp_path: Path, method: str
) -> None:
    common = {"center": 31.5, "format": "h5", "method": method}
    whole = rift.reconstruct_scan(tall, tmp_path / "a", **common)
    slabs = rift.reconstruct_scan(tall, tmp_path / "b", memory="3.2M", **common)
    assert "slabs" in " ".join(slabs.notes) and "slabs" not in " ".join(whole.notes)
    np.testing.assert_array_equal(slabs.read(), whole.read())
    pictures = [(tmp_path / run / "preview.png").read_bytes() for run in "ab"]
    assert pictures[0] == pictures[1]
    with pytest.raises(InputError, match="window"):
        rift.reconstruct_scan(tall, tmp_path / "c", memory="3.2M", dtype="uint8", **common)


@pytest.mark.full
@pytest.mark.parametrize(
    "given",
    [
        {"method": "cgls"},
        {"method": "tv", "weights": "counts"},
        {"method": "sirt", "subsets": 2},
    ],
    ids=lambda given: given["method"],
)
def test_steps_on_a_volume_larger_than_the_memory_are_done_in_parts(
    tall: Path, tmp_path: Path, given: dict[str, Any]
) -> None:
    common = {"center": 31.5, "format": "h5", "steps": 2, **given}
    whole = rift.reconstruct_scan(tall, tmp_path / "a", **common)
    parts = rift.reconstruct_scan(tall, tmp_path / "b", memory="3.2M", **common)
    assert "in parts" in " ".join(parts.notes) and "in parts" not in " ".join(whole.notes)
    found, wanted = parts.read(), whole.read()
    assert np.abs(found - wanted).max() <= 1e-4 * np.abs(wanted).max()


@pytest.mark.full
def test_a_preview_and_a_plan(
    ball: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert run("reconstruct", ball, "--out", tmp_path / "a", "--dry-run") == 0
    printed = capsys.readouterr().out
    assert "Feldkamp" in printed and not (tmp_path / "a").exists()
    words = ("--center", CENTER, "--out", tmp_path / "a", "--dry-run", "--pitch")
    for pitch, said in ((1, True), (PITCH, False)):
        assert run("reconstruct", ball, *words, pitch) == 0
        assert ("takes the place of 2" in " ".join(capsys.readouterr().out.split())) == said
    assert run("reconstruct", ball, "--out", tmp_path / "a", "--preview", "--quiet") == 0
    assert (tmp_path / "a" / "preview.png").exists() and not (tmp_path / "a" / "slices").exists()


@pytest.mark.parametrize(
    ("options", "word"),
    [
        (("--method", "levels"), "levels"),
        (("--error", "1e-3"), "--error"),
        (("--pad", "on"), "--pad"),
        (("--compensate", "exact"), "--compensate"),
        (("--rows", "3", "90"), "--rows"),
        (("--footprint", "joseph"), "--footprint joseph"),
        (("--size", "90"), "inside"),
        (("--center", "80"), "--center"),
        (("--memory", "300K"), "--binning"),
        (("--method", "cgls", "--preview"), "--preview"),
    ],
)
def test_what_cones_do_not_take(
    ball: Path,
    tmp_path: Path,
    options: tuple[str, ...],
    word: str,
    capsys: pytest.CaptureFixture[str],
) -> None:
    assert run("reconstruct", ball, "--out", tmp_path / "out", *options) == 3
    assert word in capsys.readouterr().err
    assert not (tmp_path / "out" / "slices").exists()


@pytest.mark.parametrize(
    ("views", "center", "radius", "side"),
    [
        (VIEWS, 13.5, 16, "a side"),
        (VIEWS, 21.5, 16, ""),
        (VIEWS, 21.5, 27, "the farther side"),
        (38, 21.5, 16, ""),
    ],
)
def test_an_object_beyond_a_side_is_said_or_refused(
    tmp_path: Path,
    views: int,
    center: float,
    radius: float,
    side: str,
    capsys: pytest.CaptureFixture[str],
) -> None:
    """A part of a turn past a displaced detector leaves lines that no view shows."""
    angles = 2 * np.pi * np.arange(views) / VIEWS
    cone = Cone(angles, 8, BINS, PITCH, R, S, (3.5, center))
    parts = [Ellipsoid.ball(radius, 0.02), Ellipsoid.ball(3.0, 0.02, (0.0, 4.0, -2.0))]
    path, out = tmp_path / "scan.npz", tmp_path / "out"
    lengths = {"source_to_axis": R, "source_to_detector": S, "pitch": PITCH}
    y = project(parts, Grid((2, 2, 2)), cone)
    np.savez(path, projections=y, angles=angles, **lengths)
    options = ("--kind", "attenuation", "--center", center, "--out", out, "--quiet")
    code = run("reconstruct", path, *options)
    if views == VIEWS:
        assert code == 0
        said = " ".join(json.loads((out / "metrics.json").read_text())["assumed"])
        assert ("side of the detector" in said) == bool(side) and side in said
    else:
        assert code == 3 and "beyond a side" in capsys.readouterr().err
        assert not out.exists()
