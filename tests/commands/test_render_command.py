"""``rift render``: an orbit or a path of a small scene, colours, depth, and what is refused."""

from __future__ import annotations

import json

import numpy as np
import pytest
from PIL import Image
from test_start import ring

import rift_cl as rift
from rift_cl.commands.cli import main
from rift_cl.io.captures.capture import open_capture
from rift_cl.io.captures.transforms_record import transforms_of
from rift_cl.io.images.image import read_image, write_png
from rift_cl.io.output import write_json
from rift_cl.io.scenes.splat_scene import SplatScene
from rift_cl.splat.renderer import Renderer
from rift_cl.splat.settings import SplatSettings

MIDDLE = np.array([0.3, -0.2, 0.1])


@pytest.fixture(scope="module")
def scene(tmp_path_factory):
    """A red, nearly opaque ball of splats round the point that ``ring`` looks at."""
    random = np.random.default_rng(0)
    ways = random.normal(size=(300, 3))
    means = MIDDLE + 0.5 * ways / np.linalg.norm(ways, axis=1)[:, None]
    path = tmp_path_factory.mktemp("scene") / "ball.ply"
    SplatScene(
        means=means,
        log_scales=np.full((300, 3), np.log(0.1)),
        quats=np.tile([1.0, 0, 0, 0], (300, 1)),
        logit_opacities=np.full(300, 5.0),
        sh=np.tile((np.array([0.9, 0.1, 0.1]) - 0.5) / 0.28209479177387814, (300, 1, 1)),
    ).save(path)
    return path


@pytest.fixture(scope="module")
def capture(tmp_path_factory):
    """Four cameras that look at the ball, their photographs black."""
    folder = tmp_path_factory.mktemp("capture")
    names = [f"{k}.png" for k in range(4)]
    for name in names:
        write_png(folder / name, np.zeros((60, 80, 3)))
    write_json(folder / "transforms.json", transforms_of(ring(4), names))
    return folder


def render(scene, out, *more):
    return main(["render", str(scene), "--out", str(out), "--quiet", *map(str, more)])


def small(*more):
    return ("--frames", 3, "--size", 48, 32, *more)


def test_an_orbit_leaves_frames_cameras_an_animation_and_a_report(scene, tmp_path, capsys):
    out = tmp_path / "film"
    assert render(scene, out, *small("--background", 0, 0, 1, "--film", "apng")) == 0
    assert "animation.png" in capsys.readouterr().out
    assert sorted(p.name for p in (out / "frames").iterdir()) == [f"{k:04}.png" for k in range(3)]
    for path in (out / "frames").iterdir():
        image = read_image(path)
        assert image.shape == (32, 48, 3)
        np.testing.assert_allclose(image[16, 24], (0.9, 0.1, 0.1), atol=0.03)
        np.testing.assert_allclose(image[0, 0], (0, 0, 1), atol=0.01)
    with Image.open(out / "animation.png") as moving:
        assert (moving.n_frames, moving.size) == (3, (48, 32))
    page = (out / "report.html").read_text()
    assert page.count("<img") == 1 + 3 and "ball.ply" in page
    metrics = json.loads((out / "metrics.json").read_text())
    np.testing.assert_allclose(metrics["center"], MIDDLE, atol=0.15)
    assert not (out / "depth").exists() and metrics["depth_window"] is None


def test_the_cameras_that_are_written_draw_the_same_frames(scene, tmp_path):
    assert render(scene, tmp_path / "film", *small()) == 0
    assert render(scene, tmp_path / "again", "--path", tmp_path / "film") == 0
    views = open_capture(tmp_path / "film").views
    assert [view.name for view in views] == [f"frames/{k:04}.png" for k in range(3)]
    for view in views:
        first, second = (read_image(tmp_path / d / view.name) for d in ("film", "again"))
        # Poses go through text; a code may fall to the other side.
        assert np.abs(first - second).max() < 1.5 / 255


