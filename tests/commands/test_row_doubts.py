"""Counts whose flats, darks or beam are not those of the scan: slices come out, and a doubt."""

from __future__ import annotations

import re

import h5py
import numpy as np
import pytest

import rift_cl as rift
from rift_cl.commands.cli import main
from rift_cl.commands.inputs.row_doubts import is_full_code, saturation
from rift_cl.io.scans.scan_file import ScanRows

VIEWS, BINS, BEAM, DARK = 120, 96, 20000, 100
ANGLES = np.arange(VIEWS) * np.pi / VIEWS
# From 0 in the first view to 1 in the last.
FALL = np.linspace(0, 1, VIEWS)[:, None, None]


@pytest.fixture(scope="module")
def lines():
    """Line integrals (view, 2 rows, bin), 2 at most, air at both ends."""
    scan = rift.Parallel(ANGLES, BINS)
    found = np.asarray(rift.phantom.shepp_logan_sinogram(rift.Grid((64, 64)), scan))
    return np.repeat(2 * (found / found.max())[:, None], 2, axis=1)


def frames(lines, beam=BEAM):
    random = np.random.default_rng(0)
    return {
        "data": random.poisson(beam * np.exp(-lines)) + DARK,
        "data_white": random.poisson(BEAM, (8, 2, BINS)) + DARK,
        "data_dark": random.poisson(DARK, (8, 2, BINS)),
    }


def said(tmp_path, capsys, made, *more):
    """What is printed of a scan; its slices are made."""
    with h5py.File(tmp_path / "scan.h5", "w") as file:
        for name, values in made.items():
            file[f"exchange/{name}"] = np.clip(values, 0, 65535).astype(np.uint16)
        file["exchange/theta"] = np.rad2deg(ANGLES)
    words = ["reconstruct", str(tmp_path / "scan.h5"), "--out", str(tmp_path / "out"), *more]
    if "--center" not in words:
        words += ["--center", str((BINS - 1) / 2)]
    assert main(words) == 0
    return capsys.readouterr().err


def _dark_views(lines):
    made = frames(lines)
    made["data"][70:90] = np.random.default_rng(1).poisson(DARK, (20, 2, BINS))
    return made


def _zero_views(lines):
    made = frames(lines)
    made["data"][[20, 21, 77]] = 0
    return made


def _open_views(lines):
    made = frames(lines)
    made["data"][5::40] = np.random.default_rng(1).poisson(BEAM, (3, 2, BINS)) + DARK
    return made


def _dark_flats(lines):
    made = frames(lines)
    made["data_white"][:3] = made["data_dark"][:3]
    return made


def _sample_in_flats(lines):
    made = frames(lines)
    return {**made, "data_white": made["data"][:8]}


def _saturated(lines):
    made = frames(lines)
    return {**made, "data": 4 * made["data"], "data_white": 4 * made["data_white"]}


