"""Settings as a tree: the options in it by name, and as ``config.json`` holds it and gives it back.

A command's settings are a frozen dataclass whose fields are values or further dataclasses. Each
value is an option of the command line (``rift_cl.option_marks`` says how it is named there), a name
that Python passes, and an entry of ``config.json``, which ``--config`` repeats.
"""

from __future__ import annotations

import dataclasses
import difflib
import hashlib
import types
import warnings
from collections.abc import Callable, Iterator, Sequence
from contextlib import suppress
from pathlib import Path
from typing import Annotated, Any, Literal, NamedTuple, TypeVar, Union, get_args, get_origin
from typing import get_type_hints as type_hints

import tyro

from rift_cl import __version__
from rift_cl.commands.options import KIND, MAY_BE_FILES, MISSING, default_of, kinds_of, option_name
from rift_cl.errors import InputError, RiftError, SettingError
from rift_cl.own_parts import loaded_parts

S = TypeVar("S")
# Options that say how a command runs, not what comes out: they are not repeated.
_NOT_REPEATED = (
    *("cluster", "config", "dry_run", "overwrite", "part_timeout", "preview", "resume", "view"),
)
# Those that leave what is repeated as it was, and words of a command line with no value after them.
_FREE = (*_NOT_REPEATED, "device", "memory", "out", "quiet")
_SWITCHES = ("dry_run", "overwrite", "preview", "quiet", "resume", "view")

# Of config.json: what --load ran, by name, with hashes; the options that were given; and a digest
# of the settings, which tells whether they were edited since.
LOADED, ASKED, DIGEST = "loaded", "asked", "digest"


class Option(NamedTuple):
    """A value in a tree of settings.

    Args:
        name: of its option, such as ``steps`` or ``learning_rates.means``.
        value: what it is.
        default: what it is where nothing is said; MISSING if something has to be.
        positional: whether it has no option, but a place on the command line.
        fixed: whether it can be given at all.
    """

    name: str
    value: Any
    default: Any
    positional: bool = False
    fixed: bool = False

    def words(self) -> list[str]:
        """What gives this value on a command line, after the command."""
        if self.positional:
            return [str(self.value)]
        group, _, name = self.name.replace("_", "-").rpartition(".")
        no = "no-" if self.value is False else ""
        option = f"--{group}.{no}{name}" if group else f"--{no}{name}"
        if isinstance(self.value, bool):
            return [option]
        several = self.value if isinstance(self.value, tuple) else (self.value,)
        return [option, *map(str, several)]


def options_of(settings: Any, usual: Any = None, prefix: str = "") -> Iterator[Option]:
    """All values in a tree of settings, by the names of their options.

    Args:
        settings: the tree.
        usual: settings with the defaults; those of the class where it is not given.
        prefix: name of the part of the tree that this is.
    """
    hints = type_hints(type(settings), include_extras=True)
    for field in dataclasses.fields(settings):
        value, default = getattr(settings, field.name), default_of(field, usual)
        name, marks = option_name(field.name, hints[field.name], prefix)
        if "registry" in field.metadata:
            registry = field.metadata["registry"]
            yield Option(name, registry.name_of(type(value)), registry.name_of(type(default)))
        if not dataclasses.is_dataclass(value):
            where = (tyro.conf.Positional in marks, tyro.conf.Fixed in marks)
            yield Option(name, value, default, *where)
        elif tyro.conf.Fixed not in marks:
            kind: Any = type(value)
            yield from options_of(value, default if type(default) is kind else kind(), name)


def record_of(settings: Any) -> dict[str, Any]:
    """A tree of settings as ``config.json`` holds it, by the names of the fields."""
    record: dict[str, Any] = {}
    for field in dataclasses.fields(settings):
        value = getattr(settings, field.name)
        if dataclasses.is_dataclass(value):
            registry = field.metadata.get("registry")
            kind = {} if registry is None else {KIND: registry.name_of(type(value))}
            record[field.name] = kind | record_of(value)
        else:
            record[field.name] = _plain(value)
    return record


def named_config(arguments: Sequence[str]) -> Path | None:
    """The file that ``--config`` names on a command line, if it does."""
    found = _given(arguments, "--config")
    return None if found is None else Path(found)


