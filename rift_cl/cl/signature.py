"""What a kernel takes: the names and types of its arguments, read from its source.

Launches name their arguments, so somebody has to know in which order a kernel takes them and what
they must be. A driver knows too, but forgets where it loads a program that was built before. So
the parameter list is read from the expanded source, as the preprocessor leaves it for the macros
that this variant of the kernel is built with. What the source says of the buffers' lengths is read
with it (``bounds``), and compared at each launch: a kernel that goes beyond the end of a buffer
writes into another's memory, in silence.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping, Sequence
from difflib import get_close_matches
from operator import itemgetter
from typing import Any, NamedTuple, NoReturn

import numpy as np

from rift_cl.cl.bounds import AXES, Bound, bounds, declared
from rift_cl.cl.preprocessor import Macros
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
_WORD = re.compile(r"\w+")
_COMMENT = re.compile(r"/\*.*?\*/|//[^\n]*", re.DOTALL)
_ALIAS = re.compile(r"typedef\s+(\w+)\s+(\w+)\s*;")
# Launches of one place that are remembered: what is seen of a scene differs from view to view.
_REMEMBERED = 256
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


class Signature(NamedTuple):
    """What a kernel takes.

    Args:
        name: the kernel.
        parameters: its arguments, in order.
        bounds: how long its buffers must be.
    """

    name: str
    parameters: tuple[Parameter, ...]
    bounds: tuple[Bound, ...]


def signature(name: str, source: str, given: Mapping[str, str]) -> Signature:
    """What a kernel takes.

    Args:
        name: the kernel.
        source: its source, with the includes in line.
        given: the macros that it is built with.

    Raises:
        ValueError: the source has no such kernel, or a parameter or the shape of a buffer cannot
            be read.
    """
    macros, aliases, lines = Macros(given), dict[str, str](), list[str]()
    for line in macros.active(_COMMENT.sub(" ", source)):
        alias = _ALIAS.match(line)
        if alias:
            aliases[alias[2]] = alias[1]
        lines.append(line)
    match = re.search(rf"\b(?:KERNEL|__kernel)\s+void\s+{name}\s*\(([^)]*)\)", "\n".join(lines))
    if match is None:
        raise ValueError(f"no kernel {name} in its source")
    listed = macros.expanded(match[1]).split(",")
    parameters = tuple(_parameter(text.strip(), aliases) for text in listed)
    names = [parameter.name for parameter in parameters]
    buffers = [place for place, parameter in enumerate(parameters) if parameter.lanes == 0]
    return Signature(name, parameters, tuple(bounds(names, buffers, declared(source), macros)))


class Arguments:
    """Arguments of one place that launches a kernel: names are checked once, the others each time.

    Args:
        kernel: what the kernel takes.
        given: what that place gives, by name, and macros in capitals; other launches from there
            have the same names.

    Raises:
        KernelArgumentError: an argument is missing or unknown.
    """

    def __init__(self, kernel: Signature, given: Mapping[str, Any]) -> None:
        wanted = kernel.parameters
        check_names(kernel.name, wanted, given)
        self._kernel, self._name, self._wanted = kernel, kernel.name, wanted
        self._takes = [parameter.name for parameter in wanted]
        takes = set(self._takes)
        self._spare = [key for key in given if key not in takes and not key.isupper()]
        self._arrays = [(k, each.dtype) for k, each in enumerate(wanted) if each.lanes == 0]
        self._vectors = [k for k, each in enumerate(wanted) if each.lanes > 1]
        used = {place for bound in kernel.bounds for place in bound.uses}
        # What lengths of buffers depend on, and with what of it they were found long enough.
        self._counts = sorted(place for place in used if place < len(wanted))
        self._counted = itemgetter(*self._counts) if self._counts else lambda values: None
        self._fitting = set[tuple[Any, ...]]()

    def in_order(self, given: Mapping[str, Any], items: tuple[int, ...]) -> list[Any]:
        """The arguments as the driver takes them, in the kernel's own order.

        Args:
            given: by name.
            items: work-items along each axis.

        Raises:
            KernelArgumentError: one that the kernel does not take is not None, an array or a
                vector is of another type, or an array is shorter than the kernel goes through.
        """
        for key in self._spare:
            if given[key] is not None:
                check_names(self._name, self._wanted, given)
        values = list(map(given.__getitem__, self._takes))
        sizes: list[int | None] = []
        for k, dtype in self._arrays:
            value = values[k]
            if value is None:
                sizes.append(None)
                continue
            # Kernels see buffers and know nothing of views into them.
            if getattr(value, "offset", -1) != 0 or value.dtype != dtype:
                _refuse(self._name, self._wanted[k], value)
            sizes.append(value.size)
            values[k] = value.base_data
        for k in self._vectors:
            value, wanted = values[k], self._wanted[k]
            if getattr(value, "dtype", None) != wanted.dtype or value.shape != (wanted.lanes,):
                _refuse(self._name, wanted, value)
        launch = tuple(sizes), items, self._counted(values)
        try:
            fits = launch in self._fitting
        except TypeError:  # An array in the place of a number, which is named below.
            fits = False
        if not fits:
            self._check_lengths(values, sizes, items)
            if len(self._fitting) == _REMEMBERED:
                self._fitting.clear()
            self._fitting.add(launch)
        return values

    def _check_lengths(
        self, values: list[Any], sizes: list[int | None], items: tuple[int, ...]
    ) -> None:
        """See that no buffer is shorter than the kernel goes through.

        Raises:
            KernelArgumentError: one is, or what that depends on is no whole number.
        """
        counts = [self._wanted[k] for k in self._counts]
        check_numbers(self._name, counts, [values[k] for k in self._counts])
        numbers = [*values, *items, *[1] * (len(AXES) - len(items))]
        found = {k: size for (k, _), size in zip(self._arrays, sizes, strict=True)}
        for bound in self._kernel.bounds:
            size, least = found[bound.buffer], bound.least(numbers)
            if size is not None and size < least:
                name = self._takes[bound.buffer]
                raise KernelArgumentError(
                    f"kernel {self._name}: argument {name} has {size} numbers, wanted at least "
                    f"{least} [{bound.shape}]{self._said(bound, numbers)}"
                )

    def _said(self, bound: Bound, numbers: list[Any]) -> str:
        """What the numbers are that a length depends on."""
        names = (*self._takes, *AXES)
        return "".join(f", {names[k]} = {numbers[k]}" for k in dict.fromkeys(bound.uses))


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


def check_macros(name: str, source: str, given: Iterable[str]) -> None:
    """See that a kernel's source speaks of the compile-time constants that a launch gives it.

    Raises:
        KernelArgumentError: one stands nowhere in it, so that giving it changes nothing.
    """
    words = set(_WORD.findall(_COMMENT.sub(" ", source)))
    for macro in given:
        if macro not in words:
            near = get_close_matches(macro, filter(str.isupper, words), 1)
            meant = f"; did you mean {near[0]}?" if near else ""
            raise KernelArgumentError(f"kernel {name}: has no compile-time constant {macro}{meant}")


def check_numbers(name: str, wanted: Sequence[Parameter], values: Sequence[Any]) -> None:
    """See that numbers are what a kernel wants; arguments of other kinds are passed over.

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
