"""What commands say, in the words of the functions that run them: ``theta=FILE`` for a program.

Jobs, readers and solvers name an option as a command line has it, ``--theta FILE``. A caller of
``rift.reconstruct_scan`` gives the same as a keyword, so that is how a sentence has to name it.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from contextlib import contextmanager
from functools import cache
from typing import Any, Literal, get_args, get_origin

from rift_cl.commands.options import shown_options
from rift_cl.errors import RiftError

# Commands of a shell stay as they are: they begin with the program, in quotes or to the end.
_SHELL = re.compile(r"('(?:rift|dask|pip) [^']*'|: rift .*)")
_OPTION = re.compile(r"(?<![\w-])--(no-)?([a-z][a-z0-9-]*(?:\.[a-z][a-z0-9-]*)*)")
# What readers say to both already: ``theta= (--theta)``.
_BOTH = re.compile(r"\b([a-z_]+)= \(--([a-z-]+)\)")
# Values that follow an option: numbers, and what stands for a value in capitals; then texts, those
# that are words by name.
_VALUE = re.compile(
    r" (-?\d+(?:\.\d+)?(?:e[-+]?\d+)?|[A-Z][A-Z0-9_]*(?:\.[a-z0-9]+)?)(?![\w.:/-]*\w)"
)
_TEXT = re.compile(r" ([\w.]+(?:[:,][\w.]+)+|\d+[KMGT]i?B|air|mean|um)(?![\w-])")


@contextmanager
def python_words(*settings: type) -> Iterator[None]:
    """Have errors name options as keywords.

    Args:
        *settings: the classes of the settings of commands that may raise them.
    """
    try:
        yield
    except RiftError as error:
        error.args = tuple(
            in_python(said, *settings) if isinstance(said, str) else said for said in error.args
        )
        raise


def in_python(said: str, *settings: type) -> str:
    """A sentence whose options are keywords: ``overwrite=True`` for ``--overwrite``.

    Args:
        said: the sentence.
        *settings: the classes of the settings whose options it may name; other words that begin
            with two dashes are left as they are.
    """
    if "--" not in said:
        return said
    kinds = _kinds(*settings)
    parts = _SHELL.split(_BOTH.sub(_one_of_both, said))
    return "".join(part if _SHELL.match(part) else _translated(part, kinds) for part in parts)


@cache
def _kinds(*settings: type) -> dict[str, Any]:
    """The types of options by their names in Python; it takes a while to read them."""
    return {each.name: each.kind for some in settings for each in shown_options(some)}


def _one_of_both(said: re.Match[str]) -> str:
    return f"{said[1]}=" if said[1] == said[2].replace("-", "_") else said[0]


def _translated(said: str, kinds: dict[str, Any]) -> str:
    """A piece of a sentence, by the kinds of the options' values."""
    found, done = "", 0
    for option in _OPTION.finditer(said):
        name = option[2].replace("-", "_")
        if name not in kinds:
            continue
        values, end = _values(said, option.end(), kinds[name])
        if _is_switch(kinds[name]):
            values = ["False" if option[1] else "True"]
        given = ", ".join(values) if len(values) < 2 else f"({', '.join(values)})"
        found += said[done : option.start()] + (f"{name}={given}" if values else name)
        done = end
    return found + said[done:]


def _values(said: str, place: int, kind: Any) -> tuple[list[str], int]:
    """The values that follow an option, as Python writes them, and where the last of them ends."""
    choices = "|".join(map(re.escape, sorted(_choices(kind), key=len, reverse=True)))
    choice = re.compile(rf" ({choices})(?![\w-])" if choices else _TEXT).match(said, place)
    if choice:
        return [f'"{choice[1]}"'], choice.end()
    values: list[str] = []
    while value := _VALUE.match(said, place):
        values.append(value[1])
        place = value.end()
    return values, place


def _choices(kind: Any) -> set[str]:
    """The words that an option takes, of whatever its type is made."""
    if get_origin(kind) is Literal:
        return {value for value in get_args(kind) if isinstance(value, str)}
    return {word for part in get_args(kind) for word in _choices(part)}


def _is_switch(kind: Any) -> bool:
    return kind is bool or any(_is_switch(part) for part in get_args(kind))