def changes_a_run(arguments: Sequence[str]) -> bool:
    """Whether words beside ``--config`` change what the run was asked for, and not only its place.

    Args:
        arguments: of the command line, after the command.
    """
    before = ""
    for word in arguments:
        name = word.removeprefix("--").partition("=")[0].replace("-", "_")
        if word.startswith("--") and name.removeprefix("no_") not in _FREE:
            return True
        # What stands alone is what the command works on.
        if not word.startswith("-") and (not before.startswith("-") or _is_switch(before)):
            return True
        before = word
    return False


def _is_switch(word: str) -> bool:
    name = word.removeprefix("--").replace("-", "_").removeprefix("no_")
    return "=" in word or name in _SWITCHES


def saved_settings(path: Path, job: str, settings: type[S], *, anew: bool = False) -> S:
    """The settings of an earlier run.

    Args:
        path: its config.json.
        job: the command that is to be run again, such as "reconstruct".
        settings: the command's settings.
        anew: as the run was asked for, without what it decided: options beside them may call for
            other decisions. A file that was edited is taken as it stands. So it is with a run that
            did not come to its end, which says no more, and whose folder is that of its file.

    Raises:
        InputError: the file cannot be read, is another command's or another version's, or holds a
            setting that this version does not have or a value that it does not take; or the run is
            unfinished and does not say what it was asked for.
    """
    # Imported when a file is named, so that a command's help loads no device layer.
    from rift_cl.io.json_fields import read_json_object

    try:
        record = read_json_object(path).values
        name, unfinished = record["job"], record.get("complete") is False
        values = {} if unfinished else dict(record["settings"])
    except (ValueError, LookupError, TypeError) as error:
        raise InputError(
            f"--config {path}: cannot be read as the config.json of an earlier run ({error})"
        ) from error
    if name != job:
        raise InputError(f"--config {path}: is of 'rift {name}', not of 'rift {job}'")
    if (version := record.get("rift_cl", __version__)) != __version__:
        raise InputError(
            f"--config {path}: was written by version {version!r}, this is {__version__}, whose "
            "settings may mean something else: give them as options"
        )
    _doubt_parts(record.get(LOADED), path)
    if unfinished:
        return _unfinished_settings(path, job, settings, record.get(ASKED))
    repeated = {name: value for name, value in values.items() if name not in _NOT_REPEATED}
    where = f"--config {path}: 'rift {job}'"
    saved = _read_tree(settings, None, repeated, where, open_ended=True)
    _check_saved(saved, where)
    asked = record.get(ASKED)
    if not (anew and isinstance(asked, dict) and record.get(DIGEST) == digest_of(values)):
        return saved
    # Of what may be a file, the run noted where it was.
    files = {name: getattr(saved, name) for name in asked if name in MAY_BE_FILES}
    given = {name: value for name, value in asked.items() if name not in _NOT_REPEATED}
    return parsed_settings(
        {**given, **files}, job, settings, where=f"--config {path}: ", open_ended=True
    )


def _unfinished_settings(path: Path, job: str, settings: type[S], asked: Any) -> S:
    """The settings of a run that did not come to its end, as it was asked for."""
    where = f"--config {path}: "
    if not isinstance(asked, dict):
        raise InputError(
            f"{where}is of a run that did not come to its end and does not say what it was asked "
            "for: give its options"
        )
    takes = {field.name for field in dataclasses.fields(settings)}  # type: ignore[arg-type]
    place = {"out": str(path.parent)} if "out" in takes else {}
    given = {name: value for name, value in asked.items() if name not in _NOT_REPEATED}
    return parsed_settings({**given, **place}, job, settings, where=where, open_ended=True)


def digest_of(values: Any) -> str:
    """A digest of settings, as ``config.json`` holds them."""
    from rift_cl.io.output import json_text

    return hashlib.sha256(json_text(values).encode(errors="surrogatepass")).hexdigest()[:16]


def asked_before(settings: Any) -> dict[str, Any] | None:
    """What the run was asked for that settings repeat (``--config``), unless they change it."""
    path = getattr(settings, "config", None)
    if path is None:
        return None
    from rift_cl.io.json_fields import read_json_object

    with suppress(RiftError, LookupError):
        record = read_json_object(path).values
        saved = saved_settings(path, record["job"], type(settings))
        if not differing(saved, settings):
            asked = record[ASKED]
            return asked if isinstance(asked, dict) else None
    return None


