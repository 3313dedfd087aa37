"""The page of promises: what a tool printed last, kept until it runs again."""

from __future__ import annotations

import subprocess


def test_the_page_keeps_figures_and_says_what_was_broken(tool, tmp_path, monkeypatch):
    report = tool("report_reliability")
    first, second, third = report.PROMISES[:3]
    answers = {first.tool: (0, "many\n7 of 7"), second.tool: (1, "6 of 7"), third.tool: (3, "")}

    def run(command, **_):
        (name,) = [name for name in answers if command[1].endswith(name)]
        assert command[3] == "9"
        status, said = answers[name]
        return subprocess.CompletedProcess(command, status, stdout=said)

    assert report.found(first, 9, run) == ("7 of 7", 0)
    assert report.found(second, 9, run) == ("BROKEN: 6 of 7", 1)
    assert report.found(third, 9, run) == ("BROKEN: ended with status 3", 1)
    page = tmp_path / "page.md"
    page.write_text(report.page({first.name: report.Found(first.command(7), "old", "2026-01-01")}))
    monkeypatch.setattr(report, "found", lambda *_: ("new", 0))
    assert report.main(report.Options(page=page, only=second.name, share=0.1)) == 0
    rows = {row[0]: row[1:] for row in report._ROW.findall(page.read_text())}
    assert rows[first.name] == (first.command(7), "old", "2026-01-01")
    assert rows[second.name][:2] == (second.command(second.full // 10), "new")
    assert rows[third.name] == (third.command(third.full), "not run yet", "")


def test_every_promise_has_its_tool(tool):
    report = tool("report_reliability")
    for promise in report.PROMISES:
        assert promise.count[2:] in (report._HERE / promise.tool).read_text()
