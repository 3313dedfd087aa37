"""The viewer without a browser: its camera, what it draws when, and what it refuses."""

from __future__ import annotations

import socket
import sys
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from rift_cl.commands.cli import main
from rift_cl.commands.inputs.scene_bounds import SceneBounds
from rift_cl.commands.view import viewer as viewer_module
from rift_cl.commands.view.crop import Crop
from rift_cl.commands.view.pose import Pose
from rift_cl.commands.view.viewer import Pace, SplatViewer
from rift_cl.commands.view.wish import Wish
from rift_cl.errors import InputError
from rift_cl.geometry.pose import look_at
from rift_cl.io.scenes.splat_scene import SplatScene
from rift_cl.splat.renderer import Renderer

BOUNDS = SceneBounds(np.zeros(3), 1.0, np.array([0.0, 0, 1]))
# A camera that looks along -x with z up; columns are right, down, forward in the world.
INWARD = np.array([[0.0, 0, -1], [1, 0, 0], [0, -1, 0]])


def quaternion(matrix):
    from scipy.spatial.transform import Rotation

    x, y, z, w = Rotation.from_matrix(matrix).as_quat()
    return (w, x, y, z)


POSE = Pose(quaternion(INWARD), (4.0, 0.0, 0.0), float(np.radians(40)), 1.5)


def pixel(camera, point):
    local = camera.view[:3, :3] @ point + camera.view[:3, 3]
    fx, fy, cx, cy = camera.intrinsics
    return np.array([fx * local[0] / local[2] + cx, fy * local[1] / local[2] + cy])


def test_known_points_fall_where_the_page_sees_them():
    camera = POSE.camera(300)
    assert camera.size == (200, 300)
    np.testing.assert_allclose(camera.center, (4, 0, 0), atol=1e-12)
    np.testing.assert_allclose(pixel(camera, [0, 0, 0]), (150, 100), atol=1e-9)
    # What is up in the world is up in the picture; +y is to the right of one who looks to -x.
    edge = 4 * np.tan(np.radians(20))
    np.testing.assert_allclose(pixel(camera, [0, 0, edge]), (150, 0), atol=1e-9)
    np.testing.assert_allclose(pixel(camera, [0, edge, 0]), (250, 100), atol=1e-9)
    np.testing.assert_allclose(camera.view, look_at([4, 0, 0], [0, 0, 0], [0, 0, 1]), atol=1e-12)


def test_viser_itself_means_the_same_by_its_quaternions():
    transforms = pytest.importorskip("viser.transforms", reason="viser is not installed")
    random = np.random.default_rng(0)
    for _ in range(5):
        wxyz = random.normal(size=4)
        wxyz /= np.linalg.norm(wxyz)
        position, point = random.normal(size=(2, 3))
        camera = replace(POSE, wxyz=tuple(wxyz), position=tuple(position)).camera(100)
        # P_world = [R | t] p_camera, as viser documents it.
        pose = transforms.SE3.from_rotation_and_translation(transforms.SO3(wxyz), position)
        local = camera.view[:3, :3] @ point + camera.view[:3, 3]
        np.testing.assert_allclose(pose.inverse() @ point, local, atol=1e-9)


@pytest.mark.parametrize(("aspect", "size"), [(0.5, (90, 45)), (1e9, (9, 90)), (0.0, (90, 9))])
def test_any_window_has_a_picture(aspect, size):
    assert replace(POSE, aspect=aspect).camera(90).size == size


@pytest.mark.parametrize(
    "wrong",
    [
        {"fov": 0.0},
        {"fov": float("nan")},
        {"wxyz": (0, 0, 0, 0)},
        {"position": (float("inf"), 0, 0)},
    ],
)
def test_nonsense_from_a_page_is_an_input_error(wrong):
    with pytest.raises(InputError):
        replace(POSE, **wrong).camera(90)


class FakePage:
    """A page that keeps what it is sent."""

    url = "http://127.0.0.1:1"

    def __init__(self, **given):
        self.given, self.wish, self.sent, self.said = given, Wish(edge=120), [], ""

    def watch(self, joined, moved, left):
        self.joined, self.moved, self.left = joined, moved, left

    def show(self, client, picture, quality):
        self.sent.append((client.client_id, picture, quality))

    hands_over = True

    def hand_over(self, client, splats, background):
        splats.visible = True
        self.handed = client.client_id, tuple(background)

    def tell(self, facts):
        self.said = facts

    def close(self):
        self.closed = True


