"""How long the buffers of a kernel must be, as its source declares it.

A kernel that is given a shorter buffer than it goes through writes into another's memory, in
silence. Callers check what they are given; this holds where one of them does not. The comment that
opens a kernel's file ends with the least shape of each of its buffers, in the kernel's own
arguments and macros::

    Buffers: means[count, 3], image, grad[height, width, CHANNELS], entries[*].

The product of what stands in brackets is how many numbers there are at least (the four of an
``int4`` count). ``along0``, ``along1`` and ``along2`` are the work-items that a launch asks for
along each axis. A star says that it depends on what other buffers hold, which the host does not
know. Lengths are C's expressions of whole numbers.
"""

from __future__ import annotations

import operator
import re
from collections.abc import Callable, Mapping, Sequence
from typing import Any, NamedTuple

from rift_cl.cl.preprocessor import Macros

# What a launch asks for along its axes, and how long one is that it does not have.
AXES = ("along0", "along1", "along2")
_UNKNOWN = "*"
_DECLARED = re.compile(r"\bBuffers:((?:(?!\*/).)*)\*/", re.DOTALL)
_ENTRY = re.compile(r"\s*(\w+(?:\s*,\s*\w+)*)\s*\[([^\]]*)\](?:\s*,|\s*\.\s*$)")
_TOKEN = re.compile(r"\s*(\w+|<<|>>|[<>=!]=|\|\||&&|[-+*/%()<>?:,])")
# Binary operators, by how closely they bind.
_OPERATORS: list[dict[str, Callable[[Any, Any], Any]]] = [
    {"||": lambda a, b: a != 0 or b != 0},
    {"&&": lambda a, b: a != 0 and b != 0},
    {"==": operator.eq, "!=": operator.ne},
    {"<": operator.lt, ">": operator.gt, "<=": operator.le, ">=": operator.ge},
    {"<<": operator.lshift, ">>": operator.rshift},
    {"+": operator.add, "-": operator.sub},
    {"*": operator.mul, "/": operator.floordiv, "%": operator.mod},
]
_FUNCTIONS: dict[str, Callable[[Any, Any], Any]] = {"min": min, "max": max}
# A number that is known when a kernel is built, or a function of a launch's numbers.
_Value = int | Callable[[Sequence[int]], int]


class Bound(NamedTuple):
    """How long one buffer must be.

    Args:
        buffer: its place among the kernel's arguments.
        shape: as declared.
        uses: places of the arguments that this depends on; the axes stand behind the last one.
        least: how many numbers there are at least, from all arguments and axes.
    """

    buffer: int
    shape: str
    uses: tuple[int, ...]
    least: Callable[[Sequence[int]], int]


def declared(source: str) -> dict[str, str]:
    """The least shape of each buffer by name, as a kernel's source declares it.

    Raises:
        ValueError: what stands behind ``Buffers:`` cannot be read, or names a buffer twice.
    """
    found = _DECLARED.search(source)
    text, shapes = re.sub(r"\n \*", "\n", found[1]) if found else "", dict[str, str]()
    while text.strip():
        entry = _ENTRY.match(text)
        if entry is None:
            raise ValueError(f"shapes of buffers read {text.strip()!r}")
        for name in re.split(r"\s*,\s*", entry[1]):
            if name in shapes:
                raise ValueError(f"buffer {name} has two shapes")
            shapes[name] = " ".join(entry[2].split())
        text = text[entry.end() :]
    return shapes


def bounds(
    names: Sequence[str], buffers: Sequence[int], shapes: Mapping[str, str], macros: Macros
) -> list[Bound]:
    """How long the buffers of one variant of a kernel must be; those with a star are left out.

    Args:
        names: the kernel's arguments, in order.
        buffers: the places of its buffers among them.
        shapes: what the kernel declares.
        macros: those of this variant.

    Raises:
        ValueError: a buffer has no shape, or one that cannot be read or has a name that is neither
            macro nor number.
    """
    known = {name: place for place, name in enumerate((*names, *AXES))}
    known = {name: place for name, place in known.items() if place not in buffers}
    found = list[Bound]()
    for buffer in buffers:
        if names[buffer] not in shapes:
            raise ValueError(f"the comment that opens it has no shape of buffer {names[buffer]!r}")
        shape = shapes[names[buffer]]
        if shape != _UNKNOWN:
            expression = _Expression(macros.expanded(shape), known)
            found.append(Bound(buffer, shape, tuple(expression.uses), expression.least))
    return found


class _Expression:
    """The product of expressions of C, of whole numbers.

    Args:
        text: with commas between them, without macros.
        known: the place of each name among a launch's numbers.

    Raises:
        ValueError: it cannot be read, or has another name.
    """

    def __init__(self, text: str, known: Mapping[str, int]) -> None:
        self._text, self._known = text, known
        self._tokens = _TOKEN.findall(text)
        if "".join(self._tokens) != "".join(text.split()):
            raise self._unread()
        self._tokens.append("")
        self.uses = list[int]()
        value = self._choice()
        while self._taken(","):
            value = _applied(operator.mul, value, self._choice())
        if self._tokens != [""]:
            raise self._unread()
        self.least = _called(value)

    def _unread(self) -> ValueError:
        return ValueError(f"the length of a buffer reads {self._text!r}")

    def _taken(self, token: str) -> bool:
        """Whether this token comes next; it is then read."""
        if self._tokens[0] != token:
            return False
        del self._tokens[0]
        return True

    def _expect(self, token: str) -> None:
        if not self._taken(token):
            raise self._unread()

    def _choice(self) -> _Value:
        condition = self._binary(0)
        if not self._taken("?"):
            return condition
        yes = self._choice()
        self._expect(":")
        no = self._choice()
        if isinstance(condition, int):
            return yes if condition else no
        first, second = _called(yes), _called(no)
        return lambda numbers: first(numbers) if condition(numbers) else second(numbers)

    def _binary(self, level: int) -> _Value:
        if level == len(_OPERATORS):
            return self._single()
        value = self._binary(level + 1)
        while self._tokens[0] in _OPERATORS[level]:
            apply = _OPERATORS[level][self._tokens.pop(0)]
            value = _applied(apply, value, self._binary(level + 1))
        return value

    def _single(self) -> _Value:
        if self._taken("-"):
            return _applied(operator.sub, 0, self._single())
        if self._taken("("):
            value = self._choice()
            self._expect(")")
            return value
        token = self._tokens.pop(0) if self._tokens[0] else ""
        if token.isdigit():
            return int(token)
        if token in _FUNCTIONS:
            self._expect("(")
            first = self._choice()
            self._expect(",")
            second = self._choice()
            self._expect(")")
            return _applied(_FUNCTIONS[token], first, second)
        if token not in self._known:
            raise ValueError(
                f"the length of a buffer has {token!r}, which is no number: {self._text}"
            )
        place = self._known[token]
        self.uses.append(place)
        return lambda numbers: int(numbers[place])


def _called(value: _Value) -> Callable[[Sequence[int]], int]:
    return (lambda numbers: value) if isinstance(value, int) else value


def _applied(apply: Callable[[Any, Any], Any], left: _Value, right: _Value) -> _Value:
    if isinstance(left, int) and isinstance(right, int):
        return int(apply(left, right))
    first, second = _called(left), _called(right)
    return lambda numbers: int(apply(first(numbers), second(numbers)))
