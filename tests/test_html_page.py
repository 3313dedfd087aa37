"""The page: well-formed, self-contained, accessible, and deaf to script in any text."""

from __future__ import annotations

import base64
import hashlib
import io
import re
import shutil
import subprocess
from html.parser import HTMLParser

import numpy as np
import pytest
from PIL import Image

from rift_cl.errors import InputError, ShapeError
from rift_cl.report.html_page import Compared, Page


def picture(kind="PNG", size=(6, 4)):
    buffer = io.BytesIO()
    Image.new("RGB", size, "red").save(buffer, format=kind)
    return buffer.getvalue()


CHROMIUM = shutil.which("chromium") or shutil.which("chromium-browser")
PNG, JPEG = picture(), picture("JPEG")
SVG = b'<svg width="300" height="200" viewBox="0 0 3 2"><path d="M0 0"/></svg>'
ATTACK = '</title></style><script>alert(1)</script><img src=x onerror="f()" \'&amp;'
VOID = {"meta", "img", "link", "br", "input", "source"}


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
    with page.folded(text):
        page.paragraph(text)
    page.figure(PNG, caption=text, alt=text)
    page.panels([JPEG, Compared(PNG, PNG, (text, text))], titles=[text] * 2, columns=2,
                caption=text, alt=text)  # fmt: skip
    page.slider([PNG, JPEG], labels=[text] * 2, start=1, caption=text, alt=text)
    return page


def test_no_text_becomes_markup():
    found, harmless = read(full_page(ATTACK)), read(full_page("text"))
    assert [entry[0] for entry in found] == [entry[0] for entry in harmless]
    assert [sorted(entry[1]) for entry in found] == [sorted(entry[1]) for entry in harmless]
    assert of(found, "img")[0][1]["alt"] == ATTACK
    texts = ("title", "h1", "h2", "code", "dt", "dd", "caption", "th", "td", "figcaption")
    for tag in (*texts, "summary", "output", "span"):
        assert all(entry[2] == ATTACK for entry in of(found, tag)), tag


def test_the_page_is_self_contained():
    text = full_page("text").html()
    markup = re.sub(r"base64,[^\"]*", "", text)
    assert not re.search(r"https?:|//[a-z]|url\(|@import|<link|<iframe| on[a-z]+=", markup)
    found = read(full_page("text"))
    sources = [entry[1]["src"] for entry in found if "src" in entry[1]]
    assert sources[0] == "data:image/png;base64," + base64.b64encode(PNG).decode()
    assert all(re.match(r"data:image/(png|jpeg);base64,", source) for source in sources)
    assert not [entry for entry in found if "href" in entry[1]]
    policies = [m[1]["content"] for m in of(found, "meta") if "http-equiv" in m[1]]
    assert policies[0].startswith("default-src 'none'")


def test_the_only_script_is_the_one_that_the_policy_names():
    text = full_page("text").html()
    (script,) = re.findall(r"<script>(.*?)</script>", text, re.DOTALL)
    digest = base64.b64encode(hashlib.sha256(script.encode()).digest()).decode()
    assert f"script-src 'sha256-{digest}'\"" in text
    assert "script" not in Page("Title").html()


def test_every_picture_is_enlarged_by_a_checkbox_of_its_own():
    found = read(full_page("text"))
    boxes = [e[1] for e in of(found, "input") if e[1]["type"] == "checkbox"]
    names = [box["id"] for box in boxes]
    assert len(names) == len(set(names)) == 4
    assert sorted(e[1]["for"] for e in of(found, "label") if "for" in e[1]) == sorted(names)
    assert all(box["aria-label"].startswith("Enlarge: text") for box in boxes)
    assert all(entry[1]["alt"] for entry in of(found, "img"))


def test_a_drawing_for_narrow_pages_stands_beside_that_for_wide_ones():
    page = Page("t")
    page.figure((SVG, SVG), caption="c", alt="a")
    found = read(page)
    assert of(found, "source")[0][1]["srcset"].startswith("data:image/svg+xml;base64,")
    assert (of(found, "img")[0][1]["width"], of(found, "img")[0][1]["height"]) == ("300", "200")


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
    with pytest.raises(ShapeError, match=r"rows\[1\] has 1 cells"):
        page.table(["a", "b"], [[1, 2], [3]])
    with pytest.raises(InputError, match="PNG"):
        page.figure(b"GIF89a", caption="", alt="a picture")
    with pytest.raises(InputError, match="no complete PNG"):
        page.figure(PNG[:20], caption="", alt="a picture")
    with pytest.raises(InputError, match="panels"):
        page.panels([PNG], titles=[], columns=1, caption="", alt="a")
    with pytest.raises(InputError, match="alt"):
        page.figure(PNG, caption="", alt=" ")
    assert "<figure" not in page.html()


def test_a_slider_begins_where_it_is_told():
    page = Page("Title")
    page.slider([PNG, JPEG, PNG], labels=["1 <", "2", "3"], start=1, caption="c", alt="slice")
    found = read(page)
    assert [e[1].get("class", "") for e in of(found, "img")] == ["coarse", "shown coarse", "coarse"]
    assert [e[1]["data-label"] for e in of(found, "img")] == ["1 <", "2", "3"]
    assert of(found, "output")[0][2] == "2"
    (choice,) = [e[1] for e in of(found, "input") if e[1]["type"] == "range"]
    assert (choice["min"], choice["max"], choice["value"]) == ("0", "2", "1")
    assert "slice: 1 &lt;" in page.html()


@pytest.mark.parametrize(
    "labels, start, alt", [(["1"], 0, "a"), (["1", "2"], 2, "a"), (["1", "2"], 0, " ")]
)
def test_a_slider_without_labels_or_text_is_told(labels, start, alt):
    with pytest.raises(InputError, match=r"slider|alt"):
        Page("Title").slider([PNG, PNG], labels=labels, start=start, caption="c", alt=alt)


@pytest.mark.skipif(CHROMIUM is None, reason="there is no chromium to look with")
def test_a_browser_lets_the_script_run_under_the_policy(tmp_path):
    path = tmp_path / "page.html"
    path.write_text(full_page(ATTACK).html(), encoding="utf-8")
    command = [CHROMIUM, "--headless=new", "--no-sandbox", "--disable-gpu", "--no-first-run"]
    command += [f"--user-data-dir={tmp_path / 'profile'}", "--dump-dom", path.as_uri()]
    found = subprocess.run(command, capture_output=True, text=True, timeout=120, check=True)
    assert '<html lang="en" class="live">' in found.stdout
