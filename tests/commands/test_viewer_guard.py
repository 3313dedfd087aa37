"""Who may look at a viewer, and what pages can do to it: strangers nothing, broken ones nothing."""

from __future__ import annotations

import http.client
from types import SimpleNamespace
from urllib.parse import urlsplit

import numpy as np
import pytest
from viewer_wire import Wire, dialled, told, until

from rift_cl.commands.fit_photos.job import Fit
from rift_cl.commands.fit_photos.settings import FitPhotosSettings
from rift_cl.commands.inputs.scene_bounds import SceneBounds
from rift_cl.commands.view import page as page_module
from rift_cl.commands.view import watched as watched_module
from rift_cl.commands.view.guard import Guard
from rift_cl.commands.view.viewer import SplatViewer
from rift_cl.errors import InputError

pytest.importorskip("viser", reason="viser is not installed")
BOUNDS = SceneBounds(np.zeros(3), 1.0, np.array([0.0, 0, 1]))


@pytest.fixture
def viewer():
    with SplatViewer(BOUNDS, port=0) as viewer:
        yield viewer


def status(url, **headers):
    """What a server answers to a request, its headers as they are given."""
    parts = urlsplit(url)
    connection = http.client.HTTPConnection(parts.hostname, parts.port, timeout=20)
    try:
        connection.request("GET", parts.path or "/", headers=headers)
        answer = connection.getresponse()
        return answer.status, answer.read()
    finally:
        connection.close()


def test_the_page_is_for_those_who_have_its_address_on_this_computer(viewer):
    parts = urlsplit(viewer.url)
    code, page = status(viewer.url)
    assert code == 200 and b"<html" in page
    assert status(viewer.url + "/")[0] == 200
    assert status(viewer.url, Host=f"localhost:{parts.port}")[0] == 200
    bare = f"http://{parts.netloc}"
    for url, headers in (
        (bare, {}),
        (f"{bare}/{'0' * 32}", {}),
        (f"{bare}/?{parts.path[1:]}", {}),
        (viewer.url, {"Host": f"evil.example:{parts.port}"}),
        (viewer.url, {"Host": f"127.0.0.1.evil.example:{parts.port}"}),
        (viewer.url, {"Origin": "http://evil.example"}),
    ):
        code, page = status(url, **headers)
        assert code == 403 and b"<html" not in page and parts.path[1:].encode() not in page


def test_each_server_has_a_token_of_its_own():
    assert Guard().token != Guard().token


def test_foreign_pages_get_no_socket_and_see_nothing(viewer, capfd):
    from websockets.exceptions import InvalidStatus

    parts = urlsplit(viewer.url)
    bare = f"http://{parts.netloc}"
    for url, more in (
        (bare, {}),
        (viewer.url[:-1], {}),
        (viewer.url, {"origin": "http://evil.example"}),
        (viewer.url, {"origin": "null"}),
        (viewer.url, {"origin": None}),
        (viewer.url, {"origin": f"http://127.0.0.1:{parts.port + 1}"}),
    ):
        with pytest.raises(InvalidStatus) as caught:
            dialled(url, **more)
        assert caught.value.response.status_code == 403
    assert not viewer._clients and capfd.readouterr() == ("", "")


def test_messages_without_sense_end_nothing_and_say_nothing(viewer, capfd):
    with dialled(viewer.url) as good:
        good.send(told())
        until(lambda: len(viewer._clients) == 1)
        wrong = [
            told(**changed)
            for changed in (
                {"wxyz": (1.0, 0, 0)},
                {"wxyz": ("a", "b", "c", "d")},
                {"position": ()},
                {"position": ((0, 0), 0, 0)},
                {"fov": "wide"},
                {"image_height": -1},
            )
        ]
        for sent in (*wrong, b"", b"\xc1", "words", told()[:20], b"\x81\xa4type\xa4Fake"):
            with dialled(viewer.url) as bad:
                bad.send(told())
                bad.send(sent)
        good.send(told(position=(0.0, 0, -5)))
        until(lambda: any(c.pose.position[2] == -5 for c in viewer._clients.values()))
    until(lambda: not viewer._clients)
    assert capfd.readouterr() == ("", "")


def test_a_page_that_viser_fails_to_wake_ends_nothing(viewer, monkeypatch):
    def fail(facts):
        raise RuntimeError("deque mutated during iteration")

    monkeypatch.setattr(viewer._page.view, "tell", fail)
    viewer._page.tell("2 splats")


def test_a_viser_that_does_not_ask_the_guard_is_not_used(monkeypatch):
    closed = []

    class Unasked:
        def __init__(self, **_):
            pass

        def get_port(self):
            return 1

        def stop(self):
            closed.append(True)

    monkeypatch.setattr(page_module, "_viser", lambda: SimpleNamespace(ViserServer=Unasked))
    with pytest.raises(InputError, match="cannot be guarded"):
        SplatViewer(BOUNDS, port=0)
    assert closed


class Broken:
    """A viewer that fails as soon as it must draw."""

    url = "http://127.0.0.1:1"
    calls = 0

    def __init__(self, *_, **__):
        pass

    def serve(self, *_, **__):
        Broken.calls += 1
        raise MemoryError("no room for the picture")

    def close(self):
        raise OSError("gone")


def fitted(capture, out, announce=lambda line: None, **more):
    """The bytes of the scene of a short fit."""
    given = {"steps": 30, "splats": 100, "hold_out": 4, "checkpoint_every": 0}
    job = Fit(FitPhotosSettings.of(capture, out, **given, **more))
    job.announce = announce
    list(job.run())
    return (out / "scene.ply").read_bytes()


@pytest.mark.parametrize("opens", [True, False])
@pytest.mark.full
def test_a_fit_whose_viewer_fails_goes_on_to_the_same_bits(capture, tmp_path, monkeypatch, opens):
    def refused(*_, **__):
        raise InputError("port 8080 cannot be had")

    monkeypatch.setattr(watched_module, "SplatViewer", Broken if opens else refused)
    Broken.calls, said = 0, []
    seen = fitted(capture, tmp_path / "seen", said.append, view=True)
    assert seen == fitted(capture, tmp_path / "unseen")
    warnings = [line for line in said if "warning" in line]
    assert len(warnings) == 1 and "cannot be shown" in warnings[0] and "goes on" in warnings[0]
    assert (Broken.calls > 1) is opens


def test_a_fit_that_is_looked_at_draws_and_gives_the_same_bits(capture, tmp_path, monkeypatch):
    made, pages, said = [], [], []

    class Kept(SplatViewer):
        def __init__(self, *given, **more):
            super().__init__(*given, **more)
            made.append(self)

    def look(line):
        # So few steps are doubted as well.
        if not line.startswith("http"):
            return
        said.append(line)
        pages.append(Wire(dialled(line.split()[0])))
        until(lambda: made[0]._clients)
        pages[0].socket.send(told(wxyz=(1.0, 0, 0)))

    monkeypatch.setattr(watched_module, "SplatViewer", Kept)
    seen = fitted(capture, tmp_path / "seen", look, view=True)
    pages[0].wait(lambda m: m["type"] == "BackgroundImageMessage")
    pages[0].wait(lambda m: m["type"] == "CameraFrustumMessage")
    pages[0].socket.close()
    assert len(said) == 1 and "step" in made[0].state
    assert seen == fitted(capture, tmp_path / "unseen")