def differing(one: Any, other: Any) -> list[str]:
    """The names of options that decide what comes out, and whose values in two trees differ."""
    values, others = (
        {option.name: whole_paths(option.value) for option in options_of(tree)}
        for tree in (one, other)
    )
    return [
        name
        for name in {**values, **others}
        if name not in _FREE and values.get(name, MISSING) != others.get(name, MISSING)
    ]


def whole_paths(value: Any) -> Any:
    """A value with every path from the root, since a run is repeated from anywhere."""
    if isinstance(value, Path):
        return value.absolute()
    return tuple(map(whole_paths, value)) if isinstance(value, tuple) else value


def _doubt_parts(before: Any, path: Path) -> None:
    """Warn where a file of one's own parts is another than when the run was made."""
    now = loaded_parts()
    for name, digits in before.items() if isinstance(before, dict) else ():
        if name in now and now[name] != digits:
            warnings.warn(
                f"--config {path}: {name} (--load) was changed since that run: what comes out may "
                "be another",
                stacklevel=2,
            )


def _check_saved(saved: Any, where: str) -> None:
    """Check what a file says by itself, so that a sentence about it names the file.

    Raises:
        InputError: a value is out of its range, or two contradict each other.
    """
    values = (getattr(saved, field.name) for field in dataclasses.fields(saved))
    # What has to be given may come from the command line, and is checked with it.
    if not hasattr(saved, "check") or any(value is tyro.MISSING for value in values):
        return
    try:
        saved.check()
    except InputError as error:
        raise InputError(f"{where}: {error}") from error


def named_preset(arguments: Sequence[str]) -> str | None:
    """The name that ``--preset`` gives on a command line, if it does."""
    return _given(arguments, "--preset")


def begun_settings(
    config: Path | None, preset: str | None, job: str, settings: type[S], *, anew: bool = False
) -> S | None:
    """The settings that a command begins with, and its options override.

    Args:
        config: file of an earlier run that is repeated, or None.
        preset: name of a preset of the command's, or None.
        job: the command.
        settings: its settings.
        anew: whether the run is begun with as it was asked for; see ``saved_settings``.

    Returns:
        None if the defaults are meant.

    Raises:
        InputError: both are given, or the file cannot be used.
    """
    takes = {field.name for field in dataclasses.fields(settings)}  # type: ignore[arg-type]
    if config is not None and preset is not None and {"config", "preset"} <= takes:
        raise InputError(
            "--config repeats a run with all of its values and --preset begins with others: give "
            "one of the two"
        )
    if config is not None:
        return saved_settings(config, job, settings, anew=anew) if "config" in takes else None
    return None if preset is None else _preset_settings(preset, job, settings)


def _preset_settings(name: str, job: str, settings: type[S]) -> S | None:
    """The defaults of a command with a preset's values in their place.

    Args:
        name: of the preset.
        job: the command.
        settings: its settings, whose class may have ``presets``: values by the names of options.

    Returns:
        None if the command has no preset of that name, which its parser then says.
    """
    values = getattr(settings, "presets", {}).get(name)
    if values is None:
        return None
    return parsed_settings({**values, "preset": name}, job, settings, open_ended=True)


def parsed_settings(
    values: dict[str, Any],
    job: str,
    settings: type[S],
    *,
    earlier: S | None = None,
    where: str = "",
    open_ended: bool = False,
) -> S:
    """Settings by the names of their options, as ``options_of`` gives them.

    Args:
        values: what is given, with ``_`` in names; the rest has its defaults, and so has what is
            None. The name of a part of the tree stands for a dataclass of its kind.
        job: the command.
        settings: its settings.
        earlier: those to begin with, in place of the defaults.
        where: what a sentence about a mistake begins with.
        open_ended: whether what has to be given may be missing, for a parser to ask for.

    Raises:
        InputError: there is no such setting, or a value is none that it takes.
    """
    tree: dict[str, Any] = {}
    said = f"{where}'rift {job}'"
    named = {name: kind for name, kind in values.items() if isinstance(kind, str)}
    places = dict(_places(settings, _of_kinds(settings, earlier, named.get)))
    for name, value in values.items():
        if name not in places:
            raise _unknown(name, places, said)
        if value is None:
            continue
        *above, last = places[name]
        part = tree
        for step in above:
            part = part.setdefault(step, {})
            if not isinstance(part, dict):
                raise InputError(f"{said}: {name} is given, and all of {step} as well")
        part[last] = value
    return _read_tree(settings, earlier, tree, said, open_ended=open_ended)


