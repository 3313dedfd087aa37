"""The tools that make the documentation: pages that run, reference pages, pictures with facts."""

import json
import re
from pathlib import Path

import pytest

from rift_cl.commands.cli import COMMANDS
from rift_cl.commands.options import shown_options

DOCS = Path(__file__).parents[2] / "docs"


def test_blocks_share_names_and_run_where_they_are_told(tool, tmp_path, capsys):
    page = tmp_path / "page.md"
    page.write_text(
        "```python\nfrom pathlib import Path\nPath('made').write_text('x')\nn = 1\n```\n"
        "```text\nrift no-such-command\n```\n```bash\nrift --version  # ours\n```\n"
        "```python\nn += Path('made').exists()\n```\n"
    )
    before = Path.cwd()
    names = tool("run_page").run_page(page, tmp_path / "inside", {"n = 1": "n = 2"})
    assert names["n"] == 3 and Path.cwd() == before
    assert "rift " in capsys.readouterr().out


@pytest.mark.each
@pytest.mark.parametrize("line", ["rift no-such-command", "rm -r made"])
def test_a_command_that_fails_or_is_not_ours_ends_the_page(line, tool, tmp_path, capsys):
    page = tmp_path / "page.md"
    page.write_text(f"\n```bash\n{line}\n```\n")
    with pytest.raises(RuntimeError, match=r"page\.md:3"):
        tool("run_page").run_page(page, tmp_path)


def test_what_is_changed_must_be_there(tool, tmp_path):
    page = tmp_path / "page.md"
    page.write_text("nothing\n")
    with pytest.raises(ValueError, match="--steps 5"):
        list(tool("run_page").blocks(page, {"--steps 5": "--steps 1"}))


def test_the_reference_has_every_option_of_every_command(tool, tmp_path):
    reference = tool("write_reference")
    for name in COMMANDS:
        page = reference.command_page(name)
        for option in shown_options(COMMANDS[name].settings_class()):
            word = option.name.replace("_", "-")
            assert f"`--{word}`\n" in page or f"`{word.upper()}`\n" in page, option.name
    reference.write_reference(tmp_path)
    (tmp_path / "old.md").write_text("a command that is gone")
    reference.write_reference(tmp_path)
    written = "".join(path.read_text() for path in tmp_path.glob("rift_cl*.md"))
    shown = re.findall(r"auto(?:class|function):: (\S+)", written)
    assert not (tmp_path / "old.md").exists()
    assert {"rift_cl.fbp", "rift_cl.Projector", "rift_cl.train.Trainer"} <= set(shown)
    assert len(shown) == len(set(shown))


def test_the_gallery_holds_what_was_printed(tool):
    gallery, drawn = DOCS / "gallery.md", json.loads((DOCS / "pictures/drawn.json").read_text())
    text, pictures = gallery.read_text(), tool("draw_gallery").PICTURES
    assert tool("draw_gallery").with_facts(text, drawn) == text
    assert set(re.findall(r"<!-- drawn: (\S+) -->", text)) <= set(drawn) == set(pictures)
    for name, fact in drawn.items():
        assert fact["commands"] == pictures[name].commands.strip().splitlines(), name


def test_a_page_of_the_paper_gets_tables_and_their_origin(tool, tmp_path, monkeypatch):
    figures = tool("print_paper_page")
    record = {
        "environment": {"device": "a device", "date": "2026-01-02T03:04:05"},
        "result": {"size": 8, "views": []},
    }
    rows = ("views", "PSNR"), [(2, 13.8921)]
    page = tmp_path / "page.md"
    page.write_text("<!-- printed: figure_05 -->\n<!-- end -->\n")
    (tmp_path / "figure_05.json").write_text(json.dumps(record))
    figure = tool("paper.figure_05")
    monkeypatch.setattr(figure, "show", lambda shown, result: shown.table(*rows))
    text = figures.print_page(figures.Options(tmp_path, page, tmp_path))
    assert "| 2 | 13.89 |" in text and "a device, 2026-01-02" in text


def test_the_summary_of_benchmarks_holds_what_their_pages_say(tool, tmp_path):
    summary, text = tool("print_benchmark_summary"), (DOCS / "benchmarks/index.md").read_text()
    assert summary.with_table(text, DOCS / "benchmarks") == text
    for name in ("performance", "training", "defaults"):
        (tmp_path / f"{name}.md").write_text((DOCS / f"benchmarks/{name}.md").read_text())
    slower = "| backward | rift_cl, NumPy | silx | 0.5× | 0.4× |"
    page = (DOCS / "benchmarks/performance.md").read_text()
    page = re.sub(r"^\| backward \| rift_cl, NumPy .*$", slower, page, flags=re.MULTILINE)
    (tmp_path / "performance.md").write_text(page)
    assert "| silx, the fastest of all peers | 0.5 times as fast |" in summary.table(tmp_path)
    (tmp_path / "defaults.md").write_text("on **x** (y, driver z) 2026-01-02T03:04")
    with pytest.raises(ValueError, match=r"defaults\.md"):
        summary.table(tmp_path)
