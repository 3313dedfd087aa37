"""What the preprocessor leaves of a kernel's source: lines behind conditions, and macros expanded.

A kernel's parameters and the lengths of its buffers depend on the macros that a variant is built
with, and a driver tells neither of a program that it loads. Only what our own kernels use is
understood.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping

_DIRECTIVE = re.compile(r"#\s*(\w+)\s*(.*)")
_DEFINITION = re.compile(r"(\w+)(\([\w\s,]*\))?\s*(.*)")
_WORD = re.compile(r"\b[A-Za-z_]\w*\b")


class Macros:
    """What names stand for.

    Args:
        given: those that a kernel is built with.
    """

    def __init__(self, given: Mapping[str, str]) -> None:
        self._plain = dict(given)
        self._called: dict[str, tuple[list[str], str]] = {}

    def active(self, text: str) -> Iterator[str]:
        """The lines that conditions leave; what they define is known afterwards."""
        # For each open condition: whether this branch is compiled, and whether one was already.
        open_: list[tuple[bool, bool]] = []
        for line in text.replace("\\\n", " ").splitlines():
            found = _DIRECTIVE.match(line)
            active = all(branch for branch, _ in open_)
            if found is None:
                if active:
                    yield line
            elif found[1] in ("if", "ifdef", "ifndef"):
                holds = active and self._holds(found[1], found[2])
                open_.append((holds, holds))
            elif found[1] in ("elif", "else"):
                _, taken = open_.pop()
                outside = all(branch for branch, _ in open_)
                holds = outside and not taken and self._holds(found[1], found[2])
                open_.append((holds, taken or holds))
            elif found[1] == "endif":
                open_.pop()
            elif found[1] == "define" and active:
                self._define(found[2].strip())

    def expanded(self, text: str) -> str:
        """Text with every macro replaced by what it stands for."""
        while True:
            replaced = _replaced(self._calls(text), self._plain)
            if replaced == text:
                return text
            text = replaced

    def _define(self, definition: str) -> None:
        found = _DEFINITION.fullmatch(definition)
        if found is None:
            return
        if found[2] is None:
            self._plain[found[1]] = found[3]
        else:
            names = [name.strip() for name in found[2][1:-1].split(",")]
            self._called[found[1]] = names, found[3]

    def _calls(self, text: str) -> str:
        """Text with the first use of each macro that takes arguments replaced."""
        for name, (wanted, body) in self._called.items():
            found = re.search(rf"\b{name}\s*\(", text) if name in text else None
            if found:
                given, end = _arguments(text, found.end())
                values = dict(zip(wanted, given, strict=True))
                text = text[: found.start()] + _replaced(body, values) + text[end:]
        return text

    def _holds(self, directive: str, condition: str) -> bool:
        """Whether a branch is compiled; conditions have no brackets in our kernels."""
        if directive == "else":
            return True
        if directive in ("ifdef", "ifndef"):
            return (condition.strip() in self._plain) == (directive == "ifdef")
        either = (option.split("&&") for option in condition.split("||"))
        return any(all(self._term(term.strip()) for term in terms) for terms in either)

    def _term(self, term: str) -> bool:
        if term.startswith("!"):
            return not self._number(term[1:])
        match = re.fullmatch(r"(\w+)(?:\s*(==|!=|<=|>=|<|>)\s*(\w+))?", term)
        if match is None:
            raise ValueError(f"a condition reads {term!r}")
        left = self._number(match[1])
        if match[2] is None:
            return left != 0
        right = self._number(match[3])
        return {
            "==": left == right,
            "!=": left != right,
            "<=": left <= right,
            ">=": left >= right,
            "<": left < right,
            ">": left > right,
        }[match[2]]

    def _number(self, name: str) -> int:
        """A whole number, or the one that a name stands for; 0 for a name that is not defined."""
        value = self.expanded(name.strip()).strip()
        return int(value) if value.isdigit() else 0


def _replaced(text: str, values: Mapping[str, str]) -> str:
    """Text with these words replaced by what they stand for."""
    return _WORD.sub(lambda word: values.get(word[0], word[0]), text)


def _arguments(text: str, begin: int) -> tuple[list[str], int]:
    """What stands between brackets, the first of which ends at ``begin``, and where they end."""
    given, depth, last = list[str](), 1, begin
    for at in range(begin, len(text)):
        depth += {"(": 1, ")": -1}.get(text[at], 0)
        if depth == 0 or (depth == 1 and text[at] == ","):
            given.append(text[last:at].strip())
            last = at + 1
        if depth == 0:
            return given, last
    raise ValueError(f"a bracket is open in {text!r}")
