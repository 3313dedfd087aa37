"""The page: well-formed, self-contained, accessible, and deaf to script in any text."""

from __future__ import annotations

import base64
import hashlib
import re
from html.parser import HTMLParser

import numpy as np
import pytest

from rift_cl.errors import InputError, ShapeError
from rift_cl.html_page import Page

PNG = b"\x89PNG\r\n\x1a\n" + bytes(range(40))
ATTACK = '</title></style><script>alert(1)</script><img src=x onerror="f()" \'&amp;'
VOID = {"meta", "img", "link", "br"}


class Reader(HTMLParser):
    """Collects (tag, attributes, text) and insists that every tag is closed in order."""

    def __init__(self) -> None:
        super().__init__()
        self.open: list[str] = []
        self.found: list[list] = []

    def handle_starttag(self, tag, attrs):
        self.found.append([tag, dict(attrs), ""])
        if tag not in VOID:
            self.open.append(tag)

    def handle_endtag(self, tag):
        assert self.open.pop() == tag

    def handle_data(self, data):
        if self.found and self.open and self.found[-1][0] == self.open[-1]:
            self.found[-1][2] += data


def read(page: Page):
    reader = Reader()
    reader.feed(page.html())
    reader.close()
    assert reader.open == []
    return reader.found


def of(found, tag):
    return [entry for entry in found if entry[0] == tag]


def full_page(text: str) -> Page:
    page = Page(text, text)
    page.section(text)
    page.paragraph(text)
    page.code(text)
    page.facts({text: text})
    page.table([text, text], [[text, text]], caption=text)
    page.figure(PNG, caption=text, alt=text)
    return page


def test_no_text_becomes_markup():
    found, harmless = read(full_page(ATTACK)), read(full_page("text"))
    assert [entry[0] for entry in found] == [entry[0] for entry in harmless]
    assert [sorted(entry[1]) for entry in found] == [sorted(entry[1]) for entry in harmless]
    assert of(found, "img")[0][1]["alt"] == ATTACK
    for tag in ("title", "h1", "h2", "code", "dt", "dd", "caption", "th", "td", "figcaption"):
        assert all(entry[2] == ATTACK for entry in of(found, tag)), tag


def test_the_page_is_self_contained():
    text = full_page("text").html()
    assert not re.search(r"https?:|//[a-z]|url\(|@import|<script|<link|<iframe", text)
    found = read(full_page("text"))
    sources = [entry[1]["src"] for entry in found if "src" in entry[1]]
    assert sources == ["data:image/png;base64," + base64.b64encode(PNG).decode()]
    assert not [entry for entry in found if "href" in entry[1]]
    policies = [m[1]["content"] for m in of(found, "meta") if "http-equiv" in m[1]]
    assert policies[0].startswith("default-src 'none'")


def test_the_page_is_accessible_and_adapts():
    found = read(full_page("text"))
    assert of(found, "html")[0][1]["lang"] == "en"
    assert of(found, "meta")[0][1]["charset"] == "utf-8"
    assert len(of(found, "h1")) == 1
    assert [entry[1]["scope"] for entry in of(found, "th")] == ["col", "col", "row"]
    assert of(found, "caption")[0][2] == "text"
    style = of(found, "style")[0][2]
    assert "prefers-color-scheme: dark" in style
    assert "@media print" in style
    assert style.count("{") == style.count("}")


def test_blocks_stand_in_the_order_they_came():
    page = Page("t")
    page.section("one")
    page.paragraph("two")
    page.section("three")
    page.code("four\n  five")
    text = page.html()
    places = [text.index(f">{word}<") for word in ("one", "two", "three", "four\n  five")]
    assert places == sorted(places)
    assert "<header>\n<h1>t</h1>\n</header>" in text


def test_cells_are_formatted():
    values = [3, 12345678, 0.123456, 9999.7, 31415.9, -2.5e-7, np.float32(1.5), np.int64(7)]
    page = Page("t")
    page.table(["value"], [[v] for v in values] + [[None], [True], ["1.0"], [float("nan")]])
    found = [entry[2] for entry in of(read(page), "th")[1:]]
    expected = ["3", "12345678", "0.1235", "10000", "31416", "−2.5e−07", "1.5", "7"]
    assert found == [*expected, "–", "True", "1.0", "nan"]


def test_facts_keep_six_digits():
    page = Page("t")
    page.facts({"centre": 362.7512345, "views": 720})
    assert [entry[2] for entry in of(read(page), "dd")] == ["362.751", "720"]


def test_columns_of_numbers_stand_flush_right():
    page = Page("t")
    columns = ["name", "score", "time", "note", "mixed", "empty"]
    rows = [
        ["FBP", 1.5, "12 ms", "3 views of it", 1, ""],
        ["2", None, "4.1 %", "", "none", ""],
        ["SIRT", float("inf"), "−3e−5×", "", 2, ""],
    ]
    page.table(columns, rows)
    flush = {entry[2] for entry in of(read(page), "th") if entry[1].get("class") == "number"}
    assert flush == {"score", "time"}
    cells = [entry[2] for entry in of(read(page), "td") if entry[1].get("class") == "number"]
    assert cells == ["1.5", "12 ms", "–", "4.1 %", "inf", "−3e−5×"]


def test_a_table_may_be_empty():
    page = Page("t")
    page.table(["a", "b"], [])
    assert [entry[2] for entry in of(read(page), "th")] == ["a", "b"]


def test_characters_that_no_file_may_hold_are_replaced():
    page = full_page("a\x00b\x1b\ud800c\tµ")
    page.html().encode("utf-8")
    assert of(read(page), "h2")[0][2] == "a\ufffdb\ufffd\ufffdc\tµ"


def test_useless_arguments_are_named():
    page = Page("t")
    with pytest.raises(InputError, match="title"):
        Page("  ")
    with pytest.raises(ShapeError, match="columns"):
        page.table([], [])
    with pytest.raises(ShapeError, match=r"rows\[1\] has 1 cells, not 2"):
        page.table(["a", "b"], [[1, 2], [3]])
    with pytest.raises(InputError, match="PNG"):
        page.figure(b"GIF89a", caption="", alt="a picture")
    with pytest.raises(InputError, match="alt"):
        page.figure(PNG, caption="", alt=" ")
    assert page.html() == Page("t").html()


def test_a_slider_is_hidden_until_its_script_runs():
    page = Page("Title")
    png = b"\x89PNG\r\n\x1a\n"
    page.slider([png, png, png], labels=["1 <", "2", "3"], start=1, caption="c", alt="slice")
    text = page.html()
    assert '<figure class="slider" hidden>' in text
    assert text.count(" hidden>") == 3
    assert "slice: 1 &lt;" in text
    script = re.search(r"<script>(.*?)</script>", text, re.DOTALL).group(1)
    digest = base64.b64encode(hashlib.sha256(script.encode()).digest()).decode()
    assert f"script-src 'sha256-{digest}'" in text
    assert "script" not in Page("Title").html()


@pytest.mark.parametrize(
    "labels, start, alt", [(["1"], 0, "a"), (["1", "2"], 2, "a"), (["1", "2"], 0, " ")]
)
def test_a_slider_without_labels_or_text_is_told(labels, start, alt):
    png = b"\x89PNG\r\n\x1a\n"
    with pytest.raises(InputError, match="slider"):
        Page("Title").slider([png, png], labels=labels, start=start, caption="c", alt=alt)
