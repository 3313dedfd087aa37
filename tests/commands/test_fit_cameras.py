"""A fit knows its cameras: what it wrote is read back, from wherever the fit lies."""

from __future__ import annotations

import json
import shutil
from dataclasses import replace

import numpy as np
import pytest
from test_start import MIDDLE_OF_RING, ring

from rift_cl.commands.cameras.arc import place_notes
from rift_cl.commands.cameras.fit_cameras import open_fit_cameras, save_fit_cameras
from rift_cl.commands.cameras.photograph_place import place_record
from rift_cl.commands.cli import main
from rift_cl.errors import FileFormatError, InputError
from rift_cl.geometry.lens_distortion import LENS_MODELS, Lens
from rift_cl.io.captures.capture import Capture, View, open_capture
from rift_cl.io.images.image import write_png
from rift_cl.io.output import write_json


@pytest.fixture(scope="module")
def fitted(capture, tmp_path_factory):
    out = tmp_path_factory.mktemp("fits") / "fit"
    words = ["--steps", "4", "--splats", "50", "--hold-out", "4", "--quiet"]
    assert main(["fit", str(capture), "--out", str(out), *words]) == 0
    return out


def saved(fit, capture, **facts):
    """What a fit leaves of its cameras, every third held out, without a fit."""
    fit.mkdir()
    seen = [view for k, view in enumerate(capture.views) if k % 3]
    unseen = capture.views[::3]
    write_json(
        fit / "config.json", {"job": "fit photos", "photographs": place_record(capture.views, fit)}
    )
    save_fit_cameras(fit, capture, seen, unseen, **facts)
    return open_fit_cameras(fit)


def views_of(folder, cameras, **more):
    return tuple(
        View(f"{k}.png", camera, folder / f"{k}.png", more.get("mask"), more.get("lens"))
        for k, camera in enumerate(cameras)
    )


@pytest.mark.full
def test_the_cameras_of_a_fit_are_those_of_its_capture(capture, fitted):
    cameras = open_fit_cameras(fitted)
    expected = open_capture(capture).views
    assert [view.name for view in cameras.test_views] == ["0.png", "4.png"]
    assert [view.name for view in cameras.views] == [view.name for view in expected]
    assert cameras.training_views == tuple(view for k, view in enumerate(cameras.views) if k % 4)
    for found, view in zip(cameras.views, expected, strict=True):
        assert found.image == view.image and found.camera.size == view.camera.size
        np.testing.assert_allclose(found.camera.view, view.camera.view, atol=1e-12)
        np.testing.assert_array_equal(found.camera.K, view.camera.K)
    cameras.check_photographs(fitted)
    np.testing.assert_allclose(cameras.focus, MIDDLE_OF_RING, atol=1e-6)
    assert (cameras.placed, cameras.photographs) == (8, 8)
    assert cameras.arc.closed and cameras.reprojection_error is None


@pytest.mark.full
def test_refined_poses_are_those_that_are_kept(capture, fitted, tmp_path):
    words = ["--steps", "20", "--splats", "50", "--hold-out", "4", "--quiet", "--refine-poses"]
    assert main(["fit", str(capture), "--out", str(tmp_path / "fit"), *words]) == 0
    plain, refined = (open_fit_cameras(fit) for fit in (fitted, tmp_path / "fit"))
    for old, new in zip(plain.training_views, refined.training_views, strict=True):
        moved = np.abs(new.camera.view - old.camera.view).max()
        assert 1e-6 < moved < 0.2 and np.array_equal(new.camera.K, old.camera.K)
    for old, new in zip(plain.test_views, refined.test_views, strict=True):
        moved = np.abs(new.camera.view - old.camera.view).max()
        assert 1e-6 < moved < 0.4 and np.array_equal(new.camera.K, old.camera.K)


