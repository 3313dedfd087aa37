"""Jobs through a lens with an opening: render opens one, fit and eval use what the capture says."""

from __future__ import annotations

import json

import numpy as np
import pytest
from test_start import ring

from rift_cl.commands.cameras.camera_path import opened, smooth_path
from rift_cl.commands.cli import main
from rift_cl.errors import InputError
from rift_cl.geometry import Aperture, Camera
from rift_cl.io.captures.capture import open_capture
from rift_cl.io.captures.transforms_record import transforms_of
from rift_cl.io.images.image import read_image, write_png
from rift_cl.io.output import write_json
from rift_cl.io.scenes.splat_scene import SplatScene

MIDDLE = np.array([0.3, -0.2, 0.1])


@pytest.fixture(scope="module")
def scene(tmp_path_factory):
    """A small ball of nearly opaque splats round the point that ``ring`` looks at."""
    ways = np.random.default_rng(0).normal(size=(300, 3))
    path = tmp_path_factory.mktemp("scene") / "ball.ply"
    SplatScene(
        means=MIDDLE + 0.3 * ways / np.linalg.norm(ways, axis=1)[:, None],
        log_scales=np.full((300, 3), np.log(0.05)),
        quats=np.tile([1.0, 0, 0, 0], (300, 1)),
        logit_opacities=np.full(300, 5.0),
        sh=np.full((300, 1, 3), 1.5),
    ).save(path)
    return path


def render(scene, out, *more):
    return main(["render", str(scene), "--out", str(out), "--quiet", *map(str, more)])


def small(*more):
    return ("--frames", 2, "--size", 48, 32, *more)


def fit(capture, out, *more):
    arguments = ["fit", str(capture), "--out", str(out), "--steps", "60", "--splats", "200"]
    return main([*arguments, "--hold-out", "4", "--quiet", *more])


def cameras_of(out):
    return [view.camera for view in open_capture(out).views]


def test_an_orbit_through_an_opening_is_focused_at_the_scenes_middle(scene, tmp_path):
    for name, more in (("sharp", ()), ("open", ("--aperture", 0.3)), ("near", ("--focus", 1.5))):
        wide = ("--aperture", 0.3) if name == "near" else ()
        assert render(scene, tmp_path / name, *small(*more, *wide)) == 0
    sharp, wide, near = (cameras_of(tmp_path / name) for name in ("sharp", "open", "near"))
    assert {camera.aperture for camera in sharp} == {None}
    for camera in wide:
        depth = camera.view[2, :3] @ MIDDLE + camera.view[2, 3]
        assert camera.aperture.radius == 0.3
        assert camera.aperture.focus == pytest.approx(depth, rel=0.05)
    assert {camera.aperture for camera in near} == {Aperture(0.3, 1.5)}
    pictures = [read_image(tmp_path / n / "frames" / "0000.png") for n in ("sharp", "open", "near")]
    steep = [np.abs(np.diff(picture, axis=1)).max() for picture in pictures]
    assert steep[0] >= steep[1] > 1.5 * steep[2], "the edge is soft out of focus"


def test_a_path_keeps_its_openings_and_changes_them_evenly_between(scene, tmp_path):
    cameras = [
        Camera((60, 80), c.K, c.view, aperture=Aperture(radius, 4.0) if radius else None)
        for c, radius in zip(ring(4), (0.1, 0.3, 0.0, 0.0), strict=True)
    ]
    names = [f"{k}.png" for k in range(4)]
    for name in names:
        write_png(tmp_path / name, np.zeros((60, 80, 3)))
    path = tmp_path / "lens.json"
    write_json(path, transforms_of(cameras, names))
    assert render(scene, tmp_path / "out", "--path", path, "--between", 1, "--size", 24, 16) == 0
    found = [camera.aperture for camera in cameras_of(tmp_path / "out")]
    radii = [0.0 if lens is None else round(lens.radius, 9) for lens in found]
    assert radii == [0.1, 0.2, 0.3, 0.15, 0.0, 0.0, 0.0]
    assert render(scene, tmp_path / "bare", "--path", path, "--aperture", 0) == 0
    assert {camera.aperture for camera in cameras_of(tmp_path / "bare")} == {None}


