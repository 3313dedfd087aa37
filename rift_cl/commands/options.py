"""Options that several commands share, and how a command's options fall into groups.

A command's settings are a frozen dataclass: what Python passes, what ``config.json`` holds and what
the command line shows. It inherits its fields from a few classes that each name a ``group``, under
whose title the help lists them; a field, or a part of the tree, that is marked with a ``Group`` of
``rift_cl.option_marks`` is listed under that instead.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import Field, dataclass, fields, is_dataclass, replace
from pathlib import Path
from typing import (
    TYPE_CHECKING,
    Annotated,
    Any,
    ClassVar,
    Literal,
    NamedTuple,
    TypeVar,
    get_args,
    get_type_hints,
)

import tyro

from rift_cl.errors import InputError
from rift_cl.option_marks import EXPERT, Auto, Group

if TYPE_CHECKING:
    from rift_cl.cl.device import Device

# A larger tilt of an axis is no misalignment, in degrees.
MOST_TILT = 5.0
# What something has to be given for has no default.
MISSING = (dataclasses.MISSING, tyro.MISSING)
# The name of the choice where a part of the settings is one of several kinds.
KIND = "name"
# The group of what no mark puts into one.
_UNSAID = Group("", "")


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
    """How the command runs."""

    group: ClassVar[str] = "run"

    config: Auto[Path] = None
    """config.json of an earlier run of this command, which is repeated with every value that was
    decided in it. With further options, the options of that run become the defaults of this one,
    and what was left open is decided anew. Default: none."""


@dataclass(frozen=True, kw_only=True)
class ResumableRun(RepeatableRun):
    """How the command runs."""

    group: ClassVar[str] = "run"

    resume: bool = False
    """Continue an interrupted run in --out, with the same settings; a finished one stays as it
    is."""


@dataclass(frozen=True, kw_only=True)
class SpreadRun(ResumableRun):
    """How the command runs."""

    group: ClassVar[str] = "run"

    cluster: Auto[str] = None
    """Spread the work over processes: local:N for N workers on this machine, which divide its
    devices, cores and memory, or the address of a Dask scheduler, such as tcp://10.0.0.1:8786 (see
    docs/how-to/scale_out.md). Default: this process does it."""
    part_timeout: Annotated[Auto[float], EXPERT] = None
    """Seconds that a worker of --cluster may take for a part, such as a few slices, before its
    process is begun anew and the part goes to another. Default: 20 times what parts of that size
    took at most so far, 300 at least."""

    def check_cluster(self) -> None:
        """Check what ``--cluster`` and ``--part-timeout`` say.

        Raises:
            InputError: there is no such address, or no such time.
        """
        from rift_cl.cluster.address import ClusterAddress

        if self.part_timeout is not None:
            if not 0 < self.part_timeout < float("inf"):
                raise InputError(
                    f"--part-timeout is {self.part_timeout:g}, wanted a positive number of seconds"
                )
            if self.cluster is None:
                raise InputError(
                    "--part-timeout is for the workers of --cluster: add --cluster local:1 to have "
                    "one watched, or leave it out"
                )
        if self.cluster is not None:
            ClusterAddress.of(self.cluster)


S = TypeVar("S")

# Options that take a file or a text, besides those that are paths.
MAY_BE_FILES = "theta", "flats", "darks"


def check_tilt(tilt: float | None) -> None:
    """Refuse a tilt of the rotation axis that is no misalignment.

    Args:
        tilt: in degrees; None where it is not said.

    Raises:
        InputError: it is too large, or no number.
    """
    if tilt is not None and not abs(tilt) <= MOST_TILT:
        raise InputError(f"--tilt is {tilt:g} degrees, wanted {MOST_TILT:g} at most")


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


def absolute_files(settings: S) -> S:
    """As ``absolute_paths``, and of options that take a file or a text too, where it is a file."""
    changed = {
        name: str(Path(value).absolute())
        for name in MAY_BE_FILES
        if (value := getattr(settings, name, None)) is not None and Path(value).exists()
    }
    return replace(absolute_paths(settings), **changed)  # type: ignore[type-var]


class NamedFile(NamedTuple):
    """What the value of an option names.

    Args:
        path: a file or folder that is there.
        part: what of it is meant, such as ``:/exchange/data_white``; empty where it is all.
    """

    path: Path
    part: str


def named_file(name: str, value: Any) -> NamedFile | None:
    """The file or folder that an option names; None where it names none that is there.

    Args:
        name: of the option.
        value: of the option, or one of several.
    """
    if isinstance(value, Path):
        return NamedFile(value, "") if _is_data(value) else None
    if name not in MAY_BE_FILES or not isinstance(value, str) or not value:
        return None
    if _is_data(Path(value)):
        return NamedFile(Path(value), "")
    file, colon, part = value.rpartition(":")
    return NamedFile(Path(file), colon + part) if file and _is_data(Path(file)) else None


def without_place(name: str, value: Any) -> Any:
    """The value of an option but for where the file is that it names, where it names one."""
    named = named_file(name, value)
    return value if named is None else f"a file{named.part}"


def _is_data(path: Path) -> bool:
    # A text that names a part of the scan may be no path at all.
    with suppress(OSError, ValueError):
        return path.is_file() or path.is_dir()
    return False


class ShownOption(NamedTuple):
    """An option as a command's help lists it.

    Args:
        name: its name, such as ``steps`` or ``learning_rates.means``.
        path: where its value is in the tree of settings.
        kind: its type, with the marks on it.
        default: its value where nothing is given; one of ``MISSING`` where something has to be.
        group: where the help lists it.
        help: what the help says of it.
    """

    name: str
    path: tuple[str, ...]
    kind: Any
    default: Any
    group: Group
    help: str


def shown_options(settings: type, default: Any = None) -> Iterator[ShownOption]:
    """The options of a command, in the order of the fields.

    Args:
        settings: the class of its settings.
        default: settings to begin with; the class's own where it is None.
    """
    groups = {
        field.name: Group(getattr(base, "group", ""), _first_paragraph(base))
        for base in option_groups(settings)
        for field in fields(base)
    }
    for option in _options_in(settings, default):
        said = option.group is not _UNSAID
        yield option if said else option._replace(group=groups[option.path[0]])


def gathered(words: Sequence[str], settings: type) -> list[str]:
    """A command line in which every list is given once: ``--test A --test B`` is ``--test A B``.

    Argument parsers keep the last of them alone, and say nothing of the others. That suits what a
    script begins with and a later word overrides. Two presets are refused: whoever gives both means
    to have both.

    Args:
        words: of the command line.
        settings: the class of the command's settings.

    Raises:
        InputError: ``--preset`` is given more than once.
    """
    starts = [index for index, word in enumerate(words) if word.startswith("--")]
    names = [_plain_name(words[start]) for start in starts]
    repeated = {name for name in names if names.count(name) > 1}
    if not repeated:
        # What the options are takes time to read, which a command's help has not.
        return list(words)
    if "preset" in repeated:
        raise InputError(f"--preset is given {names.count('preset')} times, wanted once")
    lists = {option.name for option in shown_options(settings) if _is_list(option.kind)} & repeated
    if not lists:
        return list(words)
    values: dict[str, list[str]] = {name: [] for name in lists}
    others = list(words[: starts[0]])
    for name, start, end in zip(names, starts, [*starts[1:], len(words)], strict=True):
        if name not in lists:
            others += words[start:end]
            continue
        _, given, value = words[start].partition("=")
        values[name] += [value] if given else []
        values[name] += words[start + 1 : end]
    return others + [word for name in sorted(lists) for word in (f"--{name}", *values[name])]


def _plain_name(word: str) -> str:
    return word.removeprefix("--").partition("=")[0].replace("-", "_")


def _is_list(kind: Any) -> bool:
    """Whether an option takes any number of values."""
    return Ellipsis in get_args(kind) or any(_is_list(part) for part in get_args(kind))


def _first_paragraph(described: type) -> str:
    return " ".join((described.__doc__ or "").split("\n\n")[0].split())


def _options_in(
    settings: Any,
    usual: Any,
    group: Group = _UNSAID,
    path: tuple[str, ...] = (),
    prefix: str = "",
) -> Iterator[ShownOption]:
    """The options of a part of a tree of settings, whose group its marks say, or do not."""
    kinds, helps = get_type_hints(settings, include_extras=True), _helps(settings)
    for field in fields(settings):
        name, marks = option_name(field.name, kinds[field.name], prefix)
        if tyro.conf.Fixed in marks:
            continue
        default, place = default_of(field, usual), (*path, field.name)
        own = next((mark for mark in marks if isinstance(mark, Group)), group)
        registry = field.metadata.get("registry")
        if registry is not None:
            usually = registry.name_of(type(default))
            choice: Any = Literal[kinds_of(field)]
            text = field.metadata["help"]
            yield ShownOption(name, (*place, KIND), choice, usually, group, text)
        if is_dataclass(default):
            yield from _options_in(type(default), default, own, place, name)
        else:
            kind = kinds[field.name]
            yield ShownOption(name, place, kind, default, own, helps.get(field.name, ""))


def assembled(
    settings: type[S],
    default: Any,
    given: Mapping[tuple[str, ...], Any],
    path: tuple[str, ...] = (),
) -> S:
    """Settings of values by their places in the tree; what is not given is as usual.

    Raises:
        SettingError: a value is out of its range.
    """
    values = {}
    for field in fields(settings):  # type: ignore[arg-type]
        usual, place = default_of(field, default), (*path, field.name)
        if is_dataclass(usual):
            values[field.name] = assembled(type(usual), usual, given, place)
        else:
            values[field.name] = given.get(place, usual)
    return settings(**values)


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


def option_name(name: str, kind: Any, prefix: str) -> tuple[str, tuple[Any, ...]]:
    """The name of the option of a field, and all marks of its type."""
    marks = getattr(kind, "__metadata__", ())
    for mark in marks:
        if getattr(mark, "name", None):
            name = mark.name.replace("-", "_")
        if getattr(mark, "prefix_name", None) is False:
            prefix = ""
    return (f"{prefix}.{name}" if prefix else name), marks


def default_of(field: Field[Any], usual: Any) -> Any:
    """A field's value in the settings to begin with, otherwise its own default."""
    if usual is not None:
        return getattr(usual, field.name)
    if field.default_factory is not dataclasses.MISSING:
        return field.default_factory()
    return field.default


def kinds_of(field: Field[Any]) -> tuple[str, ...]:
    """The kinds that a part of the tree may be of, by their names in its registry."""
    without = field.metadata.get("without", ())
    return tuple(kind for kind in field.metadata["registry"] if kind not in without)


def _helps(settings: type) -> dict[str, str]:
    """The docstring of each field, as one paragraph."""
    import docstring_parser

    helps: dict[str, str] = {}
    for base in reversed(settings.__mro__[:-1]):
        for entry in docstring_parser.parse_from_object(base).params:
            helps[entry.arg_name] = " ".join((entry.description or "").split())
    return helps