@pytest.mark.full
def test_held_out_photographs_are_scored_as_fitted_and_as_given(capture, tmp_path, capsys):
    """What the fit prints is what is scored again with the cameras that it keeps."""
    fit, words = tmp_path / "fit", ["--refine-poses", "--refine-exposures", "--hold-out", "4"]
    words += ["--steps", "60", "--splats", "150", "--checkpoint-every", "0"]
    assert main(["fit", str(capture), "--out", str(fit), *words]) == 0
    said = capsys.readouterr()
    assert "as given" in said.out and "Cameras were turned by" in said.err
    metrics = json.loads((fit / "metrics.json").read_text())
    scores = metrics["scores"]["held out"]
    assert scores["fit_psnr"] > scores["given_psnr"]
    assert {*metrics["exposures"]} == {"trained", "held out"}
    assert len(metrics["exposures"]["trained"]) == 6
    assert 0 < metrics["poses"]["turned"]["median"] <= metrics["poses"]["turned"]["largest"]
    assert main(["eval", str(fit), "--out", str(tmp_path / "eval")]) == 0
    again = json.loads((tmp_path / "eval" / "metrics.json").read_text())["scores"]["held out"]
    assert again["fit_psnr"] == pytest.approx(scores["fit_psnr"], abs=1e-3)
    assert again["nearest_psnr"] == pytest.approx(scores["nearest_psnr"], abs=1e-3)


def test_viewers_of_splats_find_the_cameras_as_they_know_them(fitted):
    """INRIA's viewer makes world-to-camera of place and rotation: the same as ours."""
    entries = json.loads((fitted / "cameras.json").read_text())
    cameras = open_fit_cameras(fitted)
    assert [entry["id"] for entry in entries] == list(range(8))
    for entry, view in zip(entries, cameras.views, strict=True):
        pose = np.eye(4)
        pose[:3, :3], pose[:3, 3] = entry["rotation"], entry["position"]
        np.testing.assert_allclose(np.linalg.inv(pose), view.camera.view, atol=1e-12)
        assert (entry["fx"], entry["fy"]) == view.camera.intrinsics[:2]
        assert (entry["width"], entry["height"]) == (80, 60) and entry["img_name"] == view.name


def test_no_file_of_cameras_names_a_folder_of_the_photographer(capture, fitted):
    for name in ("transforms.json", "cameras.json"):
        assert str(capture) not in (fitted / name).read_text()
    assert str(capture) in (fitted / "config.json").read_text()


def test_lenses_masks_and_points_come_back(tmp_path):
    camera = ring(1)[0]
    points = np.random.default_rng(0).uniform(-1, 1, (7, 3)).astype(np.float32)
    colors = (np.arange(21).reshape(7, 3) / 255).astype(np.float32)
    photographs = tmp_path / "there" / "images"
    mask = tmp_path / "there" / "masks" / "one.png"
    for file in (*(photographs / f"{k}.png" for k in range(6)), mask):
        file.parent.mkdir(parents=True, exist_ok=True)
        file.write_bytes(file.name.encode())
    for number, (model, names) in enumerate(LENS_MODELS.items()):
        lens = Lens(model, tuple(0.01 * k for k in range(1, len(names) + 1)), camera.K)
        views = views_of(photographs, ring(6), lens=lens, mask=mask)
        circle = 3.5 if model.endswith("_FISHEYE") else None
        views = tuple(replace(view, crop_radius=circle) for view in views)
        whole = Capture(views, points, colors, tmp_path, 0.75)
        found = saved(tmp_path / f"fit{number}", whole, photographs=9)
        assert all(view.lens == lens for view in found.views), model
        assert all(view.crop_radius == circle for view in found.views), model
        assert all(view.mask.resolve() == mask for view in found.views)
        assert found.views[2].image == photographs / "2.png"
        np.testing.assert_array_equal(found.points, points)
        np.testing.assert_allclose(found.reopened.point_colors, colors, atol=1e-7)
        assert (found.placed, found.photographs, found.reprojection_error) == (6, 9, 0.75)


@pytest.mark.full
def test_a_fit_that_moves_with_its_photographs_finds_them(capture, fitted, tmp_path):
    home = tmp_path / "home"
    shutil.copytree(capture, home / "photographs")
    words = ["--steps", "1", "--splats", "9", "--quiet", "--checkpoint-every", "0"]
    assert main(["fit", str(home / "photographs"), "--out", str(home / "fit"), *words]) == 0
    home.rename(tmp_path / "away")
    cameras = open_fit_cameras(tmp_path / "away" / "fit")
    cameras.check_photographs(tmp_path)
    assert cameras.views[0].image.parent == tmp_path / "away" / "photographs"


