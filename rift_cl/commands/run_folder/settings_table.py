"""The settings of a run in its report: what was asked for and decided, defaults folded away."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from rift_cl.commands.run_folder.saved_settings import options_of
from rift_cl.report.html_page import Page


def show_settings(page: Page, settings: Any, asked: Any = None) -> None:
    """Add a table of settings to a report.

    Args:
        page: the report.
        settings: those that would repeat the run, a dataclass.
        asked: those that were given, of the same class: what differs was decided by the run. If
            None, nothing was.
    """
    rows: list[tuple[str, str, str]] = []
    defaults: dict[str, str] = {}
    before = {} if asked is None else {option.name: option.value for option in options_of(asked)}
    for option in options_of(settings):
        name, value = option.name.replace("_", "-"), option.value
        given = before.get(option.name, value)
        if _alike(value, given) and _alike(value, option.default):
            defaults[name] = _words(value)
        else:
            source = "asked for" if _alike(value, given) else "decided"
            rows.append((name, _words(value), source))
    page.section("Settings")
    if rows:
        page.table(("setting", "value", "how it was chosen"), rows)
    if defaults:
        with page.folded(f"{len(defaults)} settings at their defaults"):
            page.facts(defaults)


def changed(settings: Any) -> dict[str, Any]:
    """The settings that differ from their defaults, by name."""
    return {
        option.name: option.value
        for option in options_of(settings)
        if option.value != option.default
    }


def _alike(one: Any, other: Any) -> bool:
    """Whether two values mean the same."""
    if isinstance(one, Path) and isinstance(other, Path):
        return one.absolute() == other.absolute()
    if isinstance(one, tuple) and isinstance(other, tuple) and len(one) == len(other):
        return all(map(_alike, one, other))
    return bool(one == other)


def _words(value: Any) -> str:
    if isinstance(value, Path):
        # A report is passed on: whose folder it was stands in config.json alone.
        return value.name or str(value)
    if value is None or value == ():
        return "not given"
    if isinstance(value, bool):
        return "yes" if value else "no"
    if isinstance(value, float):
        return f"{value:g}"
    if isinstance(value, (tuple, list)):
        return ", ".join(_words(entry) for entry in value)
    return str(value)