@pytest.fixture
def viewer(monkeypatch):
    monkeypatch.setattr(viewer_module, "ViewerPage", FakePage)
    monkeypatch.setattr(viewer_module.time, "monotonic", lambda: clock[0])
    clock[0] = 100.0
    with SplatViewer(BOUNDS, background=(0, 0, 1)) as viewer:
        yield viewer
    assert viewer._page.closed


clock = [100.0]


@pytest.fixture(scope="module")
def drawn(request):
    import rift_cl as rift

    device = rift.default_device()
    scene = SplatScene(
        means=np.zeros((1, 3)),
        log_scales=np.full((1, 3), np.log(0.3)),
        quats=[[1.0, 0, 0, 0]],
        logit_opacities=[6.0],
        sh=(np.array([[[1.0, 0, 0]]]) - 0.5) / 0.28209479177387814,
    )
    return scene.upload(device), Renderer(device=device)


def client(number=7):
    return SimpleNamespace(client_id=number)


def test_nothing_is_drawn_while_nobody_looks(viewer, drawn):
    assert viewer.serve(*drawn) == 0


def test_a_page_gets_its_picture_once(viewer, drawn):
    viewer._joined(client(), POSE)
    assert viewer.serve(*drawn) == 1
    assert viewer.serve(*drawn) == 0
    [(number, picture, quality)] = viewer._page.sent
    assert number == 7 and picture.shape == (80, 120, 3) and quality > 90
    np.testing.assert_allclose(picture[40, 60], (1, 0, 0), atol=0.02)
    np.testing.assert_allclose(picture[2, 2], (0, 0, 1), atol=0.02)
    assert "1 splats" in viewer._page.said and "120 x 80 pixels" in viewer._page.said


def test_the_page_of_the_viewer_says_what_its_pictures_are_sent_as():
    page = Path(__file__).parents[2] / "docs" / "how-to" / "viewer.md"
    assert f"JPEG of quality {viewer_module._SHARP}" in page.read_text("utf-8")


def test_a_camera_that_moves_gets_less_and_all_when_it_rests(viewer, drawn):
    viewer._joined(client(), POSE)
    viewer.serve(*drawn)
    viewer._pace.pixels = 60_000.0
    viewer._moved(7, replace(POSE, position=(5.0, 0, 0)))
    assert [viewer.serve(*drawn), viewer.serve(*drawn)] == [1, 0]
    assert max(viewer._page.sent[-1][1].shape) < 120
    clock[0] += 1
    assert [viewer.serve(*drawn), viewer.serve(*drawn)] == [1, 0]
    assert viewer._page.sent[-1][1].shape == (80, 120, 3)


def test_a_camera_that_comes_back_to_where_it_rested_gets_its_picture_again(viewer, drawn):
    viewer._joined(client(), POSE)
    viewer.serve(*drawn)
    viewer._pace.pixels = 60_000.0
    viewer._moved(7, replace(POSE, position=(5.0, 0, 0)))
    viewer.serve(*drawn)
    viewer._moved(7, POSE)
    clock[0] += 1
    assert viewer.serve(*drawn) == 1
    assert viewer._page.sent[-1][1].shape == (80, 120, 3)


@pytest.mark.parametrize(
    ("pixels", "width"),
    [(1e9, 960), (576e3 * 20 / 4, 480), (576e3, 480), (576e3 / 4, 240), (1, 96)],
)
def test_moving_pictures_are_half_as_large_at_least_unless_that_took_all_too_long(pixels, width):
    pace = Pace()
    pace.pixels = pixels
    small = pace.edge(replace(POSE, aspect=1.6), 960)
    assert small == pytest.approx(width, rel=0.05)


class Moving:
    """Splats for browsers; keeps what was given to whom."""

    def __init__(self):
        self.given = []

    def give(self, client, crop):
        self.given.append((client.client_id, crop))
        return SimpleNamespace(visible=False)


def test_a_browser_draws_by_itself_while_its_camera_moves(viewer, drawn):
    viewer._moving = moving = Moving()
    viewer._joined(client(), POSE)
    assert viewer.serve(*drawn) == 1 and moving.given == [(7, None)]
    splats = viewer._clients[7].splats[0]
    clock[0] += 1
    viewer._moved(7, replace(POSE, position=(5.0, 0, 0)))
    assert splats.visible and viewer._page.handed == (7, (0, 0, 1))
    assert viewer.serve(*drawn) == 0
    clock[0] += 1
    # The picture is sent first, and the splats go when it is surely seen.
    assert viewer.serve(*drawn) == 1 and splats.visible
    clock[0] += 1
    assert viewer.serve(*drawn) == 0 and not splats.visible
    # A box leaves others outside.
    viewer._page.wish = Wish(edge=120, crop=Crop((0, 0, 0), (1, 1, 1)))
    assert viewer.serve(*drawn) == 1 and moving.given[1:] == [(7, viewer._page.wish.crop)]


