"""Texts in the viewer's panels: viser runs the HTML that is in them, so none may get that far."""

from __future__ import annotations

import ast
import html
import json
import re
import string
from pathlib import Path

import numpy as np
import pytest
from viewer_wire import Wire, dialled, told, until

import rift_cl as rift
from rift_cl.commands import view
from rift_cl.commands.inputs.scene_bounds import bounds_of_cameras
from rift_cl.commands.view.markdown import markdown_of
from rift_cl.commands.view.photographs import photographs_of
from rift_cl.commands.view.viewer import SplatViewer
from rift_cl.io.captures.capture import open_capture
from rift_cl.splat.splats import Splats

EVIL = (
    '<img src=x onerror="parent.pwned=1"><b>&lt; *i* _u_ ~~x~~ `c` '
    "[a](javascript:x) ![p](y) # 1. | $"
)


def characters_of(sent):
    """What a page shows of Markdown in which nothing is markup; fails where anything may be."""
    bare = re.sub(r"&#\d+;", "", sent)
    assert not set(bare) & set(string.punctuation), bare
    return html.unescape(sent)


def test_marks_become_references_and_lines_stay_lines():
    assert characters_of(markdown_of(EVIL)) == EVIL
    assert markdown_of("    one\n\n2  two\r\n") == "one  \n  \n2 two"
    # A name of a file that is not UTF-8 is sent all the same.
    assert characters_of(markdown_of("14\udcff.png")) == "14?.png"
    assert characters_of(markdown_of("Größe 数")) == "Größe 数"


def markdown_given(tree):
    """The expressions that a module gives to a Markdown of viser's."""
    for node in ast.walk(tree):
        if isinstance(node, ast.Call) and getattr(node.func, "attr", "") == "add_markdown":
            yield node.args[0]
        if isinstance(node, ast.Assign) and getattr(node.targets[0], "attr", "") == "content":
            yield node.value


def test_every_text_of_a_panel_is_made_by_one_function():
    room = Path(view.__file__).parent
    given = [
        (path.name, expression)
        for path in sorted(room.rglob("*.py"))
        for expression in markdown_given(ast.parse(path.read_text("utf-8")))
    ]
    assert len(given) >= 7
    for name, expression in given:
        empty = isinstance(expression, ast.Constant) and expression.value == ""
        made = isinstance(expression, ast.Call) and expression.func.id == "markdown_of"
        assert empty or made, f"{name}: {ast.unparse(expression)}"


@pytest.fixture(params=["file_path", "file name"])
def shown(request, capture, tmp_path):
    """A viewer of a capture with evil names, in its JSON alone or of folder and files as well."""
    pytest.importorskip("viser", reason="viser is not installed")
    record, folder = json.loads((capture / "transforms.json").read_text()), tmp_path
    if request.param == "file name":
        folder = tmp_path / EVIL
        folder.mkdir()
    for number, frame in enumerate(record["frames"]):
        frame["file_path"] = f"{number}{EVIL}.png"
        if request.param == "file name":
            (folder / frame["file_path"]).write_bytes(b"no picture")
    (folder / "transforms.json").write_text(json.dumps(record))
    photographs = photographs_of(open_capture(folder, photographs=False).views)
    bounds = bounds_of_cameras([photograph.camera for photograph in photographs])
    with SplatViewer(bounds, photographs=photographs, port=0) as viewer:
        yield viewer, photographs


def markdown_sent(page):
    """All that the Markdown of a page has said so far."""
    for message in page.got:
        about = message.get("props") or message.get("updates") or {}
        if "_markdown" in about:
            yield characters_of(about["_markdown"])


def test_names_and_errors_of_a_capture_are_sent_as_text_alone(shown):
    viewer, photographs = shown
    device = rift.default_device()
    given = {"means": [[0.0, 0, 0]], "quats": [[1.0, 0, 0, 0]], "scales": np.ones((1, 3))}
    splats = Splats.upload(device, opacities=[0.5], colors=np.ones((1, 3)), **given)
    with dialled(viewer.url) as socket:
        page = Wire(socket)
        until(lambda: viewer._clients)
        page.press("compare", "wipe")
        until(lambda: viewer._page.wish.comparison == "wipe")
        camera = viewer._page.wish.photograph.camera
        # The photograph cannot be read: the panel says so, and names its path.
        socket.send(told(position=tuple(camera.center.tolist())))
        renderer = rift.Renderer(device=device)
        said = viewer._page.view._facts
        until(lambda: viewer.serve(splats, renderer) >= 0 and "onerror" in said.content)
        page.wait(lambda m: "splats" in str(m) and "onerror" in str(m))
        viewer._page.tell(f"this cannot be drawn: {EVIL}")
        page.wait(lambda m: "cannot be drawn" in str(m))
        texts = list(markdown_sent(page))
    assert {photograph.name for photograph in photographs} & {*texts}
    assert any(EVIL[:30] in text and "splats" in text for text in texts)
    assert f"this cannot be drawn: {EVIL}" in texts