def test_depth_is_that_of_the_renderer_in_scene_units(scene, tmp_path):
    assert render(scene, tmp_path / "film", *small("--depth", "--eps2d", 0.2)) == 0
    device = rift.default_device()
    renderer = Renderer(SplatSettings(eps2d=0.2), device=device)
    splats = SplatScene.load(scene).upload(device)
    for number, view in enumerate(open_capture(tmp_path / "film").views):
        depth = read_image(tmp_path / "film" / "depth" / f"{number:04}.exr")
        frame = renderer.forward(splats, view.camera, depth="expected")
        seen = device.get(frame.transmittance) < 0.9
        np.testing.assert_allclose(depth[seen], device.get(frame.image)[..., 3][seen], rtol=1e-4)
        distance = np.linalg.norm(view.camera.center - MIDDLE)
        assert distance - 0.8 < depth[16, 24] < distance
        assert depth[0, 0] == 0
        picture = read_image(tmp_path / "film" / "depth" / f"{number:04}.png")
        assert picture.shape == (32, 48, 3) and picture[16, 24].sum() > 0.5


def test_normals_are_the_shortest_axes_on_the_side_that_is_seen(tmp_path):
    """A flat splat, turned: all of its pixels have its normal, from both sides."""
    normal = np.array([0.6, 0.0, 0.8])
    half = np.arccos(normal[2]) / 2
    flat = SplatScene(
        means=np.zeros((1, 3)),
        log_scales=np.log([[0.5, 0.5, 0.01]]),
        quats=[[np.cos(half), 0, np.sin(half), 0]],
        logit_opacities=[4.0],
        sh=np.zeros((1, 1, 3)),
    )
    flat.save(tmp_path / "flat.ply")
    out = tmp_path / "film"
    assert render(tmp_path / "flat.ply", out, *small("--normals", "--depth")) == 0
    views, sides = open_capture(out).views, []
    for number, view in enumerate(views):
        found = read_image(out / "normals" / f"{number:04}.exr")
        side = np.sign(view.camera.center @ normal)
        sides.append(side)
        np.testing.assert_allclose(found[16, 24], side * normal, atol=1e-5)
        assert (found[0, 0] == 0).all()
        picture = read_image(out / "normals" / f"{number:04}.png")
        shares = picture[16, 24] / picture[16, 24].sum()
        np.testing.assert_allclose(
            shares, (side * normal + 1) / (side * normal + 1).sum(), atol=0.03
        )
    assert set(sides) == {-1, 1}
    page = (out / "report.html").read_text()
    assert page.count("<img") == 1 + 3 * 3 and "normals" in page


def test_a_capture_gives_the_orbit_its_distance_and_elevation(scene, tmp_path):
    cameras = ring(5)
    names = [f"{k}.png" for k in range(len(cameras))]
    write_json(tmp_path / "transforms.json", transforms_of(cameras, names))
    assert render(scene, tmp_path / "film", *small("--capture", tmp_path)) == 0
    for view in open_capture(tmp_path / "film").views:
        way = view.camera.center - MIDDLE
        assert np.linalg.norm(way) == pytest.approx(5 * np.hypot(1, 0.3), rel=1e-6)
        assert way[2] == pytest.approx(1.5, rel=1e-6)


def test_a_path_has_frames_between_its_views(scene, capture, tmp_path):
    assert render(scene, tmp_path / "film", "--path", capture, "--between", 2) == 0
    cameras = [view.camera for view in open_capture(tmp_path / "film").views]
    assert len(cameras) == 4 + 3 * 2 and cameras[0].size == (60, 80)
    for number, camera in enumerate(ring(4)):
        np.testing.assert_allclose(cameras[3 * number].view, camera.view, atol=1e-9)
    assert render(scene, tmp_path / "small", "--path", capture, "--size", 16, 12) == 0
    assert read_image(tmp_path / "small" / "frames" / "0003.png").shape == (12, 16, 3)


