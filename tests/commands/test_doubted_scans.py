"""What the data contradict is said in a sentence: an axis that was given, angles, a tilt."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import rift_cl as rift
from rift_cl.commands.inputs.scan_axis import tilt_worth_turning, unsure_tilt
from rift_cl.phantom import Ellipsoid
from rift_cl.reconstruct import AxisEstimate

ROWS = 16


def estimate(degrees: float, centers: list[float], errors: list[float]) -> AxisEstimate:
    """Of five rows of sixteen, with the line that was fitted to them."""
    return AxisEstimate(
        center=float(np.mean(centers)),
        interval=(171.0, 171.2),
        tilt=float(np.tan(np.deg2rad(degrees))),
        spread=0.1,
        by="double wedge",
        rows=np.array([1.0, 4, 8, 11, 14]),
        centers=np.array(centers),
        errors=np.array(errors),
        scores=np.zeros((2, 1)),
    )


def test_a_tilt_about_which_rows_scatter_is_told_and_not_turned() -> None:
    """Rows of an upright axis, the angles of which slip by 1.2 degrees after view 60 of 150."""
    slipped = estimate(
        -2.04, [171.32, 171.283, 170.965, 170.948, 170.925], [0.018, 0.019, 0.044, 0.052, 0.053]
    )
    assert slipped.scatter > 2 and not slipped.tilt_is_sure
    assert tilt_worth_turning(slipped, ROWS) == 0
    assert "--tilt -2" in " ".join(unsure_tilt(slipped, ROWS))
    places = slipped.rows - 8
    leaning = replace(slipped, centers=171.1 + slipped.tilt * places + 0.02 * np.cos(9 * places))
    assert leaning.tilt_is_sure and unsure_tilt(leaning, ROWS) == []
    assert tilt_worth_turning(leaning, ROWS) == pytest.approx(-2.04)
    # Rows that scatter more than they should, and still lean for sure.
    scattered = replace(leaning, errors=leaning.errors / 4)
    assert scattered.scatter > 1 and tilt_worth_turning(scattered, ROWS) == pytest.approx(-2.04)


@pytest.fixture(scope="module")
def scans(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Path]:
    """The same balls through parallel rays, a fan and a cone whose axis is at bin 30.3."""
    folder = tmp_path_factory.mktemp("scans")
    balls = [Ellipsoid.ball(12, 0.02, (0, 3, -2)), Ellipsoid.ball(4, 0.05, (0, -9, 6))]
    angles = 2 * np.pi * np.arange(80) / 80
    lengths = {"source_to_axis": 120.0, "source_to_detector": 120.0, "pitch": 1.0}
    written = {}
    for name, distance, rows in (("parallel", 1e7, 6), ("fan", 120.0, 1), ("cone", 120.0, 6)):
        cone = rift.Cone(angles, rows, 64, 1.0, distance, distance, ((rows - 1) / 2, 30.3))
        written[name] = folder / f"{name}.npz"
        views = rift.phantom.project(balls, rift.Grid((2, 2, 2)), cone)
        more = {} if name == "parallel" else lengths
        np.savez(written[name], projections=views, angles=angles, **more)
    return written


@pytest.mark.full
@pytest.mark.parametrize(
    ("beam", "options"),
    [
        ("parallel", {}),
        ("parallel", {"binning": 2}),
        ("parallel", {"rows": (0, 2)}),
        ("fan", {}),
        ("cone", {}),
    ],
)
def test_an_axis_that_the_data_contradict_is_doubted(
    scans: dict[str, Path], tmp_path: Path, beam: str, options: dict[str, object]
) -> None:
    common = {"kind": "attenuation", "size": 8, **options}
    for center, doubted in ((30.3, False), (29.3, True), (33.0, True)):
        made = rift.reconstruct_scan(scans[beam], tmp_path / str(center), center=center, **common)
        told = [note for note in made.notes if f"center={center:g}" in note]
        assert bool(told) == doubted
        assert not doubted or "at bin 30." in told[0]
        assert (
            json.loads((tmp_path / str(center) / "config.json").read_text())["settings"]["center"]
            == center
        )


def test_an_encoder_that_stuck_is_doubted(scans: dict[str, Path], tmp_path: Path) -> None:
    angles = np.rad2deg(np.load(scans["parallel"])["angles"])
    angles[30:50] = angles[30]
    np.savetxt(tmp_path / "theta.txt", angles)
    common = {"kind": "attenuation", "size": 8, "theta": str(tmp_path / "theta.txt")}
    made = rift.reconstruct_scan(scans["parallel"], tmp_path / "a", center=30.3, **common)
    assert "20 views have the angle of another one" in " ".join(made.notes)


@pytest.mark.full
def test_least_squares_that_stop_at_no_noise_say_what_the_data_show(tmp_path: Path) -> None:
    angles, noise = np.pi * np.arange(60) / 60, 0.02
    views = rift.phantom.project(
        [Ellipsoid.ball(14, 0.03, (0, 3, -2))],
        rift.Grid((2, 2, 2)),
        rift.Cone(angles, 1, 48, 1.0, 1e7, 1e7),
    )
    views += noise * np.random.default_rng(0).standard_normal(views.shape).astype(np.float32)
    np.savez(tmp_path / "scan.npz", projections=views, angles=angles)
    common = {"kind": "attenuation", "center": 23.5, "method": "cgls", "steps": 3}
    told = rift.reconstruct_scan(tmp_path / "scan.npz", tmp_path / "a", **common).notes
    (found,) = [note for note in told if "noise=" in note]
    assert float(found.split("noise=")[1].split()[0]) == pytest.approx(noise, rel=0.15)
    told = rift.reconstruct_scan(tmp_path / "scan.npz", tmp_path / "b", noise=noise, **common).notes
    assert not [note for note in told if "noise=" in note]