def test_photographs_that_have_moved_are_asked_for_and_named(capture, tmp_path):
    views = open_capture(capture).views
    (tmp_path / "old").mkdir()
    for view in views:
        shutil.copy(view.image, tmp_path / "old" / view.name)
    moved = views_of(tmp_path / "old", [view.camera for view in views])
    saved(tmp_path / "fit", Capture(moved, None, None, tmp_path))
    (tmp_path / "old").rename(tmp_path / "new")
    cameras = open_fit_cameras(tmp_path / "fit")
    assert len(cameras.views) == 8, "cameras are there without photographs"
    with pytest.raises(InputError, match=r"8 photographs.*moved.*--photographs"):
        cameras.check_photographs(tmp_path / "fit")
    (tmp_path / "there").mkdir()
    (tmp_path / "new").rename(tmp_path / "there" / "images")
    (tmp_path / "new").symlink_to(tmp_path / "there" / "images")
    for place in ("new", "there"):
        found = open_fit_cameras(tmp_path / "fit", photographs=tmp_path / place)
        found.check_photographs(tmp_path / "fit")
    again = open_fit_cameras(tmp_path / "fit", photographs=tmp_path / "new")
    again.check_photographs(tmp_path / "fit")


def test_a_fit_that_somebody_passed_on_leads_to_no_file_of_ours(capture, tmp_path):
    """The folder in its configuration is believed only if it holds the very photographs."""
    views = open_capture(capture).views
    (tmp_path / "private").mkdir()
    for view in views:
        shutil.copy(view.image, tmp_path / "private" / view.name)
    private = views_of(tmp_path / "private", [view.camera for view in views])
    there = saved(tmp_path / "fit", Capture(private, None, None, tmp_path))
    assert there.views[0].image == tmp_path / "private" / "0.png"
    known = {f"{k}.png": (tmp_path / "private" / f"{k}.png").stat().st_size for k in range(7)}
    for change in ({"bytes": known}, {"bytes": known | {"7.png": 9}}, {"bytes": 3}, {"bytes": {}}):
        record = json.loads((tmp_path / "fit" / "config.json").read_text())
        record["photographs"] |= change
        write_json(tmp_path / "fit" / "config.json", record)
        cameras = open_fit_cameras(tmp_path / "fit")
        assert all(v.image.is_relative_to(tmp_path / "fit") for v in cameras.views)
        with pytest.raises(InputError, match="no longer"):
            cameras.check_photographs(tmp_path / "fit")


def test_photographs_may_be_put_into_the_fit(capture, fitted, tmp_path):
    shutil.copytree(fitted, tmp_path / "fit")
    config = json.loads((tmp_path / "fit" / "config.json").read_text())
    del config["photographs"]
    write_json(tmp_path / "fit" / "config.json", config)
    shutil.copytree(capture, tmp_path / "fit" / "photographs")
    cameras = open_fit_cameras(tmp_path / "fit")
    cameras.check_photographs(tmp_path / "fit")
    assert cameras.views[0].image == tmp_path / "fit" / "photographs" / "0.png"


def test_an_older_fit_and_other_folders_have_none(fitted, tmp_path):
    shutil.copytree(fitted, tmp_path / "old")
    (tmp_path / "old" / "transforms.json").unlink()
    assert open_fit_cameras(tmp_path / "old") is None
    assert open_fit_cameras(tmp_path) is None
    shutil.copytree(fitted, tmp_path / "render")
    write_json(tmp_path / "render" / "config.json", {"job": "render"})
    assert open_fit_cameras(tmp_path / "render") is None


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"up": [0, 0, 0]}, "'up' is no direction"),
        ({"up": [1.7e308, 1.7e308, 1.7e308]}, r"transforms.json: capture: 'up' is no direction"),
        ({"focus": [1e200, 0, 0]}, r"transforms.json: capture: 'focus' is farther off than 1e\+15"),
        ({"up": [0, 1]}, "'up'"),
        ({"focus": ["x", 0, 0]}, "wanted a number"),
        ({"focus": None}, "'focus'"),
    ],
)
def test_a_damaged_file_of_cameras_is_named(fitted, tmp_path, change, words):
    fit = tmp_path / "fit"
    shutil.copytree(fitted, fit)
    record = json.loads((fit / "transforms.json").read_text())
    record["capture"] |= change
    (fit / "transforms.json").write_text(json.dumps(record))
    with pytest.raises(FileFormatError, match=words):
        open_fit_cameras(fit)


