"""The exported page: what is in it, and what a browser shows that opens it from a disk."""

from __future__ import annotations

import re

import numpy as np
import pytest
from browser import CHROMIUM, Page, stop, until

from rift_cl.commands.cli import main
from rift_cl.commands.view.browser_splats import browser_splats, seen_colors
from rift_cl.geometry import Camera
from rift_cl.io.output import write_json
from rift_cl.io.scenes.splat_scene import SplatScene

pytest.importorskip("viser")

C0 = 0.28209479177387814
SIZE, FOCAL = (300, 400), 300.0
# Seconds until the page must show what it should.
PATIENCE = 90


def view_from(distance: float) -> np.ndarray:
    """A camera at -y that looks along y, with z up."""
    view = np.eye(4)
    view[:3, :3] = [[1, 0, 0], [0, 0, -1], [0, 1, 0]]
    view[2, 3] = distance
    return view


@pytest.fixture(scope="module")
def fit(tmp_path_factory):
    """A folder as a fit leaves it: a green splat, and after it a large red one behind it.

    They are not quite round: viser leaves out what is round on the screen.
    """
    folder = tmp_path_factory.mktemp("made") / "statue"
    folder.mkdir()
    colors = np.array([[0.1, 0.9, 0.1], [0.9, 0.1, 0.1]])
    SplatScene(
        means=[[0, -0.5, 0], [0, 0.5, 0]],
        log_scales=np.log([[0.3, 0.29, 0.31], [1.5, 1.4, 1.6]]),
        quats=np.tile([1.0, 0.1, 0.2, 0.3], (2, 1)),
        logit_opacities=[5.0, 5.0],
        sh=((colors - 0.5) / C0)[:, None],
    ).save(folder / "scene.ply")
    write_json(folder / "config.json", {"job": "fit photos", "settings": {"light": "display"}})
    pose = np.linalg.inv(view_from(4.0)) @ np.diag([1, -1, -1, 1.0])
    frame = {"file_path": "photo.png", "split": "train", "transform_matrix": pose}
    lens = {"w": SIZE[1], "h": SIZE[0], "fl_x": FOCAL, "fl_y": FOCAL, "cx": 200, "cy": 150}
    capture = {"up": [0, 0, 1], "focus": [0, 0, 0], "placed": 1, "photographs": 1}
    write_json(folder / "transforms.json", {**lens, "frames": [frame], "capture": capture})
    return folder


@pytest.fixture(scope="module")
def page(fit):
    path = fit.parent / "statue.html"
    assert main(["export", str(fit), "--out", str(path), "--quiet"]) == 0
    return path


def test_the_page_is_whole_repeatable_and_names_no_place(fit, page):
    again = page.with_name("again.html")
    assert main(["export", str(fit), "--out", str(again), "--quiet"]) == 0
    text = page.read_text(encoding="utf-8")
    assert text == again.read_text(encoding="utf-8")
    assert "<title>statue</title>" in text
    assert str(fit.parent) not in text
    policy = re.search(r'Content-Security-Policy" content="([^"]*)"', text)[1]
    assert policy.startswith("default-src 'none'")
    assert not re.search(r"https?:", policy)
    # Nothing is loaded from beside the page or from elsewhere.
    assert not re.search(r"<(?:script|img|iframe)[^>]*\ssrc=|<link[^>]*\shref=['\"](?!data:)", text)