def test_doubts_of_a_path_are_told(scene, capture, tmp_path, capsys):
    record = json.loads((capture / "transforms.json").read_text())
    record["frames"][1]["cx"] = 2.0
    turned = np.array(record["frames"][2]["transform_matrix"]) @ np.diag([1, -1, -1, 1])
    record["frames"][2]["transform_matrix"] = turned.tolist()
    path = tmp_path / "path.json"
    write_json(path, record)
    assert render(scene, tmp_path / "film", "--path", path, "--size", 16, 12) == 0
    told = " ".join(capsys.readouterr().err.split())
    assert "the principal point of 1 of 4 photographs is far from the middle" in told
    assert told.count("no splat is in sight of 1 of 4 views") == 1


def test_lenses_that_distort_are_told_of(scene, capture, tmp_path, capsys):
    assert render(scene, tmp_path / "film", "--path", capture, "--dry-run") == 0
    assert "distort" not in capsys.readouterr().err
    record = json.loads((capture / "transforms.json").read_text()) | {"camera_model": "OPENCV"}
    record["frames"][1]["k1"] = 0.1
    write_json(tmp_path / "transforms.json", record)
    path = tmp_path / "transforms.json"
    assert render(scene, tmp_path / "film", "--path", path, "--dry-run") == 0
    assert "1 of 4 views of --path have a lens that distorts" in capsys.readouterr().err


def test_the_folder_of_a_fit_brings_its_drawing_and_background_along(scene, tmp_path, capsys):
    fit = tmp_path / "fit"
    fit.mkdir()
    SplatScene.load(scene).save(fit / "scene.ply")
    write_json(
        fit / "config.json", {"job": "fit photos", "settings": {"rendering": {"eps2d": 0.05}}}
    )
    write_json(fit / "metrics.json", {"background": [0, 1, 0]})
    assert render(fit, tmp_path / "film", *small()) == 0
    np.testing.assert_allclose(read_image(tmp_path / "film/frames/0000.png")[0, 0], (0, 1, 0))
    assert json.loads((tmp_path / "film/metrics.json").read_text())["eps2d"] == 0.05
    assert render(fit, tmp_path / "none", "--dry-run", "--eps2d", 0.4) == 0
    assert "0.4" in capsys.readouterr().out
    assert not (tmp_path / "none").exists()


@pytest.mark.full
def test_what_an_earlier_rendering_left_is_gone_after_another(scene, tmp_path, capsys):
    assert render(scene, tmp_path / "film", *small("--depth")) == 0
    assert render(scene, tmp_path / "film", *small()) == 5
    assert "--overwrite" in capsys.readouterr().err
    again = ("--frames", 1, "--size", 48, 32, "--overwrite")
    assert render(scene, tmp_path / "film", *again) == 0
    names = {path.name for path in (tmp_path / "film").iterdir()}
    assert not names & {"depth", "animation.png"} and "contact.png" in names
    assert len(list((tmp_path / "film" / "frames").iterdir())) == 1


def test_what_a_rendering_is_made_from_is_not_removed_by_it(scene, tmp_path, capsys):
    """Key frames are changed where a film left them; a film in their place would lose them."""
    film = tmp_path / "film"
    assert render(scene, film, *small()) == 0
    keys = film / "key_frames.json"
    changed = keys.read_text().replace("\n", "\n ")
    keys.write_text(changed)
    for option, read in (("--path", keys), ("--path", film), ("--capture", film)):
        assert render(scene, film, option, read, "--overwrite") == 3
        assert f"{option} {read} lies in --out" in capsys.readouterr().err
    assert keys.read_text() == changed and (film / "frames" / "0002.png").is_file()
    keys.rename(film / "mine.json")
    assert render(scene, film, "--path", film / "mine.json", "--overwrite") == 0
    assert (film / "mine.json").read_text() == changed