def test_a_long_way_up_is_a_direction(fitted, tmp_path):
    fit = tmp_path / "fit"
    shutil.copytree(fitted, fit)
    record = json.loads((fit / "transforms.json").read_text())
    record["capture"]["up"] = [0, 1e200, 0]
    (fit / "transforms.json").write_text(json.dumps(record))
    assert open_fit_cameras(fit).up.tolist() == [0, 1, 0]


def test_cameras_in_one_place_tell_no_depth_and_nothing_is_written(capture, tmp_path, capsys):
    place = tmp_path / "photographs"
    shutil.copytree(capture, place)
    record = json.loads((place / "transforms.json").read_text())
    for frame in record["frames"]:
        for row, value in zip(frame["transform_matrix"], (1.0, 2.0, 3.0, 1.0), strict=True):
            row[3] = value
    (place / "transforms.json").write_text(json.dumps(record))
    assert main(["fit", str(place), "--out", str(tmp_path / "fit")]) == 3
    assert "all 8 cameras stand in one place" in capsys.readouterr().err
    assert not (tmp_path / "fit").exists()


@pytest.mark.full
def test_a_single_photograph_is_told_to_tell_no_depth(capture, tmp_path, capsys):
    place = tmp_path / "photograph"
    shutil.copytree(capture, place)
    record = json.loads((place / "transforms.json").read_text())
    record["frames"] = record["frames"][:1]
    (place / "transforms.json").write_text(json.dumps(record))
    assert main(["fit", str(place), "--out", str(tmp_path / "fit"), "--dry-run"]) == 0
    assert "tells nothing of depth" in " ".join(capsys.readouterr().out.split())
    assert not place_notes(ring(2)) and not place_notes([])


@pytest.mark.full
def test_a_fit_that_is_refused_before_it_begins_leaves_no_folder(capture, tmp_path, capsys):
    """Cameras that look outward, without points: that is found when the work begins."""
    place, out = tmp_path / "photographs", tmp_path / "fit"
    shutil.copytree(capture, place)
    record = json.loads((place / "transforms.json").read_text())
    for number, frame in enumerate(record["frames"]):
        turn = 2 * np.pi * number / 8
        outward = np.array([np.cos(turn), np.sin(turn), 0])
        right = np.array([-np.sin(turn), np.cos(turn), 0])
        pose = np.eye(4)
        pose[:3] = np.stack([right, [0, 0, 1], -outward, 0.1 * outward], axis=1)
        pose[:3, 0] *= np.sign(np.linalg.det(pose[:3, :3]))
        frame["transform_matrix"] = pose.tolist()
        image = np.random.default_rng(number).integers(0, 256, (60, 80, 3)).astype(np.uint8)
        write_png(place / frame["file_path"], image)
    (place / "transforms.json").write_text(json.dumps(record))
    assert main(["fit", str(place), "--out", str(out), "--steps", "2", "--quiet"]) == 3
    refused = capsys.readouterr().err
    assert refused.count("\n") == 1 and not out.exists()
    words = ["--steps", "2", "--splats", "50", "--quiet"]
    assert main(["fit", str(capture), "--out", str(out), *words]) == 0


def test_the_arc_is_what_the_cameras_covered(tmp_path):
    """Eleven cameras over 100 degrees of a ring, by the angles that the ring was made of."""
    part = ring(36)[:11]
    found = saved(tmp_path / "fit", Capture(views_of(tmp_path, part), None, None, tmp_path))
    arc = found.arc
    np.testing.assert_allclose(arc.azimuth, (-50, 50), atol=0.5)
    assert not arc.closed
    way = part[5].center - found.focus
    flat = way - (way @ found.up) * found.up
    np.testing.assert_allclose(arc.front, flat / np.linalg.norm(flat), atol=1e-6)
    assert arc.distances[0] <= arc.distances[1] <= arc.distances[2]
