"""What a kernel takes: the names and types of its arguments, read from its source.

Launches name their arguments, so somebody has to know in which order a kernel takes them and what
they must be. A driver knows too, but forgets where it loads a program that was built before. So
the parameter list is read from the expanded source, as the preprocessor leaves it for the macros
that this variant of the kernel is built with.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping
from typing import Any, NamedTuple, NoReturn

import numpy as np

from rift_cl.errors import KernelArgumentError

_TYPES = {
    "char": np.int8,
    "uchar": np.uint8,
    "int": np.int32,
    "uint": np.uint32,
    "long": np.int64,
    "ulong": np.uint64,
    "float": np.float32,
    "double": np.float64,
}
_COMMENT = re.compile(r"/\*.*?\*/|//[^\n]*", re.DOTALL)
_DIRECTIVE = re.compile(r"#\s*(\w+)\s*(.*)")
_DEFINITION = re.compile(r"(\w+)(?!\()\s*(.*)")
_ALIAS = re.compile(r"typedef\s+(\w+)\s+(\w+)\s*;")
_PARAMETER = re.compile(
    r"(?P<buffer>__global\s+)?(?:const\s+)?(?P<type>[a-z]+)(?P<lanes>\d*)\s*"
    r"(?:\*\s*(?:restrict\s+)?)?(?P<name>\w+)"
)


class Parameter(NamedTuple):
    """One argument that a kernel takes.

    Args:
        name: as in the source.
        dtype: of a number, or of the numbers in a buffer or a vector.
        lanes: how many numbers are passed by value: 1, or 4 for a ``float4``; 0 for a buffer.
    """

    name: str
    dtype: np.dtype[Any]
    lanes: int

    def __str__(self) -> str:
        """What is wanted, as an error says it."""
        if self.lanes > 1:
            return f"a NumPy array of {self.lanes} x {self.dtype}"
        return f"a number of type {self.dtype}" if self.lanes else f"a {self.dtype} device array"


def parameters(name: str, source: str, macros: Mapping[str, str]) -> tuple[Parameter, ...]:
    """What a kernel takes.

    Args:
        name: the kernel.
        source: its source, with the includes in line.
        macros: those that it is built with.

    Raises:
        ValueError: the source has no such kernel, or a parameter cannot be read.
    """
    defined, aliases, lines = dict(macros), dict[str, str](), list[str]()
    for line in _active(_COMMENT.sub(" ", source).replace("\\\n", " "), defined):
        alias = _ALIAS.match(line)
        if alias:
            aliases[alias[2]] = alias[1]
        lines.append(line)
    match = re.search(rf"\b(?:KERNEL|__kernel)\s+void\s+{name}\s*\(([^)]*)\)", "\n".join(lines))
    if match is None:
        raise ValueError(f"no kernel {name} in its source")
    listed = _expanded(match[1], defined).split(",")
    return tuple(_parameter(text.strip(), aliases) for text in listed)


class Arguments:
    """Arguments of one place that launches a kernel: names are checked once, types each time.

    Args:
        name: the kernel.
        wanted: what it takes.
        given: what that place gives, by name, and macros in capitals; other launches from there
            have the same names.

    Raises:
        KernelArgumentError: an argument is missing or unknown.
    """

    def __init__(self, name: str, wanted: tuple[Parameter, ...], given: Mapping[str, Any]) -> None:
        check_names(name, wanted, given)
        self._name, self._wanted = name, wanted
        self._takes = [parameter.name for parameter in wanted]
        takes = set(self._takes)
        self._spare = [key for key in given if key not in takes and not key.isupper()]
        self._arrays = [(k, each.dtype) for k, each in enumerate(wanted) if each.lanes == 0]
        self._vectors = [k for k, each in enumerate(wanted) if each.lanes > 1]

    def in_order(self, given: Mapping[str, Any]) -> list[Any]:
        """The arguments as the driver takes them, in the kernel's own order.

        Raises:
            KernelArgumentError: one that the kernel does not take is not None, or an array or a
                vector is of another type.
        """
        for key in self._spare:
            if given[key] is not None:
                check_names(self._name, self._wanted, given)
        values = list(map(given.__getitem__, self._takes))
        for k, dtype in self._arrays:
            value = values[k]
            if value is not None:
                # Kernels see buffers and know nothing of views into them.
                if getattr(value, "offset", -1) != 0 or value.dtype != dtype:
                    _refuse(self._name, self._wanted[k], value)
                values[k] = value.base_data
        for k in self._vectors:
            value, wanted = values[k], self._wanted[k]
            if getattr(value, "dtype", None) != wanted.dtype or value.shape != (wanted.lanes,):
                _refuse(self._name, wanted, value)
        return values


def check_names(name: str, wanted: tuple[Parameter, ...], given: Mapping[str, Any]) -> None:
    """See that a launch gives the arguments that a kernel takes, and beyond them None alone.

    Raises:
        KernelArgumentError: an argument is missing or unknown.
    """
    takes = [parameter.name for parameter in wanted]
    missing = [key for key in takes if key not in given]
    unknown = [
        key
        for key, value in given.items()
        if key not in takes and not key.isupper() and value is not None
    ]
    if missing or unknown:
        faults = [f"{key} is missing" for key in missing] + [f"{key} is unknown" for key in unknown]
        raise KernelArgumentError(
            f"kernel {name}: {', '.join(faults)}; it takes {', '.join(takes)}"
        )


def check_numbers(name: str, wanted: tuple[Parameter, ...], values: list[Any]) -> None:
    """Find the number that a driver refused; launches ask only then.

    Raises:
        KernelArgumentError: an argument is no number, no whole one, or out of its type's range.
    """
    for parameter, value in zip(wanted, values, strict=True):
        if parameter.lanes != 1:
            continue
        whole = isinstance(value, int | np.integer)
        fits = whole or isinstance(value, float | np.floating)
        if parameter.dtype.kind in "iu":
            limits = np.iinfo(parameter.dtype)
            fits = whole and limits.min <= value <= limits.max
        if not fits:
            _refuse(name, parameter, value)


def _refuse(name: str, parameter: Parameter, value: Any) -> NoReturn:
    kind = type(value).__name__
    if hasattr(value, "dtype") and hasattr(value, "shape"):
        kind += f" of shape {value.shape} and type {value.dtype}"
        kind += " that begins within a buffer" if getattr(value, "offset", 0) else ""
    else:
        kind += f" ({value!r})"
    raise KernelArgumentError(
        f"kernel {name}: argument {parameter.name} is a {kind}, wanted {parameter}"
    )


def _parameter(text: str, aliases: Mapping[str, str]) -> Parameter:
    match = _PARAMETER.fullmatch(text)
    if match is None:
        raise ValueError(f"a kernel's parameter reads {text!r}")
    kind = match["type"]
    dtype = np.dtype(_TYPES[aliases.get(kind, kind)])
    return Parameter(match["name"], dtype, 0 if match["buffer"] else int(match["lanes"] or 1))


def _active(text: str, defined: dict[str, str]) -> Iterator[str]:
    """The lines that conditions leave; what they define is added to ``defined``."""
    # For each open condition: whether this branch is compiled, and whether one was already.
    open_: list[tuple[bool, bool]] = []
    for line in text.splitlines():
        found = _DIRECTIVE.match(line)
        active = all(branch for branch, _ in open_)
        if found is None:
            if active:
                yield line
        elif found[1] in ("if", "ifdef", "ifndef"):
            holds = active and _holds(found[1], found[2], defined)
            open_.append((holds, holds))
        elif found[1] in ("elif", "else"):
            _, taken = open_.pop()
            outside = all(branch for branch, _ in open_)
            holds = outside and not taken and _holds(found[1], found[2], defined)
            open_.append((holds, taken or holds))
        elif found[1] == "endif":
            open_.pop()
        elif found[1] == "define" and active:
            definition = _DEFINITION.fullmatch(found[2].strip())
            if definition:
                defined[definition[1]] = definition[2]


def _holds(directive: str, condition: str, defined: Mapping[str, str]) -> bool:
    """Whether a branch is compiled; conditions have no brackets in our kernels."""
    if directive == "else":
        return True
    if directive in ("ifdef", "ifndef"):
        return (condition.strip() in defined) == (directive == "ifdef")
    either = (option.split("&&") for option in condition.split("||"))
    return any(all(_term(term.strip(), defined) for term in terms) for terms in either)


def _term(term: str, defined: Mapping[str, str]) -> bool:
    if term.startswith("!"):
        return not _number(term[1:], defined)
    match = re.fullmatch(r"(\w+)(?:\s*(==|!=|<=|>=|<|>)\s*(\w+))?", term)
    if match is None:
        raise ValueError(f"a condition reads {term!r}")
    left = _number(match[1], defined)
    if match[2] is None:
        return left != 0
    right = _number(match[3], defined)
    return {
        "==": left == right,
        "!=": left != right,
        "<=": left <= right,
        ">=": left >= right,
        "<": left < right,
        ">": left > right,
    }[match[2]]


def _number(name: str, defined: Mapping[str, str]) -> int:
    """A whole number, or the one that a name stands for; 0 for a name that is not defined."""
    value = _expanded(name.strip(), defined).strip()
    return int(value) if value.isdigit() else 0


def _expanded(text: str, defined: Mapping[str, str]) -> str:
    """Text with every macro replaced by what it stands for."""
    while True:
        replaced = re.sub(r"\b[A-Za-z_]\w*\b", lambda word: defined.get(word[0], word[0]), text)
        if replaced == text:
            return text
        text = replaced