def read_settings(settings: type[S], record: Any, where: str) -> S:
    """A dataclass of settings, from what ``record_of`` made of one.

    Args:
        settings: its class.
        record: values by the names of its fields; what is not there has its default.
        where: what a sentence about a mistake begins with.

    Raises:
        InputError: there is no such setting, or a value is none that it takes.
    """
    return _read_tree(settings, None, record, where)


def option_of(error: SettingError, settings: Any, prefix: str = "") -> str | None:
    """The name of the option that an error is about, such as ``learning_rates.means``.

    Args:
        error: what a dataclass in the tree of settings refused.
        settings: the class of the tree.
        prefix: name of the part of the tree that this is.

    Returns:
        None if that field is no option of this tree.
    """
    hints = type_hints(settings, include_extras=True)
    here = error.settings in {kind.__name__ for kind in settings.__mro__}
    for field in dataclasses.fields(settings):
        name, marks = option_name(field.name, hints[field.name], prefix)
        if tyro.conf.Fixed in marks:
            continue
        if here and field.name == error.name:
            return name
        registry, default = field.metadata.get("registry", {}), default_of(field, None)
        parts = [registry[kind] for kind in registry] or [type(default)]
        for part in filter(dataclasses.is_dataclass, parts):
            found = option_of(error, part, name)
            if found is not None:
                return found
    return None


def chosen(settings: type[S], default: S | None, arguments: Sequence[str]) -> S | None:
    """Settings to begin with, whose parts are of the kinds that a command line names.

    ``--strategy default`` takes the place of one part of the tree by another, which has other
    options: those that the rest of the command line may then name.

    Args:
        settings: a command's settings.
        default: those of an earlier run, if it is repeated.
        arguments: the command line.

    Raises:
        InputError: there is no such kind.
    """
    try:
        return _of_kinds(settings, default, lambda name: _given(arguments, f"--{name}"))
    except InputError as error:
        raise InputError(f"--{error}") from error


def _of_kinds(settings: type[S], default: S | None, kind_of: Callable[[str], Any]) -> S | None:
    """Settings whose parts are of certain kinds, by the names of the options that say so."""
    tree: dict[str, Any] = {}
    for name, path in _places(settings, default):
        kind = kind_of(name) if path[-1] == KIND else None
        if kind is None:
            continue
        part = tree
        for step in path[:-1]:
            part = part.setdefault(step, {})
        part[KIND] = kind
    return _read(settings, default, tree, "", open_ended=True) if tree else default


def _places(settings: Any, usual: Any, prefix: str = "") -> Iterator[tuple[str, tuple[str, ...]]]:
    """Where in a tree each option is, and each part of it."""
    hints = type_hints(settings, include_extras=True)
    for field in dataclasses.fields(settings):
        default = default_of(field, usual)
        option, marks = option_name(field.name, hints[field.name], prefix)
        if dataclasses.is_dataclass(default):
            if "registry" in field.metadata:
                yield option, (field.name, KIND)
            else:
                yield option, (field.name,)
            if tyro.conf.Fixed not in marks:
                for name, path in _places(type(default), default, option):
                    yield name, (field.name, *path)
        elif tyro.conf.Fixed not in marks:
            yield option, (field.name,)


def _read_tree(
    settings: type[S], usual: S | None, values: Any, where: str, *, open_ended: bool = False
) -> S:
    """A whole tree of settings; what a part of it refuses is told by its place in the tree."""
    try:
        found: S = _read(settings, usual, values, where, open_ended=open_ended)
    except SettingError as error:
        name = option_of(error, settings) or error.name
        raise InputError(f"{where}: {name} {error.said}") from error
    return found