def test_openings_between_two_are_even_in_dioptres():
    a, b = ring(2)
    a = Camera(a.size, a.K, a.view, aperture=Aperture(0.1, 2.0, 1e-3))
    b = Camera(b.size, b.K, b.view, aperture=Aperture(0.2, np.inf))
    middle = smooth_path([a, b], 1)[1].aperture
    assert (middle.radius, middle.focus) == (pytest.approx(0.15), pytest.approx(4.0))
    assert middle.wavelength == pytest.approx(5e-4)


def test_a_middle_behind_the_camera_wants_a_focus():
    camera = ring(1)[0]
    behind = camera.center - 2 * camera.view[2, :3]
    assert opened(camera, None, None, behind) == camera
    assert opened(camera, 0.1, 3.0, behind).aperture == Aperture(0.1, 3.0)
    with pytest.raises(InputError, match="--aperture wants --focus"):
        opened(camera, 0.1, None, behind)


@pytest.mark.parametrize(
    ("more", "words"),
    [
        (("--aperture", -1), "--aperture is -1.0, wanted 0 or a positive number"),
        (("--aperture", "inf"), "--aperture is inf"),
        (("--aperture", 0.1, "--focus", 0), "--focus is 0.0, wanted a positive number"),
        (("--focus", 3), "--aperture"),
        (("--focus", 3, "--aperture", 0), "--aperture"),
    ],
)
def test_an_opening_that_makes_no_sense_is_named(scene, tmp_path, capsys, more, words):
    assert render(scene, tmp_path / "out", *small(*more)) == 3
    assert words in capsys.readouterr().err
    assert not (tmp_path / "out").exists()


@pytest.fixture
def through_lens(capture):
    """The fits' own capture, with a lens that everything is far out of the focus of."""
    record = json.loads((capture / "transforms.json").read_text())
    path = capture / "lens.json"
    path.write_text(json.dumps({**record, "aperture_radius": 0.5, "focus_distance": 1.0}))
    return path


def score(folder):
    metrics = json.loads((folder / "metrics.json").read_text())
    return next(iter(metrics["scores"].values()))["fit_psnr"]


@pytest.mark.full
def test_a_fit_looks_through_the_captures_lens_unless_it_is_told_not_to(through_lens, tmp_path):
    assert fit(through_lens, tmp_path / "lens") == 0
    assert fit(through_lens, tmp_path / "pinhole", "--pinhole") == 0
    # The pictures are sharp: a lens which blurs what it draws cannot explain them.
    assert score(tmp_path / "pinhole") > score(tmp_path / "lens") + 0.3
    plain = through_lens.with_name("transforms.json")
    assert fit(plain, tmp_path / "plain") == 0
    pinhole, same = ((tmp_path / name / "scene.ply").read_bytes() for name in ("pinhole", "plain"))
    assert pinhole == same
    config = json.loads((tmp_path / "pinhole" / "config.json").read_text())
    assert config["settings"]["pinhole"]


@pytest.mark.full
def test_a_fit_that_took_lenses_for_pinholes_is_scored_like_that(through_lens, tmp_path):
    assert fit(through_lens, tmp_path / "fit", "--pinhole", "--test", str(through_lens)) == 0
    arguments = ["eval", str(tmp_path / "fit"), str(through_lens), "--quiet"]
    assert main([*arguments, "--out", str(tmp_path / "scores")]) == 0
    fitted = json.loads((tmp_path / "fit" / "metrics.json").read_text())["scores"]["lens"]
    assert score(tmp_path / "scores") == pytest.approx(fitted["fit_psnr"], abs=0.01)