@pytest.mark.skipif(CHROMIUM is None, reason="there is no chromium to look with")
@pytest.mark.timeout(240)
def test_a_browser_shows_the_photographs_view_sorted(page, tmp_path):
    """Green before red, as large as the camera saw it: 4 away, focal length 300 of 300 high."""
    browser = Page(tmp_path / "profile")
    try:
        browser.do("Page.navigate", url=page.as_uri())

        def sorted_picture():
            image = browser.picture(tmp_path)
            if image is None:
                return None
            middle = image[len(image) // 2, image.shape[1] // 2]
            # Splats fade in, and come in the file's order until they are sorted.
            return [image] if middle[1] > 0.8 and middle[0] < 0.3 else None

        (image,) = until(sorted_picture, PATIENCE)
        asked = browser.do(
            "Runtime.evaluate",
            expression="performance.getEntriesByType('resource').map(e => e.name).join(' ')",
        )
    finally:
        stop(browser.process)
    assert re.fullmatch(r"((data|blob):\S*\s?)*", asked["result"]["value"])
    height, width = image.shape[:2]
    green = (image[..., 1] > image[..., 0])[:, width // 2].sum()
    # Red and green are alike where green's alpha is a half: at 1.18 of its standard deviations.
    wanted = 2 * 1.18 * 0.3 / 3.5 * FOCAL / SIZE[0] * height
    assert green == pytest.approx(wanted, rel=0.2)
    beside = image[height // 2, width // 2 - round(wanted)]
    assert beside[0] > 2 * beside[1]


def test_colours_are_those_that_cameras_before_a_splat_see():
    sh = np.zeros((1, 4, 3))
    sh[0, 3] = [-0.8, 0.0, 0.8]  # of -x: red grows where a camera looks along x
    scene = SplatScene([[0, 0, 0]], np.zeros((1, 3)), [[1, 0, 0, 0]], [0.0], sh)
    along_x = np.eye(4)
    along_x[:3, :3] = [[0, -1, 0], [0, 0, -1], [1, 0, 0]]
    along_x[2, 3] = 4.0
    lens = [[FOCAL, 0, 200], [0, FOCAL, 150], [0, 0, 1]]
    before, behind = along_x, along_x.copy()
    behind[2, 3] = -4.0
    seen = seen_colors(scene, [Camera(SIZE, lens, view) for view in (before, behind)])
    np.testing.assert_allclose(seen[0], 0.5 + 0.4886025 * 0.8 * np.array([1, 0, -1]), atol=1e-6)
    nobody = seen_colors(scene, [Camera(SIZE, lens, behind)])
    np.testing.assert_allclose(nobody[0], 0.5)


def test_splats_as_wide_as_the_sky_are_half_floats():
    """Those of stray points grow until they are; viser sends covariances as half floats."""
    wide = np.array([[20.0, 6.0, 6.5], [np.log(250.0), 0.0, 1.0]])
    quats = np.tile([1.0, 0.3, 0.2, 0.1], (2, 1))
    scene = SplatScene(np.zeros((2, 3)), wide, quats, [0.0, 0.0], np.zeros((2, 1, 3)))
    camera = Camera(SIZE, [[FOCAL, 0, 200], [0, FOCAL, 150], [0, 0, 1]], view_from(4.0))
    covariances = browser_splats(scene, [camera], 1.0)["covariances"]
    assert np.isfinite(covariances.astype(np.float16)).all()
    np.testing.assert_allclose(np.linalg.eigvalsh(covariances[1])[-1], 250.0**2, rtol=1e-6)


def test_without_viser_there_is_a_sentence(fit, tmp_path, monkeypatch, capsys):
    monkeypatch.setitem(__import__("sys").modules, "viser", None)
    assert main(["export", str(fit), "--out", str(tmp_path / "p.html")]) == 3
    assert "pip install 'viser>=1.1,<1.2'" in " ".join(capsys.readouterr().err.split())
    assert not any(tmp_path.iterdir())


def test_a_page_that_cannot_be_kept_from_the_network_is_not_written(fit, monkeypatch, capsys):
    monkeypatch.setattr("viser.SceneApi.as_html", lambda *_, **__: "<html><HEAD></HEAD></html>")
    path = fit.parent / "open.html"
    assert main(["export", str(fit), "--out", str(path), "--quiet"]) == 3
    assert "cannot be kept from the network" in capsys.readouterr().err
    assert not path.exists()