def _read(settings: Any, usual: Any, values: Any, where: str, *, open_ended: bool = False) -> Any:
    """A dataclass of values by the names of its fields; what is not there is as usual."""
    if dataclasses.is_dataclass(values):
        return values
    if not isinstance(values, dict):
        raise InputError(f"{where}: {settings.__name__} is {values!r}, wanted settings by name")
    hints, found = type_hints(settings, include_extras=True), {}
    known = {field.name: field for field in dataclasses.fields(settings)}
    for name in values:
        if name not in known:
            raise _unknown(name, known, where)
    for name, field in known.items():
        default = default_of(field, usual)
        if name in values and not dataclasses.is_dataclass(default):
            found[name] = _value(hints[name], values[name], f"{where}: {name}")
        elif name in values:
            part, given = _kind_of(field, default, values[name])
            found[name] = _read(type(part), part, given, where, open_ended=open_ended)
        elif default not in MISSING:
            found[name] = default
        elif open_ended:
            found[name] = tyro.MISSING
        else:
            raise InputError(f"{where} wants {name!r}")
    return settings(**found)


def _kind_of(field: dataclasses.Field[Any], default: Any, given: Any) -> tuple[Any, Any]:
    """The defaults of a part of the tree, of the kind that is given, and the values given."""
    registry = field.metadata.get("registry")
    if registry is None or not isinstance(given, dict) or KIND not in given:
        return default, given
    values = {name: value for name, value in given.items() if name != KIND}
    kind = given[KIND]
    if dataclasses.is_dataclass(kind):
        return kind, kind
    known = kinds_of(field)
    if kind not in known:
        raise InputError(
            f"{field.name} is {kind!r}, wanted one of {', '.join(known)}, or one of yours that was "
            "registered (in a shell: rift --load FILE.py COMMAND)"
        )
    return (default if registry[kind] is type(default) else registry[kind]()), values


def _value(hint: Any, value: Any, where: str) -> Any:
    """A value that JSON held, or Python passed, as what a field takes."""
    origin, inner = get_origin(hint), get_args(hint)
    if origin is Annotated:
        return _value(inner[0], value, where)
    if origin in (Union, types.UnionType):
        some = next(kind for kind in inner if kind is not type(None))
        return None if value is None else _value(some, value, where)
    if origin is tuple:
        return _values(inner, value, where)
    if origin is Literal:
        if value not in inner:
            raise InputError(f"{where} is {value!r}, wanted one of {', '.join(map(str, inner))}")
        return value
    wanted, takes = _PLAIN[hint]
    if not takes(value):
        # Runs are repeated from what config.json holds, and that is names.
        own = ": register it (rift.register_...) and give its name" if callable(value) else ""
        raise InputError(f"{where} is {value!r}, wanted {wanted}{own}")
    return hint(value)


def _values(kinds: tuple[Any, ...], value: Any, where: str) -> tuple[Any, ...]:
    """The entries of a tuple."""
    if isinstance(value, (list, tuple)):
        if kinds[-1] is Ellipsis:
            kinds = (kinds[0],) * len(value)
        if len(kinds) == len(value):
            return tuple(_value(kind, one, where) for kind, one in zip(kinds, value, strict=True))
    raise InputError(f"{where} is {value!r}, wanted {len(kinds)} values")


def _is_number(value: Any) -> bool:
    return isinstance(value, (int, float)) and not isinstance(value, bool)


# What a field of a plain type takes, in words and as a test.
_PLAIN: dict[Any, tuple[str, Callable[[Any], bool]]] = {
    bool: ("true or false", lambda value: isinstance(value, bool)),
    int: ("a whole number", lambda value: _is_number(value) and value == value // 1),
    float: ("a number", _is_number),
    str: ("a text", lambda value: isinstance(value, str)),
    Path: ("a path", lambda value: isinstance(value, (str, Path))),
}


def _unknown(name: str, known: Any, where: str) -> InputError:
    near = difflib.get_close_matches(str(name), list(known), 1, 0.5)
    hint = f"; did you mean {near[0]!r}?" if near else ""
    return InputError(f"{where} has no setting {name!r}{hint}")


def _given(arguments: Sequence[str], option: str) -> str | None:
    """What a command line gives to an option, if it does."""
    for place, argument in enumerate(arguments):
        if argument.startswith(f"{option}="):
            return argument.removeprefix(f"{option}=")
        if argument == option and place + 1 < len(arguments):
            return arguments[place + 1]
    return None


def _plain(value: Any) -> Any:
    """A value as JSON holds it."""
    if isinstance(value, Path):
        return str(value)
    return [_plain(entry) for entry in value] if isinstance(value, (list, tuple)) else value
