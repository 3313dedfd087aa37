"""Options that several commands share, and how a command's options fall into groups.

A command's settings are one flat frozen dataclass: what Python passes, what ``config.json`` holds
and what the command line shows. It inherits its fields from a few classes that each name a
``group``, under whose title the help lists them.
"""

from __future__ import annotations

from dataclasses import dataclass, fields, is_dataclass, replace
from pathlib import Path
from types import MappingProxyType
from typing import TYPE_CHECKING, Any, ClassVar, TypeVar, get_type_hints

from rift_cl.option_marks import Auto

if TYPE_CHECKING:
    from rift_cl.cl.device import Device


@dataclass(frozen=True, kw_only=True)
class DeviceOption:
    """On what the command computes."""

    group: ClassVar[str] = "run"

    device: Auto[str] = None
    """OpenCL device: its number, cpu, gpu, or part of its name (see 'rift devices'). Default: the
    environment variable RIFT_DEVICE, otherwise the one that 'rift devices' marks with a star."""

    def open_device(self, memory: int | None = None) -> Device:
        """The chosen device.

        Args:
            memory: most bytes to use on it; see ``rift_cl.open_device``.

        Raises:
            NoDeviceError: there is none, or none that matches.
        """
        # Imported when used, so that a command's help loads no device layer.
        from rift_cl.cl.discovery import open_device

        return open_device(self.device, memory)


@dataclass(frozen=True, kw_only=True)
class RunOptions(DeviceOption):
    """How the command runs."""

    group: ClassVar[str] = "run"

    overwrite: bool = False
    """Replace the results of an earlier run at the same place."""
    dry_run: bool = False
    """Print what would be done, and write nothing."""


@dataclass(frozen=True, kw_only=True)
class RepeatableRun(RunOptions):
    """How a command runs that leaves a config.json."""

    group: ClassVar[str] = "run"

    config: Auto[Path] = None
    """config.json of an earlier run of this command. Its settings, with every value that was
    decided in that run, become the defaults of this one."""


S = TypeVar("S")


def absolute_paths(settings: S) -> S:
    """The same settings with every path from the root, for a file that is read elsewhere."""
    changed: dict[str, Any] = {}
    for field in fields(settings):  # type: ignore[arg-type]
        value = getattr(settings, field.name)
        if isinstance(value, Path):
            changed[field.name] = value.absolute()
        elif isinstance(value, tuple) and any(isinstance(entry, Path) for entry in value):
            changed[field.name] = tuple(entry.absolute() for entry in value)
    return replace(settings, **changed)  # type: ignore[type-var]


def option_groups(settings: type) -> list[type]:
    """The classes that a command's settings consist of, in the order of the fields.

    Args:
        settings: the class of a command's settings.

    Returns:
        Its most derived bases that name a ``group``; the class itself where none does.
    """
    found: list[type] = []
    for base in settings.__mro__[1:]:
        if hasattr(base, "group") and not any(issubclass(other, base) for other in found):
            found.append(base)
    return found[::-1] or [settings]


def join_help_lines(settings: Any) -> None:
    """Have tyro wrap the docstring of each option as one paragraph.

    It keeps the line breaks of docstrings that are indented, but takes a field's help from the
    metadata as it stands. Classes of fields that are dataclasses themselves are gone through, too.
    """
    import docstring_parser

    described: dict[str, str] = {}
    for base in reversed(settings.__mro__[:-1]):
        for entry in docstring_parser.parse_from_object(base).params:
            described[entry.arg_name] = " ".join((entry.description or "").split())
    kinds = get_type_hints(settings)
    for field in fields(settings):
        if described.get(field.name) and "help" not in field.metadata:
            field.metadata = MappingProxyType({**field.metadata, "help": described[field.name]})
        for kind in getattr(kinds[field.name], "__args__", (kinds[field.name],)):
            if isinstance(kind, type) and is_dataclass(kind):
                join_help_lines(kind)