def test_a_browser_hands_back_where_its_camera_rested_before(viewer, drawn):
    viewer._moving = Moving()
    viewer._joined(client(), POSE)
    viewer.serve(*drawn)
    viewer._moved(7, replace(POSE, position=(5.0, 0, 0)))
    viewer._moved(7, POSE)
    clock[0] += 1
    assert viewer.serve(*drawn) == 1
    clock[0] += 1
    assert viewer.serve(*drawn) == 0 and not viewer._clients[7].splats[0].visible


def test_a_camera_that_moves_on_while_it_is_drawn_keeps_the_browser_drawing(viewer, drawn):
    viewer._moving = Moving()
    viewer._joined(client(), POSE)
    viewer.serve(*drawn)
    clock[0] += 1
    viewer._moved(7, replace(POSE, position=(5.0, 0, 0)))
    clock[0] += 1
    show = viewer._page.show

    def meanwhile(*given):
        viewer._moved(7, replace(POSE, position=(6.0, 0, 0)))
        show(*given)

    viewer._page.show = meanwhile
    assert viewer.serve(*drawn) == 1
    clock[0] += 0.1
    viewer._moved(7, replace(POSE, position=(7.0, 0, 0)))
    clock[0] += 0.15
    assert viewer.serve(*drawn) == 0 and viewer._clients[7].splats[0].visible


def test_splats_that_change_are_drawn_again(viewer, drawn):
    viewer._joined(client(), POSE)
    viewer._joined(client(8), POSE)
    assert viewer.serve(*drawn, changed=True) == 2
    # A fit is not held up by a page that only waits for the next step.
    assert viewer.serve(*drawn, changed=True) == 0
    for _ in range(2):
        clock[0] += 60
        assert viewer.serve(*drawn, changed=True) == 2
    viewer._left(8)
    clock[0] += 60
    assert viewer.serve(*drawn, changed=True) == 1
    # A page that has gone says no more.
    viewer._moved(8, POSE)
    assert viewer.serve(*drawn) == 0


def test_depth_and_size_are_what_the_panel_says(viewer, drawn):
    viewer._joined(client(), POSE)
    viewer._page.wish = Wish(kind="depth", edge=60)
    assert viewer.serve(*drawn) == 1
    picture = viewer._page.sent[-1][1]
    assert picture.shape == (40, 60, 3)
    # Nothing is as black as nothing.
    assert picture[20, 30].sum() > 0.3 and picture[1, 1].sum() < 0.05


def test_a_page_that_says_nonsense_does_not_end_a_fit(viewer, drawn):
    viewer._joined(client(), replace(POSE, fov=0.0))
    viewer._joined(client(8), POSE)
    assert viewer.serve(*drawn) == 1


@pytest.fixture
def scene_file(tmp_path):
    SplatScene(
        means=np.zeros((1, 3)),
        log_scales=np.zeros((1, 3)),
        quats=[[1.0, 0, 0, 0]],
        logit_opacities=[6.0],
        sh=np.zeros((1, 1, 3)),
    ).save(tmp_path / "one.ply")
    return str(tmp_path / "one.ply")


def test_without_viser_one_sentence_says_what_to_install(scene_file, monkeypatch, capsys):
    monkeypatch.setitem(sys.modules, "viser", None)
    assert main(["view", scene_file, "--port", "0"]) == 3
    error = capsys.readouterr().err
    assert "pip install 'viser>=1.1,<1.2'" in error and len(error.strip().splitlines()) == 1


def test_a_port_in_use_and_numbers_without_sense_are_named(scene_file, capsys):
    pytest.importorskip("viser", reason="viser is not installed")
    with socket.socket() as taken:
        taken.bind(("127.0.0.1", 0))
        taken.listen()
        port = taken.getsockname()[1]
        for more, words in (
            (["--port", str(port)], f"port {port} cannot be had"),
            (["--port", "70000"], "--port is 70000"),
            (["--size", "0"], "--size is 0"),
            (["--up", "0", "0", "0"], "--up is 0.0 0.0 0.0"),
        ):
            assert main(["view", scene_file, *more]) == 3
            assert words in capsys.readouterr().err
