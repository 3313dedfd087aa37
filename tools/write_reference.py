"""Reference pages of the commands' options and of the public names, for the site in docs.

    python tools/write_reference.py --out docs/reference/generated

The site's build runs it first. Options come from the settings that the command line itself is made
of, so that a page cannot say other than ``--help``; classes and functions come from their
docstrings.
"""

from __future__ import annotations

import sys
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from importlib import import_module
from inspect import cleandoc, isclass
from pathlib import Path
from typing import Annotated, Any, Literal, get_args, get_origin

import tyro

from rift_cl.commands.cli import COMMANDS
from rift_cl.commands.options import ShownOption, shown_options
from rift_cl.option_marks import EXPERT

_ROOT = Path(__file__).parents[1]
# Public modules, with what is read in them; of the others see ``rift_cl.__all__``.
MODULES = {
    "rift_cl.phantom": "objects whose projections are known",
    "rift_cl.metrics": "scores of images and of photographs",
    "rift_cl.basis": "Gaussian, Hermite and Laguerre modes, and functions of direction",
    "rift_cl.reconstruct": "solvers, direct methods and the rotation axis",
    "rift_cl.reconstruct.preprocess": "corrections of projections",
    "rift_cl.train": "the trainer, its settings, losses and strategies",
}


@dataclass(frozen=True)
class Options:
    """Write the reference pages.

    Args:
        out: folder for the pages; those in it are replaced.
    """

    out: Path = _ROOT / "docs" / "reference" / "generated"


def write_reference(folder: Path) -> None:
    """Write a page for each command and for each public module; unchanged pages are not touched."""
    folder.mkdir(parents=True, exist_ok=True)
    pages = {f"{name.replace(' ', '-')}.md": command_page(name) for name in COMMANDS}
    shown: set[int] = set()
    for name, about in {"rift_cl": "what `import rift_cl` gives", **MODULES}.items():
        pages[f"{name}.md"] = module_page(name, _public(name), about, shown)
    for path in folder.glob("*.md"):
        if path.name not in pages:
            path.unlink()
    for name, text in pages.items():
        path = folder / name
        if not path.exists() or path.read_text(encoding="utf-8") != text:
            path.write_text(text, encoding="utf-8", newline="\n")


def command_page(name: str) -> str:
    """A command with all of its options, group by group, as its help lists them."""
    settings = COMMANDS[name].settings_class()
    groups: dict[str, list[ShownOption]] = {}
    about: dict[str, str] = {}
    for option in shown_options(settings):
        groups.setdefault(option.group.title, []).append(option)
        about[option.group.title] = option.group.about
    lines = [f"# rift {name}", "", *_plain(cleandoc(settings.__doc__ or "")), ""]
    for title, options in sorted(groups.items(), key=lambda group: group[0] == EXPERT.title):
        lines += [f"## {title.capitalize()} options", "", about[title], ""]
        lines += [line for option in sorted(options, key=_later) for line in _option(option)]
    return "\n".join(lines).rstrip() + "\n"


def _plain(text: str) -> Iterator[str]:
    """A docstring's paragraphs; its example as a command."""
    for line in text.splitlines():
        start, found, command = line.partition("Example: ")
        if found and not start.strip():
            yield from ("```text", command.strip(), "```")
        else:
            yield line.replace("``", "`")


def _later(option: ShownOption) -> bool:
    """Whether an option is given by its name, and not by its place alone."""
    return "Positional" not in repr(getattr(option.kind, "__metadata__", ()))


def _option(option: ShownOption) -> list[str]:
    positional = not _later(option)
    name = option.name.replace("_", "-")
    shown = name.upper() if positional else f"--{name}"
    values = _values(option.kind)
    default = _default(option.default)
    facts = ". ".join(filter(None, [values, default]))
    return [f"`{shown}`", f": {facts}{'. ' if facts else ''}{_escaped(option.help)}", ""]


def _escaped(text: str) -> str:
    return text.replace("``", "`").replace("<", "\\<").replace("*", "\\*")


def _values(kind: Any) -> str:
    """What an option takes."""
    while get_origin(kind) is Annotated:
        kind = get_args(kind)[0]
    parts = [part for part in get_args(kind) if part is not type(None)]
    if get_origin(kind) is Literal:
        return "One of " + ", ".join(f"`{part}`" for part in get_args(kind))
    if isclass(kind) and get_origin(kind) is None:
        names = {bool: "A switch", int: "A whole number", float: "A number", Path: "A path"}
        return names.get(kind, "A text" if kind is str else "")
    found = list(dict.fromkeys(filter(None, (_values(part) for part in parts if part is not ...))))
    if get_origin(kind) is tuple and found:
        return f"{found[0]}, any number of them" if ... in parts else f"{len(parts)} values"
    return " or ".join([*found[:1], *(each[0].lower() + each[1:] for each in found[1:])])


def _default(value: Any) -> str:
    if value in (None, (), "") or isinstance(value, bool) or "MISSING" in repr(value):
        return ""
    shown = " ".join(map(str, value)) if isinstance(value, tuple) else str(value)
    return f"Default: `{shown}`"


def _public(module: str) -> Sequence[str]:
    found = import_module(module)
    names = getattr(found, "__all__", None) or [
        name
        for name, value in vars(found).items()
        if not name.startswith("_") and getattr(value, "__module__", "").startswith("rift_cl")
    ]
    return sorted(names)


def module_page(module: str, names: Sequence[str], about: str, shown: set[int]) -> str:
    """A page of the docstrings of a module's public names.

    Args:
        module: its name.
        names: what is public in it.
        about: what it is, for the heading.
        shown: what other pages show, which this one leaves out; grows.
    """
    lines = [f"# {module}: {about}", "", "```{eval-rst}"]
    for name in names:
        value = getattr(import_module(module), name)
        if id(value) in shown:
            continue
        shown.add(id(value))
        if isclass(value):
            lines += [f".. autoclass:: {module}.{name}", "   :members:", ""]
        elif callable(value):
            lines += [f".. autofunction:: {module}.{name}", ""]
    return "\n".join([*lines, "```"]) + "\n"


def main() -> int:
    """Run with the command line's arguments; the exit status."""
    write_reference(tyro.cli(Options).out)
    return 0


if __name__ == "__main__":
    sys.exit(main())
