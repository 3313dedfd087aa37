"""A report by keyboard alone, as wide as a phone: Tab comes to everything, arrows move it."""

from __future__ import annotations

import io

import pytest
from browser import CHROMIUM, opened, until
from PIL import Image

from rift_cl.report.html_page import Compared, Page

pytest.importorskip("websockets")
pytestmark = [
    pytest.mark.full,
    pytest.mark.skipif(CHROMIUM is None, reason="there is no chromium to look with"),
]
# What has the focus: what it is, what it is called and where it shows that it has it.
FOCUS = """(() => {
  const now = document.activeElement;
  const marked = [now, now.nextElementSibling, now.closest(".pair")];
  const outlined = (one) => one && getComputedStyle(one).outlineStyle !== "none";
  return [now.tagName, now.type || "", now.getAttribute("aria-label") || now.textContent,
          now.getAttribute("aria-valuetext"), now.value, marked.some(outlined)];
})()"""


def png():
    buffer = io.BytesIO()
    Image.new("RGB", (6, 4), "red").save(buffer, format="PNG")
    return buffer.getvalue()


def test_every_control_of_a_report_is_reached_named_and_moved(tmp_path):
    page = Page("A report", "in short")
    page.table(["row"], [["1"]], caption="rows")
    with page.folded("settings"):
        page.paragraph("more")
    page.panels([Compared(png(), png(), ("truth", "fit"))], titles=["both"], columns=1,
                caption="two", alt="a pair")  # fmt: skip
    page.slider([png()] * 3, labels=["a", "b", "c"], start=1, caption="three", alt="a slice")
    path = tmp_path / "report.html"
    path.write_text(page.html(), encoding="utf-8")
    with opened(tmp_path / "profile") as tab:
        tab.do("Emulation.setDeviceMetricsOverride", width=390, height=800, deviceScaleFactor=1,
               mobile=False)  # fmt: skip
        tab.do("Page.navigate", url=path.as_uri())
        until(lambda: asked(tab, "document.documentElement.className") == "live", 30)
        assert asked(tab, "document.documentElement.scrollWidth") <= 390
        found = [tabbed(tab) for _ in range(6)]
        assert [each[:2] for each in found] == [
            *(["DIV", ""], ["SUMMARY", ""], ["INPUT", "checkbox"], ["INPUT", "range"]),
            *(["INPUT", "checkbox"], ["INPUT", "range"]),
        ]
        assert all(name.strip() and seen for _, _, name, *_, seen in found)
        assert found[-1][3:5] == ["b", "1"]
        press(tab, "ArrowRight", 39)
        assert asked(tab, FOCUS)[3:5] == ["c", "2"]


def tabbed(tab):
    """What has the focus after a press of Tab."""
    press(tab, "Tab", 9)
    return asked(tab, FOCUS)


def press(tab, key, number):
    for kind in ("keyDown", "keyUp"):
        tab.do("Input.dispatchKeyEvent", type=kind, key=key, code=key, windowsVirtualKeyCode=number)


def asked(tab, expression):
    answer = tab.do("Runtime.evaluate", expression=expression, returnByValue=True)
    return answer.get("result", {}).get("value")