def _upper_bits(lines):
    """Twelve bits, saturated in the brighter half of the beam and stored in the upper twelve."""
    made = frames(lines)
    counts = {name: np.minimum(values / 4, 4095) for name, values in made.items()}
    counts["data_white"][:, :, BINS // 2 :] *= 0.5
    counts["data"][:, :, BINS // 2 :] *= 0.5
    return {name: 16 * values.astype(int) for name, values in counts.items()}


def _clipped(lines):
    """Counts that somebody cut at a number of no meaning."""
    made = frames(lines)
    for name in ("data", "data_white"):
        made[name] = np.minimum(made[name], 19700)
    return made


def _two_flats(lines):
    made = frames(lines)
    made["data_white"][4:] = 0.7 * (made["data_white"][4:]) + 0.3 * DARK
    return made


WRONG = {
    "no beam": (
        _dark_views,
        "20 of 120 views have next to no beam .views 70, 71, 72, 73",
    ),
    "frames of zeros": (_zero_views, "3 of 120 views have next to no beam .views 20, 21, 77"),
    "flats between": (_open_views, "3 of 120 views show next to nothing .* .views 5, 45, 85"),
    "starved": (lambda lines: frames(6 * lines, BEAM), "of row 1 have no signal above"),
    "dark flats": (_dark_flats, "the flats read .* above the darks: some of them"),
    "sample in flats": (_sample_in_flats, "of row 1 is brighter than the open beam"),
    "stronger beam": (lambda lines: frames(lines, 1.6 * BEAM), "brighter than the open beam"),
    "beam that fell": (
        lambda lines: frames(lines, BEAM * (1 - 0.1 * FALL)),
        "the beam fell by (9|10|11)(.[0-9])? % from the first view to the last",
    ),
    "beam that jumped": (
        lambda lines: frames(lines, BEAM * np.where(FALL < 0.5, 1, 0.8)),
        "the beam fell by (19|20|21) % at view 60",
    ),
    "beam that flickered": (
        lambda lines: frames(
            lines, BEAM * (0.9 + 0.1 * np.sin(1e3 * np.arange(VIEWS) ** 2)[:, None, None])
        ),
        "the beam flickered by [78].* % from view to view",
    ),
    "little weaker beam": (lambda lines: frames(lines, 0.95 * BEAM), "ends .* read 0.05"),
    "two flats": (
        _two_flats,
        "the flats read two levels, .* and .* above the darks, and nothing tells when",
    ),
    "weaker beam": (lambda lines: frames(lines, 0.7 * BEAM), "ends of the detector read 0.35"),
    "upper bits": (_upper_bits, "[0-9]+ % of the .* read 65520"),
    "clipped": (_clipped, "[0-9]+ % of the .* read 19700"),
    "saturated": (_saturated, "100 % of the detector's pixels read 65535"),
}


@pytest.mark.parametrize("case", WRONG)
def test_what_is_wrong_with_counts_is_said(lines, tmp_path, capsys, case):
    make, words = WRONG[case]
    assert re.search(f"Doubt: .*{words}", said(tmp_path, capsys, make(lines)))


@pytest.mark.parametrize("scale", [0.2, 1, 2.5])
def test_nothing_is_said_of_counts_that_are_right(lines, tmp_path, capsys, scale):
    assert "Doubt" not in said(tmp_path, capsys, frames(scale * lines))


@pytest.mark.parametrize("flats", ["mean", "air"])
def test_nothing_is_said_of_a_beam_that_the_views_themselves_tell(lines, tmp_path, capsys, flats):
    made = frames(lines)
    del made["data_white"]
    assert "Doubt" not in said(tmp_path, capsys, made, "--flats", flats)


def test_an_object_that_reaches_into_what_is_taken_for_air_is_told(lines, tmp_path, capsys):
    whole = frames(lines)
    cut = {name: whole[name][..., 20:-20] for name in ("data", "data_dark")}
    more = ("--flats", "air", "--center", str((BINS - 41) / 2))
    assert "bins at the two ends of the detector, which the beam is" in said(
        tmp_path, capsys, cut, *more
    )


@pytest.mark.full
def test_the_remedy_that_is_named_ends_the_doubt(lines, tmp_path, capsys):
    weaker = frames(lines, 0.7 * BEAM)
    assert "--background 5 brings it to zero" in said(tmp_path, capsys, weaker)
    assert "Doubt" not in said(tmp_path, capsys, weaker, "--background", "5", "--overwrite")


@pytest.mark.full
def test_air_that_is_off_zero_is_no_object_that_goes_on(lines, tmp_path, capsys):
    fallen = frames(lines, BEAM * (1 - 0.4 * FALL))
    assert "wider than the detector" not in said(tmp_path, capsys, fallen)


def test_an_object_that_reaches_both_ends_is_no_weak_beam(lines, tmp_path, capsys):
    cut = {name: values[..., 30:-30] for name, values in frames(lines).items()}
    told = said(tmp_path, capsys, cut, "--center", str((BINS - 61) / 2))
    assert "wider than the detector" in told and "Doubt" not in told
    assert "a smooth error" in told


@pytest.mark.parametrize("way", ["off", "cut"])
def test_a_background_is_advised_where_ends_of_line_integrals_are_air(lines, tmp_path, capsys, way):
    noisy = lines + np.random.default_rng(0).normal(0, 0.005, lines.shape)
    values = noisy + 0.2 if way == "off" else noisy[..., 30:-30]
    path = tmp_path / "scan.npz"
    np.savez(path, projections=values.astype(np.float32), angles=ANGLES)
    words = ["reconstruct", str(path), "--out", str(tmp_path / "out"), "--kind", "attenuation"]
    assert main([*words, "--center", str((values.shape[-1] - 1) / 2)]) == 0
    told = capsys.readouterr().err
    assert ("--background" in told) == (way == "off")
    assert ("wider than the detector" in told) == (way == "cut")


def test_air_of_line_integrals_changes_by_their_own_unit(lines, tmp_path, capsys):
    noisy = lines + 0.105 * FALL + np.random.default_rng(0).normal(0, 0.001, lines.shape)
    path = tmp_path / "scan.npz"
    np.savez(path, projections=(100 * noisy).astype(np.float32), angles=ANGLES)
    words = ["reconstruct", str(path), "--out", str(tmp_path / "out"), "--kind", "attenuation"]
    assert main([*words, "--center", str((BINS - 1) / 2)]) == 0
    told = capsys.readouterr().err
    assert re.search("Doubt: air changes by 10.[4-6] from the first view to the last", told)
    assert "the beam" not in told


def test_flats_of_two_levels_at_one_time_are_said_to_be_of_one(lines, tmp_path, capsys):
    made = _two_flats(lines)
    with h5py.File(tmp_path / "scan.nxs", "w") as file:
        entry = file.create_group("entry1/tomo_entry")
        stacks = [made[name] for name in ("data_dark", "data_white", "data")]
        entry["instrument/detector/data"] = np.concatenate(stacks).astype(np.uint16)
        entry["instrument/detector/image_key"] = np.repeat([2, 1, 0], (8, 8, VIEWS))
        entry["sample/rotation_angle"] = np.r_[np.zeros(16), np.rad2deg(ANGLES)]
    words = ["reconstruct", str(tmp_path / "scan.nxs"), "--out", str(tmp_path / "out")]
    assert main([*words, "--center", str((BINS - 1) / 2)]) == 0
    told = capsys.readouterr().err
    assert "the flats read two levels" in told and "at one time" in told


@pytest.mark.full
def test_an_axis_that_is_not_found_for_that_is_told_with_it(lines, tmp_path, capsys):
    made = _sample_in_flats(lines)
    with h5py.File(tmp_path / "scan.h5", "w") as file:
        for name, values in made.items():
            file[f"exchange/{name}"] = values.astype(np.uint16)
        file["exchange/theta"] = np.rad2deg(ANGLES)
    main(["reconstruct", str(tmp_path / "scan.h5"), "--out", str(tmp_path / "out")])
    assert "brighter than the open beam" in capsys.readouterr().err


@pytest.mark.full
def test_a_fit_of_xrays_says_what_was_found(lines, tmp_path, capsys):
    made = frames(lines, 1.6 * BEAM)
    with h5py.File(tmp_path / "scan.h5", "w") as file:
        for name, values in made.items():
            file[f"exchange/{name}"] = values.astype(np.uint16)
        file["exchange/theta"] = np.rad2deg(ANGLES)
    fit = ["fit", "xray", str(tmp_path / "scan.h5"), "--out", str(tmp_path / "fit")]
    assert main([*fit, "--steps", "3", "--splats", "20", "--rows", "0", "1"]) == 0
    told = capsys.readouterr().err
    assert "The rotation axis was found at bin" in told and "brighter than the open beam" in told
    page = (tmp_path / "fit" / "report.html").read_text()
    assert "The rotation axis was found at bin" in page


def test_codes_that_detectors_count_to():
    assert all(is_full_code(float(code)) for code in (255, 4095, 65520, 65535, 2**24 - 2**8))
    assert not any(is_full_code(float(code)) for code in (0, 1, 127, 4095.5, 4096, 30100, 32768))


def test_few_photons_and_synthetic_counts_are_not_saturated():
    """Few counts have few values, and noise-free air is bright alike."""
    random = np.random.default_rng(0)
    few = [random.poisson(0.5, (n, 1, 20)).astype(np.float32) for n in (9, 3)]
    air = np.full((40, 1, 20), 30100, np.float32)
    air[:, :, 5:15] = 9000.0
    for projections, flats in (few, (air, air[:3] * 0 + 30100)):
        assert saturation(ScanRows(projections, flats, None)) == []