def test_a_fit_in_linear_light_is_shown_as_a_display_shows_it(scene, tmp_path):
    for light in ("display", "linear"):
        fit = tmp_path / light
        fit.mkdir()
        SplatScene.load(scene).save(fit / "scene.ply")
        write_json(fit / "config.json", {"job": "fit photos", "settings": {"light": light}})
        assert render(fit, tmp_path / f"{light}.film", *small("--background", 0.5, 0.2, 0)) == 0
    plain, curved = (
        read_image(tmp_path / f"{light}.film" / "frames" / "0001.png")
        for light in ("display", "linear")
    )
    # The background is named in display light, the splats' 0.1 is 0.349 there.
    np.testing.assert_allclose(plain[0, 0], (0.5, 0.2, 0), atol=0.01)
    np.testing.assert_allclose(curved[0, 0], (0.5, 0.2, 0), atol=0.01)
    np.testing.assert_allclose(curved[16, 24], (0.955, 0.349, 0.349), atol=0.02)


@pytest.mark.parametrize(
    ("more", "words"),
    [
        (("--size", 0, 10), "--size is 0 10"),
        (("--frames", 0), "--frames is 0"),
        (("--fov", 180), "--fov is 180"),
        (("--elevation", 90), "--elevation is 90"),
        (("--elevation", "nan"), "--elevation is nan"),
        (("--distance", 0), "--distance is 0"),
        (("--rate", 0), "--rate is 0"),
        (("--up", 0, 0, 0), "--up is 0"),
        (("--background", 0, 0, 2), "--background is 0.0 0.0 2.0"),
        (("--between", 3), "--between"),
        (("--path", "nowhere"), "nowhere"),
        (("--path", "nowhere", "--fov", 50), "--fov"),
        (("--eps2d", -1), "eps2d is -1"),
        (("--capture", "nowhere"), "nowhere"),
        (("--film", "apng", "--frames", 1), "--film apng wants two frames"),
    ],
)
def test_what_makes_no_sense_is_named_and_leaves_nothing(scene, tmp_path, capsys, more, words):
    assert render(scene, tmp_path / "film", *more) == 3
    assert words in capsys.readouterr().err
    assert not (tmp_path / "film").exists()


def test_what_is_no_scene_is_named(tmp_path, capsys):
    (tmp_path / "notes.txt").write_text("no splats")
    for name in ("empty", "slices"):
        (tmp_path / name).mkdir()
    write_json(tmp_path / "slices/config.json", {"job": "reconstruct"})
    for scene, words in (("notes.txt", "no PLY file"), ("empty", "holds no scene.ply"),
                         ("slices", "holds what 'rift reconstruct' made, and no scene.ply"),
                         ("nothing.ply", "no such file")):  # fmt: skip
        assert render(tmp_path / scene, tmp_path / "film") == 3
        assert words in capsys.readouterr().err


@pytest.mark.parametrize(
    ("name", "value", "words"),
    [
        ("config.json", {"job": "fit photos"}, "no settings"),
        ("config.json", {"settings": {"rendering": {"eps2d": "wide"}}}, "wanted a number"),
        ("config.json", {"settings": {"rendering": {"eps2d": -3}}}, "eps2d is -3"),
        ("config.json", {"settings": {"light": "candle"}}, "'candle'"),
        ("metrics.json", {"background": 7}, "no red, green and blue"),
        ("metrics.json", {"background": ["x", 0, 0]}, "'background' is x 0 0"),
    ],
)
def test_a_damaged_folder_of_a_fit_is_named(scene, tmp_path, capsys, name, value, words):
    SplatScene.load(scene).save(tmp_path / "scene.ply")
    write_json(tmp_path / name, value)
    assert render(tmp_path, tmp_path / "film") == 3
    error = capsys.readouterr().err
    assert words in error and "Traceback" not in error
